//! Sensors of the ego without tables of their own, `[sensing]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_localization::flat::Origin;
use swerve_sim::sense::{GnssParams, ImuParams, PoseParams, SensorMount, WheelOdometryParams};

/// Source of the obstacle sensor's objects.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// Simulator state limited by range, field of view and occlusion.
    Truth,
    /// Simulator state limited by range and field of view only.
    TruthUnoccluded,
}

/// The sensors.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct SensingConfig {
    /// Source of the obstacle sensor's objects.
    pub source: Source,
    /// Period of the obstacle sensor, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub period_ms: f64,
    /// Range of the obstacle sensor from the ego's centre, m.
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub range_m: f64,
    /// Field of view of the obstacle sensor, degrees, symmetric around straight ahead.
    #[schemars(range(min = 1.0, max = 360.0))]
    pub fov_deg: f64,
    /// Range of the obstacle sensor for people, m; `range_m` when absent.
    #[schemars(range(min = 0.1, max = 10_000.0))]
    pub range_person_m: Option<f64>,
    /// Mount of the obstacle sensor; the middle of the roof, 1.9 m up or 0.1 m above a higher roof, when absent.
    #[ranges(nested)]
    pub mount: Option<SensorMount>,
    /// Actors of the scenario that no sensor sees: neither the obstacle sensor, also before an emulated detector, nor
    /// cameras, lidars and radars. Physics, triggers and metrics still have them.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub unseen: Vec<String>,
    /// Detects traffic lights of the scenario as the obstacle sensor detects actors, and stops at red ones; an operator
    /// of the kind `traffic_lights` replaces the sensor. When absent with the planning preset `best`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub traffic_lights: Option<bool>,
    /// Period of the pose sensor, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub pose_period_ms: f64,
    /// Period of the inertial sensor, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub imu_period_ms: f64,
    /// Period of the satellite receiver, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub gnss_period_ms: f64,
    /// Period of the wheel odometry, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub odometry_period_ms: f64,
    /// Errors of the pose sensor.
    #[ranges(nested)]
    pub pose: PoseParams,
    /// Errors of the inertial sensor.
    #[ranges(nested)]
    pub imu: ImuParams,
    /// Errors of the satellite receiver.
    #[ranges(nested)]
    pub gnss: GnssParams,
    /// Wheel encoders and their errors.
    #[ranges(nested)]
    pub odometry: WheelOdometryParams,
}

impl SensingConfig {
    /// Origin of the map, for satellite fixes.
    pub fn map_origin(&self) -> Origin {
        Origin {
            latitude_deg: self.gnss.origin_latitude_deg,
            longitude_deg: self.gnss.origin_longitude_deg,
            altitude_m: self.gnss.origin_altitude_m,
        }
    }
}

impl Default for SensingConfig {
    fn default() -> Self {
        Self {
            source: Source::Truth,
            period_ms: 50.0,
            range_m: 100.0,
            fov_deg: 360.0,
            range_person_m: None,
            mount: None,
            unseen: Vec::new(),
            traffic_lights: None,
            pose_period_ms: 10.0,
            imu_period_ms: 10.0,
            gnss_period_ms: 100.0,
            odometry_period_ms: 20.0,
            pose: PoseParams::default(),
            imu: ImuParams::default(),
            gnss: GnssParams::default(),
            odometry: WheelOdometryParams::default(),
        }
    }
}
