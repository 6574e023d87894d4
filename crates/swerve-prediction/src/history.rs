//! Tracks from lists of obstacles with known identities.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_geom::Pose2;
use swerve_msg::{ActorId, Obstacle, ObstacleList, Sighting, Track, TrackList};

/// Extent of the stored history.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct HistoryParams {
    /// Number of sightings kept per obstacle, the present one included; at least 1. Pylot's default is 10.
    pub sightings_max: usize,
    /// Time without a sighting after which an obstacle is dropped, seconds. Larger values bridge longer occlusions,
    /// and keep ghosts longer.
    pub forget_after_s: f64,
    /// The same for an obstacle that was partly hidden when last seen, such as a cyclist who disappears behind a
    /// truck, seconds.
    pub forget_hidden_after_s: f64,
    /// The same for one that stood, seconds.
    pub forget_hidden_standing_after_s: f64,
}

/// Below this speed an obstacle stands, m/s.
const STANDS_MPS: f64 = 0.3;

impl Default for HistoryParams {
    fn default() -> Self {
        Self {
            sightings_max: 10,
            forget_after_s: 0.5,
            forget_hidden_after_s: 4.0,
            forget_hidden_standing_after_s: 30.0,
        }
    }
}

impl HistoryParams {
    /// Time without a sighting after which an obstacle, as last seen, is dropped.
    fn forget_after(&self, last: &Obstacle) -> Span {
        Span::from_secs(if last.visible_share >= 1.0 {
            self.forget_after_s
        } else if last.velocity_mps.norm() < STANDS_MPS {
            self.forget_hidden_standing_after_s
        } else {
            self.forget_hidden_after_s
        })
    }
}

/// Histories of all recently seen obstacles.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct History {
    params: HistoryParams,
    newest: Option<Time>,
    tracks: BTreeMap<ActorId, TrackedObstacle>,
}

/// Latest state of an obstacle, and its past sightings.
#[derive(Clone, PartialEq, Debug)]
struct TrackedObstacle {
    last: Obstacle,
    sightings: Vec<Sighting>,
}

impl History {
    /// Creates an empty history.
    pub fn new(params: HistoryParams) -> Self {
        Self { params, ..Self::default() }
    }

    /// Adds the obstacles seen at one instant, and returns all live tracks, ordered by identity.
    ///
    /// The velocity is the reported one. A track that is missing in `seen` but not yet dropped keeps its history and
    /// is extrapolated from its last sighting with its last velocity, so that its pose is valid at the stamp. A list
    /// that is not newer than the previous one is ignored. Implausible obstacles ([`Obstacle::is_plausible`]) and
    /// repeated identities are ignored.
    pub fn update(&mut self, seen: &ObstacleList) -> TrackList {
        let newest = self.newest.unwrap_or(Time::MIN);
        if seen.stamp > newest {
            self.newest = Some(seen.stamp);
            for obstacle in seen.obstacles.iter().filter(|o| o.is_plausible()) {
                self.take_in(obstacle, seen.stamp);
            }
            let params = self.params;
            self.tracks.retain(|_, track| seen.stamp - track.last_seen() <= params.forget_after(&track.last));
        }
        self.list()
    }

    fn take_in(&mut self, obstacle: &Obstacle, stamp: Time) {
        let track = self
            .tracks
            .entry(obstacle.id)
            .or_insert_with(|| TrackedObstacle { last: obstacle.clone(), sightings: Vec::new() });
        if track.sightings.last().is_some_and(|s| s.at == stamp) {
            return;
        }
        track.last.clone_from(obstacle);
        let too_many = (track.sightings.len() + 1).saturating_sub(self.params.sightings_max.max(1));
        track.sightings.drain(..too_many);
        track.sightings.push(Sighting { at: stamp, point: obstacle.pose.point() });
    }

    fn list(&self) -> TrackList {
        let stamp = self.newest.unwrap_or_default();
        TrackList { stamp, tracks: self.tracks.values().map(|track| track.at(stamp)).collect() }
    }
}

impl TrackedObstacle {
    fn last_seen(&self) -> Time {
        self.sightings.last().expect("a sighting is added with the entry").at
    }

