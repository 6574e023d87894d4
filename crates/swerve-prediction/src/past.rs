//! What of a track's past can be gone by.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2};
use swerve_msg::{ActorKind, Sighting, Track};

use crate::linear::{REST_MPS, settled};

/// Who is seen further on than this allows has not moved there: another one, or a fault, m/s.
const JUMP_MPS: f64 = 100.0;

/// The usable past of one track, never empty, with a velocity.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Past {
    /// What it is.
    pub(crate) kind: ActorKind,
    /// Oldest first, at increasing instants.
    pub(crate) sightings: Vec<Sighting>,
    /// As reported, m/s.
    pub(crate) reported_mps: Vector2,
}

impl Past {
    /// Up to `stamp`. Sightings that are not newer than the one before are left out, and so is all before a jump that
    /// nothing on a road can make. Those of an actor at rest are all at one place. Without any the present pose is the one
    /// sighting.
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

    /// The newest sighting.
    pub(crate) fn last(&self) -> Sighting {
        self.sightings[self.sightings.len() - 1]
    }

    /// The sighting `window_s` before the newest, or the next after that; at least the one before the newest, none where
    /// there is none.
    pub(crate) fn before(&self, window_s: f64) -> Option<Sighting> {
        let (last, before) = (self.last(), &self.sightings[..self.sightings.len() - 1]);
        // Stamps are whole nanoseconds, windows are not.
        let within = |one: &&Sighting| (last.at - one.at).as_secs() <= window_s + 1e-6;
        before.iter().find(within).or(before.last()).copied()
    }

    /// Mean velocity since then; the reported one where there is one sighting alone.
    pub(crate) fn velocity_mps(&self, window_s: f64) -> Vector2 {
        let since =
            |from: Sighting| (self.last().point - from.point) * (1.0 / (self.last().at - from.at).as_secs());
        self.before(window_s).map_or(self.reported_mps, since)
    }

    /// Where it is at `stamp` if it went on with that velocity since it was seen.
    pub(crate) fn now(&self, stamp: Time, velocity_mps: Vector2) -> Point2 {
        self.last().point + velocity_mps * (stamp - self.last().at).as_secs()
    }
}
