//! Raised ground: pavements and kerbs.

use swerve_geom::Point2;
use swerve_map::{MarkKind, Side};

use super::ground::MapGround;
use super::side::{is_road, sign, spans};
use super::station::{Station, Strip};
use super::tiles::Tiles;
use crate::paving::{GRASS_M, KERB_M, flags, kerb};

/// Heights of the faces of kerbs, metres.
pub(super) const KERB_FACE_M: [f64; 2] = [GRASS_M, KERB_M as f64];
/// Width of kerb stones, metres.
const STONE_M: f64 = 0.16;
/// Largest side of a part of a pavement that is left out where a road is, metres.
const CELL_M: f64 = 1.5;

/// Pavement of a lane for pedestrians, without the parts that are on a road.
pub(super) fn lane(tiles: &mut Tiles, ground: &MapGround<'_>, strip: &Strip<'_>) {
    let dense = strip.dense(CELL_M);
    let widest_m = dense.iter().map(Station::width_m).fold(0.0, f64::max);
    let columns = ((widest_m - 2.0 * STONE_M) / CELL_M).ceil().clamp(1.0, 64.0) as usize;
    let kept = |stations: &[Station]| -> Vec<Vec<bool>> {
        let row = |two: &[Station]| {
            let is_free = |k| !ground.is_road(middle(two, columns, k));
            (0..columns + 2).map(is_free).collect()
        };
        stations.windows(2).map(row).collect()
    };
    let of_dense = kept(&dense);
    if of_dense.iter().flatten().all(|is_kept| *is_kept) {
        let rows = vec![vec![true; columns + 2]; strip.stations.len() - 1];
        return raised(tiles, &strip.stations, columns, &rows);
    }
    raised(tiles, &dense, columns, &of_dense);
}

/// Offset of the edge at the right of a column, metres: a kerb stone, `columns` of slabs, a kerb stone.
fn edge_m(station: &Station, columns: usize, k: usize) -> f64 {
    let (right_m, width_m) = (station.border_m(Side::Right), station.width_m());
    let stone_m = STONE_M.min(width_m / 3.0);
    match k {
        0 => right_m,
        k if k == columns + 2 => right_m + width_m,
        k => right_m + stone_m + (width_m - 2.0 * stone_m) * ((k - 1) as f64 / columns as f64),
    }
}

fn middle(two: &[Station], columns: usize, k: usize) -> Point2 {
    let across =
        |station: &Station| station.at(0.5 * (edge_m(station, columns, k) + edge_m(station, columns, k + 1)));
    let (from, to) = (across(&two[0]), across(&two[1]));
    from + (to - from) * 0.5
}

/// Raised ground where `kept` is true, by rows between stations and columns from the right.
fn raised(tiles: &mut Tiles, stations: &[Station], columns: usize, kept: &[Vec<bool>]) {
    let at = |station: &Station, k: usize| station.at(edge_m(station, columns, k));
    let is_kept = |row: Option<usize>, k: usize| row.and_then(|row| kept.get(row)).is_some_and(|row| row[k]);
    for (row, two) in stations.windows(2).enumerate() {
        let top = |k: usize, next: usize| {
            [(0, k), (1, k), (1, next), (0, next)].map(|(end, k)| (at(&two[end], k), KERB_FACE_M[1]))
        };
        let mut k = 0;
        while k < columns + 2 {
            // Columns of one material that are kept.
            let is_stone = k == 0 || k == columns + 1;
            let end = if is_stone {
                k + 1
            } else {
                (k..=columns).take_while(|k| is_kept(Some(row), *k)).count() + k
            };
            if is_kept(Some(row), k) {
                tiles.flat(if is_stone { kerb() } else { flags() }, top(k, end));
            }
            k = end.max(k + 1);
        }
        for k in (0..columns + 2).filter(|k| is_kept(Some(row), *k)) {
            if k == 0 || !is_kept(Some(row), k - 1) {
                tiles.wall(kerb(), [at(&two[0], k), at(&two[1], k)], KERB_FACE_M);
            }
            if k == columns + 1 || !is_kept(Some(row), k + 1) {
                tiles.wall(kerb(), [at(&two[1], k + 1), at(&two[0], k + 1)], KERB_FACE_M);
            }
            if !is_kept(row.checked_sub(1), k) {
                tiles.wall(kerb(), [at(&two[0], k + 1), at(&two[0], k)], KERB_FACE_M);
            }
            if !is_kept(Some(row + 1), k) {
                tiles.wall(kerb(), [at(&two[1], k), at(&two[1], k + 1)], KERB_FACE_M);
            }
        }
    }
}

/// Kerbs along a border without a pavement beyond it.
pub(super) fn kerbs(tiles: &mut Tiles, ground: &MapGround<'_>, strip: &Strip<'_>, side: Side) {
    let beyond = ground.beside(strip.lane, side);
    if beyond.is_some_and(|lane| !is_road(lane.kind)) {
        return;
    }
    // Between two lanes, half of the stone is on each.
    let inner_m = if beyond.is_some() { -0.5 * STONE_M } else { 0.0 };
    for (_, span_m) in spans(strip.lane, side).filter(|(mark, _)| mark.kind == MarkKind::Kerb) {
        let stations = strip.between(span_m);
        for two in stations.windows(2) {
            let at = |station: &Station, out_m: f64| station.at(station.border_m(side) + sign(side) * out_m);
            let ends = [&two[0], &two[1]];
            let [inner, outer] = [inner_m, inner_m + STONE_M].map(|out_m| ends.map(|end| at(end, out_m)));
            let middle = outer[0] + (outer[1] - outer[0]) * 0.5;
            if beyond.is_none() && ground.is_road(middle) {
                continue;
            }
            let top = [inner[0], inner[1], outer[1], outer[0]].map(|point| (point, KERB_FACE_M[1]));
            tiles.flat(kerb(), top);
            // Faces are seen from the right.
            let (right, left) = if side == Side::Left { (inner, outer) } else { (outer, inner) };
            tiles.wall(kerb(), right, KERB_FACE_M);
            tiles.wall(kerb(), [left[1], left[0]], KERB_FACE_M);
        }
    }
}
