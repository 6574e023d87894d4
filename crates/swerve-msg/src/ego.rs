//! State of the ego vehicle and its inertial and satellite measurements.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Pose2, Vector2, math};

/// The ego vehicle as localization reports it.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct EgoState {
    /// Instant that this describes.
    pub stamp: Time,
    /// Pose of the ego origin (centre of the rear axle on the ground) in the map.
    pub pose: Pose2,
    /// Speed of the ego origin along its heading, m/s; negative in reverse.
    pub speed_mps: f64,
    /// Acceleration of the ego origin along its heading, m/s².
    pub accel_mps2: f64,
    /// Lateral acceleration at the centre of gravity, m/s²; positive to the left.
    pub lateral_accel_mps2: f64,
    /// Yaw rate, rad/s; positive to the left.
    pub yaw_rate_radps: f64,
    /// Present angle of the front road wheels, radians; positive to the left.
    pub steering_rad: f64,
}

impl EgoState {
    /// Extrapolates the pose by `dt_s` (may be negative) along the arc given by speed and yaw rate.
    pub fn pose_after(&self, dt_s: f64) -> Pose2 {
        let heading_rad = self.pose.heading_rad + self.yaw_rate_radps * dt_s;
        let (sin, cos) = math::sin_cos(self.pose.heading_rad + 0.5 * self.yaw_rate_radps * dt_s);
        let way_m = self.speed_mps * dt_s;
        Pose2::new(self.pose.x_m + way_m * cos, self.pose.y_m + way_m * sin, heading_rad)
    }

    /// True if a moving car repeats the values of the previous state under a new stamp: its publisher hangs.
    pub fn repeats(&self, before: &Self) -> bool {
        self.speed_mps.abs() >= MOVES_MPS && Self { stamp: before.stamp, ..*self } == *before
    }

    /// Returns true if all values are finite and physically possible for a road vehicle.
    pub fn is_plausible(&self) -> bool {
        let Self { pose, speed_mps, accel_mps2, lateral_accel_mps2, yaw_rate_radps, steering_rad, .. } =
            *self;
        let within = [
            (speed_mps, SPEED_MAX_MPS),
            (accel_mps2, 500.0),
            (lateral_accel_mps2, 500.0),
            (yaw_rate_radps, 100.0),
            (steering_rad, 10.0),
        ];
        is_plausible_place(&pose) && within.into_iter().all(|(x, most)| x.abs() <= most)
    }
}

/// Speed from which the values of consecutive states must differ, m/s.
const MOVES_MPS: f64 = 0.1;

/// Highest plausible speed on a road, m/s.
const SPEED_MAX_MPS: f64 = 150.0;
/// Largest plausible distance from the map origin, metres.
const PLACE_MAX_M: f64 = 1e7;

/// Returns true if a pose is finite and within the bounds of a map.
pub(crate) fn is_plausible_place(pose: &Pose2) -> bool {
    pose.x_m.abs() <= PLACE_MAX_M && pose.y_m.abs() <= PLACE_MAX_M && pose.heading_rad.is_finite()
}

/// Returns true if a velocity is finite and plausible on a road.
pub(crate) fn is_plausible_velocity(velocity_mps: &Vector2) -> bool {
    velocity_mps.norm() <= SPEED_MAX_MPS
}

/// One measurement of the inertial measurement unit, at its mounting position, in the axes of the ego frame.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Imu {
    /// Instant of the measurement.
    pub stamp: Time,
    /// Specific force (acceleration minus gravity): at rest on level ground z reads +9.81, m/s².
    pub accel_mps2: [f64; 3],
    /// Angular rate, rad/s.
    pub gyro_radps: [f64; 3],
}

/// One satellite fix of the receiver's antenna, WGS 84.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Gnss {
    /// Instant of the measurement.
    pub stamp: Time,
    /// Latitude, degrees north.
    pub latitude_deg: f64,
    /// Longitude, degrees east.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, metres.
    pub altitude_m: f64,
    /// Standard deviation of the horizontal position, metres.
    pub deviation_m: f64,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pose_extrapolation_follows_the_arc() {
        let ego = EgoState { speed_mps: 10.0, yaw_rate_radps: 0.5, ..EgoState::default() };
        let later = ego.pose_after(0.2);
        // Radius 20 m, 0.1 rad.
        let exact = [20.0 * math::sin(0.1), 20.0 * (1.0 - math::cos(0.1)), 0.1];
        for (a, b) in [later.x_m, later.y_m, later.heading_rad].into_iter().zip(exact) {
            assert!((a - b).abs() < 1e-3, "{later:?}");
        }
        assert_eq!(ego.pose_after(0.0), ego.pose);
    }
}
