//! Collisions of the ego, and those at its fault.

use std::collections::BTreeSet;

use swerve_geom::{Obb, Pose2, angle_between};

use super::{Step, Track, TrackKind};

/// Speed below which the ego stands, m/s.
const EGO_STANDS_MPS: f64 = 5e-2;

/// The first contact of the ego with a track.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Impact {
    /// Index of the step.
    pub step: usize,
    /// Identity of the track.
    pub track: u64,
    /// Kind of the track.
    pub kind: TrackKind,
    /// True if the ego could have prevented it by driving differently.
    pub at_fault: bool,
}

/// First contacts of the ego with each track.
#[derive(Clone, PartialEq, Eq, Debug, Default)]
pub struct Impacts(pub Vec<Impact>);

/// Number of collisions at fault by kind of the other party.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub struct AtFault {
    /// With pedestrians and cyclists.
    pub vru: u32,
    /// With vehicles.
    pub vehicle: u32,
    /// With objects.
    pub object: u32,
}

impl AtFault {
    /// Factor of the score. One collision with an object leaves one half, any other one nothing.
    pub fn factor(self) -> f64 {
        let factor = |count: u32, allowed: u32| (1.0 - f64::from(count) / f64::from(allowed + 1)).max(0.0);
        factor(self.vru, 0) * factor(self.vehicle, 0) * factor(self.object, 1)
    }
}

impl Impacts {
    /// Number of those at fault.
    pub fn at_fault(&self) -> AtFault {
        let mut counts = AtFault::default();
        for impact in self.0.iter().filter(|impact| impact.at_fault) {
            *match impact.kind {
                TrackKind::Vru => &mut counts.vru,
                TrackKind::Vehicle => &mut counts.vehicle,
                TrackKind::Object => &mut counts.object,
            } += 1;
        }
        counts
    }
}

/// First contacts of the ego with each track. At fault are those with a track that stands, those of the front bumper,
/// and, unless the ego is in one lane, those of its sides; never those of an ego that stands, or with a track behind it.
pub fn impacts(steps: &[Step]) -> Impacts {
    let mut hit = BTreeSet::new();
    let mut found = Vec::new();
    for (i, step) in steps.iter().enumerate() {
        for track in &step.tracks {
            if !hit.contains(&track.id) && step.ego.outline.overlaps(&track.outline) {
                hit.insert(track.id);
                let at_fault = is_at_fault(step, track);
                found.push(Impact { step: i, track: track.id, kind: track.kind, at_fault });
            }
        }
    }
    Impacts(found)
}

fn is_at_fault(step: &Step, track: &Track) -> bool {
    if step.ego.speed_mps <= EGO_STANDS_MPS {
        false
    } else if track.stands() {
        true
    } else if is_behind(step.ego.rear_axle, track) {
        false
    } else {
        front_bumper(&step.ego.outline).overlaps(&track.outline) || !step.lane.in_one_lane
    }
}

/// Front edge of an outline, as a rectangle without length.
fn front_bumper(outline: &Obb) -> Obb {
    Obb { center: outline.center.ahead(outline.half_length_m), half_length_m: 0.0, ..*outline }
}

/// Angle between the heading of a pose and the direction to the centre of a track, radians.
fn angle_to(from: Pose2, track: &Track) -> f64 {
    let to = track.outline.center.point() - from.point();
    angle_between(from.heading_rad, to.heading()).abs()
}

/// Returns true if the centre of the track is within 20 degrees of the heading.
pub(super) fn is_ahead(from: Pose2, track: &Track) -> bool {
    angle_to(from, track) < 20_f64.to_radians()
}

/// Returns true if the centre of the track is more than 150 degrees off the heading.
pub(super) fn is_behind(from: Pose2, track: &Track) -> bool {
    angle_to(from, track) > 150_f64.to_radians()
}
