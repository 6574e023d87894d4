//! How long the answer to what a sensor saw may take: from speed, time to collision and what is around.
//!
//! The idea is that of D3 (Gog et al., "D3: A Dynamic Deadline-Driven Approach for Building Autonomous Vehicles",
//! EuroSys 2022): a deadline that follows the situation leaves time for an accurate answer where there is time, and
//! asks for a quick one where there is none. The formulas are ours.
//!
//! **Time left.** The ego goes on beside the route with its speed `v` (m/s). For each hazard at the gap `g` (m) ahead of
//! the bumper, itself moving along the route with `u` (m/s), the closing speed is `c = v - u`, and braking with `b`
//! (m/s²) has to begin within
//!
//! ```text
//! t_brake = (g - margin) / c - c / (2 b)        the gap over the speed, less what braking needs: c²/(2b) of way
//! ```
//!
//! which is the stopping distance of RSS (Shalev-Shwartz et al. 2017) without its response time, solved for it. Where
//! there is room beside the hazard, a swerve by `y` (m) with the lateral acceleration `a` (m/s²), half of the way to
//! either side, may begin as late as
//!
//! ```text
//! t_swerve = (g - margin) / c - 2 sqrt(y / a)
//! ```
//!
//! and the later of both counts. Hazards are
//! - **what is in the way**: predicted to be, at any instant, on the strip that the ego sweeps;
//! - **what may be hidden**: a thing beside the strip, no further than `reach_m`, behind which a person may be. Taken for
//!   a standing hazard at its far end, that can only be braked for (RSS, rule 4: be cautious where sight is limited).
//!
//! **Response.** From the least time left over all hazards goes what passes beside computing: the wait for the next
//! frame, the control period, the dead time of the car; for what is hidden also the frames until a track is confirmed.
//! The rest, within the bounds of the two components, is the response time `T`: never more with more speed, never
//! less with more distance, and the longest where there is no hazard.
//!
//! **Division.** The planner's share of `T` grows with the number of things near by, in which a planner has more to
//! look at; the detector has the rest. What the detector did not need is the planner's.
//!
//! No term is fitted to results of drives.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{FrenetPoint, Pose2};
use swerve_msg::{ActorId, EgoState, Prediction, Route};
use swerve_vehicle::{Limits, Shape};

use crate::params::{InvalidParam, require, require_not_negative, require_positive};

/// Parameters of the policy.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// The detector gets at least this, seconds. Source: D3's shortest budget.
    pub detector_min_s: f64,
    /// And at most this, seconds. Source: D3's longest budget.
    pub detector_max_s: f64,
    /// The planner gets at least this, seconds. Source: D3's shortest budget.
    pub planner_min_s: f64,
    /// And at most this, seconds. Source: D3's longest budget.
    pub planner_max_s: f64,
    /// Deceleration that is counted on, m/s². Source: 0.774 g, the competent driver of UN R157 (as remembered).
    pub brake_mps2: f64,
    /// Distance to be kept ahead, metres. Source: ours.
    pub margin_m: f64,
    /// The strip that the ego sweeps is wider than the ego by this on either side, metres. Source: ours.
    pub clearance_m: f64,
    /// What stands no further beside the strip may hide a person who steps out, metres; 0 for nothing. Source: ours: about what a
    /// person goes in the second that a response and the braking take.
    pub reach_m: f64,
    /// Things no further than this are counted, metres. Source: FOT's `obstacle_range_m`.
    pub count_within_m: f64,
    /// The planner's share with nothing near by. Source: ours.
    pub planner_share_empty: f64,
    /// The planner's share with `full_at` things near by. Source: ours: that of D3's longest budgets.
    pub planner_share_full: f64,
    /// So many things are a full scene. Source: ours.
    pub full_at: u32,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            detector_min_s: 0.020,
            detector_max_s: 0.270,
            planner_min_s: 0.030,
            planner_max_s: 0.309,
            brake_mps2: 7.6,
            margin_m: 1.0,
            clearance_m: 0.3,
            reach_m: 3.0,
            count_within_m: 50.0,
            planner_share_empty: 0.35,
            planner_share_full: 0.55,
            full_at: 10,
        }
    }
}

