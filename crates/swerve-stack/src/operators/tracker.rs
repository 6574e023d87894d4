//! Trackers: of what a detector finds, or of what is seen with its identity.

use swerve_flow::{
    At, Context, Inputs, NamedInputs, NamedOutputs, Operator, OutputInfo, Port, PortInfo, Window,
};
use swerve_geom::{Pose2, math};
use swerve_msg::{Detections, EgoState, ObstacleList, TrackList};
use swerve_perception::tracker::Tracker as Sort;
use swerve_prediction::{History, HistoryParams};

use crate::kind::{Node, OperatorKind, Settings};
use crate::site::Site;

/// Past poses kept to find the one measured at a frame's stamp: as old as frames get, at 100 Hz.
const POSES: usize = 256;

/// Trackers: of boxes where a detector is in the pipeline, else of obstacles as the sensor sees them.
pub(super) struct Trackers;

/// What a detector found, and where the ego was.
#[derive(Inputs)]
struct SortIn {
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
struct SortTracker(Sort);

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
        if settings.offers::<Detections>() { SortIn::ports() } else { HistoryIn::ports() }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let settings = site.settings();
        let config = settings.config;
        let sightings_max = config.prediction.past_steps;
        if !settings.offers::<Detections>() {
            let params = HistoryParams { sightings_max, ..HistoryParams::default() };
            return site.add(HistoryTracker(History::new(params)), None);
        }
        let tracker = Sort::new(site.resolved().tracker)?;
        site.add(SortTracker(tracker), None)
    }
}

impl Operator for SortTracker {
    type In = SortIn;
    type Out = Port<TrackList>;

    fn step(&mut self, _: &mut Context<'_>, input: &SortIn, out: &mut Self::Out) {
        let (Some(boxes), poses) = (input.boxes.get(), input.poses.get()) else { return };
        // Measured before the frame: a later one is not known where a detector takes no time.
        let before = poses.iter().rev().find(|pose| pose.header().stamp <= boxes.stamp);
        let Some(measured) = before.or(poses.first()) else { return };
        out.loan().send(self.0.update(boxes, moved_on(measured, (boxes.stamp - measured.stamp).as_secs())));
    }
}

/// The pose a moment later: along the arc that speed and turn rate make.
fn moved_on(ego: &EgoState, dt_s: f64) -> Pose2 {
    let heading_rad = ego.pose.heading_rad + ego.yaw_rate_radps * dt_s;
    let (sin, cos) = math::sin_cos(ego.pose.heading_rad + 0.5 * ego.yaw_rate_radps * dt_s);
    let way_m = ego.speed_mps * dt_s;
    Pose2::new(ego.pose.x_m + way_m * cos, ego.pose.y_m + way_m * sin, heading_rad)
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pose_moves_on_along_its_arc() {
        let ego = EgoState { speed_mps: 10.0, yaw_rate_radps: 0.5, ..EgoState::default() };
        let later = moved_on(&ego, 0.2);
        // Radius 20 m, a tenth of a radian.
        let exact = [20.0 * math::sin(0.1), 20.0 * (1.0 - math::cos(0.1)), 0.1];
        for (a, b) in [later.x_m, later.y_m, later.heading_rad].into_iter().zip(exact) {
            assert!((a - b).abs() < 1e-3, "{later:?}");
        }
        assert_eq!(moved_on(&ego, 0.0), ego.pose);
    }
}
