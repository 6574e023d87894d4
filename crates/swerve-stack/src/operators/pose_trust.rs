//! Motion by the accuracy of the pose: slower and further from the edges with a poor pose, and a stop if it does not
//! suffice for the lane.

use swerve_flow::Latest;
use swerve_geom::FrenetPoint;
use swerve_msg::{ActorId, EgoState, Plan, PlanStatus, PoseMode, PoseQuality, Prediction, Route};
use swerve_planning::stop_wall;
use swerve_vehicle::Shape;

/// Share of the target speed with the poorest pose that suffices for the lane.
const SLOWEST: f64 = 0.3;

/// Time after which missing fixes are noticed, seconds (`coasting_after_s` of the localizer).
const NOTICED_S: f64 = 2.0;

/// Longest usual time between two accepted fixes, seconds: five periods of a receiver at 10 Hz.
const SPARSE_S: f64 = 0.5;

/// Growth of the deviations since the newest fix of a good pose from which fixes count as missing, metres.
const GROWN_M: f64 = 0.05;

/// Conditions to go on after a stop: the deviations fit with this ratio to spare, and over this distance, metres.
const RESUME: f64 = 1.1;
const RESUME_M: f64 = 10.0;

/// Factor of the margin while fixes have more noise than they report: the noise is then known from a few fixes only.
const NOISY: f64 = 1.5;

/// Deceleration of the stop, m/s²; by dead reckoning, where the pose gets worse on the way; and the largest of a
/// minimal risk manoeuvre (UN Regulation 157, 5.5.3). It builds up within this time, seconds, and ends this far before
/// the line that must not be passed, metres.
const STOP_MPS2: f64 = 2.5;
const STOP_RECKONED_MPS2: f64 = 3.0;
const STOP_MAX_MPS2: f64 = 4.0;
const BUILD_UP_S: f64 = 0.5;
const STOP_GAP_M: f64 = 2.0;

/// Distance over the left line from which the outline counts as in the other lane, metres.
const OVER_LINE_M: f64 = 0.1;

/// Identity of the obstacle on the line that must not be passed: below those of traffic lights, above those of tracks.
const WALL_ID: ActorId = ActorId(u32::MAX - 1000);

/// Step by which the ground is narrowed, and least room left beside a car in the middle of its lane, metres.
const NARROWED_M: f64 = 0.1;
const LEFT_M: f64 = 0.25;

/// Standing vehicles may hide people who step out, within this time, seconds, and within this distance of the ground,
/// metres. A vehicle counts as standing if it is predicted to move no further than this, metres.
const COVER_S: f64 = 6.0;
const COVER_BESIDE_M: f64 = 3.0;
const STANDS_M: f64 = 0.5;

/// Share of the room beside the car that deviations may take before it slows beside cover.
const SPARE: f64 = 0.3;

/// Lowest target speed of a car that does not stop, m/s.
const SLOWEST_MPS: f64 = 1.0;

/// Speed below which the car counts as standing, m/s.
const STANDS_MPS: f64 = 0.5;

/// The ego and its position along the route.
#[derive(Clone, Copy)]
pub(super) struct Here<'a> {
    pub(super) ego: &'a EgoState,
    pub(super) place: FrenetPoint,
    pub(super) route: &'a Route,
}

impl Here<'_> {
    /// Returns true if an outline with its origin at this position reaches into the lane to the left.
    fn is_over_line(&self, place: FrenetPoint, shape: &Shape) -> bool {
        place.d_m + 0.5 * shape.width_m > self.route.lane().left_m(place.s_m) + OVER_LINE_M
    }
}

/// A stop because of the pose.
pub(super) struct Stop {
    /// Obstacle on the line that must not be passed.
    pub(super) wall: Prediction,
    /// True if the ego is in the lane to its left now.
    from_other_lane: bool,
}

