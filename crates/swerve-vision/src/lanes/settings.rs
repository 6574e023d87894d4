//! Settings of lane detection.

use swerve_core::param::{ParamError, Ranges, require};

/// Method of detecting lane markings.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Method {
    /// Edges (Canny, PAMI 1986) on two straight lines (Hough; Duda and Hart, CACM 1972).
    Hough,
    /// Strips of paint width that are brighter than both neighbours and align along the road.
    #[default]
    Ridge,
}

impl Method {
    /// All methods.
    pub const ALL: [Self; 2] = [Self::Hough, Self::Ridge];

    /// Name of the method.
    pub fn name(self) -> &'static str {
        ["hough", "ridge"][self as usize]
    }
}

/// Interval of the pitch relative to the mounting that is searched with marks of one width.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(super) struct Band {
    /// Middle, radians.
    pub(super) middle_rad: f64,
    /// Distance from the middle to either end, radians.
    pub(super) half_rad: f64,
}

impl Band {
    /// Largest half of a band, radians.
    const HALF_MAX_RAD: f64 = 0.015;

    /// Adjacent bands of equal size that cover the pitch up to `most_rad` to either side, from the middle outwards.
    pub(super) fn all(most_rad: f64) -> impl Iterator<Item = Self> {
        let aside = (0.5 * (most_rad / Self::HALF_MAX_RAD - 1.0 - 1e-9)).ceil().max(0.0) as i32;
        let half_rad = most_rad / f64::from(2 * aside + 1);
        let of = move |k: i32| Self { middle_rad: 2.0 * half_rad * f64::from(k), half_rad };
        (0..=2 * aside).map(move |k| of(if k % 2 == 0 { k / 2 } else { -(k / 2 + 1) }))
    }

    /// Returns true if a pitch is in the band.
    pub(super) fn contains(&self, pitch_rad: f64) -> bool {
        (pitch_rad - self.middle_rad).abs() <= self.half_rad
    }
}

/// Settings of lane detection.
#[derive(Clone, Copy, PartialEq, Debug, Ranges)]
pub struct LaneSettings {
    /// Detection method.
    pub method: Method,
    /// Width of a painted line, metres.
    #[schemars(range(min = 0.02, max = 1.0))]
    pub mark_m: f64,
    /// Detection range from the camera, metres. A longer range detects curves earlier, from fewer pixels.
    #[schemars(range(min = 10.0, max = 200.0))]
    pub reach_m: f64,
    /// Standard deviation of the pitch relative to the mounting, radians; the search covers three of them.
    #[schemars(range(min = 1e-4, max = 0.05))]
    pub pitch_deviation_rad: f64,
    /// Narrowest and widest lane, metres.
    pub width_m: [f64; 2],
}

impl Default for LaneSettings {
    fn default() -> Self {
        Self {
            method: Method::default(),
            mark_m: 0.15,
            reach_m: 50.0,
            pitch_deviation_rad: 0.015,
            width_m: [2.4, 4.8],
        }
    }
}

impl LaneSettings {
    /// Standard deviation of the pitch of a camera whose mounting is only known to look ahead, radians: the search covers
    /// 6 degrees to either side.
    pub const PITCH_UNKNOWN_RAD: f64 = 0.035;

    /// Checks that all values are in range.
    ///
    /// # Errors
    /// The first value out of range.
    pub fn validate(&self) -> Result<(), ParamError> {
        let [narrow, wide] = self.width_m;
        self.check_ranges()?;
        require("width_m", narrow, (1.0..=20.0).contains(&narrow), "a narrowest lane of 1 to 20 m")?;
        require(
            "width_m",
            wide,
            wide > narrow && wide <= 20.0,
            "a widest lane beyond the narrowest, at most 20 m",
        )
    }
}
