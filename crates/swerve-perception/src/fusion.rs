//! Fusion of camera, lidar and radar detections into one list of objects.
//!
//! Each sensor contributes its strength: the camera the class, the lidar the position and size, the radar the radial
//! speed. A camera box and a lidar box are the same object if they overlap in the image or, without an image box, if
//! they are within each other's errors; those of a camera are large along the line of sight and small across it.
//! Objects seen by one sensor only are kept with the errors of that sensor, so that a blind sensor reduces accuracy but
//! loses no object. A radar echo is assigned to the object at its direction and distance; it does not create an object.
//!
//! Sensors measure at different instants: boxes are moved to the latest instant with the ego motion, and their errors
//! grow by the possible motion of the object. Each position is reported once: a lidar sweep that an earlier list
//! already contained lends its size to newer camera boxes, and a camera box its class to the next lidar sweep.
//! Reporting a position twice would make the object appear stationary.

mod doubt;
mod object;
mod params;
mod place;
mod radar;
mod sight;
#[cfg(test)]
mod tests;

use swerve_core::Time;
use swerve_geom::{Map, Pose2, heaviest_pairs, image_iou};
use swerve_msg::{DetectedBox, Detections};

use crate::bound::surest;
use doubt::doubted;
use object::Object;
use place::{Spread, by_depth, moved};

pub use params::Params;
pub use radar::Echoes;
pub use sight::{CameraSight, Sighted};

/// Latest detections of each sensor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sources<'a> {
    /// Camera detections.
    pub camera: Option<CameraSight<'a>>,
    /// Lidar detections.
    pub lidar: Option<Sighted<'a>>,
    /// Radar echoes.
    pub radar: Option<Echoes<'a>>,
}

/// Gate of the squared Mahalanobis distance between boxes of the same object: 99 % (chi-squared, two degrees of
/// freedom).
const GATE: f64 = 9.21;

/// Fuses detections into objects by falling score, in the ego frame of the latest boxes, each with its covariance;
/// `None` without boxes.
///
/// Ignores non-finite boxes; if a source has more than [`BOXES_MAX`](crate::image_plane::BOXES_MAX), uses those with
/// the highest scores.
pub fn fuse(sources: &Sources<'_>, params: &Params) -> Option<Detections> {
    let camera = sources.camera.as_ref().map(|camera| camera.boxes);
    let (stamp, ego) = newest([camera, sources.lidar])?;
    let at = (stamp, ego);
    let seen = sources.camera.iter().flat_map(|sight| camera_objects(sight, at, params)).collect::<Vec<_>>();
    let measured =
        sources.lidar.iter().flat_map(|sight| lidar_objects(sight, at, params)).collect::<Vec<_>>();
    let pairs = pair(&seen, &measured, sources, ego, params);
    let mut objects = Vec::with_capacity(seen.len() + measured.len());
    let (mut of_seen, mut of_measured) = (vec![None; seen.len()], vec![false; measured.len()]);
    for (s, m) in pairs {
        (of_seen[s], of_measured[m]) = (Some(m), true);
    }
    for (seen, of) in seen.iter().zip(of_seen) {
        let alone = || doubted(seen, sources.lidar.map(|_| &measured[..]), params);
        objects.push(of.map_or_else(alone, |m: usize| merged(seen, &measured[m])));
    }
    objects
        .extend(measured.iter().zip(of_measured).filter(|(_, is_taken)| !is_taken).map(|(alone, _)| *alone));
    if let Some(echoes) = &sources.radar {
        echoes.add_to(&mut objects, ego, params, sources.lidar.is_some());
    }
    // Objects of earlier lists are dropped only now, so that they have claimed their echoes.
    objects.retain(|object| object.is_new);
    let mut boxes: Vec<DetectedBox> = objects.iter().map(Object::told).collect();
    // Distances so large that the covariance overflows.
    boxes.retain(DetectedBox::is_finite);
    // Stable: equal scores keep the order of their sources.
    boxes.sort_by(|a, b| b.score.total_cmp(&a.score));
    Some(Detections { stamp, boxes })
}

/// Latest instant, and the ego's pose then.
fn newest(sources: [Option<Sighted<'_>>; 2]) -> Option<(Time, Pose2<Map>)> {
    let known = sources.into_iter().flatten().filter(|sight| sight.ego.is_finite());
    known.max_by_key(|sight| sight.found.stamp).map(|sight| (sight.found.stamp, sight.ego))
}

/// Valid boxes of a source.
fn usable<'a>(sight: &Sighted<'a>) -> Vec<&'a DetectedBox> {
    let is_usable = |b: &&DetectedBox| b.is_finite() && (0.0..=1.0).contains(&b.score);
    let mut boxes: Vec<&DetectedBox> = match sight.ego.is_finite() {
        true => sight.found.boxes.iter().filter(is_usable).collect(),
        false => Vec::new(),
    };
    surest(&mut boxes, |b| b.score);
    boxes
}

