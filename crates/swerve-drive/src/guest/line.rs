//! A line to follow in a foreign world, as a scenario on a map of one road.

use core::fmt::Write as _;
use std::path::Path;

use anyhow::{Context as _, bail, ensure};
use swerve_geom::{Point2, Vector2, angle_between, math};
use swerve_scenario::{MapText, Scenario};

use crate::load::problems_error;

/// A line to follow: the centre line of a lane, with lanes of the same width and direction beside it.
///
/// Frames are the foreign world's: right-handed, metres, y to the left of x.
#[derive(Clone, PartialEq, Debug)]
pub struct Line {
    /// Points of the line in order; at least two, at least 0.1 m apart. The line is smooth between them.
    pub points: Vec<Point2>,
    /// Width of each lane, metres.
    pub lane_width_m: f64,
    /// Number of lanes to the left of the line's lane.
    pub lanes_left: usize,
    /// Number of lanes to the right of the line's lane.
    pub lanes_right: usize,
    /// Speed to drive at, m/s.
    pub target_speed_mps: f64,
    /// End of the drive at the latest, seconds.
    pub timeout_s: f64,
}

impl Line {
    /// A single lane, 3.5 m wide, for at most an hour.
    pub const fn new(points: Vec<Point2>, target_speed_mps: f64) -> Self {
        Self { points, lane_width_m: 3.5, lanes_left: 0, lanes_right: 0, target_speed_mps, timeout_s: 3600.0 }
    }

    /// The scenario with this line as the ego's way from its first to its last point.
    ///
    /// # Errors
    /// If there are fewer than two points, if they are too close together, not finite or turn sharply, or if a number is
    /// out of range.
    pub fn scenario(&self) -> anyhow::Result<Scenario> {
        let curve = self.curve()?;
        let length_m: f64 = curve.iter().map(|piece| piece.length_m).sum();
        ensure!(length_m >= LENGTH_MIN_M, "route: {length_m:.1} m long: expected {LENGTH_MIN_M} m or more");
        let lanes = self.lanes_left + 1 + self.lanes_right;
        ensure!(
            (1.0..=20.0).contains(&self.lane_width_m) && lanes <= LANES_MAX,
            "route: {lanes} lanes of {} m: expected 1 to {LANES_MAX} lanes of 1 to 20 m",
            self.lane_width_m
        );
        let map: MapText = self.map(&curve, length_m).into();
        let lane = -1 - i64::try_from(self.lanes_left)?;
        let text = format!(
            "name = \"route\"\n\n[map]\nfile = \"route.xodr\"\n\n[ego]\n\
             start = {{ road = \"1\", lane = {lane}, s_m = {ENDS_M:?} }}\n\
             goal = {{ road = \"1\", lane = {lane}, s_m = {:?} }}\n\
             target_speed_mps = {:?}\n\n[end]\ntimeout_s = {:?}\n",
            length_m - ENDS_M,
            self.target_speed_mps,
            self.timeout_s
        );
        Scenario::parse_on("route", &text, Some(&map), &[]).map_err(|problems| problems_error(&problems))
    }

    /// Smooth pieces between the points.
    fn curve(&self) -> anyhow::Result<Vec<Piece>> {
        let points = &self.points;
        ensure!(points.len() >= 2, "route: {} points: expected two or more", points.len());
        ensure!(points.len() <= POINTS_MAX, "route: {} points: expected at most {POINTS_MAX}", points.len());
        if let Some(k) = points.iter().position(|point| !(point.x_m.is_finite() && point.y_m.is_finite())) {
            bail!("route: point {k} is ({}, {}): expected finite numbers", points[k].x_m, points[k].y_m);
        }
        let chords: Vec<Vector2> = points.windows(2).map(|pair| pair[1] - pair[0]).collect();
        if let Some(k) = chords.iter().position(|chord| chord.norm() < APART_M) {
            bail!("route: points {k} and {} are the same: expected {APART_M} m between them", k + 1);
        }
        let courses: Vec<f64> = chords.iter().map(|chord| math::atan2(chord.y, chord.x)).collect();
        for (k, pair) in courses.windows(2).enumerate() {
            let turn_rad = angle_between(pair[0], pair[1]);
            ensure!(
                turn_rad.abs() <= TURN_MAX_RAD,
                "route: turns by {turn_rad:.2} rad at point {}: expected at most {TURN_MAX_RAD}; more points make a bend \
                 smooth",
                k + 1
            );
        }
        let headings = headings(&chords, &courses);
        let pieces = points.iter().zip(&chords).zip(headings.windows(2));
        Ok(pieces.map(|((from, chord), ends)| Piece::new(*from, *chord, [ends[0], ends[1]])).collect())
    }

