//! Filter state after a sequence of measurements in the order of their stamps.

use nalgebra::{Matrix3, SMatrix, Vector3};
use swerve_core::{Span, Time};
use swerve_geom::wrap_angle;

use super::estimate::{Entry, Estimate, Initial, Mode, Sensed, Source, Tally};
use super::repeats::Repeats;
use super::start::{Begin, Start};
use super::unit::{Unit, UnitHealth};
use super::window::{Fixes, Way};
use crate::eskf::{
    ATTITUDE, Covariance, Eskf, GYRO_BIAS, Linear, OFFSET, POSITION, SCALE, STATES, VELOCITY, skew, yaw_rad,
};
use crate::params::{Hold, Params};

/// Duration of a slip of the rear axle, seconds: that of a manoeuvre.
const SLIP_LASTS_S: f64 = 0.5;
/// Distance over which a heading known beforehand remains valid, metres.
const HEADING_HOLDS_M: f64 = 2.0;

/// Accepted positions after which a realigned filter is confirmed.
pub(super) const CONFIRMED: u32 = 3;
/// Until this many fixes are accepted, a refused one restarts the initialisation.
const TRIED_FIXES: u64 = 3;
/// A start from fixes whose noise proves to be understated within this time is repeated.
const TRIED: Span = Span::from_ms(3000);

/// A reading of the inertial unit.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reading {
    stamp: Time,
    pub(super) accel_mps2: Vector3<f64>,
    pub(super) gyro_radps: Vector3<f64>,
}

/// Wheel readings, and the distance that the filter moved in the meantime.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Wheels {
    /// Stamp of the newest reading, and of the one at which `wheel_m` starts.
    pub(super) last: Option<Time>,
    since: Option<Time>,
    wheel_m: f64,
    filter_m: f64,
    pub(super) standing_since: Option<Time>,
    /// Latest reported speed, m/s, and path curvature from the steering angle with its instant, 1/m.
    pub(super) speed_mps: f64,
    pub(super) curvature_1pm: Option<(Time, f64)>,
}

/// A position that the filter accepted or refused.
pub(super) struct Judged {
    pub(super) stamp: Time,
    pub(super) source: Source,
    pub(super) up_m: f64,
    pub(super) accepted: bool,
}

/// The filter with its initialisation, sensor health and statistics.
#[derive(Clone, Debug)]
pub(super) struct Fold {
    /// Measurements collected for initialisation; `None` once it is done.
    start: Option<Start>,
    /// Heading known beforehand and its standard deviation, radians, and the odometry path up to where it is valid.
    heading: Option<([f64; 2], Way)>,
    pub(super) filter: Eskf,
    /// Time of the start from fixes.
    begun: Option<Time>,
    /// True after a start from a known state: contradicting measurements then cause no restart.
    is_known: bool,
    /// Instant of the filter's state.
    pub(super) at: Time,
    /// Latest reading of the unit while it was sound.
    pub(super) imu: Option<Reading>,
    pub(super) unit: Unit,
    /// True while it propagates without the inertial unit.
    pub(super) is_bridging: bool,
    pub(super) wheels: Wheels,
    pub(super) repeats: Repeats,
    /// Odometry paths by wheels and gyroscope, and by wheels and steering angle.
    pub(super) ways: [Way; 2],
    /// Latest satellite fixes, and latest positions from other sources.
    pub(super) fixes: [Fixes; 2],
    /// Positions accepted since the filter was last realigned, and the time of that.
    pub(super) confirmed: u32,
    pub(super) realigned: Option<Time>,
    /// Time of the last vehicle constraint.
    constrained: Time,
    /// Time and source of the last accepted position.
    pub(super) last_fix: Option<Time>,
    pub(super) fixed_by: Source,
    tallies: [Tally; 6],
}

impl Fold {
    /// State before the first fix.
    pub(super) fn waiting(heading: Option<[f64; 2]>) -> Self {
        Self {
            start: Some(Start::default()),
            heading: heading.map(|heading| (heading, Way::default())),
            begun: None,
            is_known: false,
            filter: Begin::default().filter(&Params::default()),
            at: Time::ZERO,
            imu: None,
            unit: Unit::default(),
            is_bridging: false,
            wheels: Wheels::default(),
            repeats: Repeats::default(),
            ways: [Way::default(); 2],
            fixes: [Fixes::default(); 2],
            confirmed: CONFIRMED,
            realigned: None,
            constrained: Time::ZERO,
            last_fix: None,
            fixed_by: Source::Fix,
            tallies: [Tally::default(); 6],
        }
    }

