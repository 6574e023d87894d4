//! Conversion of tracks and predictions.

use std::collections::BTreeMap;

use swerve_core::{Span, Time};
use swerve_geom::Vector2;
use swerve_msg::{
    ActorId, ActorKind, Extent, PredictedPose, Prediction, PredictionList, Sighting, Track, TrackList,
};

use super::{ConvertError, Epoch, expect_frame, pose_from_ros, pose_to_ros};
use crate::msg::autoware_perception_msgs::{
    ObjectClassification as Label, PredictedObject, PredictedObjectKinematics, PredictedObjects,
    PredictedPath, Shape, UUID,
};
use crate::msg::builtin_interfaces::Duration;
use crate::msg::geometry_msgs as geo;

/// Maximum number of poses read from one path.
const PATH_POSES_MAX: usize = 1000;
/// Maximum time between poses; interpolation is meaningless beyond it.
const STEP_MAX: Span = Span::from_ms(60_000);
/// Time step of a path with a single pose, where the value does not matter.
const STEP_MIN: Span = Span::from_ms(100);

/// Converts tracks and their predictions to Autoware's predicted objects.
///
/// Poses and paths are those of the box centres; velocities are along and across the object. Autoware's paths have
/// equal time steps: predictions are resampled at the step between their first two poses. All predictions of a
/// track become its paths. Autoware has covariances of the present pose only: that of the likeliest prediction.
pub fn objects_to_ros(
    tracks: &TrackList,
    predictions: &PredictionList,
    epoch: Epoch,
    map: &str,
) -> PredictedObjects {
    let object = |track: &Track| {
        let mut pose = pose_to_ros(track.pose);
        pose.position.z = 0.5 * track.extent.height_m;
        let (ahead, v) = (track.pose.direction(), track.velocity_mps);
        let linear = geo::Vector3 { x: v.dot(ahead), y: ahead.cross(v), z: 0.0 };
        let mut kinematics = PredictedObjectKinematics::default();
        kinematics.initial_pose_with_covariance.pose = pose;
        kinematics.initial_twist_with_covariance.twist.linear = linear;
        let own = predictions.predictions.iter().filter(|p| p.id == track.id && !p.path.is_empty());
        let likeliest = Prediction::likeliest(predictions.modes_of(track.id));
        if let Some([xx, xy, yy]) = likeliest.and_then(|mode| mode.covariances_m2.first()) {
            let covariance = &mut kinematics.initial_pose_with_covariance.covariance.0;
            (covariance[0], covariance[1], covariance[6], covariance[7]) = (*xx, *xy, *xy, *yy);
        }
        kinematics.predicted_paths = own.map(|p| path_to_ros(p, pose.position.z)).collect();
        PredictedObject {
            object_id: uuid(track.id),
            existence_probability: 1.0,
            classification: vec![Label { label: label(track.kind), probability: 1.0 }],
            kinematics,
            shape: shape(track.kind, track.extent),
        }
    };
    PredictedObjects {
        header: epoch.header(tracks.stamp, map),
        objects: tracks.tracks.iter().map(object).collect(),
    }
}

fn path_to_ros(prediction: &Prediction, z: f64) -> PredictedPath {
    let path = &prediction.path;
    let step = if path.len() > 1 { path[1].at - path[0].at } else { STEP_MIN };
    let step = step.max(Span::from_ms(1));
    let (start, end) = (path[0].at, path[path.len() - 1].at);
    let steps = ((end - start).ns() / step.ns()).clamp(0, PATH_POSES_MAX as i64 - 1);
    let pose = |i: i64| {
        let mut pose = pose_to_ros(prediction.pose_at(start + step * i));
        pose.position.z = z;
        pose
    };
    PredictedPath {
        path: (0..=steps).map(pose).collect(),
        time_step: Duration::from_ns(step.ns()),
        confidence: prediction.probability.clamp(0.0, 1.0) as f32,
    }
}

/// Maps Autoware's 16-byte identifiers to numbers.
///
/// The same identifier keeps its number until more than [`Identities::MAX`] others were seen since; numbers are not
/// reused.
#[derive(Clone, Debug, Default)]
pub struct Identities {
    known: BTreeMap<[u8; 16], (u32, u64)>,
    last: u32,
    uses: u64,
}

impl Identities {
    /// Maximum number of identifiers kept.
    pub const MAX: usize = 4096;

