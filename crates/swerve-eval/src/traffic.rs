//! Interaction with traffic: time to collision, time headway, use of the ground beside the own lane, speed above the
//! target.
//!
//! The own lane is the strip of the lane's width around the route. Without a map, the ground to the left of it is the
//! opposite lane, and its borders are the lines. On a map, lanes have directions, and only lines that must not be crossed
//! count. Projections to the route are searched near the previous one, so that a road may cross
//! itself.

use core::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_geom::{FrenetPoint, Obb, Point2, Vector2, angle_between};
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{ActorId, ActorKind, Route};

use crate::{Outline, seconds};

/// Sampling interval; nuPlan's metrics use 100 ms.
const PERIOD: Span = Span::from_ms(50);
/// Maximum distance of a lead vehicle, metres.
const AHEAD_M: f64 = 100.0;
/// Maximum distance of the ego and its corners from its position one period earlier, metres.
const NEAR_M: f64 = 20.0;
/// Maximum angle between a lead's heading and the lane, radians (45 degrees): crossing cars are not leads.
const ALONG_RAD: f64 = core::f64::consts::FRAC_PI_4;
/// Maximum time to collision, seconds; excludes, for example, an ego at rest with a speed not exactly zero.
const TTC_MAX_S: f64 = 100.0;
/// Minimum speed of the ego for a headway, m/s.
const STANDS_MPS: f64 = 0.1;

/// Speed and lane that the ego is to keep, if known.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Norm {
    /// Target speed, m/s.
    pub target_speed_mps: Option<f64>,
    /// Directions of the lanes of a map.
    pub directions: Option<Directions>,
}

/// Directions of the lanes of a map: true for a point on lanes that all lead against a heading.
#[derive(Clone)]
pub struct Directions(Arc<dyn Fn(Point2, f64) -> bool + Send + Sync>);

impl Directions {
    /// Directions by a function of a point and a heading in radians.
    pub fn new(is_against: impl Fn(Point2, f64) -> bool + Send + Sync + 'static) -> Self {
        Self(Arc::new(is_against))
    }
}

impl PartialEq for Directions {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl fmt::Debug for Directions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Directions")
    }
}

/// Metrics of interaction with traffic, until the first contact.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TrafficMetrics {
    /// Minimum time to collision, seconds: until the outlines of the ego and an actor touch if both keep velocity and
    /// heading (Hayward 1972; as nuPlan's `time_to_collision_within_bound`, without its horizon). Absent if the ego was
    /// never within 100 s of a contact. In a bend the straight motions of vehicles in two lanes may cross.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_ttc_s: Option<f64>,
    /// Actor of that time.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_ttc_actor: Option<ActorId>,
    /// Instant of that time, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_ttc_at_s: Option<f64>,
    /// Minimum time headway, seconds: the distance along the route from the ego's front to the rear of the lead, over
    /// the ego's speed (time gap of ISO 15622). The lead is the nearest vehicle ahead with its centre in the own lane
    /// and at most 45 degrees to its direction. Absent if there was no lead within 100 m while the ego drove in its
    /// lane.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_headway_s: Option<f64>,
    /// Instant of that headway, seconds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub min_headway_at_s: Option<f64>,
    /// Path length of the ego origin while part of the outline was outside the own lane, on either side, metres; on a
    /// map, while it was beyond a line that must not be crossed. Absent if the lane is not known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub distance_over_line_m: Option<f64>,
    /// Time in which part of the outline was to the left of the own lane, seconds; on a map, on a lane to the left that
    /// leads against the route.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub time_in_oncoming_lane_s: Option<f64>,
    /// Maximum excess of the speed over the target speed, m/s; zero if never above. Absent if no target speed is known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub speed_over_target_mps: Option<f64>,
}

/// Accumulates the states of a drive.
#[derive(Clone, Debug)]
pub(crate) struct Traffic {
    ego: Outline,
    norm: Norm,
    route: Option<Route>,
    next: Option<Time>,
    last: Option<(Time, Point2)>,
    s_m: Option<f64>,
    /// Distance of the ego from a lead within which that is searched for, metres.
    lead_m: f64,
    figures: TrafficMetrics,
}

