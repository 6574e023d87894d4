//! Tracks on the ground against the true road users: delays, velocities, duplicates, purity, and consistency.

use std::collections::BTreeMap;

use nalgebra::{Matrix4, Vector4};
use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::Point2;
use swerve_msg::truth::{Actor, WorldState};
use swerve_msg::{ActorId, Track, TrackList};

use crate::{Sight, seconds};

/// Largest distance of a place from the outline of the road user that it is assigned to, metres, plus this share of
/// its distance from the ego.
const NEAR_M: f64 = 2.0;
const NEAR_SHARE: f64 = 0.05;

/// Error of a track's velocity, m/s, up to which the velocity counts as known.
pub const VELOCITY_KNOWN_MPS: f64 = 0.6;

/// Road user to whom a place in the map belongs: the one whose outline is nearest, if it is near enough.
pub fn actor_at(truth: &WorldState, place: Point2) -> Option<&Actor> {
    let away_m = |actor: &Actor| actor.footprint().distance_to_point(place);
    let from_center_m = |actor: &Actor| actor.pose.point().distance(place);
    let nearer = |a: &&Actor, b: &&Actor| {
        away_m(a).total_cmp(&away_m(b)).then(from_center_m(a).total_cmp(&from_center_m(b)))
    };
    let reach_m = NEAR_M + NEAR_SHARE * truth.ego.state.pose.point().distance(place);
    truth.actors.iter().min_by(nearer).filter(|actor| away_m(actor) <= reach_m)
}

/// Metrics of all tracks of a run. A track in one list is an *entry*.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TrackMetrics {
    /// Number of tracks.
    pub tracks: usize,
    /// Number of entries.
    pub entries: usize,
    /// Share of the entries that belong to the road user with the most entries of their track; null without entries.
    pub purity: Option<f64>,
    /// Share of the entries that belong to no road user.
    pub ghost_share: Option<f64>,
    /// Share of the entries of a road user that has another entry in the same list.
    pub duplicate_share: Option<f64>,
    /// Root mean square of the errors of the velocities, m/s.
    pub velocity_rms_mps: Option<f64>,
    /// Mean normalized squared error of position and velocity (NEES); 4 for a consistent filter. Null where the
    /// tracker reports no covariance.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub nees: Option<f64>,
}

/// Instants of the first tracks of a road user after its first sight, seconds. A person's tracks are those of people only.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Followed {
    /// First list with a track of it reaches its readers.
    pub tracked_s: Option<f64>,
    /// First list with a velocity of it that is known ([`VELOCITY_KNOWN_MPS`]) reaches its readers.
    pub velocity_known_s: Option<f64>,
}

/// Compares tracks with the truth, list by list.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct TrackComparison {
    followed: BTreeMap<ActorId, Followed>,
    /// Entries of each track by the road user that they belong to.
    owners: BTreeMap<ActorId, BTreeMap<Option<ActorId>, usize>>,
    duplicates: usize,
    velocity_square: f64,
    nees: (f64, usize),
}

impl TrackComparison {
    /// Adds a list that reaches its readers at `at`, with the truth at the list's stamp and the first sights of road
    /// users; `covariance` is that of x, y and their velocities of a track, if known.
    pub fn add(
        &mut self,
        (list, at): (&TrackList, Time),
        truth: &WorldState,
        sights: &[Sight],
        covariance: impl Fn(ActorId) -> Option<Matrix4<f64>>,
    ) {
        let mut listed = BTreeMap::<ActorId, usize>::new();
        for track in &list.tracks {
            let owner = actor_at(truth, track.pose.point());
            *self.owners.entry(track.id).or_default().entry(owner.map(|owner| owner.id)).or_default() += 1;
            let Some(owner) = owner else { continue };
            *listed.entry(owner.id).or_default() += 1;
            let off_mps = (track.velocity_mps - owner.velocity_mps).norm();
            self.velocity_square += off_mps * off_mps;
            if let Some(square) = covariance(track.id).and_then(|c| normalized(track, owner, c)) {
                self.nees = (self.nees.0 + square, self.nees.1 + 1);
            }
            let is_seen = sights.iter().any(|sight| sight.actor == owner.id && sight.at <= list.stamp);
            if !is_seen || track.kind.is_person() != owner.kind.is_person() {
                continue;
            }
            let followed = self.followed.entry(owner.id).or_default();
            followed.tracked_s.get_or_insert(seconds(at));
            if off_mps <= VELOCITY_KNOWN_MPS {
                followed.velocity_known_s.get_or_insert(seconds(at));
            }
        }
        self.duplicates += listed.values().filter(|count| **count > 1).sum::<usize>();
    }

    /// First tracks of a road user.
    pub fn followed(&self, actor: ActorId) -> Followed {
        self.followed.get(&actor).copied().unwrap_or_default()
    }

    /// Metrics so far.
    pub fn metrics(&self) -> TrackMetrics {
        let sum =
            |count: fn(&BTreeMap<Option<ActorId>, usize>) -> usize| self.owners.values().map(count).sum();
        let entries: usize = sum(|of| of.values().sum());
        let ghosts: usize = sum(|of| of.get(&None).copied().unwrap_or(0));
        let pure: usize =
            sum(|of| of.iter().filter(|(owner, _)| owner.is_some()).map(|(_, n)| *n).max().unwrap_or(0));
        let share = |count: usize, of: usize| (of > 0).then(|| count as f64 / of as f64);
        TrackMetrics {
            tracks: self.owners.len(),
            entries,
            purity: share(pure, entries),
            ghost_share: share(ghosts, entries),
            duplicate_share: share(self.duplicates, entries),
            velocity_rms_mps: (entries > ghosts)
                .then(|| (self.velocity_square / (entries - ghosts) as f64).sqrt()),
            nees: (self.nees.1 > 0).then(|| self.nees.0 / self.nees.1 as f64),
        }
    }
}

/// Normalized squared error of a track's position and velocity.
fn normalized(track: &Track, truth: &Actor, covariance: Matrix4<f64>) -> Option<f64> {
    let place = track.pose.point() - truth.pose.point();
    let velocity = track.velocity_mps - truth.velocity_mps;
    let off = Vector4::new(place.x, place.y, velocity.x, velocity.y);
    Some((off.transpose() * covariance.try_inverse()? * off)[0])
}

#[cfg(test)]
mod tests;
