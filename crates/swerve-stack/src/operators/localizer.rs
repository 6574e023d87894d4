//! Localization by the ego's own sensors, in place of the pose of the simulator or of a vehicle.
//!
//! ```text
//! imu, gnss, wheel odometry, matches of a lidar > localizer --EgoState--> planner, controller
//! ```
//!
//! It publishes nothing while it is lost: a controller without states is silent for the safety gate, which stops the
//! car.

use anyhow::anyhow;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Span, Time};
use swerve_flow::{
    At, Context, Every, Inputs, Latest, Message, Operator, Outputs, Port, Timer, Window, every,
};
use swerve_geom::{Pose2, math};
use swerve_localization::{Estimate, Localizer, Mode, Params, Sensed, Source};
use swerve_msg::{EgoState, Gnss, Imu, LocalPose, PoseMatch, PoseMode, PoseQuality, Route, WheelOdometry};

mod stored_pose;

use super::odom::Odometer;
use super::receiver::{Receiver, new_messages};
use crate::config::execution::span_of_ms;
use crate::config::{Config, SensingConfig};
use crate::kind::{Kind, Node, Settings};
use crate::problems::{KeyProblems, problem};
use crate::site::Site;
use stored_pose::{START, StoredPose};

/// Messages kept per sensor: those of a few steps, so that none is missed.
const KEPT: usize = 16;

/// Periods of the inertial unit after which a pose is due without it.
const SILENT: f64 = 2.0;

/// A filter over inertial unit, satellite fixes, wheels, and lidar matches.
pub(crate) struct Filter {
    localizer: Localizer,
    params: Params,
    /// Standard deviation of the lane's heading as initial heading, radians; `None` to use the first course instead.
    lane_heading_rad: Option<f64>,
    receiver: Receiver,
    /// Standard deviations of the error common to all matches with a map, metres and radians.
    map_sigma: [f64; 2],
    /// Number of messages taken of each sensor.
    taken: [u64; 3],
    /// Stamps of the first fix, and of the fix that the filter started from.
    first_fix: Option<Time>,
    started: Option<Time>,
    await_match_s: f64,
    wheelbase_m: f64,
    /// Understeer gradient, rad s²/m.
    understeer_rads2pm: f64,
    steering_rad: f64,
    /// Stamp of the newest pose, and time after it at which the next one is due without the inertial unit.
    newest: Time,
    due_after: Span,
    odometer: Odometer,
    /// Initial pose, until there is a wheel speed.
    stored: Option<StoredPose>,
    wheels_due: Span,
}

/// Measurements of motion and position.
#[derive(Inputs)]
pub(crate) struct In {
    /// Timer for poses while the inertial unit is silent.
    tick: Every,
    /// Accelerations and turn rates; each yields a pose.
    imu: At<Imu>,
    /// Satellite fixes.
    fixes: Window<Gnss, KEPT>,
    /// Wheel speeds.
    wheels: Window<WheelOdometry, KEPT>,
    /// Poses of the ego matched by its lidar.
    matches: Option<Window<PoseMatch, KEPT>>,
    /// Route of the ego, on whose lane it starts.
    route: Latest<Route>,
}

/// Pose of the ego, and its accuracy.
#[derive(Outputs)]
pub(crate) struct Out {
    /// State of the ego; silent while it is unknown.
    pub(super) state: Port<EgoState>,
    /// Accuracy of the pose.
    pub(super) quality: Port<PoseQuality>,
    /// Local pose for control, with each state.
    pub(super) local: Port<LocalPose>,
}

/// Keys of a localizer.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Keys {
    /// Standard deviation of the initial heading from the lane's, degrees; 0 takes the heading from the first course.
    #[schemars(range(min = 0.0, max = 90.0))]
    lane_heading_deg: f64,
    /// Time limit for the first match of a lidar after the first fix, seconds; no pose is published before either.
    #[schemars(range(min = 0.0, max = 60.0))]
    await_match_s: f64,
    /// Standard deviation of the position error common to all matches with a map, in addition to each match's own,
    /// metres.
    #[schemars(range(min = 0.0, max = 1.0))]
    map_sigma_m: f64,
    /// Standard deviation of the heading error common to all matches with a map, in addition to each match's own,
    /// radians.
    #[schemars(range(min = 0.0, max = 1.0))]
    map_sigma_rad: f64,
    /// Parameters of the sensors that differ from `[sensing]`.
    #[schemars(with = "Params")]
    params: toml::Table,
}

impl Default for Keys {
    fn default() -> Self {
        Self {
            lane_heading_deg: 2.0,
            await_match_s: 2.0,
            map_sigma_m: 0.02,
            map_sigma_rad: 0.001,
            params: toml::Table::new(),
        }
    }
}

impl Keys {
    fn params(&self, known: &Params) -> Result<Params, KeyProblems> {
        let within = |problems: KeyProblems| {
            problems.into_iter().map(|(key, what)| (format!("params.{key}"), what)).collect::<KeyProblems>()
        };
        let table = toml::Table::try_from(known);
        let mut table = table.map_err(|e| vec![("params".to_owned(), e.to_string())])?;
        table.extend(self.params.clone());
        let params: Params = swerve_text::read(&table).map_err(within)?;
        params.validate().map_err(|error| within(vec![problem(error)])).map(|()| params)
    }
}