impl Traffic {
    /// Creates an accumulator for an ego of this outline on a route.
    pub(crate) fn new(ego: Outline, route: Option<Route>, norm: Norm) -> Self {
        let (figures, lead_m) = (TrafficMetrics::default(), lead_m(route.as_ref()));
        Self { ego, norm, route, next: None, last: None, s_m: None, lead_m, figures }
    }

    /// Returns true if this is the route of the ego already.
    pub(crate) fn is_on(&self, route: &Route) -> bool {
        self.route.as_ref() == Some(route)
    }

    /// Takes another route of the ego.
    pub(crate) fn follow(&mut self, route: Route) {
        self.lead_m = lead_m(Some(&route));
        (self.route, self.s_m) = (Some(route), None);
    }

    /// Adds the world state after one step.
    pub(crate) fn take(&mut self, world: &WorldState) {
        let next = *self.next.get_or_insert(world.stamp);
        if world.stamp < next {
            return;
        }
        self.next = Some(next + PERIOD);
        let outline = self.ego.footprint(world.ego.state.pose);
        self.time_to_collision(world, &outline);
        self.speed(world.ego.state.speed_mps);
        if let Some(route) = self.route.take() {
            self.lane(world, &outline, &route);
            self.route = Some(route);
        }
        self.last = Some((world.stamp, world.ego.state.pose.point()));
    }

    /// Metrics so far.
    pub(crate) fn metrics(&self) -> TrafficMetrics {
        self.figures
    }

    fn time_to_collision(&mut self, world: &WorldState, outline: &Obb) {
        let own = world.ego.velocity_mps.coords;
        let own = Vector2::new(own.x, own.y);
        for actor in &world.actors {
            // One that is too far away to be there sooner is left out.
            let most_s = self.figures.min_ttc_s.unwrap_or(TTC_MAX_S);
            if outline.is_beyond(&actor.footprint(), most_s * (actor.velocity_mps - own).norm()) {
                continue;
            }
            let soon = |time_s: &f64| *time_s <= TTC_MAX_S;
            let Some(time_s) = actor.time_to_contact_s(outline, own).filter(soon) else { continue };
            if self.figures.min_ttc_s.is_none_or(|least_s| time_s < least_s) {
                self.figures.min_ttc_s = Some(time_s);
                self.figures.min_ttc_actor = Some(actor.id);
                self.figures.min_ttc_at_s = Some(seconds(world.stamp));
            }
        }
    }

    fn speed(&mut self, speed_mps: f64) {
        if let Some(target_mps) = self.norm.target_speed_mps {
            let over_mps = self.figures.speed_over_target_mps.get_or_insert(0.0);
            *over_mps = over_mps.max(speed_mps - target_mps);
        }
    }

    /// Inside junctions, where lanes have no lines, none is crossed.
    fn lane(&mut self, world: &WorldState, outline: &Obb, route: &Route) {
        let center = outline.center.point();
        let place = match self.s_m {
            Some(s_m) => route.project_near(center, s_m, NEAR_M),
            None => route.project(center),
        };
        self.s_m = Some(place.s_m);
        let corners = outline.corners().map(|corner| route.project_near(corner, place.s_m, NEAR_M));
        let has_lines =
            |at: &FrenetPoint| !route.stretch_at(at.s_m).is_some_and(|stretch| stretch.in_junction);
        let lined = || corners.iter().filter(|at| has_lines(at));
        let is_map = !route.stretches().is_empty();
        let is_left = |at: &&FrenetPoint| at.d_m > route.lane().left_m(at.s_m);
        let is_against = |at: &FrenetPoint| {
            let heading_rad = route.line().at(at.s_m).pose.heading_rad;
            let is_against = |all: &Directions| (all.0)(route.unproject(*at), heading_rad);
            self.norm.directions.as_ref().is_none_or(is_against)
        };
        let is_oncoming = lined().filter(is_left).any(is_against);
        let lines = if is_map { route.between_lines() } else { Some(route.lane()) };
        let is_outside = lines.is_some_and(|lines| {
            lined().any(|at| at.d_m > lines.left_m(at.s_m) || at.d_m < -lines.right_m(at.s_m))
        });
        let (since, from) = self.last.unwrap_or((world.stamp, world.ego.state.pose.point()));
        let over_m = self.figures.distance_over_line_m.get_or_insert(0.0);
        *over_m += if is_outside { from.distance(world.ego.state.pose.point()) } else { 0.0 };
        let oncoming_s = self.figures.time_in_oncoming_lane_s.get_or_insert(0.0);
        *oncoming_s += if is_oncoming { (world.stamp - since).as_secs() } else { 0.0 };
        if route.lane().contains(place) && world.ego.state.speed_mps > STANDS_MPS {
            self.headway(world, (center, place.s_m), route);
        }
    }

