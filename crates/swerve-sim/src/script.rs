//! Scripted motion in closed form: pose and velocity of an actor at a time since its start.

use swerve_geom::{FrenetPoint, LineTracker, Point2, Polyline, Pose2};
use swerve_scenario::{Actor, Along, Direction, Motion, RoadPlace, SpeedPoint};
use swerve_world::Movement;

use crate::track::Played;

/// All legs of one actor in sequence, from its start.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Script {
    start: Pose2,
    legs: Vec<Leg>,
    /// Recorded motion in place of legs.
    track: Option<Played>,
}

/// One leg. Its motion is a distance (metres since its start) along a course.
#[derive(Clone, PartialEq, Debug)]
struct Leg {
    /// Start, seconds since the start of the script.
    begins_s: f64,
    /// Duration, seconds; infinite for an unlimited drive.
    lasts_s: f64,
    course: Course,
    speeds: Vec<SpeedPoint>,
}

#[derive(Clone, Copy, PartialEq, Debug)]
enum Course {
    /// Straight ahead from this pose.
    Straight(Pose2),
    /// Along the road from here, or against it if turned by half a turn from the road's heading.
    Road { from: FrenetPoint, turn_rad: f64 },
}

impl Script {
    pub(crate) fn new(actor: &Actor, line: &Polyline) -> Self {
        let start = actor.pose(line);
        let track = actor.track().map(|track| Played::new(actor.id, track));
        let mut script = Self { start, legs: Vec::new(), track };
        let mut at = start;
        let mut begins_s = 0.0;
        let mut place = LineTracker::starting_at(actor.s_m, start.point());
        for motion in &actor.motion {
            for (course, speeds, lasts_s) in courses(motion, at, place.locate(line, at), line) {
                let leg = Leg { begins_s, lasts_s, course, speeds };
                at = leg.movement(lasts_s.min(1e9), line).pose;
                begins_s += lasts_s;
                script.legs.push(leg);
            }
        }
        script
    }

    /// True if it ever moves.
    pub(crate) fn moves(&self) -> bool {
        !self.legs.is_empty() || self.track.is_some()
    }

    /// True if it is at rest for good `after_s` seconds after its start.
    pub(crate) fn is_over(&self, after_s: f64) -> bool {
        if let Some(track) = &self.track {
            return track.is_over(after_s);
        }
        self.legs.last().is_none_or(|leg| after_s > leg.begins_s + leg.lasts_s)
    }

    /// Pose and velocity `after_s` seconds after its start; `None` before the start.
    pub(crate) fn at(&self, after_s: Option<f64>, line: &Polyline) -> Movement {
        if let Some(track) = &self.track {
            return track.at(after_s.unwrap_or_default());
        }
        let (Some(after_s), false) = (after_s, self.legs.is_empty()) else {
            return Movement::at_rest(self.start);
        };
        let next = self.legs.partition_point(|leg| leg.begins_s <= after_s);
        let leg = &self.legs[next.max(1) - 1];
        let inside_s = after_s - leg.begins_s;
        if inside_s < leg.lasts_s {
            return leg.movement(inside_s, line);
        }
        Movement::at_rest(leg.movement(leg.lasts_s, line).pose)
    }
}

impl Leg {
    fn movement(&self, after_s: f64, line: &Polyline) -> Movement {
        let way_m = way(&self.speeds, after_s);
        let speed_mps = speed(&self.speeds, after_s);
        match self.course {
            Course::Straight(from) => {
                Movement { pose: from.ahead(way_m), velocity_mps: from.direction() * speed_mps }
            }
            Course::Road { from, turn_rad } => {
                let sign = if turn_rad == 0.0 { 1.0 } else { -1.0 };
                let s_m = from.s_m + sign * way_m;
                let on_line = line.at(s_m);
                let place = line.to_map(FrenetPoint { s_m, d_m: from.d_m });
                // The distance is measured along the road's centre line; beside it, in a bend, the ground speed
                // differs.
                let ground = sign * speed_mps * (1.0 - on_line.curvature_1pm * from.d_m);
                Movement {
                    pose: Pose2::new(place.x_m, place.y_m, on_line.pose.heading_rad + turn_rad),
                    velocity_mps: on_line.pose.direction() * ground,
                }
            }
        }
    }
}

