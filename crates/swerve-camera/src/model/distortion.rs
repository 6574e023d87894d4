//! Lens distortion after Brown (1966) and Conrady, with coefficients in OpenCV's order.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;

/// Radial (`k1`, `k2`, `k3`) and tangential (`p1`, `p2`) distortion coefficients; all zero for an ideal lens.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(default, deny_unknown_fields)]
pub struct Distortion {
    /// Radial distortion coefficient, second power of the radius.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub k1: f64,
    /// Radial distortion coefficient, fourth power of the radius.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub k2: f64,
    /// Tangential distortion coefficient, vertical.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub p1: f64,
    /// Tangential distortion coefficient, horizontal.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub p2: f64,
    /// Radial distortion coefficient, sixth power of the radius.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub k3: f64,
}

/// Most Newton steps for inverting the model; each doubles the number of correct digits, so few are needed.
const STEPS_MAX: usize = 50;

impl Distortion {
    /// Returns true for an undistorted lens.
    pub fn is_none(&self) -> bool {
        self.coefficients() == [0.0; 5]
    }

    /// Coefficients in the order of calibration messages: `[k1, k2, p1, p2, k3]`.
    pub fn coefficients(&self) -> [f64; 5] {
        [self.k1, self.k2, self.p1, self.p2, self.k3]
    }

    /// Distorts a ray: `(x/z, y/z)` to the same of the image point.
    pub(crate) fn distort(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        [
            x * radial + 2.0 * self.p1 * x * y + self.p2 * (r2 + 2.0 * x * x),
            y * radial + self.p1 * (r2 + 2.0 * y * y) + 2.0 * self.p2 * x * y,
        ]
    }

    /// Undistorts an image point: Newton's method, damped, on [`Self::distort`].
    ///
    /// If no ray maps to the point, returns the best approximation found.
    pub(crate) fn undistort(&self, image: [f64; 2]) -> [f64; 2] {
        if self.is_none() {
            return image;
        }
        let miss = |ray: [f64; 2]| {
            let [x, y] = self.distort(ray);
            [x - image[0], y - image[1]]
        };
        let size = |v: [f64; 2]| v[0] * v[0] + v[1] * v[1];
        let mut ray = image;
        let mut error = miss(ray);
        for _ in 0..STEPS_MAX {
            let [[a, b], [c, d]] = self.jacobian(ray);
            let determinant = a * d - b * c;
            if size(error) < 1e-24 || determinant.abs() < 1e-9 {
                break;
            }
            let step =
                [(d * error[0] - b * error[1]) / determinant, (a * error[1] - c * error[0]) / determinant];
            let mut share = 1.0;
            let (mut next, mut next_error) = (ray, error);
            while share > 1e-3 {
                next = [ray[0] - share * step[0], ray[1] - share * step[1]];
                next_error = miss(next);
                if size(next_error) < size(error) {
                    break;
                }
                share *= 0.5;
            }
            if size(next_error) >= size(error) {
                break;
            }
            (ray, error) = (next, next_error);
        }
        ray
    }

    /// Derivatives of [`Self::distort`].
    fn jacobian(&self, [x, y]: [f64; 2]) -> [[f64; 2]; 2] {
        let r2 = x * x + y * y;
        let radial = 1.0 + r2 * (self.k1 + r2 * (self.k2 + r2 * self.k3));
        let slope = self.k1 + r2 * (2.0 * self.k2 + 3.0 * r2 * self.k3);
        let cross = 2.0 * x * y * slope + 2.0 * self.p1 * x + 2.0 * self.p2 * y;
        [
            [radial + 2.0 * x * x * slope + 2.0 * self.p1 * y + 6.0 * self.p2 * x, cross],
            [cross, radial + 2.0 * y * y * slope + 6.0 * self.p1 * y + 2.0 * self.p2 * x],
        ]
    }
}
