//! What it says of a person in the camera's image that the lidar finds nothing there.

use swerve_geom::{angle_between, math};
use swerve_msg::DetectedBox;

use super::{Object, Params};

/// Bearings within this of a lidar's box may be hidden by it, or its points be one with it, radians.
const BESIDE_RAD: f64 = 0.1;

/// A person whom the camera alone sees, as likely as that is after a lidar that looked there and found nothing (Bayes):
/// it misses a share of those who are there, and finds nothing where nobody is. `measured` is what it found, if it is there.
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

/// Distance and bearing of a box's middle.
fn polar(found: &DetectedBox) -> (f64, f64) {
    let (x, y) = (found.pose.x_m, found.pose.y_m);
    (math::hypot(x, y), math::atan2(y, x))
}

/// Whether a lidar's box may hide what is at a place, or hold its points.
fn may_hide(other: &DetectedBox, range_m: f64, bearing_rad: f64) -> bool {
    let (box_m, box_rad) = polar(other);
    let radius_m = 0.5 * math::hypot(other.extent.length_m, other.extent.width_m);
    let half_rad = math::atan2(radius_m, (box_m - radius_m).max(0.1)) + BESIDE_RAD;
    box_m - radius_m < range_m + radius_m && angle_between(bearing_rad, box_rad).abs() < half_rad
}
