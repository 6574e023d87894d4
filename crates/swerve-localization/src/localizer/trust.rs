//! Decides between filter and sensor when they disagree, and rates the pose.
//!
//! A single refused position is taken for an outlier. Positions that are refused repeatedly, while they agree with
//! each other and with odometry, contradict the filter, which is then realigned with them.

use nalgebra::Vector3;
use swerve_core::{Span, Time};
use swerve_geom::{math, wrap_angle};

use super::fold::Fold;
use super::start::Begin;
use super::unit::UnitHealth;
use super::window::Aligned;
use super::{Estimate, Mode, Source, Tally};
use crate::eskf::{Innovation, from_euler, yaw_rad};
use crate::params::Params;

/// Consecutive refusals after which the filter is questioned.
const REFUSED: u32 = 3;
/// Accepted positions after which a realigned filter is confirmed.
pub(super) const CONFIRMED: u32 = 3;
/// A heading from refused fixes refutes the filter's if it differs by this many standard deviations and by this much
/// (radians).
const HEADING_SIGMAS: f64 = 5.0;
const HEADING_RAD: f64 = 0.15;
/// Consecutive refusals that such a refutation requires.
const TURNED: u32 = 5;
/// Largest standard deviation of a usable heading from fixes, radians; it is larger at standstill or very low speed.
const COURSE_RAD: f64 = 0.15;
/// If the filter is realigned twice within this time, its inertial unit is taken to be at fault and not used for as
/// long.
const RELAPSE: Span = Span::from_ms(5000);
/// Number of innovations over which consistency is averaged.
const WINDOW: f64 = 10.0;
/// A normalised square counts for at most this per degree of freedom, so that the average forgets outliers within a
/// second.
const CLIPPED: f64 = 5.0;
/// Averages above this per degree of freedom are inconsistent: for ten fixes, one window in 10,000 of a consistent
/// filter.
const INCONSISTENT: f64 = 2.2;

impl Tally {
    /// Counts an innovation of `dof` numbers.
    pub(super) fn follow(&mut self, innovation: &Innovation, dof: usize) {
        let square = (innovation.nis / dof as f64).min(CLIPPED);
        self.recent_nis += (square - self.recent_nis) / WINDOW;
        if innovation.accepted {
            self.taken += 1;
            self.nis_sum += innovation.nis;
            self.refused_in_a_row = 0;
        } else {
            self.refused += 1;
            self.refused_in_a_row = self.refused_in_a_row.saturating_add(1);
        }
    }
}

/// A position that the filter accepted or refused.
pub(super) struct Judged {
    pub(super) stamp: Time,
    pub(super) source: Source,
    pub(super) at_m: [f64; 3],
    pub(super) sigma_m: f64,
    pub(super) accepted: bool,
}

impl Fold {
    /// Records a position, and realigns the filter if the refusals are due to the filter.
    pub(super) fn question(&mut self, params: &Params, judged: &Judged) {
        let Judged { stamp, source, at_m: [x_m, y_m, up_m], sigma_m, accepted } = *judged;
        let lever_m = if source == Source::Fix { params.antenna_at_m } else { [0.0; 3] };
        let fixes = &mut self.fixes[usize::from(source != Source::Fix)];
        fixes.take(stamp, ([x_m, y_m], sigma_m), &self.ways, [lever_m[0], lever_m[1]]);
        fixes.judge(stamp, accepted);
        if accepted {
            self.confirmed = self.confirmed.saturating_add(1);
        } else if let Some((aligned, way)) = self.refuted(params, stamp, source) {
            let is_relapse = self.realigned.is_some_and(|before| stamp - before < RELAPSE);
            if !self.is_bridging && (way > 0 || is_relapse) {
                self.unit.doubt(stamp + RELAPSE);
            }
            self.realign(params, stamp, &aligned, (up_m - lever_m[2], source == Source::Fix));
        }
    }

