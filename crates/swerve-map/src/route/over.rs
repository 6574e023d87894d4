//! Routes over ways with lane changes.

use swerve_geom::{FrenetPoint, Point2, Polyline, angle_between};

use super::{Beside, Parts, Route, RouteError, between_lines, drivable};
use crate::router::{Step, Way};
use crate::{Border, Borders, Lane, LaneKind, Map, Side, Station};

/// Least length of the move to a lane beside, metres.
const CHANGE_LENGTH_M: f64 = 60.0;

/// Time of the move, seconds: a lateral acceleration of 2.2 m/s² over a width of 3.5 m.
const CHANGE_S: f64 = 3.0;

/// Distance from the start of a way to its first change, metres.
const BEFORE_CHANGE_M: f64 = 5.0;

/// Largest distance of a point from the chord that skips it, metres, and length of a chord: 0.7 m at a radius of 6 m.
const CHORD_M: f64 = 0.01;
const CHORD_MAX_M: f64 = 5.0;

/// Distance of points and stations where lanes are sampled, metres.
const SAMPLE_M: f64 = 1.0;

/// Largest distance from the line up to which the ground of a junction is searched, metres, and its step.
const ASIDE_M: f64 = 12.0;
const ASIDE_STEP_M: f64 = 0.25;

/// Largest gap between lanes of a junction that is ground too, metres: where their ends are not side by side.
const GAP_M: f64 = 0.75;

/// Share of the radius of a turn up to which ground on its inside is used.
const RADIUS_SHARE: f64 = 0.8;

/// Least length of the piece of a row before or after a place that the route passes, metres.
const PIECE_M: f64 = 1.0;
/// Reserve for rounding errors of bounding boxes, metres.
const ROUNDING_M: f64 = 1e-6;

/// A row of the road: lanes side by side, from that on which the route enters to that on which it leaves. A place that
/// the route passes cuts it into pieces, each a row.
#[derive(Clone, Copy)]
struct Row<'m> {
    from: &'m Lane,
    to: &'m Lane,
    /// Number of lanes from one to the other; positive to the left.
    across: i32,
    /// Begin and end of the piece, as shares of the length of its lanes.
    span: [f64; 2],
}

impl Row<'_> {
    fn is_cut_at_begin(&self) -> bool {
        self.span[0] > 0.0
    }

    fn is_whole(&self) -> bool {
        self.span == [0.0, 1.0]
    }
}

pub(super) fn route(
    map: &Map,
    way: &Way,
    beyond_m: f64,
    speed_mps: f64,
) -> Result<(Route, [f64; 2]), RouteError> {
    let rows = rows(map, way)?;
    let Some(first) = rows.first() else { return Err(RouteError::Empty) };
    let mut parts = Parts::starting_with(first.from);
    let (mut k, mut last_begin_m) = (0, 0.0);
    while let Some(row) = rows.get(k) {
        last_begin_m = parts.length_m;
        if row.across == 0 {
            // A change further on may begin here.
            let next = rows[k..].iter().position(|row| row.across != 0).map(|ahead| k + ahead);
            let begin = next.map_or(k + 1, |change| spread(map, &rows, k, change).0);
            if begin > k {
                match row.is_whole() {
                    true => add_lane(map, &mut parts, row.from),
                    false => last_begin_m = add_change(map, &mut parts, &Change::none(row))?,
                }
                k += 1;
                continue;
            }
        }
        let change = (k..rows.len()).find(|&k| rows[k].across != 0).unwrap_or(k);
        let (begin, end) = spread(map, &rows, k, change);
        let run = run(map, &rows[begin..end], rows[change].across);
        let from_m = if begin == 0 { way.ends_m[0] + BEFORE_CHANGE_M } else { 0.0 };
        let change = Change::new(run, from_m, speed_mps);
        last_begin_m = add_change(map, &mut parts, &change)?;
        k = end;
    }
    let last = rows.last().map(|row| row.to);
    beyond(map, last, beyond_m, &mut parts);
    let route = parts.into_route()?;
    let goal = last.map(|lane| lane.line.at(way.ends_m[1]).pose.point());
    let reach_m = route.line().length();
    let goal_m = goal.map_or(0.0, |goal| {
        let near_m = last_begin_m + way.ends_m[1];
        route.project_near(goal, near_m, reach_m.min(50.0)).s_m
    });
    Ok((route, [way.ends_m[0], goal_m]))
}

