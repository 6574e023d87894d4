//! Scripted motion in closed form: where an actor is and how fast, so many seconds after it was set off.

use swerve_geom::{FrenetPoint, Point2, Polyline, Pose2, Vector2};
use swerve_scenario::{Actor, Along, Direction, Motion, RoadPlace, SpeedPoint};

/// Pose and velocity of an actor at one moment.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Moment {
    pub(crate) pose: Pose2,
    pub(crate) velocity_mps: Vector2,
}

/// All legs of one actor, one after the other, from the moment it is set off.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Script {
    start: Pose2,
    legs: Vec<Leg>,
}

/// One leg. Its motion is a way (metres since its beginning) along a course.
#[derive(Clone, PartialEq, Debug)]
struct Leg {
    /// Seconds since the script began.
    begins_s: f64,
    /// Seconds; infinite for a drive without end.
    lasts_s: f64,
    course: Course,
    speeds: Vec<SpeedPoint>,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Course {
    /// Straight ahead from this pose.
    Straight(Pose2),
    /// Along the road from here (`sign` 1) or against it (-1), turned by `turn_rad` from the road's heading.
    Road { from: FrenetPoint, sign: f64, turn_rad: f64 },
}

impl Script {
    pub(crate) fn new(actor: &Actor, line: &Polyline) -> Self {
        let start = actor.pose(line);
        let mut script = Self { start, legs: Vec::new() };
        let mut at = start;
        let mut begins_s = 0.0;
        for motion in &actor.motion {
            for (course, speeds, lasts_s) in courses(motion, at, line) {
                let leg = Leg { begins_s, lasts_s, course, speeds };
                at = leg.moment(lasts_s.min(1e9), line).pose;
                begins_s += lasts_s;
                script.legs.push(leg);
            }
        }
        script
    }

    /// Whether it ever moves.
    pub(crate) fn moves(&self) -> bool {
        !self.legs.is_empty()
    }

    /// Whether it stands still for good from `after_s` seconds on.
    pub(crate) fn is_over(&self, after_s: f64) -> bool {
        self.legs.last().is_none_or(|leg| after_s > leg.begins_s + leg.lasts_s)
    }

