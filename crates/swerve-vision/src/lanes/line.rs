//! Lane lines, and the marks from which they are fitted.

/// Painted line beside the ego: `y = c0 + c1 x + c2 x²` in the ego frame, metres, valid where it was observed.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LaneLine {
    /// `c0` (m), `c1`, `c2` (1/m).
    pub coefficients: [f64; 3],
    /// Covariance of the coefficients.
    pub covariance: [[f64; 3]; 3],
    /// `x` of the nearest and of the farthest observed mark, metres; there may be gaps in between.
    pub seen_m: [f64; 2],
}

impl LaneLine {
    /// Lateral position at `x_m` ahead of the ego's origin and its standard deviation, metres; `None` outside the
    /// observed range.
    pub fn at(&self, x_m: f64) -> Option<(f64, f64)> {
        let powers = [1.0, x_m, x_m * x_m];
        let is_seen = self.seen_m[0] <= x_m && x_m <= self.seen_m[1];
        is_seen.then(|| {
            let y_m = (0..3).map(|k| self.coefficients[k] * powers[k]).sum();
            let terms = (0..9).map(|k| powers[k / 3] * self.covariance[k / 3][k % 3] * powers[k % 3]);
            (y_m, terms.sum::<f64>().max(0.0).sqrt())
        })
    }
}

/// Lane lines detected in one image.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Lanes {
    /// Line on the ego's left.
    pub left: Option<LaneLine>,
    /// Line on the ego's right.
    pub right: Option<LaneLine>,
    /// Estimated pitch relative to the mounting, radians, positive down; zero without lines.
    pub pitch_rad: f64,
}

/// Contrast above which all marks have full weight, grey levels.
const CONTRAST_FULL: f64 = 100.0;

/// Piece of paint in one row of the level view, as the slopes of its ray: left and down per metre ahead.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Mark {
    pub(super) left: f64,
    pub(super) down: f64,
    /// Contrast with its surroundings, grey levels of 255.
    pub(super) contrast: f64,
}

impl Mark {
    /// Weight of the mark; higher contrast is more likely paint.
    pub(super) fn weight(&self) -> f64 {
        (self.contrast / CONTRAST_FULL).min(1.0)
    }

    /// Position on the road, for a camera at `height_m` pitched down relative to its mounting by an angle of this sine
    /// and cosine: metres ahead of the camera and to its left; `None` above the horizon.
    pub(super) fn on_road(&self, height_m: f64, [sin, cos]: [f64; 2]) -> Option<[f64; 2]> {
        let ahead = cos - self.down * sin;
        let down = self.down * cos + sin;
        (down > 0.0 && ahead > 0.0).then(|| [height_m * ahead / down, height_m * self.left / down])
    }
}
