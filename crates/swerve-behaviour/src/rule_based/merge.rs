//! Changes to the next lane among its traffic.
//!
//! The route fixes where the ego changes. It takes the first gap of the other lane that it can reach without being faster
//! than it would be anyway, and adapts its speed before. A gap is accepted by its two parts, the one to the vehicle ahead
//! and the one to that behind (Ahmed, Modeling Drivers' Acceleration and Lane Changing Behavior, 1999, section 3.3).

use swerve_geom::Point2;
use swerve_map::{LaneChange, LaneId, Map, Route};
use swerve_msg::ActorId;
use swerve_road_user::travel::time_s;

use super::block::OnLane;
use super::others::Vehicle;
use super::{CREEPS_MPS, Own, RuleBasedParams};
use crate::{Roads, Situation};

/// Distance beside the middle of its lane at which the ego begins to get into the way of the other lane, and the interval
/// of samples, metres.
const ASIDE_M: f64 = 0.2;
const SAMPLE_M: f64 = 1.0;
/// Distance over which the other lane is looked at behind the change, metres.
const BEHIND_M: f64 = 250.0;
/// Distance to the vehicles ahead and behind at that place, metres, and the time gaps to them, seconds.
const GAP_M: f64 = 2.0;
const AHEAD_S: f64 = 0.5;
const BEHIND_S: f64 = 0.6;
/// Share of that behind that suffices for the gap that the ego adapts to.
const KEEPS_SHARE: f64 = 0.7;
/// Decelerations with which the ego and those behind it adapt to the slower one, m/s².
const ADAPTS_MPS2: f64 = 2.0;
const IMPOSED_MPS2: f64 = 2.0;
/// Speed below which vehicles queue, m/s: there are no gaps to wait for.
const QUEUE_MPS: f64 = 4.0;
/// Time before a change from which it is too late to begin with that, seconds.
const ADAPTS_S: f64 = 2.0;
/// Delay from which the ego begins to adapt its speed, seconds, and the largest step in which it does so, m/s.
const LATE_S: f64 = 0.1;
const STEP_MPS: f64 = 1.5;
/// Distance within which vehicles are looked at that change to the other lane themselves, metres, and the time until
/// they are there, seconds.
const BESIDE_M: f64 = 60.0;
const COMES_S: f64 = 1.5;
/// Time in which it closes a larger distance to the vehicle ahead, seconds.
const CLOSES_S: f64 = 3.0;

/// A change of lanes, and the traffic of the lane after it.
#[derive(Clone, Debug)]
pub(super) struct Join {
    pub(super) change: LaneChange,
    /// Place of the ego's centre at which it gets into the way of that lane, metres.
    pub(super) over_m: f64,
    /// That lane and those that lead to it, each with the arc length along the route less that along the lane, metres.
    lanes: Vec<(LaneId, f64)>,
    /// Vehicles ahead and behind the gap that the ego adapts to.
    gap: Option<Gap>,
    /// True if it is slower for it.
    is_slower: bool,
}

/// A gap between two vehicles; `None` where there is nobody.
type Gap = [Option<ActorId>; 2];

/// Speed before a change, because of the vehicle behind which the ego joins its lane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Adaptation {
    pub(super) speed_mps: f64,
    /// Place of the ego's centre up to which it has that speed, metres.
    pub(super) until_m: f64,
    /// Place before which its front stops if there is no gap, metres.
    pub(super) stop_m: Option<f64>,
    pub(super) behind: Option<ActorId>,
}

/// The changes of a route over lanes.
pub(super) fn joins(route: &Route, lanes: &[OnLane], map: &Map) -> Vec<Join> {
    let join = |change: LaneChange| {
        let LaneChange { from, to, at_m, .. } = change;
        let from = map.lane(from)?;
        let on = lanes.iter().find(|on| on.lane == to && on.from_m == at_m)?;
        let is_aside = |s_m: &f64| from.line.project(route.line().at(*s_m).pose.point()).d_m.abs() > ASIDE_M;
        let before_m = (0..).map(|k| at_m - SAMPLE_M * f64::from(k)).take_while(|s_m| *s_m > 0.0);
        let over_m = before_m.take_while(is_aside).last().unwrap_or(at_m);
        Some(Join { change, over_m, lanes: leading_to(map, to, on.offset_m), gap: None, is_slower: false })
    };
    route.lane_changes(map).into_iter().filter_map(join).collect()
}

