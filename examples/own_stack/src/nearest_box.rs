//! A tracker: each box continues the nearest track of the previous frame.

use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, require_within};
use swerve_geom::{Map, Pose2};
use swerve_msg::{ActorId, DetectedBox, Detections, Sighting, Track, TrackList};
use swerve_perception::GroundTracker;
use swerve_stack::{NamedTracker, TrackerSetup};

/// Parameters, in `perception.tracker`.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Params {
    /// Largest distance between a box and its track, 0.1 to 20 m.
    gate_m: f64,
}

/// Tracks of the previous frame.
pub struct NearestBox {
    params: Params,
    sightings_max: usize,
    tracks: Vec<Track>,
    given: u32,
}

impl GroundTracker for NearestBox {
    fn update(&mut self, found: &Detections, ego: Pose2<Map>) -> TrackList {
        let mut before = std::mem::take(&mut self.tracks);
        for &DetectedBox { kind, pose, extent, .. } in &found.boxes {
            let point = ego.from_local(pose.point());
            let near = before.iter().enumerate().map(|(k, track)| (track.pose.point().distance(point), k));
            let near = near.min_by(|a, b| a.0.total_cmp(&b.0)).filter(|near| near.0 < self.params.gate_m);
            self.given += u32::from(near.is_none());
            let track = near.map(|(_, k)| before.swap_remove(k));
            let (id, mut history) = track.map_or((ActorId(self.given), vec![]), |t| (t.id, t.history));
            history.push(Sighting { at: found.stamp, point });
            history.drain(..history.len().saturating_sub(self.sightings_max));
            let over_s = (found.stamp - history[0].at).as_secs();
            let velocity_mps = (point - history[0].point) * (1.0 / over_s.max(1e-3));
            let pose = Pose2::new(point.x_m, point.y_m, ego.heading_rad + pose.heading_rad);
            self.tracks.push(Track { id, kind, pose, extent, velocity_mps, history });
        }
        self.tracks.sort_by_key(|track| track.id);
        TrackList { stamp: found.stamp, tracks: self.tracks.clone() }
    }
}

impl NamedTracker for NearestBox {
    const NAME: &'static str = "nearest_box";
    type Params = Params;

    fn defaults(_: TrackerSetup<'_>) -> Params {
        Params { gate_m: 3.0 }
    }

    fn with_params(params: Params, of: TrackerSetup<'_>) -> Result<Self, ParamError> {
        require_within("gate_m", params.gate_m, [0.1, 20.0])?;
        Ok(Self { params, sightings_max: of.sightings_max, tracks: Vec::new(), given: 0 })
    }
}
