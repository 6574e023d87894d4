//! Routes over lanes.

use serde::{Deserialize, Serialize};
use swerve_geom::{FrenetPoint, Obb, Point2, Polyline, PolylineError};

use crate::router::Way;
use crate::{Border, Borders, Lane, LaneId, Map, Neighbour, Side, Signal, Station};

mod over;

pub(crate) use over::{beside, change_length_m};

/// Distance before the end of a lane at which traffic stops if its signal has no stop line, metres.
const BEFORE_END_M: f64 = 1.0;

/// Route of the ego, with the borders of the drivable ground.
///
/// Its line is the centre line of its lanes. The borders beside it are those of the drivable ground, neighbouring
/// lanes included.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Route {
    /// Centre line of its lanes.
    line: Polyline,
    /// Borders of the drivable ground.
    borders: Borders,
    /// Borders of its lanes; `None` if all of the ground is one lane.
    lane: Option<Borders>,
    /// Borders of the ground without crossing lines that must not be crossed; `None` if that is all of the ground.
    between_lines: Option<Borders>,
    /// Lanes in order; empty without a map.
    stretches: Vec<Stretch>,
}

/// The part of a route that is on one lane.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Stretch {
    /// The lane.
    pub lane: LaneId,
    /// Start of the stretch along the route, metres.
    pub begin_m: f64,
    /// Speed limit on it, m/s; `None` if unknown.
    pub speed_limit_mps: Option<f64>,
    /// True if the lane is inside a junction.
    pub in_junction: bool,
}

/// A change of a route from one lane to the next one beside it.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct LaneChange {
    /// The lane before.
    pub from: LaneId,
    /// The lane after.
    pub to: LaneId,
    /// Arc length from which the route is nearer to the lane after, metres.
    pub at_m: f64,
    /// Arc lengths between which the route moves from one lane to the other, metres: about, by the speed limit.
    pub part_m: [f64; 2],
}

/// Error of constructing a route from lanes.
#[derive(Clone, Copy, PartialEq, Debug, thiserror::Error)]
pub enum RouteError {
    /// The list of lanes is empty.
    #[error("a route needs one lane at least")]
    Empty,
    /// A lane is not on the map.
    #[error("lane {} is not on the map", .0.0)]
    Unknown(LaneId),
    /// A lane is not a successor of the one before it.
    #[error("lane {} does not go on from lane {}", .to.0, .from.0)]
    NoSuccessor {
        /// The lane before.
        from: LaneId,
        /// The lane.
        to: LaneId,
    },
    /// The lanes have no common line.
    #[error(transparent)]
    Line(#[from] PolylineError),
}

impl Route {
    /// Creates a route along `line` between `borders`, without a map.
    pub const fn new(line: Polyline, borders: Borders) -> Self {
        Self { line, borders, lane: None, between_lines: None, stretches: Vec::new() }
    }

    /// The same route in a lane with these borders: drivable ground beyond them is not in the ego's lane.
    #[must_use]
    pub fn in_lane(self, lane: Borders) -> Self {
        Self { lane: Some(lane), ..self }
    }

    /// Creates a route along `line` with constant drivable ground to its left and right (positive), metres; without a
    /// map.
    pub const fn uniform(line: Polyline, left_m: f64, right_m: f64) -> Self {
        Self::new(line, Borders::constant(left_m, right_m))
    }

    /// Creates the route over these lanes of `map`, each a successor of the one before, with all drivable ground
    /// beside them.
    ///
    /// # Errors
    /// If there is no lane, a lane is not on the map or not a successor, or the lanes have no length.
    pub fn along(map: &Map, lanes: &[LaneId]) -> Result<Self, RouteError> {
        let lane = |&id: &LaneId| map.lane(id).ok_or(RouteError::Unknown(id));
        let lanes = lanes.iter().map(lane).collect::<Result<Vec<&Lane>, _>>()?;
        let Some(first) = lanes.first() else { return Err(RouteError::Empty) };
        if let Some(two) = lanes.windows(2).find(|two| !two[0].successors.contains(&two[1].id)) {
            return Err(RouteError::NoSuccessor { from: two[0].id, to: two[1].id });
        }
        let mut parts = Parts::starting_with(first);
        lanes.iter().for_each(|lane| parts.add_lane(map, lane));
        parts.into_route()
    }

