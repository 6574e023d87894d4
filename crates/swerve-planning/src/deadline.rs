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

mod params;

use swerve_core::Time;
use swerve_geom::{FrenetPoint, Pose2};
use swerve_msg::{ActorId, EgoState, Prediction, Route};
use swerve_vehicle::{Limits, Shape};

pub use params::Params;

/// The situation that the policy judges.
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
    /// Its limits.
    pub limits: &'a Limits,
    /// Motions of the others.
    pub predictions: &'a [Prediction],
}

/// Time that passes from an event to the first effect of its answer, beside computing.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Overhead {
    /// For what is tracked already, seconds: the wait for a frame, the control period, the car's dead time.
    pub seen_s: f64,
    /// For what has still to come into sight, seconds: the frames until a track is confirmed, too.
    pub hidden_s: f64,
}

/// The thing that leaves least time.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hazard {
    /// The thing itself, or the one that it is hidden behind.
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

/// Things lower or shorter than this hide nobody, metres.
const HIDES_M: f64 = 1.0;

/// A pace below which nothing is closing, m/s.
const CLOSING_MPS: f64 = 0.1;

/// The hazard that leaves least time beyond what passes anyway.
pub fn nearest_hazard(params: &Params, situation: &Situation<'_>, overhead: Overhead) -> Option<Hazard> {
    if situation.ego.speed_mps < STANDS_MPS {
        return None;
    }
    let ego = Ego::new(params, situation);
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
    fn new(params: &Params, situation: &Situation<'_>) -> Self {
        let Situation { ego, route, shape, .. } = situation;
        let middle = shape.center(ego.pose);
        let center = route.line().project_pose(Pose2::new(middle.x_m, middle.y_m, ego.pose.heading_rad));
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

/// A person who may be hidden behind a thing near the strip.
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
mod tests;
