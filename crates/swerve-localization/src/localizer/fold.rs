//! The state after a row of measurements in the order of their stamps.

use nalgebra::{Matrix3, SMatrix, Vector3};
use swerve_core::{Span, Time};
use swerve_geom::wrap_angle;

use super::start::{Begin, Start};
use super::{Entry, Estimate, Initial, Mode, Sensed, Source, Tally};
use crate::eskf::{
    ACCEL_BIAS, ATTITUDE, Covariance, Eskf, GYRO_BIAS, Linear, OFFSET, POSITION, SCALE, STATES, VELOCITY,
    skew, yaw_rad,
};
use crate::params::{Hold, Params};

/// Noise of a vehicle whose inertial unit is silent: m/s²/√Hz and rad/s/√Hz, as hard as a car can brake and turn.
const BLIND_ACCEL: f64 = 5.0;
const BLIND_GYRO: f64 = 0.5;

/// A refused fix among the first few may be right, and the start wrong.
const TRIED_FIXES: u64 = 3;

/// One reading of the inertial unit.
#[derive(Clone, Copy, Debug)]
struct Reading {
    stamp: Time,
    accel_mps2: Vector3<f64>,
    gyro_radps: Vector3<f64>,
}

/// The wheels, and what the filter moved meanwhile.
#[derive(Clone, Copy, Debug, Default)]
struct Wheels {
    /// Stamp of the newest reading, and of the one that `wheel_m` counts from.
    last: Option<Time>,
    since: Option<Time>,
    wheel_m: f64,
    filter_m: f64,
    standing_since: Option<Time>,
}

/// Filter and all that goes with it.
#[derive(Clone, Debug)]
pub(super) struct Fold {
    /// What is gathered for a start; none once it has started.
    start: Option<Start>,
    /// What is known of the heading beforehand.
    heading: Option<[f64; 2]>,
    filter: Eskf,
    /// Instant of the filter's state.
    at: Time,
    imu: Option<Reading>,
    wheels: Wheels,
    /// When the car was last supposed to be one.
    constrained: Time,
    last_fix: Option<Time>,
    tallies: [Tally; 6],
}

impl Fold {
    /// Before there is a fix.
    pub(super) fn waiting(heading: Option<[f64; 2]>) -> Self {
        Self {
            start: Some(Start::default()),
            heading,
            filter: Begin::default().filter(&Params::default()),
            at: Time::ZERO,
            imu: None,
            wheels: Wheels::default(),
            constrained: Time::ZERO,
            last_fix: None,
            tallies: [Tally::default(); 6],
        }
    }

    /// In a known state.
    pub(super) fn started(params: &Params, at: Time, initial: &Initial) -> Self {
        let filter = Begin::from(initial).filter(params);
        Self { start: None, filter, at, constrained: at, last_fix: Some(at), ..Self::waiting(None) }
    }

    pub(super) fn suppose_heading(&mut self, heading: [f64; 2]) {
        self.heading = Some(heading);
    }

    pub(super) fn filter(&self) -> Option<&Eskf> {
        self.start.is_none().then_some(&self.filter)
    }

    pub(super) fn tally(&self, source: Source) -> Tally {
        self.tallies[source as usize]
    }

    /// The next measurement, not before the last.
    pub(super) fn take(&mut self, params: &Params, entry: &Entry) {
        if let Some(start) = &mut self.start {
            if let Some(begin) = start.take(params, self.heading, entry) {
                self.begin(params, entry.stamp, &begin);
            }
            self.remember(entry);
            return;
        }
        self.advance(params, entry);
        match entry.what {
            Sensed::Imu { .. } => self.constrain(params, entry.stamp),
            Sensed::Fix { at_m, sigma_m } => self.fix(params, entry.stamp, at_m, sigma_m),
            Sensed::Place { at_m, sigma_m } => self.place(params, entry.stamp, at_m, sigma_m),
            Sensed::Pose { at_m, heading_rad, covariance_m2: [xx, xy, yy], sigma: [up, turn] } => {
                let covariance = Matrix3::new(xx, xy, 0.0, xy, yy, 0.0, 0.0, 0.0, up * up);
                self.pose(params, entry.stamp, at_m, &covariance, [heading_rad, turn]);
            }
            Sensed::Wheels(speed_mps) => self.wheels(params, entry.stamp, speed_mps),
        }
        self.remember(entry);
    }

    fn begin(&mut self, params: &Params, stamp: Time, begin: &Begin) {
        self.filter = begin.filter(params);
        (self.at, self.constrained, self.last_fix) = (stamp, stamp, Some(stamp));
        self.wheels = Wheels::default();
        self.start = None;
    }

    fn remember(&mut self, entry: &Entry) {
        if let Sensed::Imu { accel_mps2, gyro_radps } = entry.what {
            let (accel_mps2, gyro_radps) = (Vector3::from(accel_mps2), Vector3::from(gyro_radps));
            self.imu = Some(Reading { stamp: entry.stamp, accel_mps2, gyro_radps });
        }
    }

