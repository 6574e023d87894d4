//! Car following: speed along the line with a time gap, and the minimum deceleration that keeps a standstill gap.
//!
//! The acceleration is the smallest of three bounds, with a bounded rate of change:
//! - towards the speed that target and curves allow;
//! - a constant time gap, linear in relative speed and gap error; it never brakes harder than [`OPENING_MPS2`], so that
//!   the gap behind a vehicle that cuts in opens over seconds;
//! - the constant deceleration that keeps the standstill gap to a lead that continues its current motion: the
//!   constant-acceleration heuristic of Kesting, Treiber and Helbing ("Enhanced intelligent driver model", Phil. Trans.
//!   R. Soc. A 368, 2010, equation 2.4), with the lead braking to a stop as in the safe distance of Shalev-Shwartz et
//!   al. ("On a formal model of safe and scalable self-driving cars", 2017, definition 1).

use swerve_geom::math;

use crate::fot::line::Line;
use crate::occlusion::Cap;
use crate::traffic::{HORIZON_S, Knot, Mover, STANDS_MPS};

/// Gains of the time gap: on the relative speed, 1/s, and on the gap error, 1/s².
const SPEED_GAIN_1PS: f64 = 0.6;
const GAP_GAIN_1PS2: f64 = 0.1;

/// Hardest braking to open a gap that is safe, m/s².
const OPENING_MPS2: f64 = 1.0;

/// Hardest braking to keep the time gap, additional per closing speed, 1/s.
const FIRM_1PS: f64 = 0.4;

/// A required deceleration is blended in from the first value and counts in full from the second, m/s²: braking starts
/// late and is steady, instead of early and weak.
const NEEDED_MPS2: [f64; 2] = [0.8, 1.0];

/// Added to the standstill gap for deviations of the vehicle from its plan, metres.
const SPARE_M: f64 = 0.3;

/// Lag of a vehicle's deceleration behind its plan, seconds.
const RESPONDS_S: f64 = 0.15;

/// A vehicle that enters the ego's path counts this long before it arrives there, seconds.
const SOON_S: f64 = 2.0;

/// Deceleration differences below this are not perceptible, m/s².
const FELT_MPS2: f64 = 0.1;

/// Gap that remains if keeping the standstill gap would exceed comfort, metres.
const LEAST_GAP_M: f64 = 1.0;

/// For an ego that gives up a pass, the gap needed to steer out again is kept with up to this multiple of the comfort
/// deceleration.
const STEER_OUT_SHARE: f64 = 1.4;

/// Time constant of the speed towards the target, seconds.
const SETTLES_S: f64 = 0.8;

/// A speed limit that falls along the line counts this long before its place, seconds: a deceleration builds up in 0.1
/// s more than [`SETTLES_S`], by which the speed lags its set value.
const LEADS_S: f64 = SETTLES_S + 0.1;

/// Rates of the acceleration, m/s³: within comfort, and if more is needed.
const JERK_MPS3: f64 = 5.0;
const HARD_JERK_MPS3: f64 = 20.0;

/// Time step, seconds.
pub(crate) const STEP_S: f64 = 0.1;

/// Spacing of the entries of a speed table, metres.
const TABLE_M: f64 = 2.0;

/// Smallest deceleration of a stop whose place is reached, m/s², and smallest distance over which an ego at rest moves
/// up, metres.
const CREEP_MPS2: f64 = 0.3;
const DRIVE_UP_M: f64 = 2.0;

/// Below this speed the ego is at rest, and below this one it creeps, m/s: it comes to rest instead.
const AT_REST_MPS: f64 = 0.1;
const CREEPS_MPS: f64 = 0.5;

/// Look-ahead time for lead vehicles, seconds.
pub(crate) const AHEAD_S: f64 = 8.0;

/// Lateral limits in a curve: acceleration, m/s², and jerk, m/s³.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Curve {
    pub(crate) accel_mps2: f64,
    pub(crate) jerk_mps3: f64,
}

