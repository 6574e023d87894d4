//! Borders of lanes as lines, for drawings of a map.

use swerve_geom::{FrenetPoint, Point2, Polyline};

use crate::{Lane, LaneMarks, Map, MarkKind, Side};

/// Length of the strokes of broken lines and of the gaps between them, metres.
const BROKEN_M: [f64; 2] = [3.0, 6.0];
/// Most strokes of one line; in a wrong map, a line may have any length.
const STROKES_MAX: usize = 10_000;

/// Look of a border.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum BorderLook {
    /// A line that is solid on one side at least, a kerb or a barrier.
    Solid,
    /// Broken lines or dots.
    Broken,
    /// No paint and no structure, or unknown.
    Plain,
    /// Inside a junction, where nothing is painted.
    InJunction,
}

/// A border of a lane, or the part of it with one look.
#[derive(Clone, PartialEq, Debug)]
pub struct BorderLine {
    /// Its points, in the direction of the lane.
    pub points: Vec<Point2>,
    /// Its look.
    pub look: BorderLook,
}

impl BorderLine {
    /// Straight pieces to draw: between the points, and the strokes of a broken line.
    pub fn pieces(&self) -> Vec<[Point2; 2]> {
        if self.look != BorderLook::Broken {
            return self.points.windows(2).map(|two| [two[0], two[1]]).collect();
        }
        let Ok(line) = Polyline::new(&self.points) else { return Vec::new() };
        let begins = (0..STROKES_MAX).map(|k| k as f64 * (BROKEN_M[0] + BROKEN_M[1]));
        let strokes = begins.take_while(|begin_m| *begin_m < line.length());
        let ends = |begin_m: f64| [begin_m, (begin_m + BROKEN_M[0]).min(line.length())];
        strokes.map(|begin_m| ends(begin_m).map(|s_m| line.at(s_m).pose.point())).collect()
    }
}

impl Lane {
    /// Arc lengths at which the centre line or a border may bend, in order: the ends, the points of the centre line, and
    /// the stations of the borders, metres.
    pub fn bends_m(&self) -> Vec<f64> {
        let end_m = self.line.length();
        let mut s_m = 0.0;
        let along = self.line.points().windows(2).map(|two| {
            s_m += two[0].distance(two[1]);
            s_m
        });
        let stations = self.borders.left().stations().iter().chain(self.borders.right().stations());
        let between = along.chain(stations.map(|station| station.s_m));
        let mut bends: Vec<f64> = between.filter(|s_m| 0.0 < *s_m && *s_m < end_m).collect();
        bends.extend([0.0, end_m]);
        bends.sort_by(f64::total_cmp);
        bends.dedup();
        bends
    }

    /// Points of a whole border at its [bends](Self::bends_m), in the direction of the lane.
    pub fn border_points(&self, side: Side) -> Vec<Point2> {
        self.border_between(side, [0.0, self.line.length()])
    }

    fn border_between(&self, side: Side, [from_m, to_m]: [f64; 2]) -> Vec<Point2> {
        let inner = self.bends_m().into_iter().filter(|s_m| from_m < *s_m && *s_m < to_m);
        let places = core::iter::once(from_m).chain(inner).chain([to_m]);
        let d_m = |s_m| match side {
            Side::Left => self.borders.left_m(s_m),
            Side::Right => -self.borders.right_m(s_m),
        };
        places.map(|s_m| self.line.to_map(FrenetPoint { s_m, d_m: d_m(s_m) })).collect()
    }
}

impl Map {
    /// Borders of all lanes; a border between two lanes is there once, with the marks of the lane that has some.
    pub fn border_lines(&self) -> Vec<BorderLine> {
        let mut lines = Vec::new();
        for lane in self.lanes() {
            for side in [Side::Left, Side::Right] {
                if self.draws(lane, side) {
                    self.add_border(&mut lines, lane, side);
                }
            }
        }
        lines
    }

    /// Returns true if a border is drawn as that of this lane, and not as that of its neighbour.
    fn draws(&self, lane: &Lane, side: Side) -> bool {
        let beside = if side == Side::Left { lane.left } else { lane.right };
        let Some((neighbour, other)) = beside.and_then(|other| Some((other, self.lane(other.lane)?))) else {
            return true;
        };
        // The shared border is on the same side of a lane in the opposite direction.
        let of_other = match (side, neighbour.opposite) {
            (side, true) => side,
            (Side::Left, false) => Side::Right,
            (Side::Right, false) => Side::Left,
        };
        let rank = |lane: &Lane, side| (lane.marks.of(side).is_empty(), lane.id);
        rank(lane, side) < rank(other, of_other)
    }

    fn add_border(&self, lines: &mut Vec<BorderLine>, lane: &Lane, side: Side) {
        let end_m = lane.line.length();
        let mut add = |span_m, look| {
            lines.push(BorderLine { points: lane.border_between(side, span_m), look });
        };
        if self.is_in_junction(lane.id) {
            return add([0.0, end_m], BorderLook::InJunction);
        }
        for (span_m, look) in looks(&lane.marks, side, end_m) {
            add(span_m, look);
        }
    }
}

/// Looks of a border, each with its begin and end along the lane, metres.
fn looks(marks: &LaneMarks, side: Side, end_m: f64) -> Vec<([f64; 2], BorderLook)> {
    let marks = marks.of(side).iter().map(|mark| (mark.from_m.max(0.0), look_of(mark.kind)));
    let all: Vec<(f64, BorderLook)> = core::iter::once((0.0, BorderLook::Plain)).chain(marks).collect();
    let next = all.iter().skip(1).map(|(from_m, _)| from_m.min(end_m)).chain([end_m]);
    let spans = all.iter().zip(next).map(|((from_m, look), to_m)| ([*from_m, to_m], *look));
    spans.filter(|([from_m, to_m], _)| from_m < to_m).collect()
}

fn look_of(kind: MarkKind) -> BorderLook {
    match kind {
        MarkKind::Broken | MarkKind::BrokenBroken | MarkKind::Dots => BorderLook::Broken,
        MarkKind::None | MarkKind::Edge => BorderLook::Plain,
        MarkKind::Solid
        | MarkKind::SolidSolid
        | MarkKind::SolidBroken
        | MarkKind::BrokenSolid
        | MarkKind::Kerb
        | MarkKind::Barrier => BorderLook::Solid,
    }
}

#[cfg(test)]
mod tests;
