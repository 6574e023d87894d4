//! Where the ego is by its own sensors, in the place of the pose that the simulator or a vehicle tells.
//!
//! ```text
//! imu, gnss, wheel odometry, matches of a lidar > localizer --EgoState--> planner, controller
//! ```
//!
//! While it is lost it says nothing: a controller that hears no state falls silent for the safety gate, which stops the car.

use anyhow::anyhow;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_flow::{At, Context, Every, Inputs, Message, Operator, Outputs, Port, Timer, Window, every};
use swerve_geom::{FrenetPoint, Point2, Pose2, math};
use swerve_localization::flat::Origin;
use swerve_localization::ndt::Isometry3;
use swerve_localization::{Estimate, Localizer, Mode, Params, Sensed, Source};
use swerve_msg::{EgoState, Gnss, Imu, LocalPose, PoseMatch, PoseMode, PoseQuality, Route, WheelOdometry};
use swerve_sim::sense::GnssParams;

mod stored_pose;

use super::odom::Odometer;
use super::scan_matcher::pose_of;
use crate::config::{Config, SensingConfig};
use crate::kind::{KeyProblems, Kind, Node, Settings, span_of_ms};
use crate::site::Site;
use stored_pose::StoredPose;

/// Messages kept of each sensor: those of a few steps, so that none is missed.
const KEPT: usize = 16;

/// Periods of the inertial unit after which a pose is due without it.
const SILENT: f64 = 2.0;

/// A first fix further off the road than this many of its standard deviations is a reflection.
const OFF_ROAD_SIGMAS: f64 = 3.0;

/// A filter over inertial unit, satellite fixes and wheels, and over what a lidar finds.
pub(super) struct Filter {
    localizer: Localizer,
    params: Params,
    /// Deviation of the heading that the lane gives, radians; none where the course has to.
    lane_heading_rad: Option<f64>,
    receiver: Receiver,
    /// Deviations that matches with a map share, metres and radians.
    map_sigma: [f64; 2],
    /// Messages of each sensor that were taken.
    taken: [u64; 3],
    /// Stamps of the first fix, and of the one by which it starts.
    first_fix: Option<Time>,
    started: Option<Time>,
    await_match_s: f64,
    wheelbase_m: f64,
    /// Understeer gradient, rad s²/m.
    understeer_rads2pm: f64,
    steering_rad: f64,
    /// Stamp of the newest pose, and how long after it the next one is due where the inertial unit is silent.
    newest: Time,
    due_after: Span,
    odometer: Odometer,
    /// The pose to start from, until there is a speed by the wheels.
    stored: Option<StoredPose>,
    wheels_due: Span,
}

/// All that says how it moves, and where it is.
#[derive(Inputs)]
pub(super) struct In {
    /// When a pose is due although the inertial unit is silent.
    tick: Every,
    /// Accelerations and turn rates: each makes a pose.
    imu: At<Imu>,
    /// Satellite fixes.
    fixes: Window<Gnss, KEPT>,
    /// Speeds by the wheels.
    wheels: Window<WheelOdometry, KEPT>,
    /// Where the ego was by its lidar.
    matches: Option<Window<PoseMatch, KEPT>>,
}

/// Where the ego is, and how sure that is.
#[derive(Outputs)]
pub(super) struct Out {
    /// Where it is; silent while that is not known.
    pub(super) state: Port<EgoState>,
    /// How good that is.
    pub(super) quality: Port<PoseQuality>,
    /// The pose for control, with each state.
    pub(super) local: Port<LocalPose>,
}

/// What is known of a satellite receiver, and of the lane that the car is on.
pub(super) struct Receiver {
    noise_m: f64,
    bias_m: f64,
    antenna_at_m: [f64; 3],
    origin: Origin,
    route: Route,
}

impl Receiver {
    pub(super) fn new(site: &Site<'_>) -> Self {
        Self::of(&site.config().sensing.gnss, site.surroundings().route.clone())
    }

    fn of(gnss: &GnssParams, route: Route) -> Self {
        let origin = Origin {
            latitude_deg: gnss.origin_latitude_deg,
            longitude_deg: gnss.origin_longitude_deg,
            altitude_m: gnss.origin_altitude_m,
        };
        let GnssParams { noise_m, bias_m, antenna_at_m, .. } = *gnss;
        Self { noise_m: noise_m.max(0.01), bias_m, antenna_at_m, origin, route }
    }

    /// Where the antenna is on the map by a fix: east, north, up, metres.
    fn place(&self, fix: &Gnss) -> Option<[f64; 3]> {
        self.origin.east_north_up_m(fix.latitude_deg, fix.longitude_deg, fix.altitude_m)
    }

    /// The same as a measurement; `offset_m` is what fixes have in common along each axis.
    fn sensed(&self, fix: &Gnss, offset_m: f64) -> Option<Sensed> {
        // A receiver's height is half as good as its place.
        let up_m = 2.0 * math::hypot(self.noise_m, offset_m);
        let at_m = self.place(fix)?;
        Some(Sensed::Fix { at_m, sigma_m: [self.noise_m, self.noise_m, up_m] })
    }

    /// Where the ego is by a fix, level and along its lane.
    pub(super) fn ego(&self, fix: &Gnss) -> Option<Isometry3<f64>> {
        let [east, north, up] = self.place(fix)?;
        let heading_rad = self.lane_heading_rad([east, north, up]);
        let (sin, cos) = math::sin_cos(heading_rad);
        let [x, y, z] = self.antenna_at_m;
        let at_m = [east - (x * cos - y * sin), north - (x * sin + y * cos), up - z];
        Some(pose_of(at_m, heading_rad))
    }

