//! Accuracy of objects from a lidar: average precision on the ground, of single sweeps and of tracks.

use core::fmt::Write as _;

use swerve_core::ParamError;
use swerve_eval::{AveragePrecision, Found, Recalls, ground_iou};
use swerve_geom::{Ego, Point2, Pose2};
use swerve_msg::{ActorKind, DetectedBox, Detections, TrackList};
use swerve_perception::lidar::Scan;
use swerve_perception::tracker::Params;
use swerve_perception::{Ab3dMot, GroundTracker, LidarObjects, Tracker, ab3dmot};

use super::frames::There;

/// Maximum distance of objects that count, metres.
const NEAR_M: f64 = 40.0;

/// Criteria by kind: minimum number of points, minimum overlap of a match.
const KINDS: [(ActorKind, &str, usize, f64); 4] = [
    (ActorKind::Car, "cars", 20, 0.5),
    (ActorKind::Truck, "trucks", 20, 0.5),
    (ActorKind::Cyclist, "cyclists", 10, 0.25),
    (ActorKind::Pedestrian, "people", 10, 0.25),
];

/// Accumulates the accuracy over sweeps, in the order of their drives.
pub(super) struct Judge {
    one: Vec<AveragePrecision>,
    /// Average precisions of each tracker, in the order of [`trackers`].
    tracked: [Vec<AveragePrecision>; 2],
    trackers: [Box<dyn GroundTracker>; 2],
    found: Detections,
}

impl Judge {
    pub(super) fn new() -> Self {
        let each = || KINDS.iter().map(|(_, _, _, overlap)| AveragePrecision::new(*overlap)).collect();
        let trackers = trackers().expect("these are within their ranges");
        Self { one: each(), tracked: [each(), each()], trackers, found: Detections::default() }
    }

    /// Resets the trackers for the next drive.
    pub(super) fn begin_drive(&mut self) -> Result<(), ParamError> {
        self.trackers = trackers()?;
        Ok(())
    }

    pub(super) fn take(&mut self, objects: &mut LidarObjects, scan: &Scan<'_>, there: &[There]) {
        objects.detect(scan, &mut self.found);
        count(&mut self.one, &self.found.boxes, there);
        for (tracker, tracked) in self.trackers.iter_mut().zip(&mut self.tracked) {
            let tracks = tracker.update(&self.found, scan.ego.pose);
            count(tracked, &boxes(&tracks, &**tracker, scan.ego.pose), there);
        }
    }

    /// Average precision of cars: of single sweeps, and of the tracks of each tracker.
    pub(super) fn cars(&self) -> [f64; 3] {
        [&self.one, &self.tracked[0], &self.tracked[1]]
            .map(|all| all[0].value(Recalls::Kitti40).unwrap_or(0.0))
    }

    /// Table of all results.
    pub(super) fn table(&self) -> String {
        let mut text = format!(
            "within {NEAR_M} m, mean of 40 recalls      there  one sweep     sort  ab3dmot  least overlap, points\n"
        );
        for (k, (_, name, points, overlap)) in KINDS.iter().enumerate() {
            let value = |all: &[AveragePrecision]| {
                all[k].value(Recalls::Kitti40).map_or("-".to_owned(), |value| format!("{value:.3}"))
            };
            let (one, [sort, ab3dmot]) = (value(&self.one), self.tracked.each_ref().map(|all| value(all)));
            let there = self.one[k].wanted();
            let _ =
                writeln!(text, "{name:<38} {there:>8} {one:>10} {sort:>8} {ab3dmot:>8}  {overlap}, {points}");
        }
        text
    }
}

/// Trackers to evaluate, first that of `configs/lidar_objects.toml`.
fn trackers() -> Result<[Box<dyn GroundTracker>; 2], ParamError> {
    let sort = Params {
        score_min: 0.3,
        range_noise_m: 0.15,
        range_noise_share: 0.005,
        bearing_noise_rad: 0.005,
        ..Params::default()
    };
    let overlap = ab3dmot::Params { score_min: 0.3, ..ab3dmot::Params::default() };
    Ok([Box::new(Tracker::new(sort)?), Box::new(Ab3dMot::new(overlap)?)])
}

/// Tracks as boxes in the ego frame.
fn boxes(tracks: &TrackList, tracker: &dyn GroundTracker, ego: Pose2) -> Vec<DetectedBox> {
    let of = |track: &swerve_msg::Track| {
        let at = ego.to_local::<Ego>(track.pose.point());
        DetectedBox {
            kind: track.kind,
            score: tracker.score(track.id).unwrap_or(0.0),
            pose: Pose2::new(at.x_m, at.y_m, track.pose.heading_rad - ego.heading_rad),
            bottom_m: 0.0,
            extent: track.extent,
            image_px: None,
            covariance_m2: None,
            radial_speed_mps: None,
        }
    };
    tracks.tracks.iter().map(of).collect()
}

fn count(all: &mut [AveragePrecision], boxes: &[DetectedBox], there: &[There]) {
    let is_near = |b: &DetectedBox| b.pose.point().distance(Point2::default()) < NEAR_M;
    for (precision, (kind, _, points, _)) in all.iter_mut().zip(KINDS) {
        let boxes: Vec<&DetectedBox> = boxes.iter().filter(|b| b.kind == kind).collect();
        let there: Vec<&There> = there.iter().filter(|there| there.truth.kind == kind).collect();
        let found: Vec<Found> = boxes.iter().map(|b| Found { score: b.score, counts: is_near(b) }).collect();
        let counts: Vec<bool> =
            there.iter().map(|there| is_near(&there.truth) && there.points >= points).collect();
        precision.frame(&found, &counts, |f, w| ground_iou(boxes[f], &there[w].truth));
    }
}