    /// Moves the filter on to a stamp, by the last reading of the inertial unit for as long as that may hold.
    fn advance(&mut self, params: &Params, entry: &Entry) {
        let dt_s = (entry.stamp - self.at).as_secs();
        if dt_s <= 0.0 {
            return;
        }
        let before_mps = self.axle_mps().x;
        let mut held_s = 0.0;
        if let Some(Reading { stamp, accel_mps2, gyro_radps }) = self.imu {
            let held = stamp + Span::from_secs(params.imu_timeout_s) - self.at;
            held_s = held.as_secs().clamp(0.0, dt_s);
            let (mut accel, mut gyro) = (accel_mps2, gyro_radps);
            if let (Hold::Mean, Sensed::Imu { accel_mps2, gyro_radps }) = (params.hold, entry.what) {
                accel = (accel + Vector3::from(accel_mps2)) * 0.5;
                gyro = (gyro + Vector3::from(gyro_radps)) * 0.5;
            }
            if held_s > 0.0 {
                self.filter.predict(params, &accel, &gyro, held_s);
            }
        }
        if held_s < dt_s {
            self.advance_blind(params, dt_s - held_s);
        }
        self.wheels.filter_m += 0.5 * (before_mps + self.axle_mps().x) * dt_s;
        self.at = entry.stamp;
    }

    /// Moves on without an inertial unit: as fast as now, straight on, and not sure of either.
    fn advance_blind(&mut self, params: &Params, dt_s: f64) {
        let n = self.filter.nominal;
        let up = Vector3::new(0.0, 0.0, params.gravity_mps2);
        let accel = n.attitude.inverse() * up + n.accel_bias_mps2;
        let blind = Params { accel_noise: [BLIND_ACCEL; 3], gyro_noise: [BLIND_GYRO; 3], ..*params };
        self.filter.predict(&blind, &accel, &n.gyro_bias_radps, dt_s);
    }

    fn turn_radps(&self) -> Vector3<f64> {
        self.imu.map_or(Vector3::zeros(), |imu| imu.gyro_radps - self.filter.nominal.gyro_bias_radps)
    }

    /// Velocity of the rear axle along the ego's axes, m/s; the lever arm is that of the newest parameters.
    fn axle_mps(&self) -> Vector3<f64> {
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
        self.followed(params, Source::Fix, &linear, Some(stamp));
        let tally = self.tally(Source::Fix);
        if !self.filter.is_sound() || (tally.taken < TRIED_FIXES && tally.refused > 0) {
            let (heading, imu) = (self.heading, self.imu);
            *self = Self { imu, ..Self::waiting(heading) };
        }
    }

    fn place(&mut self, params: &Params, stamp: Time, at_m: [f64; 3], sigma_m: [f64; 3]) {
        let linear = self.position(at_m, sigma_m, &Vector3::zeros());
        self.followed(params, Source::Place, &linear, Some(stamp));
    }

