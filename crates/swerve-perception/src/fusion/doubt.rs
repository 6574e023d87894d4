//! Score reduction of a person detected by the camera where the lidar measures free space.

use swerve_geom::{angle_between, math};
use swerve_msg::DetectedBox;

use super::object::Object;
use super::params::Params;

/// Bearing margin around a lidar box within which an object may be hidden by it or merged with it, radians.
const BESIDE_RAD: f64 = 0.1;

/// Camera-only person with the score conditioned on a lidar sweep that could have detected it but did not (Bayes): the
/// lidar misses a share of the people present, and has no detection where there are none. `measured` holds the lidar
/// objects, if there is a lidar.
pub(super) fn doubted(seen: &Object, measured: Option<&[Object]>, params: &Params) -> Object {
    let Some(measured) = measured else { return *seen };
    let (range_m, bearing_rad) = polar(&seen.found);
    let is_free = !measured.iter().any(|other| may_hide(&other.found, range_m, bearing_rad));
    if !seen.found.kind.is_person() || range_m > params.lidar_sure_m || !is_free {
        return *seen;
    }
    let there = seen.found.score * params.lidar_miss;
    let score = there / (there + 1.0 - seen.found.score).max(f64::MIN_POSITIVE);
    Object { found: DetectedBox { score, ..seen.found }, ..*seen }
}

/// Distance and bearing of a box's centre.
fn polar(found: &DetectedBox) -> (f64, f64) {
    let (x, y) = (found.pose.x_m, found.pose.y_m);
    (math::hypot(x, y), math::atan2(y, x))
}

/// Returns true if a lidar box may hide a position or contain its points.
fn may_hide(other: &DetectedBox, range_m: f64, bearing_rad: f64) -> bool {
    let (box_m, box_rad) = polar(other);
    let radius_m = 0.5 * math::hypot(other.extent.length_m, other.extent.width_m);
    let half_rad = math::atan2(radius_m, (box_m - radius_m).max(0.1)) + BESIDE_RAD;
    box_m - radius_m < range_m + radius_m && angle_between(bearing_rad, box_rad).abs() < half_rad
}