    /// The road in OpenDRIVE: all lanes lead along the line.
    fn map(&self, curve: &[Piece], length_m: f64) -> String {
        let Self { lane_width_m, lanes_left, lanes_right, .. } = self;
        let mut text = format!(
            "<?xml version=\"1.0\"?>\n<OpenDRIVE><header revMajor=\"1\" revMinor=\"7\" name=\"route\"/>\n\
             <road id=\"1\" name=\"route\" length=\"{length_m:?}\" junction=\"-1\" rule=\"RHT\"><link/>\n<planView>\n"
        );
        let mut s_m = 0.0;
        for piece in curve {
            piece.write(s_m, &mut text);
            s_m += piece.length_m;
        }
        let offset_m = lane_width_m * (*lanes_left as f64 + 0.5);
        let _ = writeln!(
            text,
            "</planView>\n<lanes><laneOffset s=\"0\" a=\"{offset_m:?}\" b=\"0\" c=\"0\" d=\"0\"/>\n\
             <laneSection s=\"0\"><center><lane id=\"0\" type=\"none\" level=\"false\"/></center>\n<right>"
        );
        for lane in 1..=lanes_left + 1 + lanes_right {
            let _ = writeln!(
                text,
                "<lane id=\"-{lane}\" type=\"driving\" level=\"false\">\
                 <width sOffset=\"0\" a=\"{lane_width_m:?}\" b=\"0\" c=\"0\" d=\"0\"/></lane>"
            );
        }
        text + "</right></laneSection></lanes></road></OpenDRIVE>\n"
    }
}

/// A way over a map, as a scenario: from the lane at `start` to that at `goal`, in the frame of the map, metres. The target
/// speed is the highest speed limit on the way when absent.
///
/// # Errors
/// If the file is not a map, no lane is near start or goal, or no way leads from one to the other.
pub fn scenario_on_map(
    map: &Path,
    [start, goal]: [Point2; 2],
    target_speed_mps: Option<f64>,
    timeout_s: f64,
) -> anyhow::Result<Scenario> {
    let text =
        swerve_text::read_string(map, MAP_MAX).with_context(|| format!("reading {}", map.display()))?;
    let place = |point: Point2| format!("{{ x_m = {:?}, y_m = {:?} }}", point.x_m, point.y_m);
    let speed = target_speed_mps.map_or_else(String::new, |speed| format!("target_speed_mps = {speed:?}\n"));
    let file = map.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let scenario = format!(
        "name = \"route\"\n\n[map]\nfile = {file:?}\n\n[ego]\nstart = {}\ngoal = {}\n{speed}\n[end]\ntimeout_s = {timeout_s:?}\n",
        place(start),
        place(goal)
    );
    Scenario::parse_on("route", &scenario, Some(&text.into()), &[])
        .map_err(|problems| problems_error(&problems))
}

/// Size of a map's file at most, bytes.
const MAP_MAX: u64 = 256 << 20;
/// Length of a line at least, metres.
const LENGTH_MIN_M: f64 = 5.0;
/// Distance of start and goal from the ends of the road, metres.
const ENDS_M: f64 = 0.5;
/// Distance between points at least, metres.
const APART_M: f64 = 0.1;
/// Number of points at most.
const POINTS_MAX: usize = 100_000;
/// Number of lanes at most.
const LANES_MAX: usize = 20;
/// Change of course at a point at most, radians.
const TURN_MAX_RAD: f64 = 0.8;