    /// Creates the route over a way of the router, and beyond its end over at least `beyond_m` metres of successors, if
    /// there are any: those that turn least. Also gives the arc lengths of the way's start and destination on it.
    ///
    /// It begins where the first lane begins. A change to a lane beside it is a smooth move over 3 s at the speed limit, or
    /// at `speed_mps` if that is lower, and over at least 60 m, or as much as there is of the road on which
    /// the two are side by side; both are the ego's lane there. Inside
    /// junctions, the lanes that lie beside each other without a gap are drivable ground, whatever their direction.
    ///
    /// # Errors
    /// If a lane of the way is not on the map, or the lanes have no length.
    pub fn over(map: &Map, way: &Way, beyond_m: f64, speed_mps: f64) -> Result<(Self, [f64; 2]), RouteError> {
        over::route(map, way, beyond_m, speed_mps)
    }

    /// The same route with the ground narrowed by `by_m` metres on either side.
    #[must_use]
    pub fn narrowed(&self, by_m: f64) -> Self {
        let less = Border::constant(-by_m);
        let narrowed =
            |borders: &Borders| Borders::new(borders.left().plus(&less), borders.right().plus(&less));
        let between_lines = self.between_lines.as_ref().map(narrowed);
        Self { between_lines, ..self.within(narrowed(&self.borders)) }
    }

    /// The same route with other borders of the ground, all of which may be used.
    #[must_use]
    pub fn within(&self, borders: Borders) -> Self {
        Self { borders, between_lines: None, ..self.clone() }
    }

    /// The part of the ground that the ego's lane reaches without crossing a line that must not be crossed; `None` if it
    /// reaches all of the ground. Unknown lines may be crossed, and there are none in junctions.
    pub fn between_lines(&self) -> Option<&Borders> {
        self.between_lines.as_ref()
    }

    /// Centre line of its lanes.
    pub fn line(&self) -> &Polyline {
        &self.line
    }

    /// Borders of the drivable ground beside the line.
    pub fn borders(&self) -> &Borders {
        &self.borders
    }

    /// Borders of the ego's lane beside the line; those of the drivable ground if no lane is known.
    pub fn lane(&self) -> &Borders {
        self.lane.as_ref().unwrap_or(&self.borders)
    }

    /// Lanes of the route in order; empty for a route without a map.
    pub fn stretches(&self) -> &[Stretch] {
        &self.stretches
    }

    /// Lane at arc length `s_m`, the first or last beyond the ends; `None` for a route without a map.
    pub fn stretch_at(&self, s_m: f64) -> Option<&Stretch> {
        self.stretches_from(s_m).first()
    }

    /// Lanes from arc length `s_m` on, with the one there; empty for a route without a map.
    pub fn stretches_from(&self, s_m: f64) -> &[Stretch] {
        let next = self.stretches.partition_point(|x| x.begin_m <= s_m);
        &self.stretches[next.max(1) - 1..]
    }

    /// Changes of lanes in order; `map` is that of the route.
    pub fn lane_changes(&self, map: &Map) -> Vec<LaneChange> {
        let change = |two: &[Stretch]| {
            let (from, to, at_m) = (map.lane(two[0].lane)?, two[1].lane, two[1].begin_m);
            let half_m = 0.5 * over::change_length_m(from.speed_limit_mps.unwrap_or(0.0));
            let part_m = [at_m - half_m, at_m + half_m];
            (!from.successors.contains(&to)).then_some(LaneChange { from: from.id, to, at_m, part_m })
        };
        self.stretches.windows(2).filter_map(change).collect()
    }

    /// Distance from arc length `s_m` to the next junction, metres: zero inside one, infinite if none follows.
    pub fn to_junction_m(&self, s_m: f64) -> f64 {
        let next = self.stretches_from(s_m).iter().find(|x| x.in_junction);
        next.map_or(f64::INFINITY, |next| (next.begin_m - s_m).max(0.0))
    }

    /// Stop line of a signal on the route, metres: where a lane is crossed by one of its lines, or shortly before the end
    /// of a lane before a junction; `None` if the signal is for other traffic. A signal for the lanes of some turns holds
    /// only for these.
    pub fn stop_s_m(&self, map: &Map, signal: &Signal) -> Option<f64> {
        let obeys = |lane| signal.lanes.binary_search(&lane).is_ok();
        let is_inside = |lane| map.is_in_junction(lane);
        self.stretches.iter().enumerate().find_map(|(k, stretch)| {
            let after = self.stretches.get(k + 1);
            let next = after.map(|after| after.lane);
            let lane = map.lane(stretch.lane).filter(|_| !is_inside(stretch.lane))?;
            let begin_m = self.lane_begin_m(map, k, lane, after);
            let lines = map.stop_lines_of(stretch.lane);
            let line = lines.iter().find(|line| line.signals.binary_search(&signal.id).is_ok());
            let is_for_turn = next.is_some_and(|next| is_inside(next) && obeys(next));
            let is_for_any = obeys(stretch.lane) || !signal.lanes.iter().any(|lane| is_inside(*lane));
            match line {
                Some(line) if is_for_turn || is_for_any => Some(begin_m + line.s_m),
                None if obeys(stretch.lane) || is_for_turn => {
                    Some(begin_m + (lane.line.length() - BEFORE_END_M).max(0.0))
                }
                _ => None,
            }
        })
    }

