//! Asphalt.

use std::collections::BTreeSet;

use swerve_geom::Point2;
use swerve_map::{Junction, LaneKind, Side};

use super::ground::MapGround;
use super::side::{is_road, neighbour, sign};
use super::station::{Station, Strip};
use super::tiles::Tiles;
use crate::SemanticClass;
use crate::paving::{GRASS_M, asphalt, soil};

/// Asphalt that continues under neighbours and successors, metres: their cross-sections are at other places, and leave
/// gaps as wide as the error of a chord.
const UNDER_M: f64 = 0.04;
/// Width of the soil beside asphalt, metres.
const SOIL_M: f64 = 0.4;

/// Distances beyond a border at which another lane is searched, metres: the ground up to it is paved.
const GAPS_M: [f64; 4] = [0.2, 0.5, 0.9, 1.4];
/// Largest distance of cross-sections along borders without a neighbour, metres.
const EDGE_STEP_M: f64 = 3.0;

/// Side of a cell in which holes of junctions are searched, metres.
const CELL_M: f64 = 1.0;
/// Largest hole of a junction that is closed, square metres; larger ones are islands.
const HOLE_MAX_M2: f64 = 60.0;
/// Largest extent of a junction whose holes are closed, metres.
const JUNCTION_MAX_M: f64 = 250.0;
/// Height of asphalt between lanes, metres: below the lanes around it.
const HOLE_M: f64 = -0.004;

/// Asphalt of a lane; along borders without a neighbour, soil, or asphalt up to a lane nearby.
pub(super) fn lane(tiles: &mut Tiles, ground: &MapGround<'_>, strip: &Strip<'_>) {
    let lane = strip.lane;
    let material = match lane.kind {
        LaneKind::Parking => asphalt().with_class(SemanticClass::Parking),
        _ => asphalt(),
    };
    let mut stations = strip.stations.clone();
    let last = stations.len() - 1;
    stations[0] = stations[0].moved(-UNDER_M);
    stations[last] = stations[last].moved(UNDER_M);
    let under_m = |side| match ground.beside(lane, side) {
        Some(other) if is_road(other.kind) => sign(side) * UNDER_M,
        _ => 0.0,
    };
    let [left_m, right_m] = [Side::Left, Side::Right].map(under_m);
    for two in stations.windows(2) {
        let right = |station: &Station| (station.at(station.border_m(Side::Right) + right_m), 0.0);
        let left = |station: &Station| (station.at(station.border_m(Side::Left) + left_m), 0.0);
        tiles.flat(material, [right(&two[0]), right(&two[1]), left(&two[1]), left(&two[0])]);
    }
    for side in [Side::Left, Side::Right].into_iter().filter(|side| neighbour(lane, *side).is_none()) {
        edge(tiles, ground, strip, side);
    }
}

/// Ground along a border without a neighbour.
fn edge(tiles: &mut Tiles, ground: &MapGround<'_>, strip: &Strip<'_>, side: Side) {
    let at = |station: &Station, out_m: f64| station.at(station.border_m(side) + sign(side) * out_m);
    let is_lane = |point: Point2| ground.is_road(point) || ground.is_pavement(point);
    let gap_m = |station: &Station| GAPS_M.into_iter().find(|gap_m| is_lane(at(station, *gap_m)));
    for two in strip.dense(EDGE_STEP_M).windows(2) {
        let ends = [&two[0], &two[1]];
        let gaps_m = ends.map(gap_m);
        let strip = |inner: [(f64, f64); 2], outer: [(f64, f64); 2]| {
            let corner = |(k, height_m): (usize, (f64, f64))| (at(ends[k], height_m.0), height_m.1);
            [corner((0, inner[0])), corner((1, inner[1])), corner((1, outer[1])), corner((0, outer[0]))]
        };
        if gaps_m.iter().any(Option::is_some) {
            let outer = gaps_m.map(|gap_m| (gap_m.map_or(0.0, |gap_m| gap_m + UNDER_M), HOLE_M));
            tiles.flat(asphalt(), strip([(0.0, HOLE_M); 2], outer));
        }
        if gaps_m.iter().any(Option::is_none) {
            tiles.flat(soil(), strip([(0.0, HOLE_M); 2], [(SOIL_M, GRASS_M - 0.01); 2]));
        }
    }
}

/// Asphalt in the holes between the lanes of a junction.
pub(super) fn holes(tiles: &mut Tiles, ground: &MapGround<'_>, junction: &Junction) {
    let lanes = junction.lanes.iter().filter_map(|id| ground.map.lane(*id));
    let points = lanes.filter(|lane| is_road(lane.kind)).flat_map(|lane| lane.line.points());
    let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
    for point in points {
        for (axis, value) in [point.x_m, point.y_m].into_iter().enumerate() {
            (low[axis], high[axis]) = (low[axis].min(value), high[axis].max(value));
        }
    }
    let extents_m = [high[0] - low[0], high[1] - low[1]];
    if !extents_m.iter().all(|extent_m| (0.0..JUNCTION_MAX_M).contains(extent_m)) {
        return;
    }
    let [columns, rows] = extents_m.map(|extent_m| (extent_m / CELL_M).ceil() as i32);
    let middle = |(column, row): (i32, i32)| {
        let at = |low: f64, k: i32| low + (f64::from(k) + 0.5) * CELL_M;
        Point2::new(at(low[0], column), at(low[1], row))
    };
    let cells = (0..columns).flat_map(|column| (0..rows).map(move |row| (column, row)));
    let mut open: BTreeSet<(i32, i32)> = cells.filter(|cell| !ground.is_road(middle(*cell))).collect();
    while let Some(first) = open.pop_first() {
        let hole = connected(&mut open, first);
        let is_at_edge =
            |&(column, row): &(i32, i32)| column == 0 || row == 0 || column + 1 == columns || row + 1 == rows;
        if hole.iter().any(is_at_edge) || hole.len() as f64 * CELL_M * CELL_M > HOLE_MAX_M2 {
            continue;
        }
        for at in hole.into_iter().map(middle) {
            let corner = |x: f64, y: f64| (Point2::new(at.x_m + x * CELL_M, at.y_m + y * CELL_M), HOLE_M);
            let corners = [corner(-1.0, -1.0), corner(1.0, -1.0), corner(1.0, 1.0), corner(-1.0, 1.0)];
            tiles.flat(asphalt(), corners);
        }
    }
}

/// Takes the cells that are connected with one.
fn connected(open: &mut BTreeSet<(i32, i32)>, first: (i32, i32)) -> Vec<(i32, i32)> {
    let mut found = vec![first];
    let mut next = 0;
    while let Some(&(column, row)) = found.get(next) {
        let around = [(column - 1, row), (column + 1, row), (column, row - 1), (column, row + 1)];
        found.extend(around.into_iter().filter(|cell| open.remove(cell)));
        next += 1;
    }
    found
}