impl Stop {
    /// Returns true if a plan before the wall is a minimal risk manoeuvre: it brakes with at most [`STOP_MAX_MPS2`] and
    /// does not come to rest in the other lane. From the other lane it has to lead back.
    pub(super) fn is_fit(&self, plan: &Plan, here: Here<'_>, shape: &Shape) -> bool {
        let Some(end) = plan.points.last() else { return false };
        let driven_m = here.ego.pose.point().distance(end.pose.point());
        let half_m = 0.5 * driven_m + 1.0;
        let place = here.route.project_near(end.pose.point(), here.place.s_m + half_m, half_m);
        let ends = self.from_other_lane || end.speed_mps < STANDS_MPS;
        hardest_mps2(plan) <= STOP_MAX_MPS2 && !(ends && here.is_over_line(place, shape))
    }

    /// Returns true if a plan without the wall is better than a stop that is not fit.
    pub(super) fn is_worse_than(stop: &Plan, free: &Plan) -> bool {
        hardest_mps2(free) <= hardest_mps2(stop).max(STOP_MAX_MPS2)
    }
}

/// Largest deceleration of a plan, m/s²; infinite without a way out.
fn hardest_mps2(plan: &Plan) -> f64 {
    if matches!(plan.status, PlanStatus::Brake | PlanStatus::Stop | PlanStatus::GaveUp | PlanStatus::Refused)
    {
        return f64::INFINITY;
    }
    plan.points.iter().map(|point| -point.accel_mps2).fold(0.0, f64::max)
}

/// Room to the nearer edge of the ground: beside the car in the middle of its lane, and at its position.
struct Room {
    room_m: f64,
    beside_m: f64,
    needed_m: f64,
    /// Distance of dead reckoning over which the deviations grow to fill the room.
    way_m: f64,
}

/// Accuracy of the pose, and the motion that it allows.
pub(super) struct PoseTrust {
    quality: Option<PoseQuality>,
    /// Standard deviation of the position at the newest fix of a good pose, metres.
    good_m: Option<f64>,
    slow_by_sigma_m: [f64; 2],
    /// Margin to the edges of the road, in standard deviations of the lateral position; 0 for none.
    lane_sigmas: f64,
    shape: Shape,
    /// The route with this many steps of [`NARROWED_M`] less ground on either side.
    narrowed: Option<(u32, Route)>,
    /// Arc length of the line that must not be passed, while the ego stops for its pose.
    stop_s_m: Option<f64>,
    /// True if the stop waits until the ego is back in its lane.
    is_postponed: bool,
}

impl PoseTrust {
    pub(super) fn new(slow_by_sigma_m: [f64; 2], lane_sigmas: f64, shape: Shape) -> Self {
        Self {
            quality: None,
            good_m: None,
            slow_by_sigma_m,
            lane_sigmas,
            shape,
            narrowed: None,
            stop_s_m: None,
            is_postponed: false,
        }
    }

    /// Takes the newest accuracy; keeps the last one while localization is lost.
    pub(super) fn take(&mut self, quality: Option<&Latest<PoseQuality>>) {
        let quality = quality.and_then(Latest::get).filter(|quality| quality.mode != PoseMode::Lost);
        if let Some(quality) = quality {
            self.learn(**quality);
        }
    }

    fn learn(&mut self, quality: PoseQuality) {
        let before = self.quality.replace(quality);
        // Between fixes all variances grow; a fix reduces some of them.
        let is_less = |k: &usize, of: &PoseQuality| quality.covariance[*k] < of.covariance[*k];
        let is_fixed = before.is_none_or(|before| [0, 2, 5].iter().any(|k| is_less(k, &before)));
        if quality.mode == PoseMode::Good && is_fixed {
            self.good_m = Some(quality.sigma_m());
        }
    }

    /// Target speed by the accuracy of the pose, m/s. At least the present speed during a stop, which has its own
    /// deceleration, and for a car that has to leave the other lane before its stop.
    pub(super) fn target_speed_mps(&self, wanted_mps: f64, here: Here<'_>, others: &[Prediction]) -> f64 {
        let most_mps = self.speed_max_mps(here).max(SLOWEST_MPS);
        let least_mps = if self.stop_s_m.is_some() || self.is_postponed { here.ego.speed_mps } else { 0.0 };
        (wanted_mps * self.speed_share(here, others)).min(most_mps).max(least_mps).min(wanted_mps)
    }

