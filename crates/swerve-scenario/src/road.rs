use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_geom::{FrenetPoint, Point2, Polyline, Pose2, math};
use swerve_map::{
    Aspect, Borders, Lane, LaneId, LaneKind, Map, Neighbour, SignalId, SignalPhase, SignalProgram,
};
use swerve_msg::{Route, Side, Signal};

use crate::{MapText, RoadLines};

mod course;

pub use course::{Closure, MapCourse};

/// Ground of a scenario, and the ego's way over it.
#[derive(Clone, PartialEq, Debug)]
pub struct Road {
    /// The lanes.
    pub course: Course,
    /// Friction coefficient of the surface.
    pub friction: f64,
    /// Traffic lights, in file order, or by identity in the map.
    pub lights: Vec<TrafficLight>,
}

/// Lanes of a scenario.
#[derive(Clone, PartialEq, Debug)]
pub enum Course {
    /// A road without junctions, described in the scenario.
    Strip(Strip),
    /// A map from a file.
    Map(Arc<MapCourse>),
}

/// A road as a chain of straight and circular segments from the map's origin, heading along +x.
#[derive(Clone, PartialEq, Debug)]
pub struct Strip {
    /// Segments of the centre line of the ego's lane. Never empty.
    pub segments: Vec<Segment>,
    /// Width of the ego's lane, metres.
    pub lane_width_m: f64,
    /// Width of the drivable ground to the left of the lane's centre, metres (positive).
    pub left_m: f64,
    /// Width of the drivable ground to the right of the lane's centre, metres (positive).
    pub right_m: f64,
}

/// One segment of the road.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Segment {
    /// Length, metres.
    pub length_m: f64,
    /// Curvature, 1/m; zero is straight, positive turns left.
    pub curvature_1pm: f64,
}

/// A traffic light.
#[derive(Clone, PartialEq, Debug)]
pub struct TrafficLight {
    /// Unique name.
    pub name: String,
    /// Position of its mast, and the direction of the traffic that it is for.
    pub pose: Pose2,
    /// Position of its stop line along the ego's first route, metres; `None` if it is for other traffic.
    pub stop_s_m: Option<f64>,
    /// The signal of the map; `None` without a map.
    pub signal: Option<SignalId>,
    /// Its phases, from the start of the run.
    pub program: SignalProgram,
}

impl TrafficLight {
    /// Aspect at `instant`. Each phase includes its first instant and excludes its end, to the nanosecond.
    pub fn aspect(&self, instant: Time) -> Aspect {
        self.program.aspect_at(instant.ns())
    }

    /// Signal at `instant`: that of its [`aspect`](Self::aspect).
    pub fn signal(&self, instant: Time) -> Signal {
        signal_of(self.aspect(instant))
    }

    /// Signal at `instant`, and the time since it changed, at most a cycle.
    pub fn phase(&self, instant: Time) -> (Signal, Span) {
        let Some((k, mut since, _)) = self.place(instant) else { return (Signal::Red, Span::ZERO) };
        let phases = &self.program.phases;
        let signal = signal_of(phases[k].aspect);
        let before = phases[..k].iter().rev().chain(phases[k + 1..].iter().rev());
        let before = before.filter(|phase| length(phase) > Span::ZERO);
        for phase in before.take_while(|phase| signal_of(phase.aspect) == signal) {
            since += length(phase);
        }
        (signal, since)
    }

    /// Time from `instant` to the end of the phase; `None` without phases.
    pub fn phase_left(&self, instant: Time) -> Option<Span> {
        self.place(instant).map(|(_, _, left)| left)
    }

    /// Index of the phase at `instant`, the time into it, and the time to its end.
    fn place(&self, instant: Time) -> Option<(usize, Span, Span)> {
        let (k, into, left) = self.program.phase_at(instant.ns())?;
        Some((k, Span::from_ns(into), Span::from_ns(left)))
    }
}

fn length(phase: &SignalPhase) -> Span {
    Span::from_secs(phase.duration_s)
}

/// Signal that drivers take an aspect for.
fn signal_of(aspect: Aspect) -> Signal {
    match aspect {
        Aspect::Green => Signal::Green,
        Aspect::Yellow => Signal::Yellow,
        Aspect::Red | Aspect::RedYellow => Signal::Red,
        Aspect::Off => Signal::Off,
    }
}