impl Params {
    /// Checks all ranges.
    pub fn validate(&self) -> Result<(), InvalidParam> {
        for (key, value) in [
            ("detector_min_s", self.detector_min_s),
            ("planner_min_s", self.planner_min_s),
            ("brake_mps2", self.brake_mps2),
            ("count_within_m", self.count_within_m),
        ] {
            require_positive(key, value)?;
        }
        for (key, value) in [
            ("margin_m", self.margin_m),
            ("clearance_m", self.clearance_m),
            ("reach_m", self.reach_m),
            ("planner_share_empty", self.planner_share_empty),
        ] {
            require_not_negative(key, value)?;
        }
        let day_s = 86_400.0;
        let most = |key, least: f64, most: f64| {
            require(
                key,
                most,
                (least..=day_s).contains(&most),
                "must not be below the least, nor above a day",
            )
        };
        most("detector_max_s", self.detector_min_s, self.detector_max_s)?;
        most("planner_max_s", self.planner_min_s, self.planner_max_s)?;
        let full = self.planner_share_full;
        let share = (self.planner_share_empty..=1.0).contains(&full);
        require("planner_share_full", full, share, "must be between planner_share_empty and 1")?;
        require("full_at", f64::from(self.full_at), self.full_at > 0, "must be above zero")
    }
}

/// What the policy is given.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// The present instant.
    pub now: Time,
    /// The ego as measured last.
    pub ego: &'a EgoState,
    /// Where it goes, and what ground it may use.
    pub route: &'a Route,
    /// Its outline.
    pub shape: &'a Shape,
    /// What it can do.
    pub limits: &'a Limits,
    /// What moves where.
    pub predictions: &'a [Prediction],
}

/// What passes from an event to the first effect of its answer beside computing.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Overhead {
    /// For what is tracked already, seconds: the wait for a frame, the control period, the car's dead time.
    pub seen_s: f64,
    /// For what has still to come into sight, seconds: the frames until a track is confirmed, too.
    pub hidden_s: f64,
}

/// What leaves least time.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hazard {
    /// What it is, or what it is hidden behind.
    pub id: ActorId,
    /// Whether it is what may be hidden.
    pub hidden: bool,
    /// Time until braking or swerving has to begin, seconds; negative when that is over.
    pub left_s: f64,
}

/// How long the answer may take.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Response {
    /// From the frame to its plan, seconds.
    pub total_s: f64,
    /// The detector's part, seconds.
    pub detector_s: f64,
    /// The planner's part, seconds.
    pub planner_s: f64,
}

/// Slower than this the ego stands, m/s.
const STANDS_MPS: f64 = 0.3;

/// What is lower or shorter than this hides nobody, metres.
const HIDES_M: f64 = 1.0;

/// A pace below which nothing is closing, m/s.
const CLOSING_MPS: f64 = 0.1;

/// The hazard that leaves least time beyond what passes anyway.
pub fn nearest_hazard(params: &Params, situation: &Situation<'_>, overhead: Overhead) -> Option<Hazard> {
    if situation.ego.speed_mps < STANDS_MPS {
        return None;
    }
    let ego = Ego::of(params, situation);
    let spare_s = |h: &Hazard| h.left_s - if h.hidden { overhead.hidden_s } else { overhead.seen_s };
    // A thing may be in the way and hide another: both count.
    let both = |p| [in_the_way(params, situation, &ego, p), behind(params, situation, &ego, p)];
    let hazards = situation.predictions.iter().flat_map(both).flatten();
    hazards.min_by(|a, b| spare_s(a).total_cmp(&spare_s(b)))
}

