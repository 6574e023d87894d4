//! Ends of lanes: at the edge of the map, inside the map, and at places that are closed.

use swerve_map::LaneId;

use super::Net;

/// Way beyond an end at which nothing else may be, metres: vehicles drive straight on there until they enter elsewhere.
pub(crate) const BEYOND_M: f64 = 300.0;
/// Interval of the check, and the clearance from lanes, metres.
const STEP_M: f64 = 4.0;

/// Where a way ends, at a place along it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) enum End {
    /// The edge of the map: nothing is beyond it.
    Open(f64),
    /// An end inside the map, or a lane that ends beside others.
    Dead(f64),
    /// A closed place.
    Closed(f64),
}

impl End {
    /// Place before which a vehicle stops.
    pub(crate) fn wall_m(self) -> f64 {
        match self {
            Self::Open(end_m) => end_m + BEYOND_M,
            Self::Dead(end_m) | Self::Closed(end_m) => end_m,
        }
    }
}

impl Net {
    /// Finds the ends at the edge of the map, and the lanes from which all ways lead to a closed place.
    pub(super) fn find_ends(&mut self, closed: &[(LaneId, f64)]) {
        for k in 0..self.lanes.len() {
            self.lanes[k].is_open = self.lanes[k].next.is_empty() && self.is_open(k);
        }
        for (id, s_m) in closed {
            if let Ok(k) = self.lanes.binary_search_by_key(id, |lane| lane.id) {
                let nearest = &mut self.lanes[k].closed_m;
                *nearest = Some(nearest.map_or(*s_m, |nearest_m: f64| nearest_m.min(*s_m)));
            }
        }
        if closed.is_empty() {
            return;
        }
        // The smallest set: lanes of a loop without a closed place are not blocked.
        let has_way = |net: &Self, k: usize| {
            let lane = net.lane(k);
            let goes_on = lane.next.is_empty() || lane.next.iter().any(|next| !net.lane(*next).is_blocked);
            lane.closed_m.is_none() && goes_on
        };
        loop {
            let is_blocked = |k: &usize| {
                !self.lane(*k).is_blocked && !self.beside(*k).iter().any(|lane| has_way(self, *lane))
            };
            let more: Vec<usize> = (0..self.lanes.len()).filter(is_blocked).collect();
            if more.is_empty() {
                return;
            }
            for k in more {
                self.lanes[k].is_blocked = true;
            }
        }
    }

    /// The lane and those that are reached from it by changes of lanes.
    fn beside(&self, k: usize) -> Vec<usize> {
        let mut found = vec![k];
        let mut at = 0;
        while at < found.len() {
            for lane in self.lane(found[at]).beside.into_iter().flatten() {
                if !found.contains(&lane) {
                    found.push(lane);
                }
            }
            at += 1;
        }
        found
    }

    /// True if no lane is near the straight way beyond the end of a lane.
    fn is_open(&self, k: usize) -> bool {
        let end = self.lane(k).line.at(self.lane(k).length_m).pose;
        let count = (BEYOND_M / STEP_M) as usize;
        (1..=count).all(|step| {
            let point = end.point() + end.direction() * (step as f64 * STEP_M);
            self.lanes.iter().all(|lane| {
                let [low, high] = lane.bounds;
                let is_apart = point.x_m < low.x_m - STEP_M
                    || point.y_m < low.y_m - STEP_M
                    || point.x_m > high.x_m + STEP_M
                    || point.y_m > high.y_m + STEP_M;
                is_apart || {
                    let place = lane.line.project(point);
                    place.d_m.abs() > STEP_M || place.s_m < 0.0 || place.s_m > lane.length_m
                }
            })
        })
    }

    /// True if a lane cannot be followed beyond its end, or up to it.
    pub(crate) fn ends(&self, k: usize) -> bool {
        let lane = self.lane(k);
        lane.closed_m.is_some() || (self.onward(k, false).next().is_none() && !lane.is_open)
    }
}