    /// Share of the target speed; 1 without localization.
    fn speed_share(&self, here: Here<'_>, others: &[Prediction]) -> f64 {
        let by_place =
            self.quality.map_or(1.0, |quality| speed_share(quality.sigma_m(), self.slow_by_sigma_m));
        by_place.min(self.share_beside_cover(here, others))
    }

    /// Highest speed from which the car can stop in its lane by dead reckoning, m/s. With fixes and a good pose the
    /// first fault is the loss of fixes, noticed after [`NOTICED_S`]. A car without an inertial unit is in its first
    /// fault: its heading has to hold between fixes, of which some are refused ([`SPARSE_S`]).
    fn speed_max_mps(&self, here: Here<'_>) -> f64 {
        let Some(Room { way_m, .. }) = self.room(here) else { return f64::INFINITY };
        let is_good = self.quality.is_some_and(|quality| quality.mode == PoseMode::Good);
        match self.is_fixed() {
            true if is_good => way_m / NOTICED_S,
            true => way_m / SPARSE_S,
            false => (2.0 * STOP_MPS2 * way_m).sqrt(),
        }
    }

    /// Longest distance in the other lane for which the pose suffices if fixes end at its beginning, metres: an ego
    /// that stops for its pose beside or before an overtaken object blocks the road.
    pub(super) fn overtake_max_m(&self, here: Here<'_>) -> f64 {
        self.room(here).map_or(f64::INFINITY, |room| room.way_m)
    }

    /// Returns true while fixes or matches bound the position: without them the deviations grow.
    fn is_fixed(&self) -> bool {
        let Some(quality) = self.quality else { return true };
        self.good_m.is_some_and(|good_m| quality.sigma_m() <= good_m + GROWN_M)
    }

    /// Share of the target speed by the room left to swerve for a person who steps out from behind a standing vehicle:
    /// room taken by the deviations is compensated by a shorter stopping distance.
    fn share_beside_cover(&self, here: Here<'_>, others: &[Prediction]) -> f64 {
        let Here { ego, place, route } = here;
        let Some(Room { room_m, needed_m, .. }) = self.room(here) else { return 1.0 };
        let taken = needed_m / room_m.max(1e-3);
        if taken <= SPARE || !others.iter().any(|one| is_cover(one, route, place.s_m, ego.speed_mps)) {
            return 1.0;
        }
        speed_share(taken, [SPARE, 1.0])
    }

    /// Room beside the car in the middle of its lane at its arc length, and the deviations that have to fit there,
    /// metres. `None` without localization or margin.
    fn room(&self, Here { place, route, .. }: Here<'_>) -> Option<Room> {
        let quality = self.quality.filter(|_| self.lane_sigmas > 0.0)?;
        let FrenetPoint { s_m, d_m } = place;
        let [left_m, right_m] = [route.left_m(s_m), route.right_m(s_m)];
        let room_m = left_m.min(right_m) - 0.5 * self.shape.width_m;
        let beside_m = (left_m - d_m).min(right_m + d_m) - 0.5 * self.shape.width_m;
        let heading_rad = route.line().at(s_m).pose.heading_rad;
        let sigmas = if quality.mode == PoseMode::Noisy { NOISY } else { 1.0 } * self.lane_sigmas;
        let needed_m = sigmas * quality.across_sigma_m(heading_rad);
        let way_m = quality.way_until_m(heading_rad, room_m / sigmas);
        Some(Room { room_m, beside_m, needed_m, way_m })
    }

    /// Ground for plans: narrowed by the deviations of the pose, with some room left beside the car. For a standing car
    /// it still contains the car, since no plan leads back from beyond it.
    pub(super) fn ground<'a>(&'a mut self, here: Here<'a>) -> &'a Route {
        let Here { ego, route, .. } = here;
        let Some(Room { beside_m, room_m, needed_m, .. }) = self.room(here) else { return route };
        let stands = ego.speed_mps < STANDS_MPS;
        let most_m = (room_m - LEFT_M).min(if stands { beside_m - NARROWED_M } else { f64::INFINITY });
        let steps = (needed_m.min(most_m) / NARROWED_M).max(0.0) as u32;
        if steps == 0 {
            return route;
        }
        if self.narrowed.as_ref().is_none_or(|(known, _)| *known != steps) {
            self.narrowed = Some((steps, route.narrowed(f64::from(steps) * NARROWED_M)));
        }
        self.narrowed.as_ref().map_or(route, |(_, narrowed)| narrowed)
    }

