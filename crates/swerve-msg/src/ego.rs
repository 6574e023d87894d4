use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::Pose2;

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

/// One reading of the inertial measurement unit at the centre of gravity, axes of the ego frame.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Imu {
    /// Instant of the measurement.
    pub stamp: Time,
    /// Specific force (acceleration minus gravity): at rest on level ground z reads +9.81, m/s².
    pub accel_mps2: [f64; 3],
    /// Angular rate, rad/s.
    pub gyro_radps: [f64; 3],
}

/// One satellite fix of the ego origin, WGS 84.
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