impl Join {
    /// Adapts to the first gap that the ego can reach; `None` if it does not have to be slower than `free_mps` for it.
    pub(super) fn adapt(
        &mut self,
        own: Own,
        free_mps: f64,
        (vehicles, at, roads): (&[Vehicle], &Situation<'_>, Roads<'_>),
        params: &RuleBasedParams,
    ) -> Option<Adaptation> {
        let to_m = self.over_m - own.center_m;
        // What comes into view stays in view. An ego that is already there when it gets its route cannot adapt.
        let in_time_m = [ADAPTS_S * own.speed_mps, own.view_m()];
        if self.gap.is_none() && !(in_time_m[0]..in_time_m[1]).contains(&to_m) {
            return None;
        }
        let moves = vehicles.iter().filter(|other| other.speed_mps > QUEUE_MPS);
        let place_m =
            |other: &Vehicle| self.place_m(other).or_else(|| self.comes_to_m(other, own, at, roads));
        let mut beside: Vec<(f64, &Vehicle)> =
            moves.filter_map(|other| Some((place_m(other)?, other))).collect();
        beside.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.id.cmp(&b.1.id)));
        if to_m <= 0.0 {
            return self.behind(own, free_mps, &beside);
        }
        let free_s = time_s(to_m, own.speed_mps, free_mps, params.gain_mps2);
        let most_mps = (own.speed_mps * own.speed_mps + 2.0 * params.gain_mps2 * to_m).sqrt();
        let joins_mps = free_mps.min(most_mps);
        let mut gaps = (0..=beside.len()).map(|k| {
            let (ahead, behind) = (k.checked_sub(1).map(|k| beside[k]), beside.get(k).copied());
            let gap = [ahead, behind].map(|one| one.map(|(_, other)| other.id));
            let at_s = ahead.map_or(free_s, |(s_m, other)| {
                let faster_mps = (joins_mps - other.speed_mps).max(0.0);
                let adapts_m = faster_mps * faster_mps / (2.0 * ADAPTS_MPS2);
                let is_at_m = self.over_m + own.half_m + other.half_m + ahead_m(other) + adapts_m;
                free_s.max((is_at_m - s_m) / other.speed_mps)
            });
            let speed_mps = if at_s > free_s { to_m / at_s } else { joins_mps };
            let share = if self.gap == Some(gap) { KEEPS_SHARE } else { 1.0 };
            let fits = behind.is_none_or(|(s_m, other)| {
                let faster_mps = (other.speed_mps - speed_mps).max(0.0);
                let adapts_m = faster_mps * faster_mps / (2.0 * (IMPOSED_MPS2 + params.gain_mps2));
                let gap_m = GAP_M + BEHIND_S * other.speed_mps + adapts_m;
                s_m + other.speed_mps * at_s + other.half_m + share * gap_m <= self.over_m - own.half_m
            });
            (gap, at_s, fits)
        });
        // Behind the last one in sight there is room.
        let (gap, at_s, _) = gaps.find(|(.., fits)| *fits)?;
        drop(gaps);
        self.gap = Some(gap);
        let speed_mps = (to_m / at_s).max(own.speed_mps - STEP_MPS);
        self.is_slower = at_s > free_s + if self.is_slower { 0.0 } else { LATE_S };
        let stop_m = (speed_mps < CREEPS_MPS).then_some((self.over_m + own.half_m).max(own.front_m));
        self.is_slower.then_some(Adaptation { speed_mps, until_m: self.change.at_m, stop_m, behind: gap[0] })
    }

    /// Keeps the ego behind the next vehicle ahead while it changes.
    fn behind(&self, own: Own, free_mps: f64, beside: &[(f64, &Vehicle)]) -> Option<Adaptation> {
        let (s_m, other) = beside.iter().rev().find(|(s_m, _)| *s_m > own.center_m)?;
        let spare_m = s_m - other.half_m - own.front_m - ahead_m(other);
        let speed_mps = (other.speed_mps + spare_m / CLOSES_S).max(0.0);
        let until_m = self.change.at_m + CLOSES_S * own.speed_mps;
        let adaptation = Adaptation { speed_mps, until_m, stop_m: None, behind: Some(other.id) };
        (speed_mps < free_mps).then_some(adaptation)
    }

    /// Place along the route of the centre of a vehicle that is on the other lane or comes to it, metres.
    fn place_m(&self, other: &Vehicle) -> Option<f64> {
        match other.route_m {
            Some(s_m) => (s_m >= self.change.at_m).then_some(s_m),
            None => self.lanes.iter().find_map(|(lane, offset_m)| Some(offset_m + other.on_m(*lane)?)),
        }
    }

    /// The same for one near the ego that is predicted to come to the other lane from beside it.
    fn comes_to_m(&self, other: &Vehicle, own: Own, at: &Situation<'_>, roads: Roads<'_>) -> Option<f64> {
        let away_m = other.pose.point().distance(Point2::new(own.x_m, own.y_m));
        if away_m > BESIDE_M || other.route_m.is_some() {
            return None;
        }
        let begin = at.predictions.partition_point(|one| one.id < other.id);
        let one = at.predictions.get(begin).filter(|one| one.id == other.id)?;
        let first = one.path.first()?;
        let later = one.path.iter().find(|point| (point.at - first.at).as_secs() >= COMES_S)?;
        let on_m = |(lane, offset_m): &(LaneId, f64)| {
            let found = roads.map.at(later.pose.point()).find(|on| on.lane == *lane)?;
            Some(offset_m + found.place.s_m)
        };
        let way_m = other.speed_mps * (later.at - first.at).as_secs();
        Some(self.lanes.iter().find_map(on_m)? - way_m)
    }
}

/// Distance that the ego keeps behind a vehicle of the other lane, metres.
fn ahead_m(other: &Vehicle) -> f64 {
    GAP_M + AHEAD_S * other.speed_mps
}

/// A lane and those that lead to it, each with the difference of arc lengths to a route.
fn leading_to(map: &Map, lane: LaneId, offset_m: f64) -> Vec<(LaneId, f64)> {
    let mut found = vec![(lane, offset_m)];
    let mut next = 0;
    while let Some(&(lane, begin_m)) = found.get(next) {
        next += 1;
        if offset_m - begin_m > BEHIND_M {
            continue;
        }
        for before in map.predecessors(lane) {
            let Some(length_m) = map.lane(*before).map(|lane| lane.line.length()) else { continue };
            if found.iter().all(|(known, _)| known != before) {
                found.push((*before, begin_m - length_m));
            }
        }
    }
    found
}
