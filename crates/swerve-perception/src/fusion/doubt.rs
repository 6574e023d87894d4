//! Score reduction of a person detected by the camera where the lidar measures free space.

use swerve_geom::{Ego, Obb, Pose2, Vector2};
use swerve_msg::DetectedBox;

use super::object::Object;
use super::params::Params;
use super::place::polar;

/// Distance from a lidar box within which an object may be merged with it, and from the line of sight within which a
/// lidar box may hide an object, metres.
const BESIDE_M: f64 = 1.0;

/// Distance from a vehicle within which the lidar cannot separate a person from it, metres.
const MERGED_M: f64 = 0.3;

/// Score above which a detector's scores are not calibrated: few boxes that it finds in thousands of images are false
/// with more.
const SURE: f64 = 0.99;

/// Camera-only person with the score conditioned on a lidar sweep that could have detected it but did not (Bayes): the
/// lidar misses a share of the people present, and has no detection where there are none. The same holds for a person
/// inside of a vehicle's box, whose corners look like people. `measured` holds the lidar objects, if there is a lidar.
pub(super) fn doubted(seen: &Object, measured: Option<&[Object]>, params: &Params) -> Object {
    let Some(measured) = measured else { return *seen };
    let (bearing_rad, range_m) = polar(Vector2::new(seen.found.pose.x_m, seen.found.pose.y_m));
    // Up to two standard deviations of the distance beyond the object.
    let reach_m = range_m + 2.0 * seen.spread.deviation_m(bearing_rad);
    let middle = Vector2::<Ego>::from_heading(bearing_rad) * (0.5 * reach_m);
    let sight = Obb::new(Pose2::new(middle.x, middle.y, bearing_rad), reach_m, 2.0 * BESIDE_M);
    let is_free = !measured.iter().any(|other| sight.overlaps(&footprint(&other.found)));
    let is_inside = |other: &Object| {
        other.is_vehicle() && footprint(&other.found).grown(MERGED_M).contains(seen.found.pose.point())
    };
    let is_doubtful = is_free || measured.iter().any(is_inside);
    if !seen.found.kind.is_person() || range_m > params.lidar_sure_m || !is_doubtful {
        return *seen;
    }
    let before = seen.found.score.min(SURE);
    let there = before * params.lidar_miss;
    let score = there / (there + 1.0 - before);
    Object { found: DetectedBox { score, ..seen.found }, ..*seen }
}

/// Ground covered by a box.
fn footprint(found: &DetectedBox) -> Obb<Ego> {
    Obb::new(found.pose, found.extent.length_m, found.extent.width_m)
}