/// Height of the pavements on both sides of the drivable ground, metres.
pub const KERB_M: f64 = 0.12;
/// Width of the kerbstone, over which the ground rises to the pavement, metres.
const KERBSTONE_M: f64 = 0.16;
/// Width of a pavement behind its kerbstone, metres.
pub const PAVEMENT_M: f64 = 2.5;

/// Borders nearer to each other than this are merged to one line, metres.
pub(crate) const ONE_LINE_M: f64 = 0.05;

/// Point spacing on curved roads, metres: at 20 m radius the chords are within 6 mm of the arc.
const STEP_M: f64 = 1.0;

impl Road {
    /// The road that is described in the scenario; `None` for a map.
    pub fn strip(&self) -> Option<&Strip> {
        match &self.course {
            Course::Strip(strip) => Some(strip),
            Course::Map(_) => None,
        }
    }

    /// Text of the map file; `None` without one.
    pub fn map_text(&self) -> Option<&MapText> {
        match &self.course {
            Course::Strip(_) => None,
            Course::Map(course) => Some(&course.text),
        }
    }

    /// Length of the line, metres.
    pub fn length_m(&self) -> f64 {
        match &self.course {
            Course::Strip(strip) => strip.length_m(),
            Course::Map(course) => course.route.line().length(),
        }
    }

    /// Line along which places of the scenario are given: the centre line of the ego's lanes. Of a [`Strip`]: two points
    /// if it is straight, else points on the arcs, at most 1 m apart.
    ///
    /// # Panics
    /// If the road has no length, which a checked scenario excludes.
    pub fn line(&self) -> Polyline {
        match &self.course {
            Course::Strip(strip) => strip.line(),
            Course::Map(course) => course.route.line().clone(),
        }
    }

    /// Returns true if its segments form a line: they have a length, and do not all end where they began.
    pub(crate) fn is_line(&self) -> bool {
        self.strip().is_none_or(Strip::is_line)
    }

    /// Height of the ground at a point, `d_m` to the left of the line, metres. The drivable ground and the ground behind
    /// the pavements are in the map plane.
    pub fn ground_m(&self, point: Point2, d_m: f64) -> f64 {
        match &self.course {
            Course::Strip(strip) => strip.ground_m(d_m),
            Course::Map(course) => course.ground_m(point),
        }
    }

    /// Route of the ego, with the drivable limits of the scenario.
    ///
    /// # Panics
    /// As [`line`](Self::line).
    pub fn route(&self) -> Route {
        match &self.course {
            Course::Strip(strip) => strip.route(),
            Course::Map(course) => course.route.clone(),
        }
    }

    /// All lanes.
    ///
    /// # Panics
    /// As [`line`](Self::line).
    pub fn map(&self) -> Arc<Map> {
        match &self.course {
            Course::Strip(strip) => Arc::new(strip.map()),
            Course::Map(course) => Arc::clone(&course.map),
        }
    }

    /// Map that the road is part of; `None` for a road that is described in the scenario.
    pub fn network(&self) -> Option<&Arc<Map>> {
        match &self.course {
            Course::Strip(_) => None,
            Course::Map(course) => Some(&course.map),
        }
    }

    /// Stop line of a light along a route of the ego, metres; `None` if the light is for other traffic.
    pub fn stop_s_m(&self, light: &TrafficLight, route: &Route) -> Option<f64> {
        match (&self.course, light.signal) {
            (Course::Map(course), Some(signal)) => route.stop_s_m(&course.map, course.map.signal(signal)?),
            _ => light.stop_s_m,
        }
    }

    /// Lines painted along the ego's route.
    ///
    /// # Panics
    /// As [`line`](Self::line).
    pub fn lines(&self) -> RoadLines {
        RoadLines::of(&self.route())
    }

    /// Width of the ego's lane at a position along the line, metres.
    pub fn lane_width_m(&self, s_m: f64) -> f64 {
        match &self.course {
            Course::Strip(strip) => strip.lane_width_m,
            Course::Map(course) => course.route.lane().left_m(s_m) + course.route.lane().right_m(s_m),
        }
    }
}

impl Strip {
    /// Length of the centre line, metres.
    pub fn length_m(&self) -> f64 {
        self.segments.iter().map(|s| s.length_m).sum()
    }

    /// Centre line: two points if the road is straight, else points on the arcs, at most 1 m apart.
    ///
    /// # Panics
    /// If the road has no length, which a checked scenario excludes.
    pub fn line(&self) -> Polyline {
        Polyline::new(&self.points()).expect("a checked road has a length")
    }

