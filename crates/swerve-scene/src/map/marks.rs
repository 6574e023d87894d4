//! Paint: lines along lanes, stop lines, zebra crossings; kerbs where no pavement has one.

use std::collections::BTreeSet;

use swerve_geom::{Point2, Vector2};
use swerve_map::{Crossing, LaneKind, Map, Mark, MarkColour, MarkKind, Side, StopLine, StopSign};

use super::ground::MapGround;
use super::pavement;
use super::side::{is_road, sign, spans};
use super::station::{Station, Strip};
use super::tiles::Tiles;
use crate::material::Material;
use crate::paving::{PAINT_M, WHITE, YELLOW, paint};

/// Strokes and gaps of broken lines, metres.
const BROKEN_M: [f64; 2] = [3.0, 6.0];
/// Strokes and gaps of rows of dots, metres.
const DOTS_M: [f64; 2] = [0.1, 1.1];
/// Range of widths of lines, metres; others in a map are mistakes.
const WIDTHS_M: [f64; 2] = [0.08, 0.5];
/// Most strokes of a line; of a wrong map, it may have any length.
const STROKES_MAX: usize = 100_000;
/// Distance of a line from the edge of the asphalt, metres.
const INSIDE_M: f64 = 0.08;

/// Length of stop lines along the lane, metres.
const STOP_M: f64 = 0.4;
/// Distance of stop lines from the borders of their lane, metres.
const STOP_ASIDE_M: f64 = 0.15;
/// Strokes and gaps of lines at which traffic gives way, metres.
const YIELD_M: [f64; 2] = [0.5, 0.3];
/// Stop lines closer than this are one, metres: those of lanes that begin at one place.
const SAME_STOP_M: f64 = 0.5;

/// Width of bars of zebra crossings, and of gaps between them, metres.
const BAR_M: f64 = 0.5;

/// Marks along the borders of a lane.
pub(super) fn borders(tiles: &mut Tiles, ground: &MapGround<'_>, strip: &Strip<'_>) {
    for side in [Side::Left, Side::Right].into_iter().filter(|side| ground.has_marks(strip.lane, *side)) {
        pavement::kerbs(tiles, ground, strip, side);
        if !ground.is_inside(strip.lane.id) {
            lines(tiles, ground, strip, side);
        }
    }
}

fn lines(tiles: &mut Tiles, ground: &MapGround<'_>, strip: &Strip<'_>, side: Side) {
    let is_edge = ground.beside(strip.lane, side).is_none_or(|lane| !is_road(lane.kind));
    for (mark, span_m) in spans(strip.lane, side) {
        let width_m = mark.width_m.clamp(WIDTHS_M[0], WIDTHS_M[1]);
        for (offset, pattern_m) in patterns(mark.kind).iter().flatten() {
            // The outer line of two is one width inside the edge, so that both are on the asphalt.
            let middle_m =
                offset * width_m - if is_edge { INSIDE_M + (0.5 + offset.abs()) * width_m } else { 0.0 };
            let paint = Line { side, middle_m, width_m, material: material(mark) };
            strokes(span_m, *pattern_m, |span_m| paint.draw(tiles, strip, span_m));
        }
    }
}

/// Lines of a mark, the nearer one to the lane first: the offset beyond the border in widths, and stroke and gap in
/// metres if it is not solid.
fn patterns(kind: MarkKind) -> [Option<(f64, Option<[f64; 2]>)>; 2] {
    let (near, far) = (-1.0, 1.0);
    match kind {
        MarkKind::None | MarkKind::Kerb | MarkKind::Edge | MarkKind::Barrier => [None; 2],
        MarkKind::Solid => [Some((0.0, None)), None],
        MarkKind::Broken => [Some((0.0, Some(BROKEN_M))), None],
        MarkKind::Dots => [Some((0.0, Some(DOTS_M))), None],
        MarkKind::SolidSolid => [Some((near, None)), Some((far, None))],
        MarkKind::SolidBroken => [Some((near, None)), Some((far, Some(BROKEN_M)))],
        MarkKind::BrokenSolid => [Some((near, Some(BROKEN_M))), Some((far, None))],
        MarkKind::BrokenBroken => [Some((near, Some(BROKEN_M))), Some((far, Some(BROKEN_M)))],
    }
}

fn material(mark: &Mark) -> Material {
    paint(match mark.colour {
        MarkColour::White => WHITE,
        MarkColour::Yellow => YELLOW,
        MarkColour::Blue => [0.04, 0.1, 0.4],
        MarkColour::Red => [0.42, 0.05, 0.04],
    })
}

/// Calls `draw` with the ends of each stroke, metres; with the whole span without a pattern.
fn strokes([from_m, to_m]: [f64; 2], pattern_m: Option<[f64; 2]>, mut draw: impl FnMut([f64; 2])) {
    let [stroke_m, gap_m] = pattern_m.unwrap_or([f64::INFINITY, 0.0]);
    let begins = core::iter::successors(Some(from_m), |begin_m| Some(begin_m + stroke_m + gap_m));
    for begin_m in begins.take_while(|begin_m| *begin_m < to_m).take(STROKES_MAX) {
        draw([begin_m, (begin_m + stroke_m).min(to_m)]);
    }
}

/// A line along a border.
struct Line {
    side: Side,
    /// Distance of its middle beyond the border, metres.
    middle_m: f64,
    width_m: f64,
    material: Material,
}