/// Camera objects: positioned by depth if available, else on the ground plane.
fn camera_objects(sight: &CameraSight<'_>, at: (Time, Pose2<Map>), params: &Params) -> Vec<Object> {
    let one = |found: &DetectedBox| {
        let by_depth = by_depth(sight, found, params);
        let is_guessed = by_depth.is_none();
        let (pose, spread) = by_depth.unwrap_or_else(|| {
            let own = found.covariance_m2.map(Spread::told);
            (found.pose, own.unwrap_or_else(|| Spread::of_ground_plane(found.pose, &sight.camera, params)))
        });
        sight.boxes.object(found, (pose, spread), at, is_guessed)
    };
    usable(&sight.boxes).into_iter().map(one).collect()
}

/// Lidar objects.
fn lidar_objects(sight: &Sighted<'_>, at: (Time, Pose2<Map>), params: &Params) -> Vec<Object> {
    let one = |found: &DetectedBox| {
        let own = found.covariance_m2.map(Spread::told);
        let spread = own.unwrap_or_else(|| Spread::of_lidar(found.pose, params));
        sight.object(found, (found.pose, spread), at, false)
    };
    usable(sight).into_iter().map(one).collect()
}

/// Pairs camera and lidar objects by the overlap of their image boxes, or by their errors if the camera reports no
/// image box. A lidar object outside the image is not paired with a camera object that has one.
fn pair(
    seen: &[Object],
    measured: &[Object],
    sources: &Sources<'_>,
    ego: Pose2<Map>,
    params: &Params,
) -> Vec<(usize, usize)> {
    let Some(sight) = &sources.camera else { return Vec::new() };
    let picture = |object: &Object| {
        let (pose, _) = moved((object.found.pose, object.spread), ego, sight.boxes.ego);
        sight.camera.image_px(pose, object.found.bottom_m, object.found.extent)
    };
    let pictures: Vec<Option<[f64; 4]>> = measured.iter().map(picture).collect();
    let mut alike = Vec::new();
    for (s, seen) in seen.iter().enumerate() {
        for (m, measured) in measured.iter().enumerate() {
            // Image overlap outweighs distance.
            let weight = match (seen.found.image_px, pictures[m]) {
                (Some(a), Some(b)) => {
                    let iou = Some(image_iou(a, b)).filter(|iou| *iou >= params.iou_min);
                    iou.filter(|_| is_alike(seen, measured)).map(|iou| 1.0 + iou)
                }
                (Some(_), None) => None,
                (None, _) => near(seen, measured).map(|d| 1.0 - d / GATE),
            };
            alike.extend(weight.map(|weight| (s, m, weight)));
        }
    }
    heaviest_pairs(seen.len(), measured.len(), &alike)
}

/// Squared Mahalanobis distance within the gate.
fn near(seen: &Object, measured: &Object) -> Option<f64> {
    seen.distance(measured).filter(|d| *d < GATE)
}

/// True unless one is a person far from the vehicle that the other is: a camera may find people in the corners of a
/// truck that covers half of the image.
fn is_alike(seen: &Object, measured: &Object) -> bool {
    !(seen.found.kind.is_person() && measured.is_vehicle()) || near(seen, measured).is_some()
}

/// Merges a camera and a lidar object: class and image box of the camera, position and size of the lidar; the score is
/// the probability that at least one is right. If one is a person and the other is not, the size is the camera's too.
/// If the lidar's position was already reported, the position is the camera's.
fn merged(seen: &Object, measured: &Object) -> Object {
    let (camera, lidar) = (&seen.found, &measured.found);
    let agrees = camera.kind.is_person() == lidar.kind.is_person();
    let found = DetectedBox {
        kind: camera.kind,
        score: 1.0 - (1.0 - camera.score) * (1.0 - lidar.score),
        extent: if agrees { lidar.extent } else { camera.extent },
        image_px: camera.image_px,
        ..if measured.is_new { *lidar } else { *camera }
    };
    // Its distance was measured, if not at this instant, so that of an echo is not needed.
    Object { found, ..if measured.is_new { *measured } else { Object { is_guessed: false, ..*seen } } }
}