    /// Pose of the ego from positions that the filter refuses without fault of their own, with the index of the
    /// odometry path that they fit.
    fn refuted(&self, params: &Params, stamp: Time, source: Source) -> Option<(Aligned, usize)> {
        let fixes = &self.fixes[usize::from(source != Source::Fix)];
        let (refused, lasted) = fixes.refused(stamp);
        // Another source may have confirmed the filter in the meantime.
        let is_confirmed = self.last_fix.is_some_and(|last| last > stamp - lasted);
        if refused < REFUSED || is_confirmed {
            return None;
        }
        // The refused positions continue the accepted ones without a jump, as the car does.
        let is_course = |(found, _): &(Aligned, usize)| found.heading_sigma_rad <= COURSE_RAD;
        let linked = fixes.reaches_back().then(|| fixes.aligned(&self.ways)).flatten().filter(is_course);
        if linked.is_some() {
            return linked;
        }
        // They jumped, or none were received for long. A reflection shifts positions, but does not rotate the path.
        let yaw = yaw_rad(&self.filter()?.nominal.attitude);
        let alone = fixes.aligned_since(&self.ways).filter(is_course);
        let is_turned = |found: &Aligned| {
            let off_rad = wrap_angle(found.heading_rad - yaw).abs();
            refused >= TURNED && off_rad > HEADING_RAD.max(HEADING_SIGMAS * found.heading_sigma_rad)
        };
        alone.filter(|(found, _)| is_turned(found) || lasted.as_secs() >= params.believed_after_s)
    }

    /// Restarts from a position and heading on the ground, at a height.
    fn realign(&mut self, params: &Params, stamp: Time, found: &Aligned, (up_m, by_fix): (f64, bool)) {
        let attitude = from_euler(0.0, 0.0, found.heading_rad);
        let speed_mps = self.speed_mps();
        let yaw_sigma = found.heading_sigma_rad.min(core::f64::consts::PI);
        let [x_m, y_m] = found.at_m;
        let begin = Begin {
            position_m: Vector3::new(x_m, y_m, up_m) + attitude * Vector3::from(params.imu_at_m),
            velocity_mps: attitude * (Vector3::x() * speed_mps),
            attitude,
            sigma: [
                [found.sigma_m, found.sigma_m, 2.0 * found.sigma_m],
                [math::hypot(0.5, speed_mps * yaw_sigma); 3],
                [params.level_rad, params.level_rad, yaw_sigma],
            ],
            by_fix: by_fix && params.offset_m > 0.0,
        };
        self.begin(params, stamp, &begin);
        self.fixes = Default::default();
        (self.confirmed, self.realigned) = (0, Some(stamp));
    }

    /// Quality of an estimate.
    pub(super) fn mode(&self, params: &Params, estimate: &Estimate) -> Mode {
        let health = self.unit.health(params, estimate.stamp);
        let since_fix = self.last_fix.map(|last| (estimate.stamp - last).as_secs());
        let is_fixed = since_fix.is_some_and(|s| s <= params.coasting_after_s);
        // Without the unit, the heading is observable only with both steering angle and positions.
        let is_carried = health == UnitHealth::Sound || (self.steered_radps().is_some() && is_fixed);
        let tally = |source: Source| self.tally(source);
        let is_contested = self.is_contested(estimate.stamp);
        let wheels = tally(Source::Wheels).refused_in_a_row >= REFUSED;
        // False for NaN.
        let is_sure = estimate.sigma_m() <= params.lost_sigma_m;
        let is_sound = self.filter().is_some_and(crate::Eskf::is_sound);
        let is_consistent = tally(self.fixed_by).recent_nis <= INCONSISTENT;
        if !is_sure || !is_carried || !is_sound || (is_contested && wheels) {
            Mode::Lost
        } else if !is_fixed
            || is_contested
            || !is_consistent
            || self.is_bridging
            || self.confirmed < CONFIRMED
        {
            Mode::Coasting
        } else {
            Mode::Good
        }
    }

    /// Returns true if positions of some source are refused repeatedly, and no other source confirms the filter.
    fn is_contested(&self, now: Time) -> bool {
        self.fixes.iter().any(|fixes| {
            let (refused, lasted) = fixes.refused(now);
            refused >= REFUSED && self.last_fix.is_none_or(|last| last <= now - lasted)
        })
    }
}