    /// Number of an identifier; new identifiers get new numbers, from 1.
    pub fn id(&mut self, uuid: UUID) -> ActorId {
        self.uses += 1;
        if let Some((id, used)) = self.known.get_mut(&uuid.uuid) {
            *used = self.uses;
            return ActorId(*id);
        }
        if self.known.len() >= Self::MAX
            && let Some(oldest) = self.known.iter().min_by_key(|(_, (_, used))| *used).map(|(name, _)| *name)
        {
            self.known.remove(&oldest);
        }
        self.last = self.last.wrapping_add(1).max(1);
        self.known.insert(uuid.uuid, (self.last, self.uses));
        ActorId(self.last)
    }
}

/// Converts Autoware's predicted objects to tracks and predictions, ordered by identity.
///
/// # Errors
/// If the frame is not `map`.
pub fn objects_from_ros(
    objects: &PredictedObjects,
    epoch: Epoch,
    map: &str,
    identities: &mut Identities,
) -> Result<(TrackList, PredictionList), ConvertError> {
    expect_frame(&objects.header.frame_id, map)?;
    let stamp = epoch.time(objects.header.stamp);
    let mut tracks = TrackList { stamp, tracks: Vec::new() };
    let mut predictions = PredictionList { stamp, ..PredictionList::default() };
    for object in &objects.objects {
        let (id, kind) = (identities.id(object.object_id), kind(&object.classification));
        let pose = pose_from_ros(&object.kinematics.initial_pose_with_covariance.pose);
        let v = &object.kinematics.initial_twist_with_covariance.twist.linear;
        let (ahead, size) = (pose.direction(), &object.shape.dimensions);
        let extent = Extent { length_m: size.x, width_m: size.y, height_m: size.z };
        let velocity_mps = Vector2::new(ahead.x * v.x - ahead.y * v.y, ahead.y * v.x + ahead.x * v.y);
        let history = vec![Sighting { at: stamp, point: pose.point() }];
        tracks.tracks.push(Track { id, kind, pose, extent, velocity_mps, history });
        for path in &object.kinematics.predicted_paths {
            predictions.predictions.extend(path_from_ros(path, stamp).map(|poses| Prediction {
                probability: f64::from(path.confidence),
                ..Prediction::single(id, kind, extent, poses)
            }));
        }
    }
    tracks.tracks.sort_by_key(|track| track.id);
    predictions.predictions.sort_by_key(|prediction| prediction.id);
    Ok((tracks, predictions))
}

/// Converts a path; `None` if it has no poses, or a time step that is not positive or exceeds [`STEP_MAX`].
fn path_from_ros(path: &PredictedPath, stamp: Time) -> Option<Vec<PredictedPose>> {
    let step = Span::from_ns(path.time_step.ns());
    if path.path.is_empty() || step > STEP_MAX || (path.path.len() > 1 && step <= Span::ZERO) {
        return None;
    }
    let pose =
        |(i, pose)| PredictedPose { at: stamp.saturating_add(step * (i as i64)), pose: pose_from_ros(pose) };
    Some(path.path.iter().take(PATH_POSES_MAX).enumerate().map(pose).collect())
}

fn uuid(id: ActorId) -> UUID {
    let mut uuid = [0; 16];
    uuid[..4].copy_from_slice(&id.0.to_le_bytes());
    UUID { uuid }
}

fn label(kind: ActorKind) -> u8 {
    match kind {
        ActorKind::Car => Label::CAR,
        ActorKind::Truck => Label::TRUCK,
        ActorKind::Motorcycle => Label::MOTORCYCLE,
        ActorKind::Cyclist => Label::BICYCLE,
        ActorKind::Pedestrian => Label::PEDESTRIAN,
        ActorKind::Static => Label::UNKNOWN,
    }
}

/// Most likely kind; unsupported ones (animals, hazards) are treated as static, since they may not move away.
fn kind(classification: &[Label]) -> ActorKind {
    let likeliest = classification.iter().reduce(|a, b| if b.probability > a.probability { b } else { a });
    match likeliest.map_or(Label::UNKNOWN, |one| one.label) {
        Label::CAR => ActorKind::Car,
        Label::TRUCK | Label::BUS | Label::TRAILER => ActorKind::Truck,
        Label::MOTORCYCLE => ActorKind::Motorcycle,
        Label::BICYCLE => ActorKind::Cyclist,
        Label::PEDESTRIAN => ActorKind::Pedestrian,
        _ => ActorKind::Static,
    }
}

fn shape(kind: ActorKind, extent: Extent) -> Shape {
    let round = kind == ActorKind::Pedestrian;
    let length = if round { extent.width_m } else { extent.length_m };
    Shape {
        type_: if round { Shape::CYLINDER } else { Shape::BOUNDING_BOX },
        footprint: geo::Polygon::default(),
        dimensions: geo::Vector3 { x: length, y: extent.width_m, z: extent.height_m },
    }
}