/// Speeds allowed by curves along the line from `from_m` on.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct SpeedTable {
    from_m: f64,
    speeds_mps: Vec<f64>,
}

impl SpeedTable {
    /// Creates a table for `length_m` from `from_m` on: the largest speeds within the limits of `curve`, each reachable
    /// with `brake_mps2`.
    pub(crate) fn new(line: &Line, [from_m, length_m]: [f64; 2], curve: Curve, brake_mps2: f64) -> Self {
        let count = (length_m / TABLE_M).ceil() as usize;
        let curvatures_1pm: Vec<f64> =
            (0..=count + 1).map(|k| line.at(from_m + k as f64 * TABLE_M).curvature_1pm).collect();
        let curve_mps = |pair: &[f64]| {
            let bend_1pm2 = (pair[1] - pair[0]) / TABLE_M;
            // v² κ laterally, and v³ dκ/ds while the curvature changes.
            let accel_mps = (curve.accel_mps2 / pair[0].abs().max(1e-9)).sqrt();
            accel_mps.min(math::pow(curve.jerk_mps3 / bend_1pm2.abs().max(1e-12), 1.0 / 3.0))
        };
        let speeds_mps: Vec<f64> = curvatures_1pm.windows(2).map(curve_mps).collect();
        Self { from_m, speeds_mps }.reachable(brake_mps2)
    }

    /// The table with speed limits on parts of the line, each reachable with `brake_mps2`.
    pub(crate) fn capped(mut self, caps: &[Cap], brake_mps2: f64) -> Self {
        for Cap { along_m: [from_m, to_m], speed_mps } in caps {
            for (k, speed) in self.speeds_mps.iter_mut().enumerate() {
                let at_m = self.from_m + k as f64 * TABLE_M;
                if at_m + TABLE_M > *from_m && at_m < *to_m {
                    *speed = speed.min(*speed_mps);
                }
            }
        }
        self.reachable(brake_mps2)
    }

    /// The table with each speed reachable from the one before it with `brake_mps2`.
    fn reachable(mut self, brake_mps2: f64) -> Self {
        for k in (0..self.speeds_mps.len().saturating_sub(1)).rev() {
            let next_mps = self.speeds_mps[k + 1];
            let reached_mps = (next_mps * next_mps + 2.0 * brake_mps2 * TABLE_M).sqrt();
            self.speeds_mps[k] = self.speeds_mps[k].min(reached_mps);
        }
        self
    }

    /// Speed at `s_m` for an ego at `speed_mps`, m/s: at most the speed allowed [`LEADS_S`] later.
    pub(crate) fn before(&self, s_m: f64, speed_mps: f64) -> f64 {
        self.at(s_m).min(self.at(s_m + LEADS_S * speed_mps))
    }

    /// Speed at `s_m`, m/s.
    pub(crate) fn at(&self, s_m: f64) -> f64 {
        let k = ((s_m - self.from_m) / TABLE_M).max(0.0) as usize;
        self.speeds_mps[k.min(self.speeds_mps.len() - 1)]
    }
}

/// Distances to lead vehicles.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Gaps {
    /// Gap at rest, metres.
    pub(crate) standstill_m: f64,
    /// Gap at rest behind a standing obstacle that may be passed later, metres.
    pub(crate) steer_out_m: f64,
    /// Time gap, seconds.
    pub(crate) time_s: f64,
}

/// Bounds on the acceleration, m/s².
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Accel {
    pub(crate) most_mps2: f64,
    /// Deceleration within comfort.
    pub(crate) brake_mps2: f64,
    /// Deceleration of the vehicle.
    pub(crate) hardest_mps2: f64,
}

/// One step of a profile along the line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Step {
    pub(crate) s_m: f64,
    pub(crate) speed_mps: f64,
    pub(crate) accel_mps2: f64,
}

