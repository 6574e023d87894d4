//! Raised ground: pavements and kerbs.

use core::borrow::Borrow;

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
/// Distance of the stations of a pavement where it meets a road, and of samples across it, metres: no road is narrower.
const DENSE_M: f64 = 0.5;
const ACROSS_M: f64 = 1.0;
/// Distance from its edges up to which a pavement is not asked whether it is on a road, metres.
const EDGE_M: f64 = 0.02;
/// Narrowest pavement, metres.
const NARROWEST_M: f64 = 0.3;

/// Offsets of the right and left edges of a pavement at a station, metres to the left of its line.
type Edges = [f64; 2];

/// Pavement of a lane for pedestrians, without the parts that are on a road.
pub(super) fn lane(tiles: &mut Tiles, ground: &MapGround<'_>, strip: &Strip<'_>) {
    let whole = |station: &Station| {
        let right_m = station.border_m(Side::Right);
        [right_m, right_m + station.width_m()]
    };
    let dense = strip.dense(DENSE_M);
    let free: Vec<Option<Edges>> =
        dense.iter().map(|station| free(ground, station, whole(station))).collect();
    if dense.iter().zip(&free).all(|(station, free)| *free == Some(whole(station))) {
        let edges: Vec<Edges> = strip.stations.iter().map(whole).collect();
        return raised(tiles, &strip.stations, &edges);
    }
    let at: Vec<(&Station, Option<Edges>)> = dense.iter().zip(free).collect();
    for piece in at.chunk_by(|a, b| a.1.is_some() == b.1.is_some()) {
        let (stations, edges): (Vec<&Station>, Vec<Edges>) =
            piece.iter().filter_map(|(station, edges)| Some((*station, (*edges)?))).unzip();
        raised(tiles, &stations, &edges);
    }
}

/// The widest part between two edges that is not on a road; `None` if there is none.
fn free(ground: &MapGround<'_>, station: &Station, [right_m, left_m]: Edges) -> Option<Edges> {
    let is_free = |offset_m: f64| !ground.is_road(station.at(offset_m));
    let count = ((left_m - right_m) / ACROSS_M).ceil().clamp(1.0, 256.0) as usize;
    let (first_m, last_m) = (right_m + EDGE_M, left_m - EDGE_M);
    let offset_m = |k: usize| first_m + (last_m - first_m) * (k as f64 / count as f64);
    let of_samples: Vec<bool> = (0..=count).map(|k| is_free(offset_m(k))).collect();
    let mut widest: Option<[usize; 2]> = None;
    let mut k = 0;
    while k <= count {
        let end = k + of_samples[k..].iter().take_while(|is_free| **is_free).count();
        if end > k && widest.is_none_or(|[from, to]| end - k > to - from + 1) {
            widest = Some([k, end - 1]);
        }
        k = end.max(k + 1);
    }
    let [from, to] = widest?;
    // The edge of the road between a sample that is free and one that is not.
    let border_m = |mut free_m: f64, mut road_m: f64| {
        while (free_m - road_m).abs() > 0.01 {
            let middle_m = 0.5 * (free_m + road_m);
            if is_free(middle_m) { free_m = middle_m } else { road_m = middle_m }
        }
        free_m
    };
    let edges = [
        if from == 0 { right_m } else { border_m(offset_m(from), offset_m(from - 1)) },
        if to == count { left_m } else { border_m(offset_m(to), offset_m(to + 1)) },
    ];
    (edges[1] - edges[0] > NARROWEST_M).then_some(edges)
}

/// Raised ground between edges at successive stations: slabs between kerb stones.
fn raised<S: Borrow<Station>>(tiles: &mut Tiles, stations: &[S], edges: &[Edges]) {
    // Places across, from the right: a kerb stone, slabs, a kerb stone.
    let across = |(station, [right_m, left_m]): (&S, &Edges)| {
        let stone_m = STONE_M.min((left_m - right_m) / 3.0);
        [*right_m, right_m + stone_m, left_m - stone_m, *left_m].map(|offset_m| station.borrow().at(offset_m))
    };
    let rows: Vec<[Point2; 4]> = stations.iter().zip(edges).map(across).collect();
    for two in rows.windows(2) {
        for k in 0..3 {
            let top = [two[0][k], two[1][k], two[1][k + 1], two[0][k + 1]];
            let material = if k == 1 { flags() } else { kerb() };
            tiles.flat(material, top.map(|point| (point, KERB_FACE_M[1])));
        }
        tiles.wall(kerb(), [two[0][0], two[1][0]], KERB_FACE_M);
        tiles.wall(kerb(), [two[1][3], two[0][3]], KERB_FACE_M);
    }
    if let [first, .., last] = &rows[..] {
        tiles.wall(kerb(), [first[3], first[0]], KERB_FACE_M);
        tiles.wall(kerb(), [last[0], last[3]], KERB_FACE_M);
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
