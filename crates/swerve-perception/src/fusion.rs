//! One list of objects of what a camera, a lidar and a radar find.
//!
//! Each source says what it knows best: the camera what something is, the lidar where it stands and how large it is, the
//! radar how fast it comes nearer. A box of the camera and one of the lidar are the same thing if their pictures overlap,
//! or, where there is no picture, if they lie within each other's errors: along the line of sight those of a camera are
//! large, across it small. What one source alone sees stays, with the errors of that source, so that a blind one costs
//! accuracy and no object. An echo of the radar belongs to the object in whose direction and distance it is; by itself
//! it is none.
//!
//! Sources measure at different instants: boxes are brought to the newest by the way of the ego, and their errors grow by
//! what a thing may have moved meanwhile. Where something is, is told once: a turn of a lidar that an earlier list has
//! told lends its size to what the camera sees since, and the camera its kind to the lidar's next turn. A place that is
//! told twice is a thing that stands.

mod doubt;
mod params;
mod place;
mod radar;
#[cfg(test)]
mod tests;

use swerve_core::Time;
use swerve_geom::{Ego, Map, Pose2, heaviest_pairs, image_iou};
use swerve_msg::{DetectedBox, Detections, Image};

use crate::bound::surest;
use crate::image_box::ImageCamera;
use doubt::doubted;
use place::{Spread, by_depth, moved};

pub use params::Params;
pub use radar::Echoes;

/// What a detector found at an instant, and where the ego was then.
#[derive(Clone, Copy, Debug)]
pub struct Sighted<'a> {
    /// Boxes in the ego frame.
    pub found: &'a Detections,
    /// The ego at their stamp.
    pub ego: Pose2<Map>,
    /// Whether no earlier list has told them.
    pub is_new: bool,
}

/// What a camera's detector found, and what is known of the camera.
#[derive(Clone, Copy, Debug)]
pub struct CameraSight<'a> {
    /// Boxes with their pictures.
    pub boxes: Sighted<'a>,
    /// The camera that the pictures are in.
    pub camera: ImageCamera,
    /// Distances along the optical axis at the same stamp, from stereo or whatever measures them.
    pub depth: Option<&'a Image>,
}

/// What there is of each sensor.
#[derive(Clone, Copy, Debug, Default)]
pub struct Sources<'a> {
    /// Boxes in images.
    pub camera: Option<CameraSight<'a>>,
    /// Boxes of points.
    pub lidar: Option<Sighted<'a>>,
    /// Echoes.
    pub radar: Option<Echoes<'a>>,
}

/// An object at the newest instant.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Object {
    found: DetectedBox,
    spread: Spread,
    /// Its distance is that of the ground plane: anything else knows it better.
    is_guessed: bool,
    /// Nobody has told it yet.
    is_new: bool,
}

/// Squared distance in standard deviations within which two boxes are the same thing: 99 % (chi-squared, two degrees of
/// freedom).
const GATE: f64 = 9.21;

/// Standard deviation of each part of the velocity of who walks and of who drives, m/s.
const PERSON_MPS: f64 = 2.0;
const VEHICLE_MPS: f64 = 8.0;

/// Objects by falling score, in the ego frame of the newest boxes, each with its covariance; none without boxes.
///
/// Boxes whose numbers are not finite are left out; of more than [`BOXES_MAX`](crate::image_plane::BOXES_MAX) of a
/// source the surest count.
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
        echoes.add_to(&mut objects, ego, params);
    }
    // What was told before has taken its echoes, and no other takes them.
    objects.retain(|object| object.is_new);
    let mut boxes: Vec<DetectedBox> = objects.iter().map(Object::told).collect();
    // So far away that its errors have no number.
    boxes.retain(DetectedBox::is_finite);
    // Stable: what has the same score stays in the order of its sources.
    boxes.sort_by(|a, b| b.score.total_cmp(&a.score));
    Some(Detections { stamp, boxes })
}

/// The newest instant, and where the ego was then.
fn newest(sources: [Option<Sighted<'_>>; 2]) -> Option<(Time, Pose2<Map>)> {
    let known = sources.into_iter().flatten().filter(|sight| sight.ego.is_finite());
    known.max_by_key(|sight| sight.found.stamp).map(|sight| (sight.found.stamp, sight.ego))
}

/// The boxes of a source that can be something.
fn usable<'a>(sight: &Sighted<'a>) -> Vec<&'a DetectedBox> {
    let is_usable = |b: &&DetectedBox| b.is_finite() && (0.0..=1.0).contains(&b.score);
    let mut boxes: Vec<&DetectedBox> = match sight.ego.is_finite() {
        true => sight.found.boxes.iter().filter(is_usable).collect(),
        false => Vec::new(),
    };
    surest(&mut boxes, |b| b.score);
    boxes
}

/// What a camera sees: where a depth says that it is, else where it stands on the ground plane.
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

/// What a lidar measures.
fn lidar_objects(sight: &Sighted<'_>, at: (Time, Pose2<Map>), params: &Params) -> Vec<Object> {
    let one = |found: &DetectedBox| {
        let own = found.covariance_m2.map(Spread::told);
        let spread = own.unwrap_or_else(|| Spread::of_lidar(found.pose, params));
        sight.object(found, (found.pose, spread), at, false)
    };
    usable(sight).into_iter().map(one).collect()
}

/// Which object of the camera is which of the lidar: by the overlap of their pictures; by their errors where the camera
/// tells no picture, or the lidar's box has none.
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
            // A picture says more than errors do.
            let weight = match (seen.found.image_px, pictures[m]) {
                (Some(a), Some(b)) => {
                    Some(image_iou(a, b)).filter(|iou| *iou >= params.iou_min).map(|iou| 1.0 + iou)
                }
                (Some(_), None) => None,
                (None, _) => seen.distance(measured).filter(|d| *d < GATE).map(|d| 1.0 - d / GATE),
            };
            alike.extend(weight.map(|weight| (s, m, weight)));
        }
    }
    heaviest_pairs(seen.len(), measured.len(), &alike)
}

impl Sighted<'_> {
    /// A box as an object at a later instant.
    fn object(
        &self,
        found: &DetectedBox,
        place: (Pose2<Ego>, Spread),
        (stamp, ego): (Time, Pose2<Map>),
        is_guessed: bool,
    ) -> Object {
        let (pose, spread) = moved(place, self.ego, ego);
        let pace_mps = if found.kind.is_person() { PERSON_MPS } else { VEHICLE_MPS };
        let spread = spread.grown(pace_mps * (stamp - self.found.stamp).as_secs());
        Object { found: DetectedBox { pose, ..*found }, spread, is_guessed, is_new: self.is_new }
    }
}

/// One object of two: kind and picture of the camera, place and size of the lidar; as sure as either is not wrong. The
/// size of a person is no car's: where the two disagree on that, the size is the camera's too. The place is the camera's
/// where that of the lidar has been told.
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
    // Its distance is known, if not to this instant: it needs no echo's.
    Object { found, ..if measured.is_new { *measured } else { Object { is_guessed: false, ..*seen } } }
}

impl Object {
    /// Squared distance to another in standard deviations of both; none where those are no covariance.
    fn distance(&self, other: &Self) -> Option<f64> {
        self.spread.distance(self.found.pose.point() - other.found.pose.point(), other.spread)
    }

    fn told(&self) -> DetectedBox {
        DetectedBox { covariance_m2: Some(self.spread.entries()), ..self.found }
    }
}
