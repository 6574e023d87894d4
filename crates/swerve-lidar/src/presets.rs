//! Lidar presets. Angles, columns and ranges are from public data sheets; values missing there are round numbers
//! typical of the class of sensor, so the presets are similar to the products, not exact.

use std::str::FromStr;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::spec::{Beam, LidarSpec};

/// Lidar preset.
#[derive(
    Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Default, Serialize, Deserialize, JsonSchema,
)]
#[serde(try_from = "String", into = "&'static str")]
pub enum LidarPreset {
    /// Like Velodyne's VLP-32C: 32 beams from -25 to 15 degrees, dense around the horizon, 1800 columns at 10 Hz.
    #[default]
    Vlp32,
    /// Like Velodyne's HDL-64E: two blocks of 32 beams from -24.3 to 2 degrees, 2083 columns at 10 Hz.
    Hdl64,
    /// Like Ouster's OS1-64 (first generation): 64 even beams from -16.6 to 16.6 degrees, 2048 columns at 10 Hz.
    Os1,
}

/// Error of an unknown lidar name.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("unknown lidar `{asked}`; the lidars are vlp_32, hdl_64, os1_64 (or os1)")]
pub struct UnknownLidar {
    /// Requested name.
    pub asked: String,
}

/// Elevation and azimuth offset of each laser of a VLP-32C, degrees, from the lowest up: VLP-32C User Manual (Velodyne
/// 63-9325), table of laser angles, which lists them in firing order. Azimuth is clockwise in the manual.
const VLP_32C_DEG: [[f64; 2]; 32] = [
    [-25.0, 1.4],
    [-15.639, -1.4],
    [-11.31, 1.4],
    [-8.843, -1.4],
    [-7.254, 1.4],
    [-6.148, -1.4],
    [-5.333, 4.2],
    [-4.667, 1.4],
    [-4.0, -1.4],
    [-3.667, -4.2],
    [-3.333, 4.2],
    [-3.0, 1.4],
    [-2.667, -1.4],
    [-2.333, -4.2],
    [-2.0, 4.2],
    [-1.667, 1.4],
    [-1.333, -1.4],
    [-1.0, -4.2],
    [-0.667, 4.2],
    [-0.333, 1.4],
    [0.0, -1.4],
    [0.333, -4.2],
    [0.667, 4.2],
    [1.0, 1.4],
    [1.333, -1.4],
    [1.667, -4.2],
    [2.333, 1.4],
    [3.333, -1.4],
    [4.667, 1.4],
    [7.0, -1.4],
    [10.333, 1.4],
    [15.0, -1.4],
];

/// Azimuth offsets of an OS1-64's beams, degrees, clockwise, repeating from the highest beam down: metadata reported by
/// the sensor.
const OS1_AZIMUTH_DEG: [f64; 4] = [3.164, 1.055, -1.055, -3.164];
/// Elevation of an OS1-64's highest beam, degrees; the others are evenly spaced down to the same angle below the
/// horizon.
const OS1_HIGHEST_DEG: f64 = 16.611;

fn beam(elevation_deg: f64, clockwise_deg: f64) -> Beam {
    Beam { elevation_rad: elevation_deg.to_radians(), azimuth_rad: -clockwise_deg.to_radians() }
}

impl LidarPreset {
    /// All presets.
    pub const ALL: [Self; 3] = [Self::Vlp32, Self::Hdl64, Self::Os1];

    /// Name in configurations.
    pub fn name(self) -> &'static str {
        match self {
            Self::Vlp32 => "vlp_32",
            Self::Hdl64 => "hdl_64",
            Self::Os1 => "os1_64",
        }
    }

    /// Beams, from the lowest to the highest.
    pub fn beams(self) -> Vec<Beam> {
        match self {
            Self::Vlp32 => VLP_32C_DEG.iter().map(|&[elevation, azimuth]| beam(elevation, azimuth)).collect(),
            // HDL-64E S2 manual: the upper block from 2 degrees down in thirds, the lower from -8 5/6 in halves.
            Self::Hdl64 => {
                let lower = (0..32).map(|k| beam(-24.0 - 1.0 / 3.0 + 0.5 * f64::from(k), 0.0));
                let upper = (0..32).map(|k| beam(-8.0 - 1.0 / 3.0 + f64::from(k) / 3.0, 0.0));
                lower.chain(upper).collect()
            }
            Self::Os1 => (0..64_u32)
                .rev()
                .map(|from_top| {
                    let elevation = OS1_HIGHEST_DEG * (1.0 - f64::from(from_top) * 2.0 / 63.0);
                    beam(elevation, OS1_AZIMUTH_DEG[from_top as usize % 4])
                })
                .collect(),
        }
    }

    /// Full specification.
    pub fn spec(self) -> LidarSpec {
        // Columns at 10 Hz; smallest range, largest range, range of a 10 % target; sigma, step.
        let (columns, [near, far, reach], [sigma, step]) = match self {
            Self::Vlp32 => (1800, [1.0, 200.0, 100.0], [0.03, 0.004]),
            Self::Hdl64 => (2083, [0.9, 120.0, 50.0], [0.02, 0.002]),
            Self::Os1 => (2048, [0.8, 120.0, 40.0], [0.02, 0.003]),
        };
        LidarSpec {
            beams: self.beams(),
            columns,
            rate_hz: 10.0,
            first_azimuth_rad: core::f64::consts::PI,
            is_clockwise: true,
            range_min_m: near,
            range_max_m: far,
            reach_m: reach,
            range_sigma_m: sigma,
            range_step_m: step,
            dropout: 0.003,
            intensity_full_m: 10.0,
            seed: 0,
        }
    }
}

impl From<LidarPreset> for &'static str {
    fn from(preset: LidarPreset) -> Self {
        preset.name()
    }
}

impl FromStr for LidarPreset {
    type Err = UnknownLidar;

    fn from_str(text: &str) -> Result<Self, UnknownLidar> {
        if text == "os1" {
            return Ok(Self::Os1);
        }
        let named = Self::ALL.into_iter().find(|preset| preset.name() == text);
        named.ok_or_else(|| UnknownLidar { asked: text.to_owned() })
    }
}

impl TryFrom<String> for LidarPreset {
    type Error = UnknownLidar;

    fn try_from(text: String) -> Result<Self, UnknownLidar> {
        text.parse()
    }
}

impl Default for LidarSpec {
    fn default() -> Self {
        LidarPreset::default().spec()
    }
}