/// Rows of a way: successive changes are one row.
fn rows<'m>(map: &'m Map, way: &Way) -> Result<Vec<Row<'m>>, RouteError> {
    let mut rows: Vec<Row<'m>> = Vec::new();
    for (k, &(step, id)) in way.lanes.iter().enumerate() {
        let lane = map.lane(id).ok_or(RouteError::Unknown(id))?;
        let aside = match step {
            Step::Begin | Step::Follow => 0,
            Step::ChangeLeft => 1,
            Step::ChangeRight => -1,
        };
        match rows.last_mut().filter(|_| aside != 0) {
            Some(row) => (row.to, row.across) = (lane, row.across + aside),
            None => rows.push(Row { from: lane, to: lane, across: 0, span: [0.0, 1.0] }),
        }
        for (_, s_m) in way.via.iter().filter(|(at, _)| *at == k) {
            cut(&mut rows, s_m / lane.line.length());
        }
    }
    Ok(rows)
}

/// Cuts the last row at a share of its length, so that the changes before and after that place are not one. Where there
/// is a single lane, nothing changes.
fn cut(rows: &mut Vec<Row<'_>>, share: f64) {
    let Some(last) = rows.last_mut() else { return };
    let least = PIECE_M / last.to.line.length();
    let is_alone = [last.to.left, last.to.right].into_iter().flatten().all(|beside| beside.opposite);
    if is_alone || share < last.span[0] + least || share > last.span[1] - least {
        return;
    }
    let next = Row { from: last.to, across: 0, span: [share, last.span[1]], ..*last };
    last.span[1] = share;
    rows.push(next);
}

/// Rows before and after the row of a change on which the same lanes are side by side, not before row `least`: their
/// range.
fn spread(map: &Map, rows: &[Row<'_>], least: usize, change: usize) -> (usize, usize) {
    let Row { from, to, across, .. } = rows[change];
    let (mut begin, mut target) = (change, to);
    while begin > least && rows[begin - 1].across == 0 && !rows[begin].is_cut_at_begin() {
        let found = beside(map, rows[begin - 1].to, across);
        let Some(other) = found.filter(|other| other.successors.contains(&target.id)) else { break };
        (begin, target) = (begin - 1, other);
    }
    let (mut end, mut left) = (change + 1, from);
    while end < rows.len() && rows[end].across == 0 && !rows[end].is_cut_at_begin() {
        let found = beside(map, rows[end].from, -across);
        let Some(other) = found.filter(|other| left.successors.contains(&other.id)) else { break };
        (end, left) = (end + 1, other);
    }
    (begin, end)
}

/// The driving lane of the same direction this many lanes to the left.
pub(crate) fn beside<'m>(map: &'m Map, lane: &'m Lane, across: i32) -> Option<&'m Lane> {
    let mut at = lane;
    for _ in 0..across.abs() {
        let next = if across > 0 { at.left } else { at.right };
        let next = next.filter(|next| !next.opposite)?;
        at = map.lane(next.lane).filter(|lane| lane.kind == LaneKind::Driving)?;
    }
    Some(at)
}

/// Both lanes of each row of a change, from the lane before the change to that after it.
fn run<'m>(map: &'m Map, rows: &[Row<'m>], across: i32) -> Vec<Pair<'m>> {
    let mut changed = false;
    let pair = |row: &Row<'m>| {
        let span = row.span;
        if row.across != 0 {
            changed = true;
            return Pair { from: row.from, to: row.to, span };
        }
        let aside = beside(map, row.from, if changed { -across } else { across }).unwrap_or(row.from);
        match changed {
            false => Pair { from: row.from, to: aside, span },
            true => Pair { from: aside, to: row.from, span },
        }
    };
    rows.iter().map(pair).collect()
}

/// The lanes of a row before and after a change, and begin and end of the piece, as shares of their lengths.
#[derive(Clone, Copy)]
struct Pair<'m> {
    from: &'m Lane,
    to: &'m Lane,
    span: [f64; 2],
}