    /// Heading of the lane beside a place, radians.
    fn lane_heading_rad(&self, [x_m, y_m, _]: [f64; 3]) -> f64 {
        let s_m = self.route.project(Point2::new(x_m, y_m)).s_m;
        self.route.line().at(s_m).pose.heading_rad
    }

    /// Whether a place is on the ground beside the route, but for the errors of fixes.
    fn may_be_on_road(&self, [x_m, y_m, _]: [f64; 3]) -> bool {
        let FrenetPoint { s_m, d_m } = self.route.project(Point2::new(x_m, y_m));
        let beyond_m = OFF_ROAD_SIGMAS * self.sigma_m();
        (-self.route.right_m(s_m) - beyond_m..=self.route.left_m(s_m) + beyond_m).contains(&d_m)
    }

    /// Standard deviation of a fix, metres.
    pub(super) fn sigma_m(&self) -> f64 {
        math::hypot(self.noise_m, self.bias_m)
    }
}

/// Keys of a localizer.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(super) struct Keys {
    /// At the start the car stands along its lane, but for this deviation, degrees; 0: its heading is that of its first course.
    lane_heading_deg: f64,
    /// With a lidar: how long after the first fix its first match is waited for before a pose is told, seconds.
    await_match_s: f64,
    /// Deviation of the place that matches with a map share, beside the one that each tells, metres.
    map_sigma_m: f64,
    /// The same of the heading, radians.
    map_sigma_rad: f64,
    /// What differs from what `[sensing]` says of the sensors.
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
        let told = |e: swerve_core::ParamError| {
            within(vec![(e.key.to_string(), format!("expected {}, found {}", e.expected, e.value))])
        };
        params.validate().map_err(told).map(|()| params)
    }
}

/// What the configuration says of the sensors, and no better than real ones are.
fn known(config: &Config) -> Params {
    let SensingConfig { imu, gnss, odometry, .. } = &config.sensing;
    let [accel_density, gyro_density] = imu.densities(config.sensing.imu_period_ms * 1e-3);
    let usual = Params::default();
    // Most of what an accelerometer's scale does is done to gravity, all the time, as a bias does it.
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
        if !(0.0..=90.0).contains(&table.lane_heading_deg) {
            told.push((
                "lane_heading_deg".into(),
                format!("expected 0 to 90, found {}", table.lane_heading_deg),
            ));
        }
        let ranges = [
            ("await_match_s", table.await_match_s, 60.0),
            ("map_sigma_m", table.map_sigma_m, 1.0),
            ("map_sigma_rad", table.map_sigma_rad, 1.0),
        ];
        for (key, value, most) in ranges {
            if !(0.0..=most).contains(&value) {
                told.push((key.into(), format!("expected 0 to {most}, found {value}")));
            }
        }
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
        Some(every(span_of_ms(settings.config.sensing.imu_period_ms * SILENT)))
    }
}

impl Operator for Filter {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
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
        for wheels in new(input.wheels.get(), &mut self.taken[0]) {
            self.start_stored(wheels);
            let sensed = self.wheels(wheels);
            self.localizer.take(wheels.stamp, sensed);
        }
        if !self.awaits_wheels(stamp) {
            for fix in new(input.fixes.get(), &mut self.taken[1]) {
                self.fix(fix);
            }
        }
        let matches = input.matches.as_ref().map_or(&[][..], |matches| matches.get());
        for found in new(matches, &mut self.taken[2]) {
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
        Mode::Coasting => PoseMode::Coasting,
        Mode::Lost => PoseMode::Lost,
    };
    let c = |i: usize, j: usize| estimate.covariance[(i, j)];
    let covariance = [c(0, 0), c(0, 1), c(1, 1), c(0, 2), c(1, 2), c(2, 2)];
    PoseQuality { stamp: estimate.stamp, mode, covariance }
}

/// Those of a window that were not there before.
pub(super) fn new<'a, T>(
    window: &'a [Message<T>],
    taken: &mut u64,
) -> impl Iterator<Item = &'a Message<T>> + use<'a, T> {
    let from = *taken;
    *taken = window.last().map_or(from, |newest| newest.header().seq + 1);
    window.iter().filter(move |message| message.header().seq >= from)
}

impl Filter {
    /// Speed and steering angle as a measurement.
    fn wheels(&mut self, wheels: &WheelOdometry) -> Sensed {
        self.steering_rad = wheels.steering_rad;
        // An oversteering car has a speed from which on this is no longer so.
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

    /// Whether a fix before the start is none to begin with: the car stands on its lane. What stays off the road for
    /// `believed_after_s` is believed.
    fn is_refused_as_start(&mut self, stamp: Time, at_m: [f64; 3]) -> bool {
        let first = *self.first_fix.get_or_insert(stamp);
        self.started.is_none()
            && self.lane_heading_rad.is_some()
            && !self.receiver.may_be_on_road(at_m)
            && (stamp - first).as_secs() < self.params.believed_after_s
    }

    /// Whether nothing is told yet, as the first match will move the pose by as much as the first fix is off.
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

    /// Before the first fix nothing was known; now the lane is.
    fn start(&mut self, at_m: [f64; 3]) {
        let Some(sigma_rad) = self.lane_heading_rad else { return };
        self.localizer.suppose_heading([self.receiver.lane_heading_rad(at_m), sigma_rad]);
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
