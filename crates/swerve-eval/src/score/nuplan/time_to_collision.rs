//! Time to collision as nuPlan samples it.

use std::collections::BTreeSet;

use swerve_geom::Obb;

use super::collision::{Impacts, is_ahead, is_behind};
use super::{PERIOD_S, Step, Track};

/// Number of projected instants: 0.1 s to 2.9 s.
const PROJECTIONS: u32 = 29;
/// Speed up to which the ego stands, m/s.
const STANDS_MPS: f64 = 5e-3;

/// Time to collision of each step, seconds: the first multiple of 0.1 s below 3 s at which the outlines of the ego and a
/// track overlap, if both keep speed and heading. Zero in a collision at fault; `None` if there is none, or if the ego
/// stands. Tracks ahead count; those at the sides only if the ego is between lanes or in an intersection; none that the
/// ego has hit.
pub fn times_to_collision_s(steps: &[Step], impacts: &Impacts) -> Vec<Option<f64>> {
    let mut hit = BTreeSet::new();
    let one = |(i, step): (usize, &Step)| {
        let mut now = impacts.0.iter().filter(|impact| impact.step == i);
        let is_at_fault = now.clone().any(|impact| impact.at_fault);
        hit.extend(now.by_ref().map(|impact| impact.track));
        if is_at_fault {
            return Some(0.0);
        }
        let is_open = !step.lane.in_one_lane || step.lane.in_intersection;
        let axle = step.ego.rear_axle;
        let counts = |track: &&Track| {
            !hit.contains(&track.id) && (is_ahead(axle, track) || (is_open && !is_behind(axle, track)))
        };
        let tracks: Vec<&Track> = step.tracks.iter().filter(counts).collect();
        first_overlap_s(&step.ego.outline, step.ego.speed_mps, &tracks)
    };
    steps.iter().enumerate().map(one).collect()
}

fn first_overlap_s(ego: &Obb, speed_mps: f64, tracks: &[&Track]) -> Option<f64> {
    if speed_mps <= STANDS_MPS {
        return None;
    }
    let projected = |outline: &Obb, ahead_m: f64| Obb { center: outline.center.ahead(ahead_m), ..*outline };
    let overlaps = |k: &u32| {
        let after_s = PERIOD_S * f64::from(*k);
        let ego = projected(ego, speed_mps * after_s);
        tracks.iter().any(|track| {
            let speed_mps = if track.stands() { 0.0 } else { track.speed_mps };
            ego.overlaps(&projected(&track.outline, speed_mps * after_s))
        })
    };
    (1..=PROJECTIONS).find(overlaps).map(|k| PERIOD_S * f64::from(k))
}