impl Pair<'_> {
    fn length_m(&self) -> f64 {
        self.from.line.length() * (self.span[1] - self.span[0])
    }
}

/// Length of a change at a speed, metres.
pub(crate) fn change_length_m(speed_mps: f64) -> f64 {
    CHANGE_LENGTH_M.max(CHANGE_S * speed_mps)
}

/// A move from lane to lane over rows of both.
struct Change<'m> {
    rows: Vec<Pair<'m>>,
    /// Place where it begins, metres into the rows, and its length.
    begin_m: f64,
    over_m: f64,
}

impl<'m> Change<'m> {
    /// The first move at or after `from_m` that crosses no line that must not be crossed; that at `from_m` if there is
    /// none. The speed is at most `speed_mps`.
    fn new(rows: Vec<Pair<'m>>, from_m: f64, speed_mps: f64) -> Self {
        let length_m: f64 = rows.iter().map(Pair::length_m).sum();
        let from_m = from_m.min(0.5 * length_m);
        let limit_mps = |lane: &Lane| lane.speed_limit_mps.map_or(speed_mps, |limit| limit.min(speed_mps));
        let lanes = rows.iter().flat_map(|row| [row.from, row.to]);
        let fastest_mps = lanes.map(limit_mps).fold(0.0, f64::max);
        let over_m = change_length_m(fastest_mps);
        let at = |rows, begin_m: f64| Self { rows, begin_m, over_m: over_m.min(length_m - begin_m) };
        let mut change = at(rows, from_m);
        while change.begin_m + over_m <= length_m {
            if change.is_free() {
                return change;
            }
            change.begin_m += SAMPLE_M;
        }
        at(change.rows, from_m)
    }

    /// The lane of a piece of a row, without a move.
    fn none(row: &Row<'m>) -> Self {
        let rows = vec![Pair { from: row.from, to: row.from, span: row.span }];
        Self { rows, begin_m: 0.0, over_m: f64::INFINITY }
    }

    /// Returns true if the line between the lanes may be crossed where the outline is over it: in the middle half.
    fn is_free(&self) -> bool {
        let places = (0..=4).map(|k| self.begin_m + self.over_m * (0.25 + 0.125 * f64::from(k)));
        places.into_iter().all(|at_m| self.may_cross(at_m))
    }

    fn may_cross(&self, at_m: f64) -> bool {
        let mut row_m = 0.0;
        for row @ Pair { from, to, span } in &self.rows {
            if at_m <= row_m + row.length_m() {
                let is_left = from.left.is_some_and(|left| left.lane == to.id);
                let s_m = span[0] * from.line.length() + at_m - row_m;
                return from.may_cross(if is_left { Side::Left } else { Side::Right }, s_m);
            }
            row_m += row.length_m();
        }
        true
    }

    /// Share of the way from one lane to the other, `at_m` metres into the rows.
    fn share(&self, at_m: f64) -> f64 {
        smooth(((at_m - self.begin_m) / self.over_m).clamp(0.0, 1.0))
    }
}

