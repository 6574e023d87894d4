//! Dead reckoning by wheels and gyroscopes from the newest match of a lidar sweep, in place of a filter.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_flow::{At, Context, Inputs, Operator, Window};
use swerve_geom::Pose2;
use swerve_localization::Sensed;
use swerve_localization::dead_reckoning::DeadReckoning;
use swerve_localization::eskf::yaw_rad;
use swerve_localization::lateral_velocity::RollEstimate;
use swerve_msg::{EgoState, Imu, PoseMatch, PoseMode, PoseQuality, WheelOdometry};

use super::localizer::Out;
use super::odom::Odometer;
use super::receiver::pose_of;
use super::scan_matcher::readings;
use crate::kind::{Kind, Node};
use crate::problems::KeyProblems;
use crate::site::Site;

/// Messages kept per input: those of a few steps, so that none is missed.
const KEPT: usize = 16;
/// Drift of dead reckoning: as a share of the distance, and in rad/s.
const DRIFT: f64 = 0.01;
const DRIFT_RADPS: f64 = 0.002;

/// Estimates the pose between two matches.
pub(crate) struct Carried {
    keys: Keys,
    car: DeadReckoning,
    roll: RollEstimate,
    odometer: Odometer,
    taken: [u64; 2],
}

/// Last match, and motion since.
#[derive(Inputs)]
pub(crate) struct In {
    /// Accelerations and turn rates; each yields a pose.
    imu: At<Imu>,
    /// Wheel speeds.
    wheels: Window<WheelOdometry, KEPT>,
    /// Poses of the ego matched by its lidar.
    matches: Window<PoseMatch, 1>,
}

/// Keys of dead reckoning.
#[derive(Clone, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct Keys {
    /// Time without a match after which it is coasting, seconds.
    coasting_after_s: f64,
    /// Time without a match after which it is lost and publishes no pose, seconds.
    lost_after_s: f64,
}

impl Default for Keys {
    fn default() -> Self {
        Self { coasting_after_s: 0.35, lost_after_s: 2.0 }
    }
}

impl Kind for Carried {
    const NODE: Node =
        Node::new("dead_reckoning", "where the ego is by a lidar's newest match, wheels and gyroscopes");
    type Table = Keys;

    fn problems(table: &Keys) -> KeyProblems {
        let of = [("coasting_after_s", table.coasting_after_s), ("lost_after_s", table.lost_after_s)];
        let wrong = of.into_iter().filter(|(_, s)| !(0.01..=2.9).contains(s));
        wrong.map(|(key, s)| (key.to_owned(), format!("expected 0.01 to 2.9, found {s}"))).collect()
    }

    fn new(keys: Keys, site: &Site<'_>) -> anyhow::Result<Self> {
        let config = site.settings().setup;
        Ok(Self {
            keys,
            car: DeadReckoning::new(),
            roll: RollEstimate::default(),
            odometer: Odometer::new(config.sensing.imu.at_m(&config.sim.vehicle)),
            taken: [0; 2],
        })
    }
}

impl Operator for Carried {
    type In = In;
    type Out = Out;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Out) {
        let is_sound =
            |&Imu { accel_mps2, gyro_radps, .. }: &Imu| Sensed::Imu { accel_mps2, gyro_radps }.is_sound();
        let (Some(imu), wheels) = (input.imu.get().filter(|imu| is_sound(imu)), input.wheels.get()) else {
            return;
        };
        for (stamp, reading) in readings(core::slice::from_ref(imu), wheels, &mut self.taken) {
            self.car.take(stamp, reading);
        }
        let stamp = imu.stamp;
        let lateral_accel_mps2 = self.roll.take(stamp, imu.accel_mps2[1], imu.gyro_radps[0]);
        let told = input.matches.newest().and_then(|found| {
            let age_s = (stamp - found.stamp).as_secs();
            let is_lost = age_s > self.keys.lost_after_s;
            let moved = self.car.between(found.stamp, stamp).filter(|_| !is_lost)?;
            Some((found, age_s, moved))
        });
        let Some((found, age_s, moved)) = told else {
            out.quality.send(PoseQuality { stamp, ..PoseQuality::default() });
            return;
        };
        let map_from_ego = pose_of(found.at_m, found.heading_rad) * moved;
        let at = map_from_ego.translation.vector;
        let state = EgoState {
            stamp,
            pose: Pose2::new(at.x, at.y, yaw_rad(&map_from_ego.rotation)),
            speed_mps: self.car.speed_mps(),
            accel_mps2: imu.accel_mps2[0],
            lateral_accel_mps2,
            yaw_rate_radps: imu.gyro_radps[2],
            steering_rad: wheels.last().map_or(0.0, |wheels| wheels.steering_rad),
        };
        out.local.send(self.odometer.advance(&state, imu.gyro_radps[0]));
        out.state.send(state);
        let mode = if age_s > self.keys.coasting_after_s { PoseMode::Coasting } else { PoseMode::Good };
        let [xx, xy, yy] = found.covariance_m2;
        let (drift_m, drift_rad) = (DRIFT * moved.translation.vector.norm(), DRIFT_RADPS * age_s);
        let grown_m2 = drift_m * drift_m;
        let heading = found.heading_sigma_rad * found.heading_sigma_rad + drift_rad * drift_rad;
        let covariance = [xx + grown_m2, xy, yy + grown_m2, 0.0, 0.0, heading];
        out.quality.send(PoseQuality { stamp, mode, covariance });
    }
}
