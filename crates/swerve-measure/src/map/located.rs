//! Lidar localization by map and by odometry, against the ground truth; wheels and gyroscopes compensate the motion in
//! a turn.

use std::fmt;

use serde::Serialize;
use swerve_core::Rng;
use swerve_geom::math;
use swerve_localization::eskf::{angle_between, from_euler};
use swerve_localization::map_file::MapFile;
use swerve_localization::matcher::{Guess, Matcher};
use swerve_localization::ndt::{Isometry3, Vector3};
use swerve_localization::odometry::Odometry;

/// Error of the initial guess along and across the road, metres, and its reported standard deviations, metres and
/// radians.
const START_M: [f64; 2] = [1.0, 0.5];
const START_SIGMA: [f64; 2] = [1.5, 0.09];
/// Number of poses drawn around it.
const PARTICLES: u32 = 200;
/// Error of further starts, and the error below which they count as captured, metres and degrees.
const CAPTURE_FROM: [f64; 2] = [2.0, 5.0];
const CAPTURED: [f64; 2] = [0.1, 0.2];

/// Map matching and odometry in progress.
pub(super) struct Located<'a> {
    map: &'a MapFile,
    /// Matcher, created at the first turn, and the true pose there.
    matcher: Option<(Matcher, Isometry3<f64>)>,
    odometry: Odometry,
    /// Starts per turn, and total number captured.
    starts: u8,
    captured: usize,
    truth: Vec<Vector3<f64>>,
    /// Squared errors in the ground plane (m²) and of the heading (rad²), one per turn.
    errors: Vec<[f64; 2]>,
    unmatched: usize,
    degenerate: usize,
    odometry_off_m: f64,
}

/// Result of `swerve map check`.
#[derive(Serialize)]
pub(super) struct Report {
    turns: usize,
    way_m: f64,
    ndt_rms_2d_m: f64,
    ndt_max_2d_m: f64,
    ndt_heading_rms_deg: f64,
    ndt_unmatched: usize,
    ndt_degenerate: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    capture: Option<Capture>,
    odometry_end_off_m: f64,
    odometry_percent: f64,
}

/// Starts 2 m and 5° off, and how many of them were matched to within 10 cm and 0.2° of the truth at once.
#[derive(Serialize)]
struct Capture {
    starts: usize,
    captured: usize,
    percent: f64,
}

impl<'a> Located<'a> {
    pub(super) fn new(map: &'a MapFile, starts: u8) -> Self {
        Self {
            map,
            matcher: None,
            odometry: Odometry::new(),
            starts,
            captured: 0,
            truth: Vec::new(),
            errors: Vec::new(),
            unmatched: 0,
            degenerate: 0,
            odometry_off_m: 0.0,
        }
    }

    pub(super) fn take(&mut self, turn: &super::Turn) {
        let truth = turn.map_from_lidar;
        let (matcher, first) = self.matcher.get_or_insert_with(|| {
            let mut map_from_lidar = truth;
            map_from_lidar.translation.vector += Vector3::new(START_M[0], START_M[1], 0.0);
            (Matcher::new(self.map, 1, guess(map_from_lidar)), truth)
        });
        let (sweep, moved) = (&turn.motion.sweep, turn.motion.over_turn);
        let since_last = if turn.motion.is_first { Isometry3::identity() } else { moved };
        let found = matcher.take(&turn.measured, sweep, &since_last);
        self.unmatched += usize::from(found.is_none());
        self.degenerate += usize::from(found.is_some_and(|found| found.degenerate > 0));
        let pose = matcher.pose();
        let off = pose.translation.vector - truth.translation.vector;
        let heading = angle_between(&truth.rotation, &pose.rotation);
        self.errors.push([off.x * off.x + off.y * off.y, heading * heading]);
        let way = *first * self.odometry.take_moved(&turn.measured, sweep, &moved).pose();
        self.odometry_off_m = (way.translation.vector - truth.translation.vector).norm();
        for start in 0..self.starts {
            let mut lost = matcher.clone();
            self.captured += usize::from(is_captured(&mut lost, turn, self.truth.len(), start));
        }
        self.truth.push(truth.translation.vector);
    }

    pub(super) fn report(&self) -> Option<Report> {
        let way_m: f64 = self.truth.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        let turns = self.errors.len();
        let mean = |k: usize| self.errors.iter().map(|error| error[k]).sum::<f64>() / turns as f64;
        (turns > 1).then(|| Report {
            turns,
            way_m,
            ndt_rms_2d_m: mean(0).sqrt(),
            ndt_max_2d_m: self.errors.iter().map(|error| error[0]).fold(0.0, f64::max).sqrt(),
            ndt_heading_rms_deg: mean(1).sqrt().to_degrees(),
            ndt_unmatched: self.unmatched,
            ndt_degenerate: self.degenerate,
            capture: (self.starts > 0).then(|| {
                let starts = turns * usize::from(self.starts);
                Capture {
                    starts,
                    captured: self.captured,
                    percent: 100.0 * self.captured as f64 / starts as f64,
                }
            }),
            odometry_end_off_m: self.odometry_off_m,
            odometry_percent: 100.0 * self.odometry_off_m / way_m.max(1.0),
        })
    }
}

/// Initial guess around a pose.
fn guess(map_from_lidar: Isometry3<f64>) -> Guess {
    let [sigma_m, sigma_rad] = START_SIGMA;
    Guess { map_from_lidar, sigma_m, sigma_rad, particles: PARTICLES }
}

/// True if a turn is matched from a start drawn off the truth.
fn is_captured(matcher: &mut Matcher, turn: &super::Turn, number: usize, start: u8) -> bool {
    let mut rng = Rng::keyed(1, "starts off the truth", &[number as i64, i64::from(start)]);
    let direction = rng.uniform(0.0, core::f64::consts::TAU);
    let side = if rng.below(2) == 0 { 1.0 } else { -1.0 };
    let (sin, cos) = math::sin_cos(direction);
    let [off_m, off_deg] = CAPTURE_FROM;
    let turned = from_euler(0.0, 0.0, side * off_deg.to_radians());
    let mut at = turn.map_from_lidar;
    at.translation.vector += Vector3::new(off_m * cos, off_m * sin, 0.0);
    at.rotation = turned * at.rotation;
    matcher.begin_at(guess(at));
    let found = matcher.take(&turn.measured, &turn.motion.sweep, &Isometry3::identity());
    found.is_some_and(|found| {
        let away = found.map_from_scan.translation.vector - turn.map_from_lidar.translation.vector;
        let heading = angle_between(&turn.map_from_lidar.rotation, &found.map_from_scan.rotation);
        math::hypot(away.x, away.y) < CAPTURED[0] && heading.to_degrees() < CAPTURED[1]
    })
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} turns, {:.1} m", self.turns, self.way_m)?;
        writeln!(
            f,
            "by the map: {:.3} m rms on the ground, at most {:.3} m, {:.3}°; {} turns unmatched, {} degenerate",
            self.ndt_rms_2d_m,
            self.ndt_max_2d_m,
            self.ndt_heading_rms_deg,
            self.ndt_unmatched,
            self.ndt_degenerate
        )?;
        if let Some(Capture { starts, captured, percent }) = &self.capture {
            let [m, deg] = CAPTURE_FROM;
            writeln!(
                f,
                "from {m} m and {deg}° off: {captured} of {starts} starts find it at once, {percent:.1} %"
            )?;
        }
        writeln!(
            f,
            "by its own way: {:.3} m off at the end, {:.2} %",
            self.odometry_end_off_m, self.odometry_percent
        )
    }
}