impl Line {
    fn draw(&self, tiles: &mut Tiles, strip: &Strip<'_>, span_m: [f64; 2]) {
        let at = |station: &Station, out_m: f64| {
            let off_m = station.border_m(self.side) + sign(self.side) * (self.middle_m + out_m);
            (station.at(off_m), f64::from(PAINT_M))
        };
        let half_m = 0.5 * self.width_m;
        for two in strip.between(span_m).windows(2) {
            let corners =
                [at(&two[0], -half_m), at(&two[1], -half_m), at(&two[1], half_m), at(&two[0], half_m)];
            tiles.flat(self.material, corners);
        }
    }
}

/// All stop lines of a map.
pub(super) fn stop_lines(tiles: &mut Tiles, map: &Map) {
    let mut painted = BTreeSet::new();
    for line in map.stop_lines() {
        let Some(lane) = map.lane(line.lane).filter(|lane| is_road(lane.kind)) else { continue };
        let strip = Strip::new(lane);
        let begin_m = line.s_m.min(lane.line.length() - STOP_M).max(0.0);
        let at = strip.point(begin_m, 0.0);
        if painted.insert([at.x_m, at.y_m].map(|m| (m / SAME_STOP_M).round() as i64)) {
            stop_line(tiles, &strip, begin_m, line);
        }
    }
}

fn stop_line(tiles: &mut Tiles, strip: &Strip<'_>, begin_m: f64, line: &StopLine) {
    let gives_way = line.sign == Some(StopSign::Yield) && line.signals.is_empty();
    let station = Station::new(strip.lane, begin_m);
    let [right_m, left_m] = [Side::Right, Side::Left].map(|side| station.border_m(side));
    let across_m = [right_m + STOP_ASIDE_M, left_m - STOP_ASIDE_M];
    strokes(across_m, gives_way.then_some(YIELD_M), |[from_m, to_m]| {
        let corner = |s_m: f64, d_m: f64| (strip.point(s_m, d_m), f64::from(PAINT_M));
        let end_m = begin_m + STOP_M;
        let corners =
            [corner(begin_m, from_m), corner(end_m, from_m), corner(end_m, to_m), corner(begin_m, to_m)];
        tiles.flat(paint(WHITE), corners);
    });
}

/// Bars of a zebra crossing, in the direction of the traffic that it crosses.
pub(super) fn crossing(tiles: &mut Tiles, ground: &MapGround<'_>, crossing: &Crossing) {
    let count = crossing.outline.len() as f64;
    let mean = |of: fn(&Point2) -> f64| crossing.outline.iter().map(of).sum::<f64>() / count;
    let middle = Point2::new(mean(|p| p.x_m), mean(|p| p.y_m));
    let of_crossed = crossing.lanes.iter().filter_map(|id| ground.map.lane(*id));
    let crossed = of_crossed.filter(|lane| lane.kind == LaneKind::Driving).map(|lane| {
        let place = lane.line.project(middle);
        (place.d_m.abs(), lane.line.at(place.s_m).pose.heading_rad)
    });
    let nearest = crossed.min_by(|a, b| a.0.total_cmp(&b.0)).map(|(_, heading_rad)| heading_rad);
    let Some(heading_rad) = nearest.or_else(|| ground.road_heading_rad(middle)) else { return };
    let along = Vector2::from_heading(heading_rad);
    let frame = Frame { middle, along, across: along.left() };
    let corners: Vec<[f64; 2]> = crossing.outline.iter().map(|point| frame.local(*point)).collect();
    let ends = corners.iter().map(|[_, across]| *across);
    let (low, high) =
        ends.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), m| (low.min(m), high.max(m)));
    strokes([low + 0.5 * BAR_M, high], Some([BAR_M, BAR_M]), |[right_m, left_m]| {
        let [right, left] = [right_m, left_m].map(|across_m| extent(&corners, across_m));
        let (Some(right), Some(left)) = (right, left) else { return };
        let bar = [(right[0], right_m), (right[1], right_m), (left[1], left_m), (left[0], left_m)];
        let bar = bar.map(|(along_m, across_m)| frame.point(along_m, across_m));
        let center = bar[0] + (bar[2] - bar[0]) * 0.5;
        if left_m - right_m > 0.5 * BAR_M && ground.is_road(center) {
            tiles.flat(paint(WHITE), bar.map(|point| (point, f64::from(PAINT_M))));
        }
    });
}

/// Axes of a crossing: along the traffic, and to its left.
struct Frame {
    middle: Point2,
    along: Vector2,
    across: Vector2,
}

impl Frame {
    fn local(&self, point: Point2) -> [f64; 2] {
        let off = point - self.middle;
        [off.dot(self.along), off.dot(self.across)]
    }

    fn point(&self, along_m: f64, across_m: f64) -> Point2 {
        self.middle + self.along * along_m + self.across * across_m
    }
}

/// First and last position along the traffic at which a line of equal `across_m` meets an outline; `None` if it does not.
fn extent(corners: &[[f64; 2]], across_m: f64) -> Option<[f64; 2]> {
    let count = corners.len();
    let met = (0..count).filter_map(|k| {
        let ([from, a], [to, b]) = (corners[k], corners[(k + 1) % count]);
        let is_met = (a - across_m) * (b - across_m) <= 0.0 && a != b;
        is_met.then(|| from + (to - from) * ((across_m - a) / (b - a)))
    });
    met.fold(None, |range: Option<[f64; 2]>, at| {
        let [low, high] = range.unwrap_or([at, at]);
        Some([low.min(at), high.max(at)])
    })
}