    /// Returns true if its segments form a line.
    pub(crate) fn is_line(&self) -> bool {
        Polyline::new(&self.points()).is_ok()
    }

    fn points(&self) -> Vec<Point2> {
        let straight = self.segments.iter().all(|s| s.curvature_1pm == 0.0);
        let mut points = vec![Point2::new(0.0, 0.0)];
        if straight {
            points.push(Point2::new(self.length_m(), 0.0));
        } else {
            let (mut from, mut heading) = (Point2::new(0.0, 0.0), 0.0);
            for segment in &self.segments {
                let n = (segment.length_m / STEP_M).ceil().max(1.0) as usize;
                let at = |s_m: f64| arc(from, heading, segment.curvature_1pm, s_m);
                points.extend((1..=n).map(|k| at(segment.length_m * k as f64 / n as f64)));
                from = at(segment.length_m);
                heading += segment.curvature_1pm * segment.length_m;
            }
        }
        points
    }

    fn ground_m(&self, d_m: f64) -> f64 {
        let beyond_m = (d_m - self.left_m).max(-self.right_m - d_m);
        let is_paved = beyond_m > 0.0 && beyond_m < KERBSTONE_M + PAVEMENT_M;
        if is_paved { KERB_M * (beyond_m / KERBSTONE_M).min(1.0) } else { 0.0 }
    }

    fn route(&self) -> Route {
        let half_m = 0.5 * self.lane_width_m;
        let lane = Borders::constant(half_m.min(self.left_m), half_m.min(self.right_m));
        Route::uniform(self.line(), self.left_m, self.right_m).in_lane(lane)
    }

    /// The road as a map: the ego's lane, [`EGO_LANE`](Self::EGO_LANE), and beside it lanes of the same width up to the
    /// edge of the drivable ground; a remainder narrower than a lane is a shoulder. Lanes to the left are for oncoming
    /// traffic.
    ///
    /// The route along the ego's lane over this map equals [`Road::route`] except for rounding of its borders.
    ///
    /// # Panics
    /// As [`line`](Self::line).
    pub fn map(&self) -> Map {
        let half_m = 0.5 * self.lane_width_m;
        let line = self.line();
        let own = Borders::constant(half_m.min(self.left_m), half_m.min(self.right_m));
        let mut lanes = vec![Lane::new(Self::EGO_LANE, line.clone(), own)];
        for (side, limit_m) in [(Side::Left, self.left_m), (Side::Right, self.right_m)] {
            self.add_lanes_beside(&mut lanes, &line, side, limit_m);
        }
        Map::new(lanes).expect("lanes side by side fit together")
    }

    /// The ego's lane on its map; lanes to its left follow, then those to its right.
    pub const EGO_LANE: LaneId = LaneId(1);

    /// Adds the lanes on one side of the first, outwards up to `limit_m` from its centre.
    fn add_lanes_beside(&self, lanes: &mut Vec<Lane>, line: &Polyline, side: Side, limit_m: f64) {
        let (mut inner_m, mut inside, mut oncoming) = (0.5 * self.lane_width_m, 0, false);
        while inner_m < limit_m - ONE_LINE_M {
            let is_lane = limit_m - inner_m > self.lane_width_m - ONE_LINE_M;
            let outer_m = if is_lane { (inner_m + self.lane_width_m).min(limit_m) } else { limit_m };
            let half_m = 0.5 * (outer_m - inner_m);
            let sign = if side == Side::Left { 1.0 } else { -1.0 };
            let Some(line) = beside(line, sign * (inner_m + half_m)) else { break };
            let turns = is_lane && side == Side::Left && !oncoming;
            oncoming |= turns;
            let line = if oncoming { reversed(&line) } else { Some(line) };
            let (Some(line), id) = (line, LaneId(lanes.len() as u32 + 1)) else { break };
            let kind = if is_lane { LaneKind::Driving } else { LaneKind::Shoulder };
            let mut lane = Lane { kind, ..Lane::new(id, line, Borders::constant(half_m, half_m)) };
            let beside = |lane| Some(Neighbour { lane, opposite: turns });
            let inner = &mut lanes[inside];
            // Outwards from an oncoming lane is to its right.
            let (outwards, inwards) = match side {
                Side::Left if turns => (&mut inner.left, &mut lane.left),
                Side::Left if !oncoming => (&mut inner.left, &mut lane.right),
                Side::Left | Side::Right => (&mut inner.right, &mut lane.left),
            };
            (*outwards, *inwards) = (beside(id), beside(inner.id));
            (inner_m, inside) = (outer_m, lanes.len());
            lanes.push(lane);
        }
    }
}