/// How many things are near by.
pub fn obstacles_near(params: &Params, situation: &Situation<'_>) -> usize {
    let at = situation.ego.pose.point();
    let near = |p: &&Prediction| {
        p.path.first().is_some_and(|place| place.pose.point().distance(at) <= params.count_within_m)
    };
    situation.predictions.iter().filter(near).count()
}

/// How long the answer may take with this hazard and so many things near by.
pub fn respond(params: &Params, hazard: Option<Hazard>, overhead: Overhead, obstacles: usize) -> Response {
    let least_s = params.detector_min_s + params.planner_min_s;
    let most_s = params.detector_max_s + params.planner_max_s;
    let spare_s = hazard.map_or(most_s, |hazard| {
        hazard.left_s - if hazard.hidden { overhead.hidden_s } else { overhead.seen_s }
    });
    let total_s = spare_s.clamp(least_s, most_s);
    let full = (obstacles as f64 / f64::from(params.full_at)).min(1.0);
    let share = params.planner_share_empty + (params.planner_share_full - params.planner_share_empty) * full;
    // Neither below its least; what one cannot use is the other's.
    let detector_s = (total_s * (1.0 - share))
        .clamp(params.detector_min_s, params.detector_max_s)
        .max(total_s - params.planner_max_s)
        .min(total_s - params.planner_min_s);
    Response { total_s, detector_s, planner_s: total_s - detector_s }
}

/// The ego in terms of the route.
struct Ego {
    /// Of its bumper, metres.
    front_m: f64,
    /// Of its middle, metres to the left.
    d_m: f64,
    /// Half of the strip that it sweeps, metres.
    half_m: f64,
}

impl Ego {
    fn of(params: &Params, situation: &Situation<'_>) -> Self {
        let Situation { ego, route, shape, .. } = situation;
        let center = route.project(shape.center(ego.pose));
        Self {
            front_m: center.s_m + 0.5 * shape.length_m,
            d_m: center.d_m,
            half_m: 0.5 * shape.width_m + params.clearance_m,
        }
    }
}

/// A footprint in terms of the route, metres.
#[derive(Clone, Copy)]
struct Stretch {
    s_m: [f64; 2],
    d_m: [f64; 2],
}

fn stretch(route: &Route, prediction: &Prediction, pose: Pose2) -> Stretch {
    let mut s_m = [f64::INFINITY, f64::NEG_INFINITY];
    let mut d_m = s_m;
    for corner in prediction.extent.footprint(pose).corners() {
        let FrenetPoint { s_m: s, d_m: d } = route.project(corner);
        s_m = [s_m[0].min(s), s_m[1].max(s)];
        d_m = [d_m[0].min(d), d_m[1].max(d)];
    }
    Stretch { s_m, d_m }
}

/// How far a thing is beside the strip that the ego sweeps, metres; negative on it.
fn beside_m(ego: &Ego, at: &Stretch) -> f64 {
    (at.d_m[0] - ego.d_m).max(ego.d_m - at.d_m[1]) - ego.half_m
}

/// A thing that is predicted to be on the strip, ahead.
fn in_the_way(
    params: &Params,
    situation: &Situation<'_>,
    ego: &Ego,
    prediction: &Prediction,
) -> Option<Hazard> {
    let (when, at) = prediction.path.iter().find_map(|place| {
        let at = stretch(situation.route, prediction, place.pose);
        (at.s_m[1] > ego.front_m && beside_m(ego, &at) < 0.0).then_some((place.at, at))
    })?;
    let along_mps = along_mps(situation.route, prediction);
    // Where it would be now, had it always been on the strip.
    let gap_m = at.s_m[0] - along_mps * (when - situation.now).as_secs().max(0.0) - ego.front_m;
    let closing_mps = situation.ego.speed_mps - along_mps;
    let left_s = left_s(params, gap_m, closing_mps, swerve_m(situation, ego, &at), situation.limits)?;
    Some(Hazard { id: prediction.id, hidden: false, left_s })
}