/// Headings at the points: of the circle through a point and both neighbours; at the ends, through the first or last
/// three.
fn headings(chords: &[Vector2], courses: &[f64]) -> Vec<f64> {
    let between = |k: usize| {
        let [before_m, after_m] = [chords[k - 1].norm(), chords[k].norm()];
        let share = before_m / (before_m + after_m);
        courses[k - 1] + share * angle_between(courses[k - 1], courses[k])
    };
    let mut headings = vec![0.0; courses.len() + 1];
    for (k, heading) in headings.iter_mut().enumerate().take(courses.len()).skip(1) {
        *heading = between(k);
    }
    let last = courses.len();
    let mirrored = |course: f64, inner: f64| course + angle_between(inner, course);
    headings[0] = if last > 1 { mirrored(courses[0], headings[1]) } else { courses[0] };
    headings[last] = if last > 1 { mirrored(courses[last - 1], headings[last - 1]) } else { courses[0] };
    headings
}

/// A cubic from one point to the next, in the frame of its start: coefficients of u and v over 0 to 1.
struct Piece {
    from: Point2,
    heading_rad: f64,
    u: [f64; 4],
    v: [f64; 4],
    length_m: f64,
}

impl Piece {
    /// The Hermite cubic with these headings at its ends.
    fn new(from: Point2, chord: Vector2, [start_rad, end_rad]: [f64; 2]) -> Self {
        let (sin, cos) = math::sin_cos(start_rad);
        let (du, dv) = (chord.x * cos + chord.y * sin, chord.y * cos - chord.x * sin);
        let speed_m = chord.norm();
        let (turn_sin, turn_cos) = math::sin_cos(end_rad - start_rad);
        let coefficients = |d: f64, [before, after]: [f64; 2]| {
            [0.0, before, 3.0 * d - 2.0 * before - after, before + after - 2.0 * d]
        };
        let u = coefficients(du, [speed_m, speed_m * turn_cos]);
        let v = coefficients(dv, [0.0, speed_m * turn_sin]);
        let mut piece = Self { from, heading_rad: start_rad, u, v, length_m: 0.0 };
        piece.length_m = piece.measured_m();
        piece
    }

    /// Length by Simpson's rule, metres.
    fn measured_m(&self) -> f64 {
        const PARTS: usize = 16;
        let speed = |p: f64| {
            let slope = |[_, b, c, d]: [f64; 4]| b + p * (2.0 * c + p * 3.0 * d);
            math::hypot(slope(self.u), slope(self.v))
        };
        let weight = |k: usize| if k == 0 || k == PARTS { 1.0 } else { 2.0 + 2.0 * (k % 2) as f64 };
        let sum: f64 = (0..=PARTS).map(|k| weight(k) * speed(k as f64 / PARTS as f64)).sum();
        sum / (3.0 * PARTS as f64)
    }

    fn write(&self, s_m: f64, text: &mut String) {
        let Self { from, heading_rad, u, v, length_m } = self;
        let (x_m, y_m) = (from.x_m, from.y_m);
        let _ = writeln!(
            text,
            "<geometry s=\"{s_m:?}\" x=\"{x_m:?}\" y=\"{y_m:?}\" hdg=\"{heading_rad:?}\" length=\"{length_m:?}\">\
             <paramPoly3 pRange=\"normalized\" aU=\"{:?}\" bU=\"{:?}\" cU=\"{:?}\" dU=\"{:?}\" \
             aV=\"{:?}\" bV=\"{:?}\" cV=\"{:?}\" dV=\"{:?}\"/></geometry>",
            u[0], u[1], u[2], u[3], v[0], v[1], v[2], v[3]
        );
    }
}