/// A speed profile along the line.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct Profile {
    /// One step every [`STEP_S`].
    pub(crate) steps: Vec<Step>,
    /// Largest deceleration, m/s².
    pub(crate) brake_mps2: f64,
    /// True if a lead vehicle limits it at any time.
    pub(crate) is_led: bool,
}

/// A lead vehicle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Lead<'a> {
    pub(crate) mover: &'a Mover,
    pub(crate) response: Response,
}

/// Response to a lead vehicle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum Response {
    /// Follows it.
    Follow,
    /// Stops behind it with the gap needed to steer out; `firmly`, with more than the comfort deceleration.
    PassLater { firmly: bool },
    /// Falls back behind it, for a vehicle beside the ego.
    FallBack(FallBack),
}

/// Speed and braking of an ego that lets a vehicle beside it go ahead.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct FallBack {
    /// Speed difference to the vehicle, m/s; the ego is slower.
    pub(crate) slower_mps: f64,
    /// Largest deceleration, m/s²; the ego's own limit applies too.
    pub(crate) brake_mps2: f64,
}

/// Input of a speed profile.
pub(crate) struct Follower<'a> {
    pub(crate) gaps: Gaps,
    pub(crate) accel: Accel,
    pub(crate) target_mps: f64,
    pub(crate) curves: &'a SpeedTable,
    /// Distance from the ego origin to its front, metres.
    pub(crate) front_m: f64,
    pub(crate) leads: Vec<Lead<'a>>,
    /// Returns true if a road user at this place is in the ego's path.
    pub(crate) in_way: &'a dyn Fn(&Knot) -> bool,
}