/// What may be hidden behind a thing near the strip.
fn behind(params: &Params, situation: &Situation<'_>, ego: &Ego, prediction: &Prediction) -> Option<Hazard> {
    let here = stretch(situation.route, prediction, prediction.path.first()?.pose);
    let extent = &prediction.extent;
    let large = extent.height_m >= HIDES_M && extent.length_m.max(extent.width_m) >= HIDES_M;
    let near = params.reach_m > 0.0 && beside_m(ego, &here) <= params.reach_m;
    let hides = large && !prediction.kind.is_person() && near;
    let gap_m = here.s_m[1] - ego.front_m;
    if !hides || gap_m <= 0.0 {
        return None;
    }
    let left_s = left_s(params, gap_m, situation.ego.speed_mps, None, situation.limits)?;
    Some(Hazard { id: prediction.id, hidden: true, left_s })
}

/// Time until braking, or a swerve by `swerve_m` where there is room for one, has to begin, seconds; none where
/// nothing is closing.
fn left_s(
    params: &Params,
    gap_m: f64,
    closing_mps: f64,
    swerve_m: Option<f64>,
    limits: &Limits,
) -> Option<f64> {
    if closing_mps < CLOSING_MPS {
        return None;
    }
    let brake_s = closing_mps / (2.0 * params.brake_mps2);
    let swerve_s =
        swerve_m.map_or(f64::INFINITY, |y_m| 2.0 * (y_m.max(0.0) / limits.lateral_accel_max_mps2).sqrt());
    Some((gap_m - params.margin_m) / closing_mps - brake_s.min(swerve_s))
}

/// How far the ego has to go aside to pass, to the nearer side that has room for it, metres.
fn swerve_m(situation: &Situation<'_>, ego: &Ego, at: &Stretch) -> Option<f64> {
    let route = situation.route;
    let half_m = 0.5 * situation.shape.width_m;
    let left_m = at.d_m[1] + ego.half_m;
    let right_m = at.d_m[0] - ego.half_m;
    let to_left =
        (left_m + half_m <= route.borders().left().min_between_m(at.s_m)).then_some(left_m - ego.d_m);
    let to_right =
        (right_m - half_m >= -route.borders().right().min_between_m(at.s_m)).then_some(ego.d_m - right_m);
    [to_left, to_right].into_iter().flatten().reduce(f64::min)
}