/// Adds the move from lane to lane. Gives the arc length at which the last lanes of its rows begin.
fn add_change(map: &Map, parts: &mut Parts, change: &Change<'_>) -> Result<f64, RouteError> {
    let (mut row_m, mut last_begin_m) = (0.0, parts.length_m);
    for row @ &Pair { from, to, span } in &change.rows {
        last_begin_m = parts.length_m - span[0] * to.line.length();
        let row_length_m = row.length_m();
        let share = |s_m: f64| change.share(row_m + s_m);
        let count = (row_length_m / SAMPLE_M).ceil().max(1.0);
        let sample = |k: usize| {
            let at = k as f64 / count;
            let along = span[0] + at * (span[1] - span[0]);
            Sample::between(from, to, along, share(row_length_m * at))
        };
        let samples: Vec<Sample> = (0..=count as usize).map(sample).collect();
        let mut points = vec![*parts.points.last().unwrap_or(&samples[0].at)];
        points.extend(samples[1..].iter().map(|sample| sample.at));
        let line = Polyline::new(&points)?;
        let grounds = [from, to].map(|lane| drivable(map, lane));
        let ground = around(&points, &samples, [&grounds[0], &grounds[1]], true);
        let own = around(&points, &samples, [&from.borders, &to.borders], false);
        let [lines, other] = [from, to].map(|lane| between_lines(map, lane));
        let between_lines = (lines.is_some() || other.is_some()).then(|| {
            let lines = [lines.as_ref().unwrap_or(&grounds[0]), other.as_ref().unwrap_or(&grounds[1])];
            around(&points, &samples, lines, true)
        });
        let leaves = samples.iter().position(|x| x.share > 0.5);
        let goes_on = span[0] > 0.0 && parts.stretches.last().is_some_and(|last| last.lane == from.id);
        if leaves != Some(0) && !goes_on {
            parts.stretch(map, from, 0.0);
        }
        if let Some(k) = leaves {
            parts.stretch(map, to, line.length() * k as f64 / count);
        }
        let beside = Beside { ground: &ground, between_lines: between_lines.as_ref(), own: &own };
        parts.add(&points[1..], line.length(), &beside);
        row_m += row_length_m;
    }
    Ok(last_begin_m)
}

/// Borders around both of two others, each beside its own lane; or, except `always`, around those that the move has not
/// left yet or has begun to enter.
fn around(points: &[Point2], samples: &[Sample], of: [&Borders; 2], always: bool) -> Borders {
    let widest = |sample: &Sample, distance_m: &dyn Fn(&Borders, f64) -> f64, sign: f64| {
        let used = [always || sample.share < 1.0, always || sample.share > 0.0];
        let beside = (0..2).filter(|k| used[*k]);
        let distances = beside.map(|k| distance_m(of[k], sample.s_m[k]) - sign * sample.d_m[k]);
        distances.fold(f64::NEG_INFINITY, f64::max)
    };
    let left = samples.iter().map(|sample| widest(sample, &Borders::left_m, 1.0));
    let right = samples.iter().map(|sample| widest(sample, &Borders::right_m, -1.0));
    Borders::new(stations(points, left), stations(points, right))
}

/// A point of a change, with its places beside both lanes.
struct Sample {
    at: Point2,
    share: f64,
    s_m: [f64; 2],
    d_m: [f64; 2],
}

impl Sample {
    /// The point at a share of the way from one lane to the other, at the same share of both lengths.
    fn between(from: &Lane, to: &Lane, along: f64, share: f64) -> Self {
        let s_m = [from, to].map(|lane| along * lane.line.length());
        let places = [from.line.at(s_m[0]).pose, to.line.at(s_m[1]).pose];
        let at = places[0].point() + (places[1].point() - places[0].point()) * share;
        let d_m = places.map(|place| (at - place.point()).dot(place.direction().left()));
        Self { at, share, s_m, d_m }
    }
}

/// Border with a station at each point.
fn stations(points: &[Point2], distances_m: impl Iterator<Item = f64>) -> Border {
    let mut s_m = 0.0;
    let mut last = points[0];
    let stations: Vec<Station> = points
        .iter()
        .zip(distances_m)
        .map(|(&point, distance_m)| {
            s_m += point.distance(last);
            last = point;
            Station { s_m, distance_m }
        })
        .collect();
    Border::linear(&stations).unwrap_or_else(|_| Border::constant(stations[0].distance_m))
}

/// Smooth step with zero slope and curvature at both ends.
fn smooth(u: f64) -> f64 {
    u * u * u * (10.0 + u * (6.0 * u - 15.0))
}

/// Adds a whole lane, of which fewer points are kept; in a junction with all ground beside it.
fn add_lane(map: &Map, parts: &mut Parts, lane: &Lane) {
    let (ground, between_lines) = match map.is_in_junction(lane.id) {
        true => (junction_ground(map, lane), None),
        false => (drivable(map, lane), between_lines(map, lane)),
    };
    let points = thinned(lane.line.points());
    let length_m: f64 = points.windows(2).map(|two| two[0].distance(two[1])).sum();
    let scaled = |borders: &Borders| {
        let side = |border: &Border| border.along(0.0, length_m / lane.line.length());
        Borders::new(side(borders.left()), side(borders.right()))
    };
    parts.stretch(map, lane, 0.0);
    let between_lines = between_lines.as_ref().map(scaled);
    let beside = Beside {
        ground: &scaled(&ground),
        between_lines: between_lines.as_ref(),
        own: &scaled(&lane.borders),
    };
    parts.add(&points[1..], length_m, &beside);
}