/// Courses of one motion from `at`, at this position along the road, each with speeds and duration (seconds).
fn courses(
    motion: &Motion,
    at: Pose2,
    place: FrenetPoint,
    line: &Polyline,
) -> Vec<(Course, Vec<SpeedPoint>, f64)> {
    let steady = |speed_mps| vec![SpeedPoint { at_s: 0.0, speed_mps }];
    match motion {
        Motion::Wait { for_s } => vec![(Course::Straight(at), steady(0.0), *for_s)],
        Motion::Walk { speed_mps, distance_m, direction, turn_rad } => {
            let road = line.at(place.s_m).pose.heading_rad;
            let quarter = core::f64::consts::FRAC_PI_2;
            let turn = match direction {
                Direction::Ahead => 0.0,
                Direction::Left => quarter,
                Direction::Right => -quarter,
                Direction::Back => core::f64::consts::PI,
            };
            let from = Pose2::new(at.x_m, at.y_m, road + turn + turn_rad);
            vec![(Course::Straight(from), steady(*speed_mps), distance_m / speed_mps)]
        }
        Motion::Drive { along, speeds, distance_m } => {
            let lasts_s = distance_m.map_or_else(|| ends(speeds), |way_m| time_for(speeds, way_m));
            vec![(course(*along, at, place, line), speeds.clone(), lasts_s)]
        }
        Motion::Path { speed_mps, points } => path(*speed_mps, points, at.point(), line),
        Motion::Track(_) => Vec::new(),
    }
}