/// Sensor parameters of the configuration, limited to the accuracy of real sensors.
fn known(config: &Config) -> Params {
    let SensingConfig { imu, gnss, odometry, .. } = &config.sensing;
    let [accel_density, gyro_density] = imu.densities(config.sensing.imu_period_ms * 1e-3);
    let usual = Params::default();
    // An accelerometer's scale error acts mostly on gravity, all the time, like a bias.
    let scaled_mps2 = imu.accel_scale_error * usual.gravity_mps2;
    Params {
        accel_noise: [accel_density.max(0.02); 3],
        gyro_noise: [gyro_density.max(5e-4); 3],
        accel_bias_mps2: math::hypot(imu.accel_bias_mps2, scaled_mps2).max(0.01),
        accel_bias_walk: imu.accel_bias_walk.max(usual.accel_bias_walk),
        gyro_bias_radps: imu.gyro_bias_radps.max(1e-4),
        gyro_bias_walk: imu.gyro_bias_walk.max(usual.gyro_bias_walk),
        gyro_scale: imu.gyro_scale_error,
        offset_m: gnss.bias_m,
        offset_time_s: gnss.bias_time_s,
        wheel_scale: odometry.radius_error,
        imu_at_m: imu.at_m(&config.sim.vehicle),
        antenna_at_m: gnss.antenna_at_m,
        ..usual
    }
}

impl Kind for Filter {
    const NODE: Node =
        Node::new("localizer", "where the ego is by a filter over its sensors, and how sure that is");
    type Table = Keys;

    fn problems(table: &Keys) -> KeyProblems {
        let mut told = table.params(&Params::default()).err().unwrap_or_default();
        told.extend(table.out_of_range().into_iter().map(problem));
        told
    }

    fn new(table: Keys, site: &Site<'_>) -> anyhow::Result<Self> {
        let config = site.config();
        let problems =
            |told: KeyProblems| anyhow!("operator.{}: {}", site.name(), swerve_text::in_one_line(&told));
        let params = table.params(&known(config)).map_err(problems)?;
        let lane = table.lane_heading_deg.to_radians();
        Ok(Self {
            localizer: Localizer::new(params, None)?,
            params,
            lane_heading_rad: (lane > 0.0).then_some(lane),
            receiver: Receiver::new(site),
            map_sigma: [table.map_sigma_m, table.map_sigma_rad],
            taken: [0; 3],
            first_fix: None,
            started: None,
            await_match_s: table.await_match_s,
            wheelbase_m: config.sim.vehicle.shape.wheelbase_m,
            understeer_rads2pm: config.sim.vehicle.understeer_gradient_rads2pm(),
            steering_rad: 0.0,
            newest: Time::ZERO,
            due_after: span_of_ms(config.sensing.imu_period_ms * SILENT),
            odometer: Odometer::new(params.imu_at_m),
            stored: StoredPose::new(site),
            wheels_due: span_of_ms(config.sensing.odometry_period_ms * SILENT),
        })
    }

    fn timer(_: &Keys, settings: &Settings<'_>) -> Option<Timer> {
        Some(every(span_of_ms(settings.setup.sensing.imu_period_ms * SILENT)))
    }
}

impl Operator for Filter {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        self.receiver.follow(input.route.get().map(Message::shared));
        let is_due = cx.stamp() - self.newest >= self.due_after;
        let stamp = match input.imu.get() {
            Some(imu) => {
                let Imu { accel_mps2, gyro_radps, .. } = **imu;
                self.localizer.take(imu.stamp, Sensed::Imu { accel_mps2, gyro_radps });
                imu.stamp
            }
            None if is_due => cx.stamp(),
            None => return,
        };
        self.newest = stamp;
        for wheels in new_messages(input.wheels.get(), &mut self.taken[0]) {
            self.start_stored(wheels);
            let sensed = self.wheels(wheels);
            self.localizer.take(wheels.stamp, sensed);
        }
        if !self.awaits_wheels(stamp) {
            for fix in new_messages(input.fixes.get(), &mut self.taken[1]) {
                self.fix(fix);
            }
        }
        let matches = input.matches.as_ref().map_or(&[][..], |matches| matches.get());
        for found in new_messages(matches, &mut self.taken[2]) {
            let sensed = self.matched(found);
            self.localizer.take(found.stamp, sensed);
        }
        let estimate = match input.imu.get() {
            Some(_) => self.localizer.estimate(),
            None => self.localizer.estimate_at(stamp),
        };
        let Some(estimate) = estimate else {
            out.quality.send(PoseQuality { stamp, ..PoseQuality::default() });
            return;
        };
        let mut quality = quality(&estimate);
        if self.awaits_match(input.matches.is_some(), estimate.stamp) {
            quality.mode = PoseMode::Lost;
        }
        if quality.mode != PoseMode::Lost {
            let state = self.state(&estimate);
            out.local.send(self.odometer.advance(&state, estimate.roll_rate_radps));
            out.state.send(state);
        }
        out.quality.send(quality);
    }
}

