//! Lane lines detected by a camera.

use serde::{Deserialize, Serialize};
use swerve_core::Time;

/// Lines of the ego's lane as detected by a camera.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Lanes {
    /// Instant of the image.
    pub stamp: Time,
    /// Line to the left of the ego.
    pub left: Option<LaneLine>,
    /// Line to the right of the ego.
    pub right: Option<LaneLine>,
    /// Pitch of the camera relative to its mounting, radians; positive downwards, zero without lines.
    pub pitch_rad: f64,
}

/// A painted line on flat ground: `y = c0 + c1 x + c2 x²` in the ego frame, metres, within `seen_m`.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct LaneLine {
    /// `c0` (m), `c1`, `c2` (1/m).
    pub coefficients: [f64; 3],
    /// Covariance of the coefficients.
    pub covariance: [[f64; 3]; 3],
    /// `x` of the nearest and farthest detected point, metres.
    pub seen_m: [f64; 2],
}

/// Approximate spacing of the points of a drawn line, metres.
const STEP_M: f64 = 1.0;

impl LaneLine {
    /// Points along the detected part of the line in the ego frame, metres.
    pub fn places(&self) -> impl Iterator<Item = [f64; 2]> + use<> {
        let ([c0, c1, c2], [from, to]) = (self.coefficients, self.seen_m);
        let n = ((to - from) / STEP_M).clamp(1.0, 1000.0) as usize;
        (0..=n).map(move |k| {
            let x_m = from + (to - from) * k as f64 / n as f64;
            [x_m, c0 + x_m * (c1 + x_m * c2)]
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lane_line_points_cover_exactly_the_detected_part() {
        let line = LaneLine { coefficients: [1.0, 0.1, 0.01], seen_m: [4.0, 10.5], ..LaneLine::default() };
        let places: Vec<_> = line.places().collect();
        assert_eq!((places.len(), places[0][0], places[6][0]), (7, 4.0, 10.5));
        assert!((places[6][1] - (1.0 + 1.05 + 1.1025)).abs() < 1e-12, "{places:?}");
        let broken = LaneLine { seen_m: [f64::NAN, 1.0], ..line };
        assert_eq!(broken.places().count(), 1);
    }
}