fn course(along: Along, at: Pose2, from: FrenetPoint, line: &Polyline) -> Course {
    match along {
        Along::Heading => Course::Straight(at),
        Along::Road => {
            let turn_rad = swerve_geom::angle_between(line.at(from.s_m).pose.heading_rad, at.heading_rad);
            let against = turn_rad.abs() > core::f64::consts::FRAC_PI_2;
            Course::Road {
                from,
                turn_rad: if against { core::f64::consts::PI.copysign(turn_rad) } else { 0.0 },
            }
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

/// Speed `after_s` seconds into a leg, m/s: linear between the points, constant after the last.
fn speed(speeds: &[SpeedPoint], after_s: f64) -> f64 {
    let next = speeds.partition_point(|p| p.at_s <= after_s);
    if next == 0 || next == speeds.len() {
        return speeds[next.max(1) - 1].speed_mps;
    }
    let (a, b) = (speeds[next - 1], speeds[next]);
    a.speed_mps + (b.speed_mps - a.speed_mps) * (after_s - a.at_s) / (b.at_s - a.at_s)
}

/// Distance covered `after_s` seconds into a leg, metres: the integral of the speed.
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

/// End of a leg without a given distance, seconds: at the last point if that is a stop, else infinite.
fn ends(speeds: &[SpeedPoint]) -> f64 {
    speeds.last().filter(|last| last.speed_mps == 0.0).map_or(f64::INFINITY, |last| last.at_s)
}

/// Time after which `way_m` metres are covered, seconds; infinite if never.
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

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_scenario::Scenario;

    fn script(road: &str, actor: &str) -> (Script, Polyline) {
        let text = format!(
            "name = \"x\"\n[road]\nsegments = {road}\nleft_m = 9.0\n[ego]\ntarget_speed_mps = 1.0\nend_m = 50.0\n\
             [[actor]]\nname = \"a\"\nkind = \"car\"\n{actor}\n\
             [expect]\nverdict = \"avoided\"\nduration_s = {{ max = 1.0 }}\n"
        );
        let scenario = Scenario::parse("x.toml", &text).unwrap_or_else(|p| panic!("{p:#?}"));
        let line = scenario.road.line();
        (Script::new(&scenario.actors[0], &line), line)
    }

    const STRAIGHT: &str = "[{ length_m = 200.0 }]";

    #[test]
    fn braking_from_10_mps_over_4_s_takes_20_m() {
        let (script, line) = script(
            STRAIGHT,
            "s_m = 30.0\nd_m = 4.0\nmotion = [{ drive = { speeds = [[0.0, 10.0], [4.0, 0.0]] } }]",
        );
        let at = |t: f64| script.at(Some(t), &line);
        assert_eq!(script.at(None, &line).pose, Pose2::new(30.0, 4.0, 0.0));
        assert!(
            (at(2.0).pose.x_m - (30.0 + 15.0)).abs() < 1e-9 && (at(2.0).velocity_mps.x - 5.0).abs() < 1e-9
        );
        assert!((at(4.0).pose.x_m - 50.0).abs() < 1e-9 && at(4.0).velocity_mps.norm() == 0.0);
        assert_eq!(at(99.0).pose, at(4.0).pose);
        assert!(script.is_over(4.1) && !script.is_over(3.9));
    }

    #[test]
    fn distance_limit_ends_a_drive_within_a_ramp() {
        // 2 m/s² from rest: 9 m after 3 s at 6 m/s.
        let (script, line) = script(
            STRAIGHT,
            "s_m = 30.0\nd_m = 4.0\nmotion = [{ drive = { speeds = [[0.0, 0.0], [5.0, 10.0]], distance_m = 9.0 } }]",
        );
        assert!((script.at(Some(2.999_999), &line).velocity_mps.x - 6.0).abs() < 1e-4);
        let end = script.at(Some(3.1), &line);
        assert!((end.pose.x_m - 39.0).abs() < 1e-9 && end.velocity_mps.norm() == 0.0, "{end:?}");
    }

    #[test]
    fn drive_along_a_bend_keeps_its_offset_and_its_velocity_is_its_derivative() {
        let road = "[{ length_m = 20.0 }, { length_m = 100.0, curvature_1pm = 0.02 }]";
        for (heading, sign) in [(0.0, 1.0), (3.0, -1.0)] {
            let motion = "motion = [{ drive = { speed_mps = 8.0 } }]";
            let (script, line) =
                script(road, &format!("s_m = 60.0\nd_m = 4.0\nheading_rad = {heading}\n{motion}"));
            for t in [0.5, 2.0, 4.0] {
                let now = script.at(Some(t), &line);
                let next = script.at(Some(t + 1e-5), &line);
                let place = line.project(now.pose.point());
                assert!((place.d_m - 4.0).abs() < 1e-3, "{place:?}");
                // Beside a line with a point every metre, arc length is accurate to 0.1 m.
                assert!((place.s_m - (60.0 + sign * 8.0 * t)).abs() < 0.1, "{place:?}");
                let moved = (next.pose.point() - now.pose.point()) * 1e5;
                assert!((moved - now.velocity_mps).norm() < 0.2, "{moved:?} {:?}", now.velocity_mps);
                let ahead_mps = now.velocity_mps.dot(now.pose.direction());
                assert!(ahead_mps > 7.0, "it faces the way it drives: {now:?}");
            }
        }
    }

    #[test]
    fn a_cyclist_who_has_moved_out_faces_along_the_road_again() {
        let out = "path = { speed_mps = 4.0, points = [[36.0, 8.15]] }";
        let on = "drive = { along = \"road\", speed_mps = 4.0 }";
        let (script, line) =
            script(STRAIGHT, &format!("s_m = 30.0\nd_m = 4.0\nmotion = [{{ {out} }}, {{ {on} }}]"));
        let heading = |t: f64| script.at(Some(t), &line).pose.heading_rad;
        assert!((heading(1.0) - swerve_geom::math::atan2(4.15, 6.0)).abs() < 1e-9, "{}", heading(1.0));
        assert_eq!(heading(3.0), 0.0);
    }

    #[test]
    fn legs_follow_each_other_continuously() {
        let (script, line) = script(
            STRAIGHT,
            "s_m = 30.0\nd_m = 4.0\nmotion = [{ wait = { for_s = 1.0 } }, { walk = { speed_mps = 2.0, distance_m = 3.0, \
             direction = \"right\" } }, { path = { speed_mps = 5.0, points = [[35.0, 1.0], [35.0, 6.0]] } }]",
        );
        let at = |t: f64| script.at(Some(t), &line).pose;
        let quarter = core::f64::consts::FRAC_PI_2;
        assert_eq!(at(0.5), Pose2::new(30.0, 4.0, 0.0));
        assert!((at(2.0).y_m - 2.0).abs() < 1e-9 && (at(2.0).heading_rad + quarter).abs() < 1e-12);
        // At 2.5 s it is at (30, 1); 1 s on the first line of the path, 1 s on the second.
        assert!(at(3.0).point().distance(Point2::new(32.5, 1.0)) < 1e-9, "{:?}", at(3.0));
        assert!(at(4.0).point().distance(Point2::new(35.0, 3.5)) < 1e-9, "{:?}", at(4.0));
        assert!(
            at(9.0).point().distance(Point2::new(35.0, 6.0)) < 1e-9
                && (at(9.0).heading_rad - quarter).abs() < 1e-9
        );
        let mut last = at(0.0).point();
        for k in 1..900 {
            let now = at(f64::from(k) * 0.005).point();
            assert!(now.distance(last) <= 5.0 * 0.005 + 1e-9);
            last = now;
        }
    }
}
