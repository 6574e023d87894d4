//! Usable past of a track.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2};
use swerve_msg::{ActorKind, Sighting, Track};

use crate::linear::{REST_MPS, settled};

/// Speed above which a step between sightings is a change of identity or a fault, m/s.
const JUMP_MPS: f64 = 100.0;

/// Usable past of one track, never empty, with a velocity.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Past {
    /// Kind of actor.
    pub(crate) kind: ActorKind,
    /// Sightings, oldest first, at increasing instants.
    pub(crate) sightings: Vec<Sighting>,
    /// Reported velocity, m/s.
    pub(crate) reported_mps: Vector2,
}

impl Past {
    /// Past of a track up to `stamp`. Sightings that are not newer than the previous one are dropped, and so are all
    /// before an implausible jump. Those of an actor at rest are moved to one position. Without sightings, the
    /// present pose is used as the only one.
    pub(crate) fn of(track: &Track, stamp: Time) -> Self {
        let mut sightings: Vec<Sighting> = Vec::with_capacity(track.history.len());
        for sighting in track.history.iter().filter(|sighting| sighting.at <= stamp) {
            if let Some(last) = sightings.last() {
                let since_s = (sighting.at - last.at).as_secs();
                if since_s <= 0.0 {
                    continue;
                }
                if sighting.point.distance(last.point) > JUMP_MPS * since_s {
                    sightings.clear();
                }
            }
            sightings.push(*sighting);
        }
        if sightings.is_empty() {
            sightings.push(Sighting { at: stamp, point: track.pose.point() });
        }
        let sightings = settled(&sightings, track.velocity_mps, REST_MPS).into_owned();
        Self { kind: track.kind, sightings, reported_mps: track.velocity_mps }
    }

    /// Latest sighting.
    pub(crate) fn last(&self) -> Sighting {
        self.sightings[self.sightings.len() - 1]
    }

    /// The sighting `window_s` before the latest, or the next one after that; at least the one before the latest.
    /// `None` if there is only one.
    pub(crate) fn before(&self, window_s: f64) -> Option<Sighting> {
        let (last, before) = (self.last(), &self.sightings[..self.sightings.len() - 1]);
        // Stamps are whole nanoseconds, window lengths are not.
        let within = |one: &&Sighting| (last.at - one.at).as_secs() <= window_s + 1e-6;
        before.iter().find(within).or(before.last()).copied()
    }

    /// Mean velocity over `window_s`; the reported one if there is a single sighting.
    pub(crate) fn velocity_mps(&self, window_s: f64) -> Vector2 {
        let since =
            |from: Sighting| (self.last().point - from.point) * (1.0 / (self.last().at - from.at).as_secs());
        self.before(window_s).map_or(self.reported_mps, since)
    }

    /// Position at `stamp`, extrapolated from the latest sighting with a velocity.
    pub(crate) fn now(&self, stamp: Time, velocity_mps: Vector2) -> Point2 {
        self.last().point + velocity_mps * (stamp - self.last().at).as_secs()
    }
}