    /// Stop of an ego whose pose does not suffice for its lane, before an obstacle across the road. Never nearer than
    /// the end of a stop at [`STOP_MAX_MPS2`], so that an ego off the plan of the stop does not brake harder for it.
    pub(super) fn stop(&mut self, here: Here<'_>) -> Option<Stop> {
        let Here { ego, place, route } = here;
        let Room { room_m, needed_m, way_m, .. } = self.room(here)?;
        let [spare, least_m] = if self.stop_s_m.is_some() { [RESUME, RESUME_M] } else { [1.0, STOP_GAP_M] };
        let square = 0.5 * ego.speed_mps * ego.speed_mps;
        let ends_beside = !self.is_fixed() && (square / STOP_MAX_MPS2).max(least_m) > way_m;
        if needed_m * spare <= room_m && !ends_beside {
            (self.stop_s_m, self.is_postponed) = (None, false);
            return None;
        }
        let front_s_m = place.s_m + self.shape.length_m - self.shape.rear_overhang_m;
        let begun_m = BUILD_UP_S * ego.speed_mps.max(0.0) + STOP_GAP_M;
        let brake_mps2 = if self.is_fixed() { STOP_MPS2 } else { STOP_RECKONED_MPS2 };
        let mut stop_s_m = self.stop_s_m.unwrap_or(front_s_m + square / brake_mps2 + begun_m);
        if ego.speed_mps > STANDS_MPS {
            stop_s_m = stop_s_m.max(front_s_m + square / STOP_MAX_MPS2 + STOP_GAP_M);
        }
        (self.stop_s_m, self.is_postponed) = (Some(stop_s_m), false);
        let from_other_lane = here.is_over_line(place, &self.shape);
        Some(Stop { wall: stop_wall(WALL_ID, stop_s_m, route, ego.stamp), from_other_lane })
    }

    /// Forgets places along the route before: another one begins.
    pub(super) fn begin_route(&mut self) {
        (self.stop_s_m, self.is_postponed, self.narrowed) = (None, false, None);
    }

    /// Lets the ego drive on for now: its stop begins anew from its next position.
    pub(super) fn postpone(&mut self) {
        (self.stop_s_m, self.is_postponed) = (None, true);
    }

    /// The plan, with the status that explains its stop.
    pub(super) fn explained(&self, plan: Plan) -> Plan {
        let led = matches!(plan.status, PlanStatus::Comfortable | PlanStatus::Found | PlanStatus::Route);
        let status = if self.stop_s_m.is_some() && led { PlanStatus::PoseUncertain } else { plan.status };
        Plan { status, ..plan }
    }
}

/// Returns true if a road user stands ahead of an ego at `s_m`, beside or on the ground, and may hide a person.
fn is_cover(one: &Prediction, route: &Route, s_m: f64, speed_mps: f64) -> bool {
    let (Some(first), Some(last)) = (one.path.first(), one.path.last()) else { return false };
    let FrenetPoint { s_m: at_m, d_m } = route.project(first.pose.point());
    !one.kind.is_person()
        && first.pose.point().distance(last.pose.point()) <= STANDS_M
        && (0.0..=COVER_S * speed_mps.max(0.0)).contains(&(at_m - s_m))
        && (-route.right_m(at_m) - COVER_BESIDE_M..=route.left_m(at_m) + COVER_BESIDE_M).contains(&d_m)
}

/// Share of the target speed at a deviation of the pose, metres.
fn speed_share(sigma_m: f64, [from_m, to_m]: [f64; 2]) -> f64 {
    if sigma_m <= from_m {
        return 1.0;
    }
    let slowed = ((sigma_m - from_m) / (to_m - from_m)).min(1.0);
    1.0 - (1.0 - SLOWEST) * slowed
}

#[cfg(test)]
mod tests;