/// The line in the other direction.
fn reversed(line: &Polyline) -> Option<Polyline> {
    Polyline::new(&line.points().iter().rev().copied().collect::<Vec<_>>()).ok()
}

/// Parallel line `d_m` to the left of a line; `None` if a bend is too tight for it.
fn beside(line: &Polyline, d_m: f64) -> Option<Polyline> {
    let mut s_m = 0.0;
    let mut last = line.points()[0];
    let points = line.points().iter().map(|&point| {
        s_m += point.distance(last);
        last = point;
        line.to_map(FrenetPoint { s_m, d_m })
    });
    Polyline::new(&points.collect::<Vec<_>>()).ok()
}

/// Point at `s_m` along an arc that starts at `from`.
fn arc(from: Point2, heading_rad: f64, curvature_1pm: f64, s_m: f64) -> Point2 {
    let turn = curvature_1pm * s_m;
    // Ratio of chord to arc length: sin(x)/x of half the turn.
    let half = 0.5 * turn;
    let chord = if half.abs() < 1e-9 { s_m } else { s_m * math::sin(half) / half };
    let (sin, cos) = math::sin_cos(heading_rad + half);
    Point2::new(from.x_m + chord * cos, from.y_m + chord * sin)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn road(segments: &[(f64, f64)]) -> Strip {
        let segments =
            segments.iter().map(|&(length_m, curvature_1pm)| Segment { length_m, curvature_1pm }).collect();
        Strip { segments, lane_width_m: 4.0, left_m: 6.0, right_m: 2.0 }
    }

    #[test]
    fn map_has_lanes_up_to_the_edge_of_the_ground() {
        let mut road = road(&[(40.0, 0.0), (60.0, 0.01)]);
        // 2 m to the left of the ego's lane: a shoulder. 10 m to its right: two lanes and a shoulder.
        (road.left_m, road.right_m) = (4.0, 12.0);
        let map = road.map();
        let lanes: Vec<_> =
            map.lanes().iter().map(|lane| (lane.id.0, lane.kind, lane.width_m(5.0))).collect();
        let (driving, shoulder) = (LaneKind::Driving, LaneKind::Shoulder);
        assert_eq!(
            lanes,
            [(1, driving, 4.0), (2, shoulder, 2.0), (3, driving, 4.0), (4, driving, 4.0), (5, shoulder, 2.0)]
        );
        let line = road.line();
        for (s_m, d_m, id) in
            [(70.0, 0.5, 1), (70.0, 3.0, 2), (70.0, -3.0, 3), (70.0, -9.0, 4), (70.0, -11.5, 5)]
        {
            let on: Vec<_> =
                map.at(line.to_map(FrenetPoint { s_m, d_m })).map(|place| place.lane.0).collect();
            assert_eq!(on, [id], "{d_m} m to the left");
        }
        assert_eq!(map.at(line.to_map(FrenetPoint { s_m: 70.0, d_m: 4.1 })).count(), 0);
    }

    #[test]
    fn route_agrees_with_that_over_the_map() {
        for (left_m, right_m) in [(6.0, 2.0), (5.3, 3.7), (1.5, 2.0), (9.1, 12.7)] {
            let road = Strip { left_m, right_m, ..road(&[(40.0, 0.0), (60.0, 0.01)]) };
            let (stated, over_map) = (road.route(), Route::along(&road.map(), &[Strip::EGO_LANE]).unwrap());
            assert_eq!(stated.line(), over_map.line());
            for s_m in [0.0, 50.0, 99.0] {
                assert!((stated.left_m(s_m) - over_map.left_m(s_m)).abs() < 1e-12);
                assert!((stated.right_m(s_m) - over_map.right_m(s_m)).abs() < 1e-12);
                // The ego's lane is 2 m wide on either side, limited by the drivable ground.
                for route in [&stated, &over_map] {
                    assert_eq!(route.lane().left_m(s_m), left_m.min(2.0));
                    assert_eq!(route.lane().right_m(s_m), right_m.min(2.0));
                }
            }
        }
    }

    #[test]
    fn traffic_light_cycles_through_its_signals_to_the_nanosecond() {
        let light = TrafficLight {
            name: "light".into(),
            pose: Pose2::new(50.0, -3.0, 0.0),
            stop_s_m: Some(48.0),
            signal: None,
            program: SignalProgram::green_yellow_red([10.0, 3.0, 7.0], 0.0),
        };
        let with = |durations_s, offset_s| {
            let program = SignalProgram::green_yellow_red(durations_s, offset_s);
            TrafficLight { program, ..light.clone() }
        };
        let at = |light: &TrafficLight, s: f64, ns: i64| {
            light.signal(Time::ZERO + Span::from_secs(s) + Span::from_ns(ns))
        };
        for cycle in 0..3 {
            let s = 20.0 * f64::from(cycle);
            assert_eq!(at(&light, s, 0), Signal::Green);
            assert_eq!((at(&light, s + 10.0, -1), at(&light, s + 10.0, 0)), (Signal::Green, Signal::Yellow));
            assert_eq!((at(&light, s + 13.0, -1), at(&light, s + 13.0, 0)), (Signal::Yellow, Signal::Red));
            assert_eq!((at(&light, s + 20.0, -1), at(&light, s + 20.0, 0)), (Signal::Red, Signal::Green));
        }
        assert_eq!(light.phase(Time::from_ms(15_500)), (Signal::Red, Span::from_ms(2500)));
        let late = with([10.0, 3.0, 7.0], 12.0);
        assert_eq!(late.phase(Time::ZERO), (Signal::Yellow, Span::from_ms(2000)));
        assert_eq!(late.phase(Time::from_ms(1000)), (Signal::Red, Span::ZERO));
        let no_yellow = with([10.0, 0.0, 7.0], 0.0);
        assert_eq!((at(&no_yellow, 10.0, -1), at(&no_yellow, 10.0, 0)), (Signal::Green, Signal::Red));
        assert_eq!(no_yellow.phase(Time::from_ms(12_000)), (Signal::Red, Span::from_ms(2000)));
        // Into the cycle by a negative offset.
        assert_eq!(with([10.0, 3.0, 7.0], -7.0).phase(Time::ZERO), (Signal::Red, Span::ZERO));
        let none = with([0.0; 3], 0.0);
        assert_eq!((none.phase(Time::ZERO), none.phase_left(Time::ZERO)), ((Signal::Red, Span::ZERO), None));
    }

    #[test]
    fn red_and_yellow_counts_as_red_and_off_as_neither() {
        let mut program = SignalProgram::default();
        let aspects = [Aspect::RedYellow, Aspect::Green, Aspect::Off, Aspect::Red];
        for (aspect, duration_s) in aspects.into_iter().zip([1.0, 10.0, 5.0, 4.0]) {
            program.push(aspect, duration_s);
        }
        let light = TrafficLight {
            name: String::new(),
            pose: Pose2::new(0.0, 0.0, 0.0),
            stop_s_m: None,
            signal: None,
            program,
        };
        let at = |ms: i64| (light.phase(Time::from_ms(ms)), light.aspect(Time::from_ms(ms)));
        // Red since 4 s before the cycle begins.
        assert_eq!(at(0), ((Signal::Red, Span::from_ms(4000)), Aspect::RedYellow));
        assert_eq!(at(1000), ((Signal::Green, Span::ZERO), Aspect::Green));
        assert_eq!(at(12_000), ((Signal::Off, Span::from_ms(1000)), Aspect::Off));
        assert_eq!(at(20_500), ((Signal::Red, Span::from_ms(4500)), Aspect::RedYellow));
        assert_eq!(light.phase_left(Time::from_ms(12_000)), Some(Span::from_ms(4000)));
    }

    #[test]
    fn straight_road_has_two_points() {
        let line = road(&[(100.0, 0.0), (80.0, 0.0)]).line();
        assert_eq!(line.points().len(), 2);
        assert_eq!(line.length(), 180.0);
    }

    #[test]
    fn quarter_circle_ends_one_radius_ahead_and_to_the_left() {
        let quarter = 50.0 * core::f64::consts::FRAC_PI_2;
        let line = road(&[(30.0, 0.0), (quarter, 0.02), (10.0, 0.0)]).line();
        let end = line.points()[line.points().len() - 1];
        assert!(end.distance(Point2::new(80.0, 60.0)) < 1e-9, "{end:?}");
        assert!((line.length() - 40.0 - quarter).abs() < 0.01);
        assert!((line.at(60.0).curvature_1pm - 0.02).abs() < 1e-4);
    }
}