    /// Begin of the lane of stretch `k` along the route, metres. After a change of lanes, the stretch begins on the way
    /// along the lane.
    fn lane_begin_m(&self, map: &Map, k: usize, lane: &Lane, after: Option<&Stretch>) -> f64 {
        let follows = |before: LaneId, next: LaneId| {
            map.lane(before).is_some_and(|before| before.successors.contains(&next))
        };
        let before = k.checked_sub(1).map(|before| self.stretches[before].lane);
        let is_changed_to = before.is_some_and(|before| !follows(before, lane.id));
        match after.filter(|after| is_changed_to && follows(lane.id, after.lane)) {
            Some(after) => after.begin_m - lane.line.length(),
            None => self.stretches[k].begin_m,
        }
    }

    /// Width of the drivable ground to the left of the line at arc length `s_m`, metres (positive).
    pub fn left_m(&self, s_m: f64) -> f64 {
        self.borders.left_m(s_m)
    }

    /// Width of the drivable ground to the right of the line at arc length `s_m`, metres (positive).
    pub fn right_m(&self, s_m: f64) -> f64 {
        self.borders.right_m(s_m)
    }

    /// Projects `point` onto the nearest position of the whole route.
    pub fn project(&self, point: Point2) -> FrenetPoint {
        self.line.project(point)
    }

    /// As [`project`](Self::project), restricted to arc lengths within `reach_m` of `near_s_m`.
    pub fn project_near(&self, point: Point2, near_s_m: f64, reach_m: f64) -> FrenetPoint {
        self.line.project_near(point, near_s_m, reach_m)
    }

    /// Map position of a point along the route.
    pub fn unproject(&self, place: FrenetPoint) -> Point2 {
        self.line.to_map(place)
    }

    /// Smallest distance of an outline from the border of the drivable ground, measured across the line, metres;
    /// negative outside.
    pub fn margin_m(&self, outline: &Obb) -> f64 {
        self.borders.margin_m(outline.corners(), |point| self.project(point))
    }
}

/// Parts of a route, from its start on.
struct Parts {
    points: Vec<Point2>,
    length_m: f64,
    stretches: Vec<Stretch>,
    ground: [Vec<(f64, Border)>; 2],
    own: [Vec<(f64, Border)>; 2],
    between_lines: [Vec<(f64, Border)>; 2],
    /// True if the ground between lines differs from the ground.
    has_lines: bool,
}

/// Borders of a part of a route.
struct Beside<'a> {
    /// Of the drivable ground.
    ground: &'a Borders,
    /// Of the ground between lines; `None` if that is all of the ground.
    between_lines: Option<&'a Borders>,
    /// Of the ego's lane.
    own: &'a Borders,
}

impl Parts {
    fn starting_with(first: &Lane) -> Self {
        let points = vec![first.line.points()[0]];
        let none = || [Vec::new(), Vec::new()];
        Self {
            points,
            length_m: 0.0,
            stretches: Vec::new(),
            ground: none(),
            own: none(),
            between_lines: none(),
            has_lines: false,
        }
    }

    /// Adds a whole lane. At joints, the end of the part before replaces the start of the lane.
    fn add_lane(&mut self, map: &Map, lane: &Lane) {
        self.stretch(map, lane, 0.0);
        let (ground, between_lines) = (drivable(map, lane), between_lines(map, lane));
        let beside = Beside { ground: &ground, between_lines: between_lines.as_ref(), own: &lane.borders };
        self.add(&lane.line.points()[1..], lane.line.length(), &beside);
    }

    /// Begins a stretch on `lane` at `ahead_m` into the next part.
    fn stretch(&mut self, map: &Map, lane: &Lane, ahead_m: f64) {
        let (begin_m, in_junction) = (self.length_m + ahead_m, map.is_in_junction(lane.id));
        let speed_limit_mps = lane.speed_limit_mps;
        self.stretches.push(Stretch { lane: lane.id, begin_m, speed_limit_mps, in_junction });
    }