/// Mean speed along the route over the predicted path, m/s.
fn along_mps(route: &Route, prediction: &Prediction) -> f64 {
    let (Some(first), Some(last)) = (prediction.path.first(), prediction.path.last()) else { return 0.0 };
    let dt_s = (last.at - first.at).as_secs();
    if dt_s <= 0.0 {
        return 0.0;
    }
    let place_m = |pose: Pose2| route.project(pose.point()).s_m;
    (place_m(last.pose) - place_m(first.pose)) / dt_s
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;
    use swerve_core::Span;
    use swerve_geom::{Point2, Polyline};
    use swerve_msg::{ActorKind, Extent, PredictedPose};

    use super::*;

    const OVERHEAD: Overhead = Overhead { seen_s: 0.2, hidden_s: 0.4 };

    fn route() -> Route {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(500.0, 0.0)]).unwrap();
        Route::uniform(line, 6.0, 2.0)
    }

    /// Something 0.5 m across, or a truck, that goes on from (s, d) with a velocity for 5 s.
    fn thing(kind: ActorKind, (s_m, d_m): (f64, f64), (along_mps, left_mps): (f64, f64)) -> Prediction {
        let extent = match kind {
            ActorKind::Truck => Extent { length_m: 5.2, width_m: 2.6, height_m: 2.5 },
            ActorKind::Static => Extent { length_m: 0.5, width_m: 8.0, height_m: 1.8 },
            _ => Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 },
        };
        let place = |k: i64| {
            let t_s = k as f64 * 0.1;
            let pose = Pose2::new(s_m + along_mps * t_s, d_m + left_mps * t_s, 0.0);
            PredictedPose { at: Time::from_ms(100 * k), pose }
        };
        let id = ActorId(7);
        Prediction { id, kind, extent, probability: 1.0, path: (0..=50).map(place).collect() }
    }

    fn hazard_at(speed_mps: f64, things: &[Prediction]) -> Option<Hazard> {
        hazard_by(&Params::default(), speed_mps, things)
    }

    /// Of what is in the way, without what that may hide.
    fn seen_at(speed_mps: f64, things: &[Prediction]) -> Option<Hazard> {
        hazard_by(&Params { reach_m: 0.0, ..Params::default() }, speed_mps, things)
    }

    fn hazard_by(params: &Params, speed_mps: f64, things: &[Prediction]) -> Option<Hazard> {
        let (route, shape, limits) = (route(), Shape::default(), Limits::default());
        let ego = EgoState { speed_mps, ..EgoState::default() };
        let situation = Situation {
            now: Time::ZERO,
            ego: &ego,
            route: &route,
            shape: &shape,
            limits: &limits,
            predictions: things,
        };
        nearest_hazard(params, &situation, OVERHEAD)
    }

    fn total_s(speed_mps: f64, things: &[Prediction]) -> f64 {
        respond(&Params::default(), hazard_at(speed_mps, things), OVERHEAD, things.len()).total_s
    }

    /// Of the bumper before the ego origin, metres.
    fn front_m() -> f64 {
        Shape::default().center_ahead_m() + 0.5 * Shape::default().length_m
    }

    #[test]
    fn the_time_left_is_the_gap_over_the_speed_less_what_braking_needs() {
        // A wall across the whole road.
        let row = [thing(ActorKind::Static, (50.0, 2.0), (0.0, 0.0))];
        let gap_m = 50.0 - 0.25 - front_m();
        let hazard = seen_at(12.0, &row).unwrap();
        assert!(!hazard.hidden);
        assert!((hazard.left_s - ((gap_m - 1.0) / 12.0 - 12.0 / 15.2)).abs() < 1e-9, "{hazard:?}");
    }

    #[test]
    fn at_high_speed_a_swerve_may_begin_later_than_braking() {
        let person = [thing(ActorKind::Pedestrian, (60.0, 0.0), (0.0, 0.0))];
        let limits = Limits::default();
        let hazard = hazard_at(24.0, &person).unwrap();
        let y_m = 0.25 + 0.5 * Shape::default().width_m + 0.3;
        let swerve_s = 2.0 * (y_m / limits.lateral_accel_max_mps2).sqrt();
        assert!(swerve_s < 24.0 / 15.2);
        let gap_m = 60.0 - 0.25 - front_m() - 1.0;
        assert!((hazard.left_s - (gap_m / 24.0 - swerve_s)).abs() < 1e-9, "{hazard:?}");
    }

    #[test]
    fn what_is_hidden_behind_a_truck_counts_as_standing_at_its_end() {
        let truck = [thing(ActorKind::Truck, (40.0, 4.0), (0.0, 0.0))];
        let hazard = hazard_at(12.0, &truck).unwrap();
        let gap_m = 40.0 + 2.6 - front_m() - 1.0;
        assert!(hazard.hidden && (hazard.left_s - (gap_m / 12.0 - 12.0 / 15.2)).abs() < 1e-9, "{hazard:?}");
        // Far beside, behind, or a person who hides nobody.
        assert_eq!(hazard_at(12.0, &[thing(ActorKind::Truck, (40.0, 7.0), (0.0, 0.0))]), None);
        assert_eq!(hazard_at(12.0, &[thing(ActorKind::Truck, (0.0, 4.0), (0.0, 0.0))]), None);
        assert_eq!(hazard_at(12.0, &[thing(ActorKind::Pedestrian, (40.0, 4.0), (0.0, 0.0))]), None);
        // Also if it is taken for one that drifts into the way, far ahead.
        let drifts = hazard_at(12.0, &[thing(ActorKind::Truck, (40.0, 4.0), (0.5, -0.3))]).unwrap();
        assert_eq!(drifts, hazard);
        // One who walks onto the strip is in the way.
        let walks = hazard_at(12.0, &[thing(ActorKind::Pedestrian, (40.0, 4.0), (0.0, -1.5))]).unwrap();
        assert!(!walks.hidden);
    }

    #[test]
    fn what_goes_ahead_as_fast_leaves_all_the_time() {
        assert_eq!(seen_at(12.0, &[thing(ActorKind::Static, (30.0, 0.0), (12.0, 0.0))]), None);
        assert_eq!(seen_at(0.0, &[thing(ActorKind::Static, (5.0, 0.0), (0.0, 0.0))]), None);
        let slower = seen_at(12.0, &[thing(ActorKind::Static, (30.0, 0.0), (6.0, 0.0))]).unwrap();
        let standing = seen_at(12.0, &[thing(ActorKind::Static, (30.0, 0.0), (0.0, 0.0))]).unwrap();
        assert!(slower.left_s > standing.left_s);
        assert_eq!(total_s(12.0, &[]), 0.270 + 0.309);
    }

    #[test]
    fn a_full_scene_gives_the_planner_more() {
        let params = Params::default();
        let [empty, full, fuller] = [0, 10, 100].map(|n| respond(&params, None, OVERHEAD, n));
        assert!(empty.planner_s < full.planner_s && full == fuller);
        assert_eq!(empty.total_s, full.total_s);
    }

    #[test]
    fn nonsense_is_refused() {
        let refused = |params: Params| params.validate().unwrap_err().key;
        let good = Params::default();
        assert_eq!(good.validate(), Ok(()));
        assert_eq!(refused(Params { brake_mps2: 0.0, ..good }), "brake_mps2");
        assert_eq!(refused(Params { detector_max_s: 0.01, ..good }), "detector_max_s");
        assert_eq!(refused(Params { planner_max_s: f64::NAN, ..good }), "planner_max_s");
        assert_eq!(refused(Params { planner_share_full: 0.1, ..good }), "planner_share_full");
        assert_eq!(refused(Params { full_at: 0, ..good }), "full_at");
    }

    proptest! {
        #[test]
        fn more_speed_never_gives_more_time_and_more_distance_never_less(
            speed_mps in 1.0..30.0_f64,
            faster_mps in 0.0..5.0_f64,
            s_m in 6.0..200.0_f64,
            further_m in 0.0..50.0_f64,
            d_m in -3.0..5.0_f64,
            kind in prop::sample::select(vec![ActorKind::Pedestrian, ActorKind::Truck]),
        ) {
            let at = |s_m| [thing(kind, (s_m, d_m), (0.0, 0.0))];
            let here_s = total_s(speed_mps, &at(s_m));
            prop_assert!(total_s(speed_mps + faster_mps, &at(s_m)) <= here_s + 1e-9);
            // A thing that is passed is none: only what is still ahead is compared.
            if hazard_at(speed_mps, &at(s_m)).is_some() {
                prop_assert!(total_s(speed_mps, &at(s_m + further_m)) >= here_s - 1e-9);
            }
        }

        #[test]
        fn the_parts_are_within_their_bounds_and_make_the_whole(
            left_s in -2.0..3.0_f64,
            hidden in any::<bool>(),
            obstacles in 0_usize..30,
        ) {
            let params = Params::default();
            let hazard = Some(Hazard { id: ActorId(1), hidden, left_s });
            let Response { total_s, detector_s, planner_s } = respond(&params, hazard, OVERHEAD, obstacles);
            let slack = 1e-12;
            prop_assert!((params.detector_min_s - slack..=params.detector_max_s + slack).contains(&detector_s));
            prop_assert!((params.planner_min_s - slack..=params.planner_max_s + slack).contains(&planner_s));
            prop_assert!((total_s - detector_s - planner_s).abs() < slack);
            prop_assert!(Span::from_secs(total_s) >= Span::from_ms(50));
        }
    }
}
