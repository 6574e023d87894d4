//! Trackers of a detector's boxes, or of obstacles with known identities.

use swerve_flow::{
    At, Context, Inputs, NamedInputs, NamedOutputs, Operator, OutputInfo, Port, PortInfo, Window,
};
use swerve_msg::{Detections, EgoState, LocalPose, ObstacleList, TrackList};
use swerve_perception::GroundTracker;
use swerve_prediction::{History, HistoryParams};
use swerve_text::{KeyProblem, in_one_line};

use super::odom::LocalPoses;
use super::relative::{Motion, in_odom};
use crate::config::PredictionConfig;
use crate::config::perception::PerceptionConfig;
use crate::kind::{Node, OperatorKind, Settings};
use crate::site::Site;
use crate::trackers::TrackerSetup;

/// Past poses kept to find the one at a frame's stamp: up to the age of a frame, at 100 Hz.
const POSES: usize = 256;

/// Trackers: of boxes if a detector is in the pipeline, else of obstacles as the sensor sees them.
pub(super) struct Trackers;

/// Boxes of a detector, and past poses of the ego.
#[derive(Inputs)]
struct BoxesIn {
    /// Boxes.
    boxes: At<Detections>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
    /// The same in the odometry frame.
    local: Option<Window<LocalPose, POSES>>,
}

/// Obstacles of the sensor.
#[derive(Inputs)]
struct HistoryIn {
    /// Obstacles with their identities.
    obstacles: At<ObstacleList>,
    /// Past localized poses of the ego.
    local: Option<Window<LocalPose, POSES>>,
}

/// Tracks a detector's boxes: in the odometry frame, or in the map where the pose is that of the simulator or the
/// vehicle.
struct BoxTracker {
    tracker: Box<dyn GroundTracker>,
    local: LocalPoses,
}

/// Keeps past sightings of the sensor's obstacles by their identity; in frames as [`BoxTracker`].
struct HistoryTracker {
    history: History,
    local: LocalPoses,
}

impl OperatorKind for Trackers {
    fn node(&self) -> Node {
        Node::new("tracker", "tracks of boxes, or of obstacles with their identities")
            .section(&PerceptionConfig::SECTION)
            .section(&PredictionConfig::SECTION)
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        <Port<TrackList> as NamedOutputs>::ports()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if settings.offers::<Detections>() { BoxesIn::ports() } else { HistoryIn::ports() }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let settings = site.settings();
        let config = settings.setup;
        let sightings_max = config.prediction.sightings();
        if !settings.offers::<Detections>() {
            let params = HistoryParams { sightings_max, ..HistoryParams::default() };
            let (history, local) = (History::new(params), LocalPoses::default());
            return site.add(HistoryTracker { history, local }, None);
        }
        let of = TrackerSetup { behind: &site.resolved().behind, sightings_max };
        let wrong = |found: Vec<KeyProblem>| anyhow::anyhow!("perception: {}", in_one_line(&found));
        let tracker = config.perception.built_tracker(&config.registry, of).map_err(wrong)?;
        site.add(BoxTracker { tracker, local: LocalPoses::default() }, None)
    }
}

impl Operator for BoxTracker {
    type In = BoxesIn;
    type Out = Port<TrackList>;

    fn step(&mut self, _: &mut Context<'_>, input: &BoxesIn, out: &mut Self::Out) {
        self.local.take(input.local.as_ref().map_or(&[], |local| local.get()));
        let (Some(boxes), poses) = (input.boxes.get(), input.poses.get()) else { return };
        // A pose before the frame: later ones are unknown where a detector takes no time.
        let before = poses.iter().rev().find(|pose| pose.header().stamp <= boxes.stamp);
        let Some(measured) = before.or(poses.first()) else { return };
        let local = self.local.at(boxes.stamp);
        let pose = local.map_or(measured.pose, |local| in_odom(&local));
        let state = EgoState { pose, ..**measured };
        let tracks = self.tracker.update(boxes, state.pose_after((boxes.stamp - measured.stamp).as_secs()));
        out.loan().send(in_map(tracks, local));
    }
}

impl Operator for HistoryTracker {
    type In = HistoryIn;
    type Out = Port<TrackList>;

    fn step(&mut self, _: &mut Context<'_>, input: &HistoryIn, out: &mut Self::Out) {
        self.local.take(input.local.as_ref().map_or(&[], |local| local.get()));
        let Some(obstacles) = input.obstacles.get() else { return };
        let tracks = match self.local.before(obstacles.stamp) {
            None => self.history.update(obstacles),
            // By the pose with which the sensor placed them.
            Some(seen_by) => self.history.update(&Motion::to_odom(&seen_by).obstacles((**obstacles).clone())),
        };
        out.loan().send(in_map(tracks, self.local.at(obstacles.stamp)));
    }
}

/// Tracks in the map at their stamp.
fn in_map(tracks: TrackList, local: Option<LocalPose>) -> TrackList {
    match local {
        Some(local) => Motion::to_map(&local).tracks(tracks),
        None => tracks,
    }
}
