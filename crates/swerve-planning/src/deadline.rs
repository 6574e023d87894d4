//! Deadline policy: response time to a sensor frame from speed, time to collision and scene.
//!
//! The idea is that of D3 (Gog et al., "D3: A Dynamic Deadline-Driven Approach for Building Autonomous Vehicles",
//! EuroSys 2022): a deadline that follows the situation allows an accurate answer when there is time, and a quick one
//! when there is not. The formulas are ours.
//!
//! **Time left.** The ego moves parallel to the route at its speed `v` (m/s). For each hazard at gap `g` (m) ahead of
//! the bumper, itself moving along the route at `u` (m/s), the closing speed is `c = v - u`, and braking with `b`
//! (m/s²) has to begin within
//!
//! ```text
//! t_brake = (g - margin) / c - c / (2 b)  the gap over the closing speed, less the braking distance c²/(2b)
//! ```
//!
//! which is the stopping distance of RSS (Shalev-Shwartz et al. 2017) without its response time, solved for the time.
//! If there is room beside the hazard, a swerve by `y` (m) with the lateral acceleration `a` (m/s²), half of the
//! distance in either direction, may begin as late as
//!
//! ```text
//! t_swerve = (g - margin) / c - 2 sqrt(y / a)
//! ```
//!
//! and the later of the two counts. Hazards are
//! - **in the way**: predicted to be, at any instant, on the strip that the ego sweeps;
//! - **possibly hidden**: a person behind an object beside the strip, no further away than `reach_m`. Treated as a
//!   standing hazard at the object's far end that can only be braked for (RSS, rule 4: be cautious where sight is
//!   limited).
//!
//! **Response.** The time that passes besides computing is subtracted from the smallest time left over all hazards: the
//! wait for the next frame, the control period, the dead time of the car; for hidden hazards also the frames until a
//! track is confirmed. The rest, within the bounds of the two components, is the response time `T`: non-increasing in
//! speed, non-decreasing in distance, and largest without hazards.
//!
//! **Division.** The planner's share of `T` grows with the number of nearby obstacles, which give a planner more to
//! check; the detector has the rest. Time that the detector does not use goes to the planner.
//!
//! No term is fitted to results of drives.

mod params;

use swerve_core::Time;
use swerve_geom::{FrenetPoint, Pose2};
use swerve_msg::{ActorId, EgoState, Prediction, Route};
use swerve_vehicle::{Limits, Shape};

pub use params::Params;

/// Input of the policy.
#[derive(Clone, Copy, Debug)]
pub struct Situation<'a> {
    /// The present instant.
    pub now: Time,
    /// The ego as measured last.
    pub ego: &'a EgoState,
    /// Route with its drivable ground.
    pub route: &'a Route,
    /// Outline of the ego.
    pub shape: &'a Shape,
    /// Limits of the ego.
    pub limits: &'a Limits,
    /// Predicted motions of other road users.
    pub predictions: &'a [Prediction],
}

/// Time from an event to the first effect of the response, excluding computation.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Overhead {
    /// For tracked objects, seconds: the wait for a frame, the control period, the car's dead time.
    pub seen_s: f64,
    /// For objects still hidden, seconds: also the frames until a track is confirmed.
    pub hidden_s: f64,
}

/// The hazard with the least time left.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Hazard {
    /// Identity of the hazard, or of the object that may hide it.
    pub id: ActorId,
    /// True if the hazard may be hidden behind the object.
    pub hidden: bool,
    /// Time until braking or swerving has to begin, seconds; negative if that has passed.
    pub left_s: f64,
}

/// Response time and its division.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Response {
    /// Time from the frame to its plan, seconds.
    pub total_s: f64,
    /// The detector's share, seconds.
    pub detector_s: f64,
    /// The planner's share, seconds.
    pub planner_s: f64,
}

/// Below this speed the ego stands, m/s.
const STANDS_MPS: f64 = 0.3;

/// Objects lower or shorter than this hide nobody, metres.
const HIDES_M: f64 = 1.0;

/// Closing speeds below this do not count as closing, m/s.
const CLOSING_MPS: f64 = 0.1;

/// The hazard with the least time left after the overhead.
pub fn nearest_hazard(params: &Params, situation: &Situation<'_>, overhead: Overhead) -> Option<Hazard> {
    if situation.ego.speed_mps < STANDS_MPS {
        return None;
    }
    let ego = Ego::new(params, situation);
    let spare_s = |h: &Hazard| h.left_s - if h.hidden { overhead.hidden_s } else { overhead.seen_s };
    // An object may be in the way and also hide somebody: both count.
    let both = |p| [in_the_way(params, situation, &ego, p), behind(params, situation, &ego, p)];
    let hazards = situation.predictions.iter().flat_map(both).flatten();
    hazards.min_by(|a, b| spare_s(a).total_cmp(&spare_s(b)))
}

/// Number of nearby obstacles.
pub fn obstacles_near(params: &Params, situation: &Situation<'_>) -> usize {
    let at = situation.ego.pose.point();
    let near = |p: &&Prediction| {
        p.path.first().is_some_and(|place| place.pose.point().distance(at) <= params.count_within_m)
    };
    situation.predictions.iter().filter(near).count()
}

/// Response time for this hazard and number of nearby obstacles.
pub fn respond(params: &Params, hazard: Option<Hazard>, overhead: Overhead, obstacles: usize) -> Response {
    let least_s = params.detector_min_s + params.planner_min_s;
    let most_s = params.detector_max_s + params.planner_max_s;
    let spare_s = hazard.map_or(most_s, |hazard| {
        hazard.left_s - if hazard.hidden { overhead.hidden_s } else { overhead.seen_s }
    });
    let total_s = spare_s.clamp(least_s, most_s);
    let full = (obstacles as f64 / f64::from(params.full_at)).min(1.0);
    let share = params.planner_share_empty + (params.planner_share_full - params.planner_share_empty) * full;
    // Neither is below its minimum; the remainder of one goes to the other.
    let detector_s = (total_s * (1.0 - share))
        .clamp(params.detector_min_s, params.detector_max_s)
        .max(total_s - params.planner_max_s)
        .min(total_s - params.planner_min_s);
    Response { total_s, detector_s, planner_s: total_s - detector_s }
}

/// The ego in route coordinates.
struct Ego {
    /// Arc length of its bumper, metres.
    front_m: f64,
    /// Offset of its centre, metres to the left.
    d_m: f64,
    /// Half width of the strip that it sweeps, metres.
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

/// A footprint in route coordinates, metres.
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

/// Lateral gap between an object and the strip that the ego sweeps, metres; negative on the strip.
fn beside_m(ego: &Ego, at: &Stretch) -> f64 {
    (at.d_m[0] - ego.d_m).max(ego.d_m - at.d_m[1]) - ego.half_m
}

/// Hazard from an object predicted to be on the strip, ahead.
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
    // Its current place, had it always been on the strip.
    let gap_m = at.s_m[0] - along_mps * (when - situation.now).as_secs().max(0.0) - ego.front_m;
    let closing_mps = situation.ego.speed_mps - along_mps;
    let left_s = left_s(params, gap_m, closing_mps, swerve_m(situation, ego, &at), situation.limits)?;
    Some(Hazard { id: prediction.id, hidden: false, left_s })
}

/// Hazard from a person possibly hidden behind an object near the strip.
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

/// Time until braking, or a swerve by `swerve_m` if there is room for one, has to begin, seconds; `None` if nothing is
/// closing.
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

/// Lateral distance to pass on the nearer side that has room, metres.
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