    /// Adds a part with borders relative to its own start.
    fn add(&mut self, points: &[Point2], length_m: f64, beside: &Beside<'_>) {
        let Beside { ground, between_lines, own } = *beside;
        self.points.extend(points);
        self.has_lines |= between_lines.is_some();
        let between_lines = between_lines.unwrap_or(ground);
        for (parts, borders) in
            [(&mut self.ground, ground), (&mut self.own, own), (&mut self.between_lines, between_lines)]
        {
            parts[0].push((self.length_m, borders.left().along(self.length_m, 1.0)));
            parts[1].push((self.length_m, borders.right().along(self.length_m, 1.0)));
        }
        self.length_m += length_m;
    }

    fn into_route(self) -> Result<Route, RouteError> {
        let joined = |[left, right]: [Vec<(f64, Border)>; 2]| {
            Borders::new(Border::joined(&left, self.length_m), Border::joined(&right, self.length_m))
        };
        let (borders, lane) = (joined(self.ground), Some(joined(self.own)));
        let between_lines = self.has_lines.then(|| joined(self.between_lines));
        Ok(Route {
            line: Polyline::new(&self.points)?,
            borders,
            lane,
            between_lines,
            stretches: self.stretches,
        })
    }
}

/// A drivable lane on the way outwards from another one.
struct Outer<'m> {
    /// The lane before it on that way, and the side of it that is crossed.
    from: &'m Lane,
    side: Side,
    lane: &'m Lane,
    /// True for lanes of the opposite direction: the lane before it, and this one.
    turned: [bool; 2],
}

/// Drivable lanes to one side of a lane, the nearest first.
fn outwards<'m>(map: &'m Map, lane: &'m Lane, to_left: bool) -> Vec<Outer<'m>> {
    let mut found = Vec::new();
    // In a lane of the opposite direction, outwards is on the other side.
    let (mut from, mut left) = (lane, to_left);
    for _ in 0..map.lanes().len() {
        let beside = if left { from.left } else { from.right };
        let Some(Neighbour { lane: id, opposite }) = beside else { break };
        let Some(next) = map.lane(id).filter(|next| next.kind.is_drivable()) else { break };
        let side = if left { Side::Left } else { Side::Right };
        let before = left != to_left;
        left ^= opposite;
        found.push(Outer { from, side, lane: next, turned: [before, left != to_left] });
        from = next;
    }
    found
}

/// Borders of the drivable ground beside a lane: the outer borders of its drivable neighbours.
fn drivable(map: &Map, lane: &Lane) -> Borders {
    let side = |own: &Border, to_left: bool| {
        outwards(map, lane, to_left).iter().fold(own.clone(), |border, Outer { lane: next, turned, .. }| {
            let width = next.borders.left().plus(next.borders.right());
            let scale = lane.line.length() / next.line.length();
            border.plus(&match turned[1] {
                true => width.along(lane.line.length(), -scale),
                false => width.along(0.0, scale),
            })
        })
    };
    Borders::new(side(lane.borders.left(), true), side(lane.borders.right(), false))
}

/// Distance of stations where the ground between lines is sampled, metres.
const LINES_SAMPLE_M: f64 = 1.0;

/// Borders of the ground beside a lane up to the first lines that must not be crossed; `None` if that is all of the
/// drivable ground.
fn between_lines(map: &Map, lane: &Lane) -> Option<Borders> {
    let length_m = lane.line.length();
    let count = (length_m / LINES_SAMPLE_M).ceil().max(1.0) as usize;
    let mut is_limited = false;
    let mut side = |own: &Border, to_left: bool| {
        let outwards = outwards(map, lane, to_left);
        let station = |k: usize| {
            let share = k as f64 / count as f64;
            let place = |lane: &Lane, turned| lane.line.length() * if turned { 1.0 - share } else { share };
            let mut distance_m = own.at(share * length_m);
            for Outer { from, side, lane: next, turned } in &outwards {
                if !from.may_cross(*side, place(from, turned[0])) {
                    is_limited = true;
                    break;
                }
                distance_m += next.width_m(place(next, turned[1]));
            }
            Station { s_m: share * length_m, distance_m }
        };
        let stations: Vec<Station> = (0..=count).map(station).collect();
        Border::linear(&stations).unwrap_or_else(|_| own.clone())
    };
    let borders = Borders::new(side(lane.borders.left(), true), side(lane.borders.right(), false));
    is_limited.then_some(borders)
}

#[cfg(test)]
mod tests;
