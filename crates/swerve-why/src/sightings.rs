//! First occurrences of an actor in the stack's data. Boxes and tracks are assigned to the nearest true actor.

use std::collections::BTreeMap;

use swerve_core::Time;
use swerve_geom::Point2;
use swerve_log::{Log, LogError};
use swerve_msg::truth::{Surroundings, WorldState};
use swerve_msg::{ActorId, Detections, ObstacleList, TrackList};
use swerve_stack::Assembly;

use super::timeline::{Seen, Timeline};

/// Finds one actor in the streams of a log.
pub(super) struct Sightings<'a> {
    log: &'a Log,
    timeline: &'a Timeline<'a>,
    world: &'a str,
    actor: ActorId,
}

impl<'a> Sightings<'a> {
    pub(super) fn new(log: &'a Log, timeline: &'a Timeline<'a>, world: &'a str, actor: ActorId) -> Self {
        Self { log, timeline, world, actor }
    }

    /// Stamp of the first frame in which part of the actor is visible.
    pub(super) fn first_visible(&self, assembly: &Assembly) -> Result<Option<Time>, LogError> {
        let listed = assembly.publisher::<ObstacleList>();
        if let Some(stream) = listed.and_then(|of| self.timeline.stream_of::<ObstacleList>(of)) {
            for publication in self.log.publications(stream) {
                let list: ObstacleList = publication.decode()?;
                if list.obstacles.iter().any(|o| o.id == self.actor && o.visible_share > 0.0) {
                    return Ok(Some(list.stamp));
                }
            }
        }
        // With a detector that works on the surroundings there is no such list.
        let around = assembly.publisher::<Surroundings>();
        if let Some(stream) = around.and_then(|of| self.timeline.stream_of::<Surroundings>(of)) {
            for publication in self.log.publications(stream) {
                let list: Surroundings = publication.decode()?;
                if list.obstacles.iter().any(|o| o.id == self.actor) {
                    return Ok(Some(list.stamp));
                }
            }
        }
        Ok(None)
    }

    /// First detections that contain a box of the actor, of a frame at `from` or later.
    pub(super) fn first_detected(&self, stream: &str, from: Time) -> Result<Option<Seen>, LogError> {
        for publication in self.log.publications(stream).filter(|p| p.header.stamp >= from) {
            let found: Detections = publication.decode()?;
            if found.boxes.is_empty() {
                continue;
            }
            let Some(truth) = self.truth(found.stamp)? else { continue };
            let place = |b: &swerve_msg::DetectedBox| truth.ego.state.pose.from_local(b.pose.point());
            if found.boxes.iter().any(|b| owner(&truth, place(b)) == Some(self.actor)) {
                return Ok(self.timeline.seen(stream, publication.header.stamp));
            }
        }
        Ok(None)
    }

    /// First list with a track of the actor, of a frame at `from` or later, and all its tracks that did not belong to
    /// another actor before.
    pub(super) fn tracks(&self, stream: &str, from: Time) -> Result<Option<(Seen, Vec<ActorId>)>, LogError> {
        let mut owners: BTreeMap<ActorId, ActorId> = BTreeMap::new();
        let mut first = None;
        for publication in self.log.publications(stream) {
            let list: TrackList = publication.decode()?;
            if list.tracks.iter().any(|track| !owners.contains_key(&track.id)) {
                let Some(truth) = self.truth(list.stamp)? else { continue };
                for track in &list.tracks {
                    if !owners.contains_key(&track.id)
                        && let Some(owner) = owner(&truth, track.pose.point())
                    {
                        owners.insert(track.id, owner);
                    }
                }
            }
            let is_own = |id: ActorId| owners.get(&id) == Some(&self.actor);
            if first.is_none() && list.stamp >= from && list.tracks.iter().any(|track| is_own(track.id)) {
                first = self.timeline.seen(stream, publication.header.stamp);
            }
        }
        let own = owners.into_iter().filter(|(_, owner)| *owner == self.actor).map(|(id, _)| id);
        Ok(first.map(|first| (first, own.collect())))
    }

    /// World state at an instant, or the last one before it.
    fn truth(&self, at: Time) -> Result<Option<WorldState>, LogError> {
        self.timeline.newest(self.world, at).map(|publication| publication.decode()).transpose()
    }
}

/// Actor at a position.
fn owner(truth: &WorldState, place: Point2) -> Option<ActorId> {
    swerve_eval::actor_at(truth, place).map(|actor| actor.id)
}
