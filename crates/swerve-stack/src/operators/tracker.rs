//! Trackers: of what a detector finds, or of what is seen with its identity.

use swerve_flow::{
    At, Context, Inputs, NamedInputs, NamedOutputs, Operator, OutputInfo, Port, PortInfo, Window,
};
use swerve_msg::{Detections, EgoState, ObstacleList, TrackList};
use swerve_perception::GroundTracker;
use swerve_prediction::{History, HistoryParams};

use crate::kind::{Node, OperatorKind, Settings};
use crate::site::Site;

/// Past poses kept to find the one measured at a frame's stamp: as old as frames get, at 100 Hz.
const POSES: usize = 256;

/// Trackers: of boxes where a detector is in the pipeline, else of obstacles as the sensor sees them.
pub(super) struct Trackers;

/// What a detector found, and where the ego was.
#[derive(Inputs)]
struct BoxesIn {
    /// Boxes.
    boxes: At<Detections>,
    /// Where the ego was.
    poses: Window<EgoState, POSES>,
}

/// What is seen.
#[derive(Inputs)]
struct HistoryIn {
    /// Obstacles with their identities.
    obstacles: At<ObstacleList>,
}

/// Follows what a detector reports, in the map.
struct BoxTracker(GroundTracker);

/// Follows what the sensor reports by its identity and keeps past sightings.
struct HistoryTracker(History);

impl OperatorKind for Trackers {
    fn node(&self) -> Node {
        Node::new("tracker", "tracks of boxes, or of obstacles with their identities")
            .sections(&["perception", "prediction"])
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        <Port<TrackList> as NamedOutputs>::ports()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if settings.offers::<Detections>() { BoxesIn::ports() } else { HistoryIn::ports() }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let settings = site.settings();
        let config = settings.config;
        let sightings_max = config.prediction.sightings();
        if !settings.offers::<Detections>() {
            let params = HistoryParams { sightings_max, ..HistoryParams::default() };
            return site.add(HistoryTracker(History::new(params)), None);
        }
        let tracker = GroundTracker::new(site.resolved().tracker)?;
        site.add(BoxTracker(tracker), None)
    }
}

impl Operator for BoxTracker {
    type In = BoxesIn;
    type Out = Port<TrackList>;

    fn step(&mut self, _: &mut Context<'_>, input: &BoxesIn, out: &mut Self::Out) {
        let (Some(boxes), poses) = (input.boxes.get(), input.poses.get()) else { return };
        // Measured before the frame: a later one is not known where a detector takes no time.
        let before = poses.iter().rev().find(|pose| pose.header().stamp <= boxes.stamp);
        let Some(measured) = before.or(poses.first()) else { return };
        let ego = measured.pose_after((boxes.stamp - measured.stamp).as_secs());
        out.loan().send(self.0.update(boxes, ego));
    }
}

impl Operator for HistoryTracker {
    type In = HistoryIn;
    type Out = Port<TrackList>;

    fn step(&mut self, _: &mut Context<'_>, input: &HistoryIn, out: &mut Self::Out) {
        if let Some(obstacles) = input.obstacles.get() {
            out.loan().send(self.0.update(obstacles));
        }
    }
}