    fn headway(&mut self, world: &WorldState, (center, s_m): (Point2, f64), route: &Route) {
        let gap_m = |actor: &Actor| {
            if (actor.pose.point() - center).norm_squared() > self.lead_m * self.lead_m {
                return None;
            }
            let place = lead_place(actor, route, s_m).filter(|place| route.lane().contains(*place))?;
            Some(place.s_m - s_m - 0.5 * (actor.extent.length_m + self.ego.length_m))
        };
        let Some(gap_m) = world.actors.iter().filter_map(gap_m).reduce(f64::min) else { return };
        let headway_s = gap_m.max(0.0) / world.ego.state.speed_mps;
        if self.figures.min_headway_s.is_none_or(|least_s| headway_s < least_s) {
            self.figures.min_headway_s = Some(headway_s);
            self.figures.min_headway_at_s = Some(seconds(world.stamp));
        }
    }
}

/// Distance between an ego and a lead that are both in the lane of a route and at most [`AHEAD_M`] apart along it, at most,
/// metres.
fn lead_m(route: Option<&Route>) -> f64 {
    route.map_or(0.0, |route| AHEAD_M + 2.0 * route.lane().farthest_m().max(0.0) + 1.0)
}

/// Position along the route of a vehicle ahead of `s_m` that moves or faces along the lane.
fn lead_place(actor: &Actor, route: &Route, s_m: f64) -> Option<FrenetPoint> {
    if matches!(actor.kind, ActorKind::Pedestrian | ActorKind::Static) {
        return None;
    }
    let place = route.project_near(actor.pose.point(), s_m, AHEAD_M);
    let lane_rad = route.line().at(place.s_m).pose.heading_rad;
    let is_along = angle_between(lane_rad, actor.pose.heading_rad).abs() <= ALONG_RAD;
    (is_along && place.s_m > s_m && place.s_m - s_m <= AHEAD_M).then_some(place)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::verdict::tests::{actor, world};
    use swerve_geom::{Polyline, Pose2, Vector};
    use swerve_map::{Borders, Lane, LaneId, LaneMarks, Map, Mark, MarkKind, Neighbour};

    /// The outline's centre is the origin: the front is 2.5 m ahead of it.
    const EGO: Outline = Outline { length_m: 5.0, width_m: 2.0, center_ahead_m: 0.0 };

    fn traffic() -> Traffic {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(900.0, 0.0)]).unwrap();
        let norm = Norm { target_speed_mps: Some(10.0), ..Norm::default() };
        let route = Route::uniform(line, 6.0, 2.0).in_lane(Borders::constant(2.0, 2.0));
        Traffic::new(EGO, Some(route), norm)
    }

    fn at(ms: i64, (x_m, y_m): (f64, f64), speed_mps: f64, actors: Vec<Actor>) -> WorldState {
        let mut state = world(ms, x_m);
        state.ego.state.pose = Pose2::new(x_m, y_m, 0.0);
        state.ego.state.speed_mps = speed_mps;
        state.ego.velocity_mps = Vector::new(speed_mps, 0.0, 0.0);
        state.actors = actors;
        state
    }

    fn car(id: u32, (x_m, y_m, heading_rad): (f64, f64, f64), speed_mps: f64) -> Actor {
        let pose = Pose2::new(x_m, y_m, heading_rad);
        let mut car = actor(id, ActorKind::Car, pose, 4.0, 2.0);
        car.velocity_mps = pose.direction() * speed_mps;
        car
    }

    #[test]
    fn ttc_is_gap_over_closing_speed_and_absent_when_not_closing() {
        let mut drive = traffic();
        // 20.5 m between the bumpers; the lead is faster, equally fast, then slower by 4 m/s.
        for (k, lead_mps) in [(0, 12.0), (1, 10.0)] {
            drive.take(&at(50 * k, (0.0, 0.0), 10.0, vec![car(1, (25.0, 0.0, 0.0), lead_mps)]));
            assert_eq!(drive.metrics().min_ttc_s, None);
        }
        drive.take(&at(75, (0.0, 0.0), 1e-12, vec![car(1, (25.0, 0.0, 0.0), 0.0)]));
        assert_eq!(drive.metrics().min_ttc_s, None, "at rest");
        drive.take(&at(100, (0.0, 0.0), 10.0, vec![car(1, (25.0, 0.0, 0.0), 6.0)]));
        drive.take(&at(150, (0.0, 0.0), 10.0, vec![car(1, (35.0, 0.0, 0.0), 6.0)]));
        let found = drive.metrics();
        assert_eq!(found.min_ttc_s, Some(20.5 / 4.0));
        assert_eq!((found.min_ttc_actor, found.min_ttc_at_s), (Some(ActorId(1)), Some(0.1)));
        // An oncoming car in the next lane passes by; one in the own lane is on a collision course.
        let half_turn = core::f64::consts::PI;
        drive.take(&at(200, (0.0, 0.0), 10.0, vec![car(2, (44.5, 4.0, half_turn), 10.0)]));
        assert_eq!(drive.metrics().min_ttc_s, Some(20.5 / 4.0));
        drive.take(&at(250, (0.0, 0.0), 10.0, vec![car(2, (44.5, 0.5, half_turn), 10.0)]));
        assert!((drive.metrics().min_ttc_s.unwrap() - 2.0).abs() < 1e-12);
    }

    #[test]
    fn headway_is_to_the_nearest_vehicle_ahead_in_the_own_lane() {
        let mut drive = traffic();
        let quarter_turn = core::f64::consts::FRAC_PI_2;
        let person = actor(5, ActorKind::Pedestrian, Pose2::new(6.0, 0.0, 0.0), 0.5, 0.5);
        let others = vec![
            car(1, (24.5, 1.9, 0.0), 8.0),
            car(2, (12.0, 4.0, 0.0), 8.0),
            car(3, (-12.0, 0.0, 0.0), 8.0),
            car(4, (12.0, 0.0, quarter_turn), 8.0),
            person,
        ];
        // 20 m between the bumpers at 10 m/s.
        drive.take(&at(0, (0.0, 0.0), 10.0, others.clone()));
        assert_eq!(drive.metrics().min_headway_s, Some(2.0));
        // An ego that stands or is outside the lane has no headway.
        drive.take(&at(50, (10.0, 0.0), 0.05, others.clone()));
        drive.take(&at(100, (10.0, 2.1), 10.0, others[..1].to_vec()));
        assert_eq!(drive.metrics().min_headway_s, Some(2.0));
        drive.take(&at(150, (10.0, 0.0), 10.0, others[..1].to_vec()));
        let found = drive.metrics();
        assert_eq!((found.min_headway_s, found.min_headway_at_s), (Some(1.0), Some(0.15)));
        assert_eq!(traffic().metrics(), TrafficMetrics::default(), "absent without a state");
    }

    #[test]
    fn distance_over_line_and_time_in_oncoming_lane_use_the_outline() {
        let mut drive = traffic();
        // The ego extends 1 m to either side: it is over a line from 1 m off centre.
        for k in 0..400_i64 {
            let d_m = match k {
                100..140 => 1.1,
                200..260 => -1.1,
                300..400 => 0.9,
                _ => 0.0,
            };
            drive.take(&at(5 * k, (0.05 * k as f64, d_m), 10.0, Vec::new()));
        }
        let found = drive.metrics();
        // Sampled every 50 ms, 0.5 m: 4 samples to the left, 6 to the right, of which the first of each includes the
        // lateral step.
        let wanted_m = 2.0 * swerve_geom::math::hypot(0.5, 1.1) + 8.0 * 0.5;
        assert!((found.time_in_oncoming_lane_s.unwrap() - 0.2).abs() < 1e-9, "{found:?}");
        assert!((found.distance_over_line_m.unwrap() - wanted_m).abs() < 1e-9, "{found:?}");
        assert_eq!(found.min_headway_s, None, "nobody is ahead");
    }

    #[test]
    fn lanes_of_a_map_have_directions_and_lines_that_may_be_crossed() {
        let lane = |id: u32, y_m: f64, turned: bool| {
            let ends = if turned { [900.0, 0.0] } else { [0.0, 900.0] };
            let line = Polyline::new(&ends.map(|x_m| Point2::new(x_m, y_m))).unwrap();
            Lane::new(LaneId(id), line, Borders::constant(2.0, 2.0))
        };
        let beside = |id: u32, opposite: bool| Some(Neighbour { lane: LaneId(id), opposite });
        // From right to left: the route, a lane in its direction behind a broken line, one against it behind a solid one.
        let (mut own, mut middle, mut left) = (lane(0, 0.0, false), lane(1, 4.0, false), lane(2, 8.0, true));
        (own.left, middle.right) = (beside(1, false), beside(0, false));
        (middle.left, left.left) = (beside(2, true), beside(1, true));
        let mark = |kind| vec![Mark::new(0.0, kind)];
        own.marks = LaneMarks::new(mark(MarkKind::Broken), Vec::new()).unwrap();
        middle.marks = LaneMarks::new(mark(MarkKind::Solid), mark(MarkKind::Broken)).unwrap();
        left.marks = LaneMarks::new(mark(MarkKind::Solid), Vec::new()).unwrap();
        let map = Map::new(vec![own, middle, left]).unwrap();
        let route = Route::along(&map, &[LaneId(0)]).unwrap();
        let directions = Directions::new(|point, heading_rad| point.y_m > 6.0 && heading_rad.abs() < 1.0);
        let norm = Norm { target_speed_mps: None, directions: Some(directions) };
        let metrics = |d_m: f64| {
            let mut drive = Traffic::new(EGO, Some(route.clone()), norm.clone());
            for k in 0..=100_i64 {
                drive.take(&at(50 * k, (10.0 + 0.5 * k as f64, d_m), 10.0, Vec::new()));
            }
            let found = drive.metrics();
            (found.distance_over_line_m.unwrap(), found.time_in_oncoming_lane_s.unwrap())
        };
        assert_eq!(metrics(4.0), (0.0, 0.0));
        let (over_m, oncoming_s) = metrics(5.5);
        assert!((over_m - 50.0).abs() < 1e-9 && (oncoming_s - 5.0).abs() < 1e-9, "{over_m} {oncoming_s}");
    }

    #[test]
    fn speed_over_target_is_zero_below_it() {
        let mut drive = traffic();
        drive.take(&at(0, (0.0, 0.0), 8.0, Vec::new()));
        assert_eq!(drive.metrics().speed_over_target_mps, Some(0.0));
        drive.take(&at(50, (0.0, 0.0), 11.5, Vec::new()));
        drive.take(&at(100, (0.0, 0.0), 9.0, Vec::new()));
        assert_eq!(drive.metrics().speed_over_target_mps, Some(1.5));
        let mut unknown = Traffic::new(EGO, None, Norm::default());
        unknown.take(&at(0, (0.0, 0.0), 8.0, Vec::new()));
        assert_eq!(unknown.metrics(), TrafficMetrics::default());
    }
}
