//! Grade and bank of lanes, which the flat projection of a map leaves out.

mod profile;

use crate::import::LaneSource;
use crate::opendrive::Network;

pub use profile::{Piece, Profile};
pub(crate) use profile::{Raised, raised, raised_borders};

/// Largest distance of two samples along a road, metres: the length of a car, over which bumps even out.
const STEP_M: f64 = 5.0;

/// Slopes that differ less are equal.
const SAME: f64 = 1e-9;

/// Shortest part of a lane whose grade is measured, metres: heights are rounded.
const LENGTH_MIN_M: f64 = 0.01;

/// Narrowest lane whose bank is measured, metres.
const WIDTH_MIN_M: f64 = 0.5;

/// Slope at a place of a lane.
#[derive(Clone, PartialEq, Debug)]
pub struct Slope {
    /// Height over distance in the ground plane: positive uphill in the direction of travel, or with the left border
    /// over the right one.
    pub slope: f64,
    /// Identity of the road of OpenDRIVE; the name of the lane in files of other formats.
    pub road: String,
    /// Place along the road, or along the lane, metres.
    pub s_m: f64,
}

/// Largest slopes of lanes.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Slopes {
    /// Along the lanes; `None` on flat roads.
    pub grade: Option<Slope>,
    /// Across the lanes; `None` on flat roads, and where the file has no heights of borders.
    pub bank: Option<Slope>,
}

impl Slopes {
    /// Adds a part of a lane, between shares of its length.
    pub(crate) fn add(&mut self, network: &Network, source: &LaneSource, shares: [f64; 2]) {
        let LaneSource { road: index, section, lane, span_m: [begin_m, end_m], forward } = *source;
        let road = &network.roads[index];
        let ends_m = shares.map(|share| {
            let share = if forward { share } else { 1.0 - share };
            begin_m + (end_m - begin_m) * share
        });
        let [from_m, to_m] = ends_m;
        let steps = ((to_m - from_m).abs() / STEP_M).ceil().max(1.0);
        let mut last: Option<[f64; 3]> = None;
        for k in 0..=steps as usize {
            let s_m = from_m + (to_m - from_m) * (k as f64 / steps);
            let mut edges = road.edges(&road.sections[section], lane > 0, s_m);
            let Some((_, edges)) = edges.find(|(one, _)| one.id == lane) else { return };
            let at = |t_m: f64| network.place(road, s_m, t_m).position_m;
            let here = at(edges.center().t_m);
            let found = |slope: f64| Slope { slope, road: road.id.clone(), s_m };
            if let Some(slope) = last.and_then(|last| rise(last, here, LENGTH_MIN_M)) {
                keep(&mut self.grade, slope, found);
            }
            // To the left of the reference line, outwards is to the left in the direction of s.
            let [right, left] =
                if (lane > 0) == forward { [edges.inner, edges.outer] } else { [edges.outer, edges.inner] };
            if let Some(slope) = rise(at(right.t_m), at(left.t_m), WIDTH_MIN_M) {
                keep(&mut self.bank, slope, found);
            }
            last = Some(here);
        }
    }

    /// Adds a part of a lane with a name, between shares of its length.
    pub(crate) fn add_profile(&mut self, profile: &Profile, (name, length_m): (&str, f64), shares: [f64; 2]) {
        for (share, Piece { grade, bank }) in profile.over(shares) {
            let found = |slope: f64| Slope { slope, road: name.to_owned(), s_m: share * length_m };
            for (largest, slope) in [(&mut self.grade, Some(grade)), (&mut self.bank, bank)] {
                if let Some(slope) = slope.filter(|slope| slope.abs() > SAME) {
                    keep(largest, slope, found);
                }
            }
        }
    }
}

/// Height over distance in the ground plane from one place to another; `None` if they are not farther apart than
/// `least_m`, or level.
fn rise(from: [f64; 3], to: [f64; 3], least_m: f64) -> Option<f64> {
    let [x, y, z] = [0, 1, 2].map(|k| to[k] - from[k]);
    let apart_m = swerve_geom::math::hypot(x, y);
    (apart_m > least_m && z != 0.0).then(|| z / apart_m)
}

/// Keeps the larger slope of two, the first of equal ones.
fn keep(largest: &mut Option<Slope>, slope: f64, found: impl Fn(f64) -> Slope) {
    if largest.as_ref().is_none_or(|largest| slope.abs() > largest.slope.abs() + SAME) {
        *largest = Some(found(slope));
    }
}

#[cfg(test)]
mod tests;