    /// Starts from a known state.
    pub(super) fn started(params: &Params, at: Time, initial: &Initial) -> Self {
        let filter = Begin::from(initial).filter(params);
        Self { start: None, is_known: true, filter, at, constrained: at, ..Self::waiting(None) }
    }

    pub(super) fn suppose_heading(&mut self, heading: [f64; 2]) {
        self.heading = Some((heading, self.ways[0]));
    }

    pub(super) fn filter(&self) -> Option<&Eskf> {
        self.start.is_none().then_some(&self.filter)
    }

    pub(super) fn tally(&self, source: Source) -> Tally {
        self.tallies[source as usize]
    }

    /// Processes the next measurement, whose stamp must not be before the last.
    pub(super) fn take(&mut self, params: &Params, entry: &Entry) {
        if let Sensed::Imu { accel_mps2, gyro_radps } = entry.what {
            let stands = self.wheels.standing_since.is_some();
            let before = self.unit.health(params, self.at);
            self.unit.take(params, entry.stamp, [accel_mps2, gyro_radps], stands);
            let after = self.unit.health(params, self.at);
            if before != UnitHealth::Noisy && after == UnitHealth::Noisy {
                self.open_leaked(params);
            }
            // Also of a unit that is not used because the filter has diverged: the wheels may be the cause.
            let is_usable = matches!(after, UnitHealth::Sound | UnitHealth::Doubted);
            self.repeats.accelerate(if is_usable { self.forward_mps2(params, accel_mps2) } else { 0.0 });
        }
        match self.start {
            None => self.advance(params, entry.stamp, Some(&entry.what)),
            Some(_) => self.wait(entry),
        }
        let was_understated = self.fixes[0].is_understated();
        let entry = &Entry { what: self.weighed(params, entry), ..*entry };
        let has_just_begun = self.begun.is_some_and(|begun| entry.stamp - begun < TRIED);
        if has_just_begun && !was_understated && self.fixes[0].is_understated() {
            self.restart();
        }
        let heading = self.known_heading();
        if let Some(start) = &mut self.start {
            if let Some(begin) = start.take(params, heading, entry) {
                self.begin(params, entry.stamp, &begin);
                self.begun = Some(entry.stamp);
            }
            self.remember(params, entry);
            return;
        }
        match entry.what {
            Sensed::Imu { .. } => self.constrain(params, entry.stamp),
            Sensed::Fix { at_m, sigma_m } => self.fix(params, entry.stamp, at_m, sigma_m),
            Sensed::Place { at_m, sigma_m } => self.place(params, entry.stamp, at_m, sigma_m),
            Sensed::Pose { at_m, heading_rad, covariance_m2: [xx, xy, yy], sigma: [up, turn] } => {
                let covariance = Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, up * up);
                self.pose(params, entry.stamp, at_m, &covariance, [heading_rad, turn]);
            }
            Sensed::Wheels { speed_mps, curvature_1pm } => {
                self.wheels(params, entry.stamp, speed_mps, curvature_1pm);
                if self.is_bridging {
                    self.constrain(params, entry.stamp);
                }
            }
        }
        self.remember(params, entry);
    }

    /// Advances the odometry paths before initialisation.
    fn wait(&mut self, entry: &Entry) {
        if let Sensed::Wheels { speed_mps, curvature_1pm } = entry.what {
            let curvature_1pm = curvature_1pm.map(|curvature| (entry.stamp, curvature));
            self.wheels = Wheels { last: Some(entry.stamp), speed_mps, curvature_1pm, ..self.wheels };
        }
        let since = if self.at == Time::ZERO { entry.stamp } else { self.at };
        self.at = entry.stamp;
        if self.wheels.last.is_some() {
            self.go((entry.stamp - since).as_secs());
        }
    }

    /// The measurement, with the noise of its position as measured where the reported deviation is understated.
    fn weighed(&mut self, params: &Params, entry: &Entry) -> Sensed {
        match entry.what {
            Sensed::Fix { at_m, sigma_m } => {
                let ratio = self.understated(params, entry.stamp, Source::Fix, (at_m, sigma_m));
                Sensed::Fix { at_m, sigma_m: sigma_m.map(|s| s * ratio) }
            }
            Sensed::Place { at_m, sigma_m } => {
                let ratio = self.understated(params, entry.stamp, Source::Place, (at_m, sigma_m));
                Sensed::Place { at_m, sigma_m: sigma_m.map(|s| s * ratio) }
            }
            Sensed::Pose { at_m, heading_rad, covariance_m2, sigma } => {
                let sigma_m = [covariance_m2[0].sqrt(), covariance_m2[2].sqrt(), sigma[0]];
                let ratio = self.understated(params, entry.stamp, Source::Place, (at_m, sigma_m));
                let covariance_m2 = covariance_m2.map(|c| c * ratio * ratio);
                Sensed::Pose { at_m, heading_rad, covariance_m2, sigma }
            }
            what => what,
        }
    }

    pub(super) fn begin(&mut self, params: &Params, stamp: Time, begin: &Begin) {
        self.filter = begin.filter(params);
        (self.at, self.constrained, self.last_fix) = (stamp, stamp, Some(stamp));
        let Wheels { speed_mps, curvature_1pm, last, .. } = self.wheels;
        self.wheels = Wheels { speed_mps, curvature_1pm, last, ..Wheels::default() };
        self.start = None;
    }

    /// Restarts the initialisation.
    fn restart(&mut self) {
        let Self { heading, at, imu, unit, wheels, ways, .. } = *self;
        let fixes = self.fixes.map(Fixes::cleared);
        *self = Self { heading, at, imu, unit, wheels, ways, fixes, ..Self::waiting(None) };
    }

    /// The heading known beforehand, near the place where it was valid; farther away as turned by the gyroscope, if
    /// the noise of fixes explains why they were refused.
    fn known_heading(&self) -> Option<[f64; 2]> {
        let ([heading_rad, sigma_rad], there) = self.heading?;
        let way = self.ways[0];
        let is_near = way.length_m() - there.length_m() < HEADING_HOLDS_M;
        let turned_rad = if is_near { 0.0 } else { way.turned_rad() - there.turned_rad() };
        (is_near || self.fixes[0].is_understated()).then_some([heading_rad + turned_rad, sigma_rad])
    }

    fn remember(&mut self, params: &Params, entry: &Entry) {
        let is_sound = || self.unit.health(params, entry.stamp) == UnitHealth::Sound;
        if let Sensed::Imu { accel_mps2, gyro_radps } = entry.what
            && is_sound()
        {
            let (accel_mps2, gyro_radps) = (Vector3::from(accel_mps2), Vector3::from(gyro_radps));
            self.imu = Some(Reading { stamp: entry.stamp, accel_mps2, gyro_radps });
        }
    }

    /// Propagates the filter to a stamp, by the latest reading of the inertial unit as long as that is valid.
    pub(super) fn advance(&mut self, params: &Params, stamp: Time, what: Option<&Sensed>) {
        let dt_s = (stamp - self.at).as_secs();
        if dt_s <= 0.0 {
            return;
        }
        self.repeats.advance(dt_s);
        let before_mps = self.axle_mps().x;
        let mut held_s = 0.0;
        let usable = self.imu.filter(|_| self.unit.health(params, self.at) == UnitHealth::Sound);
        if let Some(Reading { stamp: read, accel_mps2, gyro_radps }) = usable {
            let held = read + Span::from_secs(self.unit.hold_s(params)) - self.at;
            held_s = held.as_secs().clamp(0.0, dt_s);
            let (mut accel, mut gyro) = (accel_mps2, gyro_radps);
            if let (Hold::Mean, Some(Sensed::Imu { accel_mps2, gyro_radps })) = (params.hold, what) {
                accel = (accel + Vector3::from(*accel_mps2)) * 0.5;
                gyro = (gyro + Vector3::from(*gyro_radps)) * 0.5;
            }
            if held_s > 0.0 {
                self.filter.predict(params, &accel, &gyro, held_s);
            }
        }
        self.is_bridging = held_s < dt_s;
        if self.is_bridging {
            self.bridge(params, dt_s - held_s);
        }
        self.wheels.filter_m += 0.5 * (before_mps + self.axle_mps().x) * dt_s;
        self.at = stamp;
        self.go(dt_s);
    }

    /// Velocity of the inertial unit along the ego's axes, m/s, without the lever arm to the rear axle.
    pub(super) fn axle_mps(&self) -> Vector3<f64> {
        let n = &self.filter.nominal;
        n.attitude.inverse() * n.velocity_mps
    }

    fn fix(&mut self, params: &Params, stamp: Time, at_m: [f64; 3], sigma_m: [f64; 3]) {
        let lever = Vector3::from(params.antenna_at_m) - Vector3::from(params.imu_at_m);
        let mut linear = self.position(at_m, sigma_m, &lever);
        if params.offset_m > 0.0 {
            for axis in 0..2 {
                linear.residual[axis] -= self.filter.nominal.offset_m[axis];
                linear.rows[(axis, OFFSET + axis)] = 1.0;
            }
        }
        let accepted = self.followed(params, Source::Fix, &linear, Some(stamp));
        self.question(params, &Judged { stamp, source: Source::Fix, up_m: at_m[2], accepted });
        let tally = self.tally(Source::Fix);
        if !self.filter.is_sound() || (!self.is_known && tally.taken < TRIED_FIXES && tally.refused > 0) {
            self.restart();
        }
    }

    fn place(&mut self, params: &Params, stamp: Time, at_m: [f64; 3], sigma_m: [f64; 3]) {
        let linear = self.position(at_m, sigma_m, &Vector3::zeros());
        let accepted = self.followed(params, Source::Place, &linear, Some(stamp));
        self.question(params, &Judged { stamp, source: Source::Place, up_m: at_m[2], accepted });
    }

    /// Updates by the position of the ego origin, then by its heading.
    fn pose(
        &mut self,
        params: &Params,
        stamp: Time,
        at_m: [f64; 3],
        covariance: &Matrix3<f64>,
        heading: [f64; 2],
    ) {
        let lever = -Vector3::from(params.imu_at_m);
        let linear = Linear { noise: *covariance, ..self.position(at_m, [1.0; 3], &lever) };
        let accepted = self.followed(params, Source::Place, &linear, Some(stamp));
        self.question(params, &Judged { stamp, source: Source::Place, up_m: at_m[2], accepted });
        let n = &self.filter.nominal;
        let mut rows = SMatrix::<f64, 1, STATES>::zeros();
        let up = n.attitude.to_rotation_matrix().into_inner().row(2).into_owned();
        rows.fixed_view_mut::<1, 3>(0, ATTITUDE).copy_from(&up);
        let residual = wrap_angle(heading[0] - yaw_rad(&n.attitude));
        let linear = Linear { residual: [residual].into(), rows, noise: [[heading[1] * heading[1]]].into() };
        self.followed(params, Source::Heading, &linear, None);
    }

    /// Linearises the position of a point at `lever` from the inertial unit.
    fn position(&self, at_m: [f64; 3], sigma_m: [f64; 3], lever: &Vector3<f64>) -> Linear<3> {
        let n = &self.filter.nominal;
        let rotation = n.attitude.to_rotation_matrix().into_inner();
        let mut rows = SMatrix::<f64, 3, STATES>::zeros();
        rows.fixed_view_mut::<3, 3>(0, POSITION).copy_from(&Matrix3::identity());
        rows.fixed_view_mut::<3, 3>(0, ATTITUDE).copy_from(&(rotation * -skew(lever)));
        let noise = Matrix3::from_diagonal(&Vector3::from(sigma_m.map(|s| s * s)));
        Linear { residual: Vector3::from(at_m) - n.position_m - rotation * lever, rows, noise }
    }

    /// Velocity of the rear axle along the ego's axes, and its Jacobian.
    fn axle(&self, params: &Params) -> (Vector3<f64>, SMatrix<f64, 3, STATES>) {
        let n = &self.filter.nominal;
        let lever = -Vector3::from(params.imu_at_m);
        let along = n.attitude.inverse() * n.velocity_mps;
        let mut rows = SMatrix::<f64, 3, STATES>::zeros();
        let rotation = n.attitude.inverse().to_rotation_matrix().into_inner();
        rows.fixed_view_mut::<3, 3>(0, VELOCITY).copy_from(&rotation);
        rows.fixed_view_mut::<3, 3>(0, ATTITUDE).copy_from(&skew(&along));
        rows.fixed_view_mut::<3, 3>(0, GYRO_BIAS).copy_from(&skew(&lever));
        (along + self.turn_radps().cross(&lever), rows)
    }

    /// Processes a wheel reading; updates the filter once the readings span `wheel_span_s`.
    fn wheels(&mut self, params: &Params, stamp: Time, speed_mps: f64, curvature_1pm: Option<f64>) {
        if params.wheel_noise_mps <= 0.0 {
            return;
        }
        self.repeats.take(stamp, speed_mps);
        if self.repeats.is_frozen(stamp) {
            (self.wheels.since, self.wheels.standing_since) = (None, None);
            return;
        }
        self.wheels.speed_mps = speed_mps;
        self.wheels.curvature_1pm =
            curvature_1pm.map(|curvature| (stamp, curvature)).or(self.wheels.curvature_1pm);
        let Wheels { last, since, .. } = self.wheels;
        self.wheels.last = Some(stamp);
        self.wheels.standing_since = (speed_mps == 0.0).then(|| self.wheels.standing_since.unwrap_or(stamp));
        // The first reading covers an unknown period, so it is not compared with the filter's motion.
        let (Some(last), Some(since)) = (last, since) else {
            self.wheels = Wheels { since: Some(stamp), filter_m: 0.0, wheel_m: 0.0, ..self.wheels };
            return;
        };
        self.wheels.wheel_m += speed_mps * (stamp - last).as_secs();
        let span_s = (stamp - since).as_secs();
        // Half a reading less, so that rounding of stamps does not delay the update by a reading.
        if span_s + 0.5 * (stamp - last).as_secs() < params.wheel_span_s || span_s <= 0.0 {
            return;
        }
        let (now, all) = self.axle(params);
        // The lever arm affects the mean forward speed only through the turn about z.
        let lever_mps = now.x - self.axle_mps().x;
        let mean_mps = self.wheels.filter_m / span_s + lever_mps;
        let scale = 1.0 + self.filter.nominal.wheel_scale;
        let mut rows = SMatrix::<f64, 1, STATES>::zeros();
        rows.copy_from(&(all.fixed_rows::<1>(0) * scale));
        rows[(0, SCALE)] = mean_mps;
        let residual = self.wheels.wheel_m / span_s - mean_mps * scale;
        let noise = params.wheel_noise_mps * params.wheel_noise_mps;
        let linear = Linear { residual: [residual].into(), rows, noise: [[noise]].into() };
        self.wheels = Wheels { since: Some(stamp), wheel_m: 0.0, filter_m: 0.0, ..self.wheels };
        self.followed(params, Source::Wheels, &linear, None);
    }

    /// Applies the vehicle constraints periodically.
    fn constrain(&mut self, params: &Params, stamp: Time) {
        if (stamp - self.constrained).as_secs() < params.constraint_period_s {
            return;
        }
        self.constrained = stamp;
        let standing = |since: Time| (stamp - since).as_secs() >= params.standing_s;
        if params.zero_velocity_mps > 0.0 && self.wheels.standing_since.is_some_and(standing) {
            self.stand(params);
        } else if params.non_holonomic_mps > 0.0 {
            self.roll(params);
        }
    }

    /// Non-holonomic constraint: the rear axle moves only along the vehicle.
    fn roll(&mut self, params: &Params) {
        let (velocity, all) = self.axle(params);
        let slip_mps = params.slip_rad_per_mps2 * self.turn_radps().z * velocity.x * velocity.x;
        let square = |x: f64| x * x;
        let usual = square(params.non_holonomic_mps);
        let mut noise = SMatrix::<f64, 2, 2>::identity() * usual;
        // The slip persists, so repeated updates during one slip add little information.
        noise[(0, 0)] += square(slip_mps) * (2.0 * SLIP_LASTS_S / params.constraint_period_s).max(1.0);
        let residual = [-velocity.y, -velocity.z].into();
        let linear = Linear { residual, rows: all.fixed_rows::<2>(1).into_owned(), noise };
        self.followed(params, Source::NonHolonomic, &linear, None);
    }

    /// Zero-velocity constraint: the car neither moves nor turns.
    fn stand(&mut self, params: &Params) {
        let mut rows = SMatrix::<f64, 3, STATES>::zeros();
        rows.fixed_view_mut::<3, 3>(0, VELOCITY).copy_from(&Matrix3::identity());
        let noise = Matrix3::identity() * (params.zero_velocity_mps * params.zero_velocity_mps);
        let linear = Linear { residual: -self.filter.nominal.velocity_mps, rows, noise };
        self.followed(params, Source::Standing, &linear, None);
        let Some(imu) = self.imu.filter(|_| params.gyro_bias_radps > 0.0 && !self.is_bridging) else {
            return;
        };
        let mut rows = SMatrix::<f64, 3, STATES>::zeros();
        rows.fixed_view_mut::<3, 3>(0, GYRO_BIAS).copy_from(&Matrix3::identity());
        // A single reading of a unit that is read at 100 Hz.
        let noise = Vector3::from(params.gyro_noise.map(|d| (100.0 * d * d).max(1e-12)));
        let residual = imu.gyro_radps - self.filter.nominal.gyro_bias_radps;
        let linear = Linear { residual, rows, noise: Matrix3::from_diagonal(&noise) };
        self.followed(params, Source::Standing, &linear, None);
    }

    fn followed<const M: usize>(
        &mut self,
        params: &Params,
        source: Source,
        linear: &Linear<M>,
        fix: Option<Time>,
    ) -> bool {
        let before_mps = self.axle_mps().x;
        let innovation = self.filter.update(linear, params.gate(M), params.degrees_error);
        // The corrected speed error has existed since the last wheel update; without this the wheels would correct it
        // again.
        let counted = self.wheels.since.map_or(0.0, |since| (self.at - since).as_secs());
        self.wheels.filter_m += (self.axle_mps().x - before_mps) * counted;
        let tally = &mut self.tallies[source as usize];
        tally.follow(&innovation, M);
        if innovation.accepted && fix.is_some() {
            (self.last_fix, self.fixed_by) = (fix, source);
        }
        innovation.accepted
    }

    /// Current estimate; `None` before initialisation.
    pub(super) fn estimate(&self, params: &Params) -> Option<Estimate> {
        let filter = self.filter()?;
        let n = &filter.nominal;
        let rotation = n.attitude.to_rotation_matrix().into_inner();
        let lever = -Vector3::from(params.imu_at_m);
        let (position_covariance, covariance) = spread(&filter.covariance, &rotation, &lever);
        let mut estimate = Estimate {
            stamp: self.at,
            position_m: n.position_m + rotation * lever,
            attitude: n.attitude,
            heading_rad: yaw_rad(&n.attitude),
            velocity_mps: self.axle(params).0,
            accel_mps2: self.accel_mps2(params, &rotation),
            roll_rate_radps: self.turn_radps().x,
            yaw_rate_radps: self.turn_radps().z,
            covariance,
            position_covariance,
            mode: Mode::Good,
        };
        estimate.mode = self.mode(params, &estimate);
        Some(estimate)
    }
}

/// Covariances of the ego origin's position, and of x, y and heading.
fn spread(p: &Covariance, rotation: &Matrix3<f64>, lever: &Vector3<f64>) -> (Matrix3<f64>, Matrix3<f64>) {
    let mut rows = SMatrix::<f64, 4, STATES>::zeros();
    rows.fixed_view_mut::<3, 3>(0, POSITION).copy_from(&Matrix3::identity());
    rows.fixed_view_mut::<3, 3>(0, ATTITUDE).copy_from(&(rotation * -skew(lever)));
    rows.fixed_view_mut::<1, 3>(3, ATTITUDE).copy_from(&rotation.row(2));
    let all = rows * p * rows.transpose();
    let pick = |of: [usize; 3]| Matrix3::from_fn(|i, j| all[(of[i], of[j])]);
    (pick([0, 1, 2]), pick([0, 1, 3]))
}
