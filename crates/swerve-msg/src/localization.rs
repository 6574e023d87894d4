use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// Place and heading of the ego by what a lidar sees: on a map, or on from its own turns before.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseMatch {
    /// Instant that this describes: the end of the turn.
    pub stamp: Time,
    /// Ego origin in the map, metres.
    pub at_m: [f64; 3],
    /// Heading, radians.
    pub heading_rad: f64,
    /// Covariance of the place on the ground: xx, xy, yy, m². Along a direction in which nothing was seen it is large.
    pub covariance_m2: [f64; 3],
    /// Standard deviation of the height, metres.
    pub height_sigma_m: f64,
    /// Standard deviation of the heading, radians.
    pub heading_sigma_rad: f64,
}

/// How good the pose is that localization tells.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PoseQuality {
    /// Instant that this describes.
    pub stamp: Time,
    /// Whether it can be driven by.
    pub mode: PoseMode,
    /// Covariance of x (m), y (m) and heading (rad): xx, xy, yy, xh, yh, hh.
    pub covariance: [f64; 6],
}

/// Whether a pose can be driven by; the worse the greater.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PoseMode {
    /// What tells the place comes and is believed.
    Good,
    /// By inertia and wheels alone for now.
    Coasting,
    /// Not to be driven by: no pose is told.
    #[default]
    Lost,
}

impl PoseQuality {
    /// Standard deviation of the place on the ground along its worst direction, metres.
    pub fn sigma_m(&self) -> f64 {
        let [xx, xy, yy, ..] = self.covariance;
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        (mean + (half * half + xy * xy).sqrt()).max(0.0).sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_worst_direction_counts() {
        // 0.3 m along the diagonal, 0.1 m across it.
        let covariance = [0.05, 0.04, 0.05, 0.0, 0.0, 1e-4];
        let quality = PoseQuality { covariance, ..PoseQuality::default() };
        assert!((quality.sigma_m() - 0.3).abs() < 1e-12, "{}", quality.sigma_m());
    }
}