/// Points of a line without those that are within [`CHORD_M`] of the chords that skip them: maps have many more points
/// in bends than driving needs.
fn thinned(points: &[Point2]) -> Vec<Point2> {
    let mut kept = vec![points[0]];
    let mut from = 0;
    for to in 2..points.len() {
        let chord = points[to] - points[from];
        let is_near = |point: &Point2| chord.cross(*point - points[from]).abs() <= CHORD_M * chord.norm();
        if chord.norm() > CHORD_MAX_M || !points[from + 1..to].iter().all(is_near) {
            from = to - 1;
            kept.push(points[from]);
        }
    }
    kept.push(points[points.len() - 1]);
    kept
}

/// Borders of the ground beside a lane of a junction, up to the first place without a drivable lane.
fn junction_ground(map: &Map, lane: &Lane) -> Borders {
    let length_m = lane.line.length();
    let count = (length_m / SAMPLE_M).ceil().max(1.0) as usize;
    let near: Vec<_> = map.near(lane, ASIDE_M).filter(|(other, _)| other.kind.is_drivable()).collect();
    let at = |s_m: f64, d_m: f64| lane.line.to_map(FrenetPoint { s_m, d_m });
    let is_ground = |point: Point2| {
        near.iter().any(|(lane, bounds)| bounds.has(point, ROUNDING_M) && lane.place_of(point).is_some())
    };
    let side = |sign: f64| {
        let own = if sign > 0.0 { lane.borders.left() } else { lane.borders.right() };
        let station = |k: usize| {
            let s_m = length_m * k as f64 / count as f64;
            let inwards_1pm = sign * lane.line.at(s_m).curvature_1pm;
            let most_m = if inwards_1pm > 0.0 { ASIDE_M.min(RADIUS_SHARE / inwards_1pm) } else { ASIDE_M };
            let (mut distance_m, mut next_m) = (own.at(s_m), own.at(s_m) + ASIDE_STEP_M);
            while next_m <= most_m && next_m - distance_m <= GAP_M {
                if is_ground(at(s_m, sign * next_m)) {
                    distance_m = next_m;
                }
                next_m += ASIDE_STEP_M;
            }
            let next_m = (distance_m + ASIDE_STEP_M).min(most_m);
            Station { s_m, distance_m: edge_m(distance_m, next_m, |d_m| is_ground(at(s_m, sign * d_m))) }
        };
        let stations: Vec<Station> = (0..=count).map(station).collect();
        Border::linear(&stations).unwrap_or_else(|_| own.clone())
    };
    Borders::new(side(1.0), side(-1.0))
}

/// Last distance that is ground between one that is and one that may not be, metres, within a centimetre.
fn edge_m(mut inside_m: f64, mut outside_m: f64, is_ground: impl Fn(f64) -> bool) -> f64 {
    while outside_m - inside_m > 0.01 {
        let middle_m = 0.5 * (inside_m + outside_m);
        if is_ground(middle_m) { inside_m = middle_m } else { outside_m = middle_m }
    }
    inside_m
}

/// Adds successors of the last lane up to a length.
fn beyond(map: &Map, last: Option<&Lane>, length_m: f64, parts: &mut Parts) {
    let until_m = parts.length_m + length_m;
    let mut at = last;
    while let Some(lane) = at.filter(|_| parts.length_m < until_m) {
        let turn = |next: &Lane| {
            let [begin, end] = [0.0, next.line.length()].map(|s_m| next.line.at(s_m).pose.heading_rad);
            (next.kind == LaneKind::Driving).then_some(angle_between(begin, end).abs())
        };
        at = map.best_successor(lane, turn);
        if let Some(next) = at {
            add_lane(map, parts, next);
        }
    }
}

#[cfg(test)]
mod tests;