impl Follower<'_> {
    /// Profile from `start` until the ego has stood for a while, or for [`AHEAD_S`].
    pub(crate) fn profile(&self, start: Step) -> Profile {
        let mut profile = Profile::default();
        let mut now = start;
        let count = (AHEAD_S.min(HORIZON_S) / STEP_S) as usize;
        for k in 0..=count {
            let (wanted_mps2, is_led, hard) = self.wanted(&now, k as f64 * STEP_S);
            profile.is_led |= is_led;
            let jerk_mps3 = if hard { HARD_JERK_MPS3 } else { JERK_MPS3 };
            let next_mps2 =
                wanted_mps2.clamp(now.accel_mps2 - jerk_mps3 * STEP_S, now.accel_mps2 + jerk_mps3 * STEP_S);
            let next_mps = (now.speed_mps + 0.5 * (now.accel_mps2 + next_mps2) * STEP_S).max(0.0);
            let next_mps2 = if next_mps > 0.0 { next_mps2 } else { 0.0 };
            profile.brake_mps2 = profile.brake_mps2.max(-next_mps2);
            profile.steps.push(now);
            let s_m = now.s_m + 0.5 * (now.speed_mps + next_mps) * STEP_S;
            now = Step { s_m, speed_mps: next_mps, accel_mps2: next_mps2 };
        }
        profile
    }

    /// Acceleration to aim for at `t_s` after the start, true if a lead vehicle limits it, and true if it exceeds
    /// comfort.
    fn wanted(&self, now: &Step, t_s: f64) -> (f64, bool, bool) {
        let free_mps = self.target_mps.min(self.curves.before(now.s_m, now.speed_mps));
        let free_mps2 =
            ((free_mps - now.speed_mps) / SETTLES_S).clamp(-self.accel.brake_mps2, self.accel.most_mps2);
        let mut least_mps2 = free_mps2;
        for &Lead { mover: lead, response } in &self.leads {
            let knot = lead.at(t_s);
            if (knot.to_m < now.s_m && !matches!(response, Response::FallBack(_)))
                || !self.comes_in_way(lead, &knot, t_s)
                || lead.crosses(t_s)
            {
                continue;
            }
            let (speed_mps, brake_mps2) = lead.motion(t_s);
            let comfort_mps2 = self.accel.brake_mps2;
            let (standing_m, yields_mps2) = match response {
                Response::PassLater { firmly } if speed_mps < STANDS_MPS => {
                    let share = if firmly { STEER_OUT_SHARE } else { 1.0 };
                    (self.gaps.steer_out_m, (share * comfort_mps2).min(self.accel.hardest_mps2))
                }
                _ => (self.gaps.standstill_m, comfort_mps2),
            };
            let gap_m = knot.from_m - now.s_m - self.front_m;
            if let Response::FallBack(back) = response
                && gap_m < standing_m
            {
                let error_mps = (speed_mps - back.slower_mps).max(0.0) - now.speed_mps;
                let hardest_mps2 = back.brake_mps2.min(self.accel.hardest_mps2);
                least_mps2 = least_mps2.min((error_mps / SETTLES_S).max(-hardest_mps2));
                continue;
            }
            let lead = (speed_mps.max(0.0), brake_mps2);
            least_mps2 = least_mps2.min(self.behind(now, [gap_m, standing_m], lead, yields_mps2));
        }
        let is_led = least_mps2 < free_mps2 - 0.05;
        // The deceleration fades until the ego stands.
        let dies_mps2 = -(2.0 * JERK_MPS3 * now.speed_mps).sqrt().max(CREEP_MPS2);
        let hard = least_mps2 < -self.accel.brake_mps2 - 0.05;
        (if hard { least_mps2 } else { least_mps2.max(dies_mps2) }, is_led, hard)
    }

    /// True for a vehicle in the ego's path at `t_s`, or soon after.
    fn comes_in_way(&self, lead: &Mover, now: &Knot, t_s: f64) -> bool {
        (self.in_way)(now) || (self.in_way)(&lead.at(t_s + SOON_S))
    }

    /// Acceleration behind one lead with the given speed and deceleration. Part of the standstill gap is given up where
    /// it needs more than `yields_mps2`.
    fn behind(
        &self,
        now: &Step,
        [gap_m, standing_m]: [f64; 2],
        (lead_mps, brake_mps2): (f64, f64),
        yields_mps2: f64,
    ) -> f64 {
        let v = now.speed_mps;
        let room_m = gap_m - standing_m - SPARE_M - RESPONDS_S * (v - lead_mps).max(0.0);
        if lead_mps < STANDS_MPS && room_m < DRIVE_UP_M {
            // At rest the ego stays; the remaining distance is not crept over.
            if v < AT_REST_MPS {
                return if v > 0.0 { -CREEP_MPS2 } else { 0.0 };
            }
            if v < CREEPS_MPS || (room_m < 0.5 * DRIVE_UP_M && v < 1.0) {
                return -CREEP_MPS2.max(needed_mps2(v, 0.0, 0.0, room_m.max(0.1)).min(self.accel.brake_mps2));
            }
        }
        // Gap error for a slower lead, with the time gap at the lead's speed.
        let error_m = gap_m - standing_m - self.gaps.time_s * v.min(lead_mps);
        let closing_mps = (v - lead_mps).max(0.0);
        let keeps_mps2 = (SPEED_GAIN_1PS * (lead_mps - v) + GAP_GAIN_1PS2 * error_m).max(-OPENING_MPS2);
        // Closing in is no slower than with the steady deceleration that ends at the gap.
        let steady_mps2 =
            if error_m > 0.0 { closing_mps * closing_mps / (2.0 * error_m) } else { f64::INFINITY };
        let keeps_mps2 = keeps_mps2.max(-steady_mps2);
        // Closing in on a slower lead, the time gap is kept as well, the more firmly the faster it closes.
        let firm_mps2 = (OPENING_MPS2 + FIRM_1PS * closing_mps).min(self.accel.brake_mps2);
        let in_time = needed_mps2(v, lead_mps, 0.0, room_m - self.gaps.time_s * lead_mps);
        let braking = self.braking(now, (lead_mps, brake_mps2), [gap_m, room_m], yields_mps2);
        keeps_mps2.min(self.counted(in_time.min(firm_mps2))).min(braking)
    }

    /// Bound on the acceleration for a closing gap, m/s².
    fn braking(
        &self,
        now: &Step,
        (lead_mps, brake_mps2): (f64, f64),
        [gap_m, room_m]: [f64; 2],
        yields_mps2: f64,
    ) -> f64 {
        let v = now.speed_mps;
        let needed = needed_mps2(v, lead_mps, brake_mps2, room_m);
        let comfort = self.accel.brake_mps2;
        if needed > comfort {
            // Part of the standstill gap is given up if the difference is perceptible, or if that keeps the braking
            // within comfort.
            let least =
                needed_mps2(v, lead_mps, brake_mps2, gap_m - (LEAST_GAP_M + SPARE_M).min(0.5 * gap_m));
            let is_worth_it = least <= comfort || needed - least > FELT_MPS2;
            // Braking must not decrease.
            let eased =
                if is_worth_it { needed.min(least.max(yields_mps2).max(-now.accel_mps2)) } else { needed };
            return -eased.min(self.accel.hardest_mps2);
        }
        self.counted(needed)
    }

    /// Bound on the acceleration from a required deceleration, blended from the largest acceleration to the full
    /// deceleration, m/s².
    fn counted(&self, needed_mps2: f64) -> f64 {
        let [from, full] = NEEDED_MPS2;
        let share = ((needed_mps2 - from) / (full - from)).clamp(0.0, 1.0);
        (1.0 - share) * self.accel.most_mps2 - share * needed_mps2
    }
}

