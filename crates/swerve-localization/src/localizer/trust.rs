//! Whether filter or sensor is wrong where they disagree, and how good the pose is.
//!
//! One refused place questions the place. Places that are refused again and again, while they agree with each other and with
//! odometry, question the filter: it is aligned with them anew.

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

/// Places refused in a row that question the filter.
const REFUSED: u32 = 3;
/// Places accepted in a row that confirm it again.
pub(super) const CONFIRMED: u32 = 3;
/// A heading by refused fixes that differs from the filter's by so many deviations, and by so much (radians), refutes it.
const HEADING_SIGMAS: f64 = 5.0;
const HEADING_RAD: f64 = 0.15;
/// It takes so many of them.
const TURNED: u32 = 5;
/// A heading by fixes that is less sure than this is none: the car stands, or hardly moves, radians.
const COURSE_RAD: f64 = 0.15;
/// Aligned anew twice within this time, the filter goes astray by its inertial unit, which then rests for as long.
const RELAPSE: Span = Span::from_ms(5000);
/// Innovations over which their consistency is averaged.
const WINDOW: f64 = 10.0;
/// A refused one counts no more than this per number, so that the average forgets it within a second.
const CLIPPED: f64 = 5.0;
/// Average squares above this per number are no chance: for ten fixes one window in 10,000 of a consistent filter.
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

/// A place that the filter followed or refused.
pub(super) struct Judged {
    pub(super) stamp: Time,
    pub(super) source: Source,
    pub(super) at_m: [f64; 3],
    pub(super) sigma_m: f64,
    pub(super) accepted: bool,
}

impl Fold {
    /// Takes note of a place, and aligns the filter anew where its refusal is the filter's fault.
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

    /// Where the ego is by places that the filter refuses without a reason in them; with the odometry that they fit.
    fn refuted(&self, params: &Params, stamp: Time, source: Source) -> Option<(Aligned, usize)> {
        let fixes = &self.fixes[usize::from(source != Source::Fix)];
        let (refused, lasted) = fixes.refused(stamp);
        // Another source may have confirmed the filter meanwhile.
        let is_confirmed = self.last_fix.is_some_and(|last| last > stamp - lasted);
        if refused < REFUSED || is_confirmed {
            return None;
        }
        // The refused ones go on from the accepted ones without a jump: so does the car.
        let is_course = |(found, _): &(Aligned, usize)| found.heading_sigma_rad <= COURSE_RAD;
        let linked = fixes.reaches_back().then(|| fixes.aligned(&self.ways)).flatten().filter(is_course);
        if linked.is_some() {
            return linked;
        }
        // They jumped, or nothing was heard for long. A reflection moves places, but does not turn the way.
        let yaw = yaw_rad(&self.filter()?.nominal.attitude);
        let alone = fixes.aligned_since(&self.ways).filter(is_course);
        let is_turned = |found: &Aligned| {
            let off_rad = wrap_angle(found.heading_rad - yaw).abs();
            refused >= TURNED && off_rad > HEADING_RAD.max(HEADING_SIGMAS * found.heading_sigma_rad)
        };
        alone.filter(|(found, _)| is_turned(found) || lasted.as_secs() >= params.believed_after_s)
    }

    /// Begins anew from a place and heading on the ground, at a height.
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

    /// How good an estimate is.
    pub(super) fn mode(&self, params: &Params, estimate: &Estimate) -> Mode {
        let health = self.unit.health(params, estimate.stamp);
        let since_fix = self.last_fix.map(|last| (estimate.stamp - last).as_secs());
        let is_fixed = since_fix.is_some_and(|s| s <= params.coasting_after_s);
        // Without the unit it takes steering angle and places together to know the heading.
        let is_carried = health == UnitHealth::Sound || (self.steered_radps().is_some() && is_fixed);
        let tally = |source: Source| self.tally(source);
        let is_contested = self.is_contested(estimate.stamp);
        let wheels = tally(Source::Wheels).refused_in_a_row >= REFUSED;
        // What is no number is lost, too.
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

    /// Whether places of some source are refused again and again, and no other source confirms the filter.
    fn is_contested(&self, now: Time) -> bool {
        self.fixes.iter().any(|fixes| {
            let (refused, lasted) = fixes.refused(now);
            refused >= REFUSED && self.last_fix.is_none_or(|last| last <= now - lasted)
        })
    }
}
