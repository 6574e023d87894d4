//! Size of a road user with the error of its position.

use swerve_geom::math;
use swerve_msg::Prediction;

/// Length and width of a road user at the `k`-th pose of its path, with one standard deviation of the position added on
/// each side. The last covariance also holds for later poses.
pub(super) fn sizes_m(one: &Prediction, k: usize) -> [f64; 2] {
    let (length_m, width_m) = (one.extent.length_m, one.extent.width_m);
    let covariances_m2 = &one.covariances_m2;
    let Some([xx, xy, yy]) = covariances_m2.get(k).or(covariances_m2.last()) else {
        return [length_m, width_m];
    };
    let (sin, cos) = math::sin_cos(one.path[k].pose.heading_rad);
    let along_m2 = xx * cos * cos + 2.0 * xy * sin * cos + yy * sin * sin;
    let across_m2 = xx * sin * sin - 2.0 * xy * sin * cos + yy * cos * cos;
    [length_m + 2.0 * along_m2.max(0.0).sqrt(), width_m + 2.0 * across_m2.max(0.0).sqrt()]
}