/// The minimum constant deceleration, m/s², with which an ego at `v` keeps within `room_m` of a lead at `lead_mps` that
/// brakes with `brake_mps2` to a stop.
pub(crate) fn needed_mps2(v: f64, lead_mps: f64, brake_mps2: f64, room_m: f64) -> f64 {
    let room_m = room_m.max(0.05);
    let closing_mps = (v - lead_mps).max(0.0);
    if brake_mps2 <= 0.0 {
        return closing_mps * closing_mps / (2.0 * room_m);
    }
    let stop_s = lead_mps / brake_mps2;
    // Ego braking harder than the lead: closest while both move.
    let moving = brake_mps2 + closing_mps * closing_mps / (2.0 * room_m);
    if closing_mps > 0.0 && closing_mps / (moving - brake_mps2) <= stop_s {
        return moving;
    }
    let lead_m = lead_mps * lead_mps / (2.0 * brake_mps2);
    v * v / (2.0 * (room_m + lead_m))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// At less than half a metre per second, the ego stops within the last two metres instead of creeping over them.
    #[test]
    fn ego_that_rolls_slowly_behind_a_standing_vehicle_stops() {
        let curves = SpeedTable { from_m: 0.0, speeds_mps: vec![20.0] };
        let follower = Follower {
            gaps: Gaps { standstill_m: 2.0, steer_out_m: 5.0, time_s: 1.5 },
            accel: Accel { most_mps2: 2.0, brake_mps2: 3.5, hardest_mps2: 8.0 },
            target_mps: 10.0,
            curves: &curves,
            front_m: 3.0,
            leads: Vec::new(),
            in_way: &|_| true,
        };
        let accel_mps2 = |speed_mps: f64, gap_m: f64| {
            let now = Step { s_m: 0.0, speed_mps, accel_mps2: 0.0 };
            follower.behind(&now, [gap_m, 2.0], (0.0, 0.0), 3.5)
        };
        for gap_m in [2.8, 3.5, 4.2] {
            assert_eq!(accel_mps2(0.4, gap_m), -CREEP_MPS2, "{gap_m} m");
        }
        assert!(accel_mps2(0.4, 8.0) > 0.2 && accel_mps2(0.8, 4.2) > -CREEP_MPS2);
    }
}