    /// Where it is `after_s` seconds after it was set off; `None`: not set off yet.
    pub(crate) fn at(&self, after_s: Option<f64>, line: &Polyline) -> Moment {
        let standing = |pose| Moment { pose, velocity_mps: Vector2::default() };
        let (Some(after_s), false) = (after_s, self.legs.is_empty()) else { return standing(self.start) };
        let next = self.legs.partition_point(|leg| leg.begins_s <= after_s);
        let leg = &self.legs[next.max(1) - 1];
        let inside_s = after_s - leg.begins_s;
        if inside_s < leg.lasts_s {
            return leg.moment(inside_s, line);
        }
        standing(leg.moment(leg.lasts_s, line).pose)
    }
}

impl Leg {
    fn moment(&self, after_s: f64, line: &Polyline) -> Moment {
        let way_m = way(&self.speeds, after_s);
        let speed_mps = speed(&self.speeds, after_s);
        match self.course {
            Course::Straight(from) => {
                Moment { pose: from.ahead(way_m), velocity_mps: from.direction() * speed_mps }
            }
            Course::Road { from, sign, turn_rad } => {
                let s_m = from.s_m + sign * way_m;
                let on_line = line.at(s_m);
                let place = line.to_map(FrenetPoint { s_m, d_m: from.d_m });
                // The way counts along the road's line; beside it, in a bend, the ground speed differs.
                let ground = sign * speed_mps * (1.0 - on_line.curvature_1pm * from.d_m);
                Moment {
                    pose: Pose2::new(place.x_m, place.y_m, on_line.pose.heading_rad + turn_rad),
                    velocity_mps: on_line.pose.direction() * ground,
                }
            }
        }
    }
}

/// The courses of one motion from `at`, each with its speeds and duration (seconds).
fn courses(motion: &Motion, at: Pose2, line: &Polyline) -> Vec<(Course, Vec<SpeedPoint>, f64)> {
    let steady = |speed_mps| vec![SpeedPoint { at_s: 0.0, speed_mps }];
    match motion {
        Motion::Wait { for_s } => vec![(Course::Straight(at), steady(0.0), *for_s)],
        Motion::Walk { speed_mps, distance_m, direction } => {
            let road = line.at(line.project(at.point()).s_m).pose.heading_rad;
            let quarter = core::f64::consts::FRAC_PI_2;
            let turn = match direction {
                Direction::Ahead => 0.0,
                Direction::Left => quarter,
                Direction::Right => -quarter,
                Direction::Back => core::f64::consts::PI,
            };
            let from = Pose2::new(at.x_m, at.y_m, road + turn);
            vec![(Course::Straight(from), steady(*speed_mps), distance_m / speed_mps)]
        }
        Motion::Drive { along, speeds, distance_m } => {
            let lasts_s = distance_m.map_or_else(|| ends(speeds), |way_m| time_for(speeds, way_m));
            vec![(course(*along, at, line), speeds.clone(), lasts_s)]
        }
        Motion::Path { speed_mps, points } => path(*speed_mps, points, at.point(), line),
    }
}

fn course(along: Along, at: Pose2, line: &Polyline) -> Course {
    match along {
        Along::Heading => Course::Straight(at),
        Along::Road => {
            let from = line.project(at.point());
            let turn_rad = swerve_geom::angle_between(line.at(from.s_m).pose.heading_rad, at.heading_rad);
            let against = turn_rad.abs() > core::f64::consts::FRAC_PI_2;
            Course::Road { from, sign: if against { -1.0 } else { 1.0 }, turn_rad }
        }
    }
}

fn path(
    speed_mps: f64,
    points: &[RoadPlace],
    at: Point2,
    line: &Polyline,
) -> Vec<(Course, Vec<SpeedPoint>, f64)> {
    let mut from = at;
    let mut legs = Vec::new();
    for place in points {
        let to = line.to_map(FrenetPoint { s_m: place.s_m, d_m: place.d_m });
        let way = to - from;
        if way.norm() > 0.0 {
            let course = Course::Straight(Pose2::new(from.x_m, from.y_m, way.heading()));
            legs.push((course, vec![SpeedPoint { at_s: 0.0, speed_mps }], way.norm() / speed_mps));
            from = to;
        }
    }
    legs
}

/// Speed `after_s` seconds into a leg, m/s: linear between the points, held after the last.
fn speed(speeds: &[SpeedPoint], after_s: f64) -> f64 {
    let next = speeds.partition_point(|p| p.at_s <= after_s);
    if next == 0 || next == speeds.len() {
        return speeds[next.max(1) - 1].speed_mps;
    }
    let (a, b) = (speeds[next - 1], speeds[next]);
    a.speed_mps + (b.speed_mps - a.speed_mps) * (after_s - a.at_s) / (b.at_s - a.at_s)
}

/// Way covered `after_s` seconds into a leg, metres: the area under the speeds.
fn way(speeds: &[SpeedPoint], after_s: f64) -> f64 {
    let mut way_m = 0.0;
    for two in speeds.windows(2) {
        if after_s <= two[1].at_s {
            break;
        }
        way_m += 0.5 * (two[0].speed_mps + two[1].speed_mps) * (two[1].at_s - two[0].at_s);
    }
    let since = speeds.iter().rev().find(|p| p.at_s < after_s).unwrap_or(&speeds[0]);
    way_m + 0.5 * (since.speed_mps + speed(speeds, after_s)) * (after_s - since.at_s).max(0.0)
}

/// When a leg without a given way ends: at the last point if that is a stop, else never.
fn ends(speeds: &[SpeedPoint]) -> f64 {
    speeds.last().filter(|last| last.speed_mps == 0.0).map_or(f64::INFINITY, |last| last.at_s)
}

/// When `way_m` metres are covered, seconds; infinite if never.
fn time_for(speeds: &[SpeedPoint], way_m: f64) -> f64 {
    let mut left_m = way_m;
    for two in speeds.windows(2) {
        let lasts = two[1].at_s - two[0].at_s;
        let covered = 0.5 * (two[0].speed_mps + two[1].speed_mps) * lasts;
        if covered >= left_m {
            // v t + a t²/2 = left, in the form that is stable for a near 0.
            let (v, a) = (two[0].speed_mps, (two[1].speed_mps - two[0].speed_mps) / lasts);
            return two[0].at_s + 2.0 * left_m / (v + (v * v + 2.0 * a * left_m).max(0.0).sqrt());
        }
        left_m -= covered;
    }
    let last = speeds[speeds.len() - 1];
    if last.speed_mps > 0.0 { last.at_s + left_m / last.speed_mps } else { f64::INFINITY }
}
