//! Decides between filter and sensor when they disagree, and rates the pose.
//!
//! A single refused position is taken for an outlier. Positions that are refused repeatedly, while they agree with
//! each other and with odometry, contradict the filter, which is then realigned with them.

use nalgebra::Vector3;
use swerve_core::{Span, Time};
use swerve_geom::{math, wrap_angle};

use super::estimate::{Estimate, Mode, Source, Tally};
use super::fold::{CONFIRMED, Fold, Judged};
use super::start::Begin;
use super::unit::UnitHealth;
use super::window::{Aligned, Fixes};
use crate::eskf::{Innovation, from_euler, yaw_rad};
use crate::params::Params;

/// Consecutive refusals after which the filter is questioned.
const REFUSED: u32 = 3;
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

/// Position of the point that a source locates, from the ego origin, metres. That of other sources than satellites is
/// the inertial unit, which serves as well as the ego origin for a few seconds.
fn lever_m(params: &Params, source: Source) -> [f64; 3] {
    if source == Source::Fix { params.antenna_at_m } else { [0.0; 3] }
}

impl Fold {
    /// Adds a position to the window of its source; returns the ratio of its noise, as measured in the window, to the
    /// reported deviation: 1 if that is right or overstated.
    pub(super) fn understated(
        &mut self,
        params: &Params,
        stamp: Time,
        source: Source,
        ([x_m, y_m, _], [sigma_x_m, sigma_y_m, _]): ([f64; 3], [f64; 3]),
    ) -> f64 {
        let [forward_m, left_m, _] = lever_m(params, source);
        let stated_m = sigma_x_m.max(sigma_y_m);
        let heading_rad = self.filter().map_or(0.0, |filter| yaw_rad(&filter.nominal.attitude));
        let turn_rad = heading_rad - self.ways[0].turned_rad();
        let in_doubt = self.tally(source).recent_nis > INCONSISTENT;
        let fixes = &mut self.fixes[usize::from(source != Source::Fix)];
        let lever_m = [forward_m, left_m];
        fixes.take(stamp, ([x_m, y_m], stated_m), &self.ways, lever_m, (turn_rad, in_doubt));
        fixes.sigma_m(stated_m) / stated_m
    }

    /// Records a position, and realigns the filter if the refusals are due to the filter.
    pub(super) fn question(&mut self, params: &Params, judged: &Judged) {
        let Judged { stamp, source, up_m, accepted } = *judged;
        let lever_m = lever_m(params, source);
        self.fixes[usize::from(source != Source::Fix)].judge(stamp, accepted);
        if accepted {
            self.confirmed = self.confirmed.saturating_add(1);
            return;
        }
        self.repeats.doubt(stamp);
        if let Some((aligned, way)) = self.refuted(params, stamp, source) {
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
        self.fixes = self.fixes.map(Fixes::cleared);
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
        } else if is_fixed && self.is_noisy() {
            Mode::Noisy
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

    /// Returns true if the noise of the latest accepted position's source is far above the reported one.
    fn is_noisy(&self) -> bool {
        self.fixes[usize::from(self.fixed_by != Source::Fix)].is_understated()
    }

    /// Returns true if positions of some source are refused repeatedly, and no other source confirms the filter.
    fn is_contested(&self, now: Time) -> bool {
        self.fixes.iter().any(|fixes| {
            let (refused, lasted) = fixes.refused(now);
            refused >= REFUSED && self.last_fix.is_none_or(|last| last <= now - lasted)
        })
    }
}