    /// Place of the ego origin, then its heading.
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
        self.followed(params, Source::Place, &linear, Some(stamp));
        let n = &self.filter.nominal;
        let mut rows = SMatrix::<f64, 1, STATES>::zeros();
        let up = n.attitude.to_rotation_matrix().into_inner().row(2).into_owned();
        rows.fixed_view_mut::<1, 3>(0, ATTITUDE).copy_from(&up);
        let residual = wrap_angle(heading[0] - yaw_rad(&n.attitude));
        let linear = Linear { residual: [residual].into(), rows, noise: [[heading[1] * heading[1]]].into() };
        self.followed(params, Source::Heading, &linear, None);
    }

    /// The place of a point `lever` from the inertial unit.
    fn position(&self, at_m: [f64; 3], sigma_m: [f64; 3], lever: &Vector3<f64>) -> Linear<3> {
        let n = &self.filter.nominal;
        let rotation = n.attitude.to_rotation_matrix().into_inner();
        let mut rows = SMatrix::<f64, 3, STATES>::zeros();
        rows.fixed_view_mut::<3, 3>(0, POSITION).copy_from(&Matrix3::identity());
        rows.fixed_view_mut::<3, 3>(0, ATTITUDE).copy_from(&(rotation * -skew(lever)));
        let noise = Matrix3::from_diagonal(&Vector3::from(sigma_m.map(|s| s * s)));
        Linear { residual: Vector3::from(at_m) - n.position_m - rotation * lever, rows, noise }
    }

    /// Velocity of the rear axle along the ego's axes, and its derivatives.
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

    /// One more reading of the wheels; a measurement when there is time enough in them.
    fn wheels(&mut self, params: &Params, stamp: Time, speed_mps: f64) {
        if params.wheel_noise_mps <= 0.0 {
            return;
        }
        let Wheels { last, since, .. } = self.wheels;
        self.wheels.last = Some(stamp);
        self.wheels.standing_since = (speed_mps == 0.0).then(|| self.wheels.standing_since.unwrap_or(stamp));
        // The first reading's own time is not known, and so not what the filter moved in it.
        let (Some(last), Some(since)) = (last, since) else {
            self.wheels = Wheels { since: Some(stamp), filter_m: 0.0, wheel_m: 0.0, ..self.wheels };
            return;
        };
        self.wheels.wheel_m += speed_mps * (stamp - last).as_secs();
        let span_s = (stamp - since).as_secs();
        // Half a reading less: spans of decimal fractions are whole numbers of readings.
        if span_s + 0.5 * (stamp - last).as_secs() < params.wheel_span_s || span_s <= 0.0 {
            return;
        }
        let (now, all) = self.axle(params);
        // The lever arm adds nothing to the mean of the forward speed but its turn about z.
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

    /// What is supposed of a car, from time to time.
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

    /// The rear axle moves along the car.
    fn roll(&mut self, params: &Params) {
        let (velocity, all) = self.axle(params);
        let slip_mps = params.slip_rad_per_mps2 * self.turn_radps().z * velocity.x * velocity.x;
        let square = |x: f64| x * x;
        let usual = square(params.non_holonomic_mps);
        let mut noise = SMatrix::<f64, 2, 2>::identity() * usual;
        noise[(0, 0)] += square(slip_mps);
        let residual = [-velocity.y, -velocity.z].into();
        let linear = Linear { residual, rows: all.fixed_rows::<2>(1).into_owned(), noise };
        self.followed(params, Source::NonHolonomic, &linear, None);
    }

    /// The car stands: neither moves nor turns.
    fn stand(&mut self, params: &Params) {
        let mut rows = SMatrix::<f64, 3, STATES>::zeros();
        rows.fixed_view_mut::<3, 3>(0, VELOCITY).copy_from(&Matrix3::identity());
        let noise = Matrix3::identity() * (params.zero_velocity_mps * params.zero_velocity_mps);
        let linear = Linear { residual: -self.filter.nominal.velocity_mps, rows, noise };
        self.followed(params, Source::Standing, &linear, None);
        let Some(imu) = self.imu.filter(|_| params.gyro_bias_radps > 0.0) else { return };
        let mut rows = SMatrix::<f64, 3, STATES>::zeros();
        rows.fixed_view_mut::<3, 3>(0, GYRO_BIAS).copy_from(&Matrix3::identity());
        // One reading of a unit that is read a hundred times a second.
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
    ) {
        let before_mps = self.axle_mps().x;
        let innovation = self.filter.update(linear, params.gate(M), params.degrees_error);
        // What the speed was off by now it was since the wheels were last looked at: they correct it once.
        let counted = self.wheels.since.map_or(0.0, |since| (self.at - since).as_secs());
        self.wheels.filter_m += (self.axle_mps().x - before_mps) * counted;
        let tally = &mut self.tallies[source as usize];
        if innovation.accepted {
            tally.taken += 1;
            tally.nis_sum += innovation.nis;
            self.last_fix = fix.or(self.last_fix);
        } else {
            tally.refused += 1;
        }
    }

    /// What is to be told of it.
    pub(super) fn estimate(&self, params: &Params) -> Option<Estimate> {
        let filter = self.filter()?;
        let n = &filter.nominal;
        let rotation = n.attitude.to_rotation_matrix().into_inner();
        let lever = -Vector3::from(params.imu_at_m);
        let force = self.imu.map_or(Vector3::zeros(), |imu| imu.accel_mps2 - n.accel_bias_mps2);
        let down = rotation.transpose() * Vector3::new(0.0, 0.0, -params.gravity_mps2);
        let (position_covariance, covariance) = spread(&filter.covariance, &rotation, &lever);
        let mut estimate = Estimate {
            stamp: self.at,
            position_m: n.position_m + rotation * lever,
            attitude: n.attitude,
            heading_rad: yaw_rad(&n.attitude),
            velocity_mps: self.axle(params).0,
            accel_mps2: self.imu.map_or(Vector3::zeros(), |_| force + down),
            yaw_rate_radps: self.turn_radps().z,
            covariance,
            position_covariance,
            mode: Mode::Good,
        };
        estimate.mode = self.mode(params, &estimate);
        Some(estimate)
    }

    fn mode(&self, params: &Params, estimate: &Estimate) -> Mode {
        let silent = |imu: Reading| (self.at - imu.stamp).as_secs() > params.imu_timeout_s;
        let since_fix = self.last_fix.map(|last| (self.at - last).as_secs());
        // What is no number is lost, too.
        let is_sure = estimate.sigma_m() <= params.lost_sigma_m;
        if !is_sure || self.imu.is_none_or(silent) || !self.filter.is_sound() {
            Mode::Lost
        } else if since_fix.is_none_or(|s| s > params.coasting_after_s) {
            Mode::Coasting
        } else {
            Mode::Good
        }
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

/// First of the states that a start gives variances of its own.
pub(super) const KNOWN: [usize; 3] = [POSITION, VELOCITY, ATTITUDE];
/// Those whose variances are the sensors'.
pub(super) const LEARNT: [usize; 4] = [ACCEL_BIAS, GYRO_BIAS, OFFSET, SCALE];