    fn at(&self, stamp: Time) -> Track {
        let unseen_s = (stamp - self.last_seen()).as_secs();
        let point = self.last.pose.point() + self.last.velocity_mps * unseen_s;
        Track {
            id: self.last.id,
            kind: self.last.kind,
            pose: Pose2::new(point.x_m, point.y_m, self.last.pose.heading_rad),
            extent: self.last.extent,
            velocity_mps: self.last.velocity_mps,
            history: self.sightings.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_geom::Vector2;
    use swerve_msg::{ActorKind, Extent};

    fn person(id: u32, x_m: f64) -> Obstacle {
        Obstacle {
            id: ActorId(id),
            kind: ActorKind::Pedestrian,
            pose: Pose2::new(x_m, 0.0, 0.3),
            extent: Extent { length_m: 0.5, width_m: 0.5, height_m: 1.8 },
            velocity_mps: Vector2::new(2.0, 0.0),
            visible_share: 1.0,
        }
    }

    fn list(ms: i64, obstacles: Vec<Obstacle>) -> ObstacleList {
        ObstacleList { stamp: Time::from_ms(ms), obstacles }
    }

    #[test]
    fn history_keeps_the_newest_sightings_oldest_first() {
        let mut history = History::new(HistoryParams { sightings_max: 3, ..Default::default() });
        let mut tracks = TrackList::default();
        for k in 0..5 {
            tracks = history.update(&list(50 * k, vec![person(1, k as f64)]));
        }
        let at: Vec<(i64, f64)> =
            tracks.tracks[0].history.iter().map(|s| (s.at.ns() / 1_000_000, s.point.x_m)).collect();
        assert_eq!(at, [(100, 2.0), (150, 3.0), (200, 4.0)]);
        assert_eq!(tracks.stamp, Time::from_ms(200));
    }

    #[test]
    fn unseen_track_is_extrapolated_then_dropped() {
        let mut history = History::new(HistoryParams { forget_after_s: 0.1, ..Default::default() });
        history.update(&list(0, vec![person(1, 10.0), person(2, 0.0)]));
        let tracks = history.update(&list(100, vec![person(2, 0.2)]));
        assert_eq!(tracks.tracks.len(), 2);
        assert!((tracks.tracks[0].pose.x_m - 10.2).abs() < 1e-12);
        assert_eq!(tracks.tracks[0].history.len(), 1, "nothing is invented in the history");
        let tracks = history.update(&list(101, vec![]));
        assert_eq!(tracks.tracks.iter().map(|t| t.id).collect::<Vec<_>>(), [ActorId(2)]);
    }

    #[test]
    fn hidden_obstacles_are_remembered_longer_and_standing_ones_longest() {
        let partly = |id: u32, speed_mps: f64| Obstacle {
            visible_share: 0.4,
            velocity_mps: Vector2::new(speed_mps, 0.0),
            ..person(id, 0.0)
        };
        let mut history = History::new(HistoryParams::default());
        history.update(&list(0, vec![person(1, 0.0), partly(2, 2.0), partly(3, 0.0)]));
        for (ms, ids) in [(400, &[1, 2, 3][..]), (600, &[2, 3]), (3900, &[2, 3]), (4100, &[3]), (30_100, &[])]
        {
            let tracks = history.update(&list(ms, vec![])).tracks;
            assert_eq!(tracks.iter().map(|track| track.id.0).collect::<Vec<_>>(), ids, "{ms} ms");
        }
    }

    #[test]
    fn gap_within_the_limit_keeps_the_history() {
        let mut history = History::new(HistoryParams::default());
        history.update(&list(0, vec![person(1, 0.0)]));
        history.update(&list(50, vec![]));
        let tracks = history.update(&list(100, vec![person(1, 0.2)]));
        assert_eq!(tracks.tracks[0].history.len(), 2);
    }

    #[test]
    fn older_lists_repeats_and_invalid_numbers_are_ignored() {
        let mut history = History::new(HistoryParams::default());
        let before = history.update(&list(100, vec![person(1, 0.0), person(1, 7.0), person(2, f64::NAN)]));
        assert_eq!(before.tracks.len(), 1);
        assert_eq!(before.tracks[0].pose.x_m, 0.0);
        assert_eq!(history.update(&list(100, vec![person(1, 5.0)])), before);
        assert_eq!(history.update(&list(50, vec![person(1, 5.0)])), before);
    }

    #[test]
    fn tracks_are_ordered_by_identity() {
        let mut history = History::new(HistoryParams::default());
        let tracks = history.update(&list(0, vec![person(9, 0.0), person(2, 0.0), person(5, 0.0)]));
        assert_eq!(tracks.tracks.iter().map(|t| t.id.0).collect::<Vec<_>>(), [2, 5, 9]);
    }
}