fn quality(estimate: &Estimate) -> PoseQuality {
    let mode = match estimate.mode {
        Mode::Good => PoseMode::Good,
        Mode::Noisy => PoseMode::Noisy,
        Mode::Coasting => PoseMode::Coasting,
        Mode::Lost => PoseMode::Lost,
    };
    let c = |i: usize, j: usize| estimate.covariance[(i, j)];
    let covariance = [c(0, 0), c(0, 1), c(1, 1), c(0, 2), c(1, 2), c(2, 2)];
    PoseQuality { stamp: estimate.stamp, mode, covariance }
}

impl Filter {
    /// Returns true while a stored pose waits for a wheel speed, which is due within two of their periods.
    fn awaits_wheels(&self, now: Time) -> bool {
        self.stored.is_some() && now - START <= self.wheels_due
    }

    /// Starts from the stored pose with the first wheel speed, unless a fix came before.
    fn start_stored(&mut self, wheels: &WheelOdometry) {
        let Some(stored) = self.stored.take().filter(|_| self.started.is_none()) else { return };
        let initial = stored.initial(&self.params, wheels.stamp, wheels.speed_mps);
        // The parameters were validated when the operator was built.
        if let Ok(localizer) = Localizer::starting_at(self.params, wheels.stamp, &initial) {
            (self.localizer, self.started) = (localizer, Some(wheels.stamp));
        }
    }

    /// Speed and steering angle as a measurement.
    fn wheels(&mut self, wheels: &WheelOdometry) -> Sensed {
        self.steering_rad = wheels.steering_rad;
        // An oversteering car has a speed above which this does not hold.
        let speed_mps = wheels.speed_mps;
        let length_m = self.wheelbase_m + self.understeer_rads2pm * speed_mps * speed_mps;
        let curvature_1pm = Some(math::tan(wheels.steering_rad) / length_m.max(0.5 * self.wheelbase_m));
        Sensed::Wheels { speed_mps, curvature_1pm }
    }

    fn fix(&mut self, fix: &Gnss) {
        let Some(at_m) = self.receiver.place(fix) else { return };
        if self.is_refused_as_start(fix.stamp, at_m) {
            return;
        }
        if self.started.is_none() {
            self.started = Some(fix.stamp);
            self.start(at_m);
        }
        if let Some(sensed) = self.receiver.sensed(fix, self.params.offset_m) {
            self.localizer.take(fix.stamp, sensed);
        }
    }

    /// Returns true if a fix before the start is refused: the car stands on its lane. Fixes that stay off the road for
    /// `believed_after_s` are accepted.
    fn is_refused_as_start(&mut self, stamp: Time, at_m: [f64; 3]) -> bool {
        let first = *self.first_fix.get_or_insert(stamp);
        self.started.is_none()
            && self.lane_heading_rad.is_some()
            && !self.receiver.may_be_on_road(at_m)
            && (stamp - first).as_secs() < self.params.believed_after_s
    }

    /// Returns true while no pose is published because the first match would correct it by the error of the first fix.
    fn awaits_match(&self, has_lidar: bool, now: Time) -> bool {
        let waited_s = self.started.map_or(0.0, |started| (now - started).as_secs());
        let is_matched = self.localizer.tally(Source::Place).taken > 0;
        has_lidar && !is_matched && waited_s < self.await_match_s
    }

    fn matched(&self, found: &PoseMatch) -> Sensed {
        let PoseMatch { at_m, heading_rad, height_sigma_m, heading_sigma_rad, .. } = *found;
        let [along_m, turn_rad] = self.map_sigma;
        let [xx, xy, yy] = found.covariance_m2;
        let covariance_m2 = [xx + along_m * along_m, xy, yy + along_m * along_m];
        let sigma = [math::hypot(height_sigma_m, along_m), math::hypot(heading_sigma_rad, turn_rad)];
        Sensed::Pose { at_m, heading_rad, covariance_m2, sigma }
    }

    /// Sets the heading from the lane, unknown before the first fix.
    fn start(&mut self, at_m: [f64; 3]) {
        let lane_rad = self.receiver.lane_heading_rad(at_m);
        if let (Some(sigma_rad), Some(lane_rad)) = (self.lane_heading_rad, lane_rad) {
            self.localizer.suppose_heading([lane_rad, sigma_rad]);
        }
    }

    fn state(&self, estimate: &Estimate) -> EgoState {
        let Estimate { stamp, position_m, heading_rad, velocity_mps, accel_mps2, yaw_rate_radps, .. } =
            *estimate;
        EgoState {
            stamp,
            pose: Pose2::new(position_m.x, position_m.y, heading_rad),
            speed_mps: velocity_mps.x,
            accel_mps2: accel_mps2.x,
            lateral_accel_mps2: accel_mps2.y,
            yaw_rate_radps,
            steering_rad: self.steering_rad,
        }
    }
}

#[cfg(test)]
mod tests;
