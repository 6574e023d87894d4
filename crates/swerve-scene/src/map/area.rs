//! Areas: islands, pavements, parking places.

use swerve_geom::Point2;
use swerve_map::{Area, AreaKind};

use super::ground::MapGround;
use super::pavement::KERB_FACE_M;
use super::tiles::Tiles;
use crate::SemanticClass;
use crate::material::Material;
use crate::paving::{asphalt, flags, kerb};

/// Height of paved areas that are not raised, metres: below lanes.
const PAVED_M: f64 = -0.003;

/// Ground of an area. Areas of other uses than parking, walking and islands have none of their own.
pub(super) fn area(tiles: &mut Tiles, ground: &MapGround<'_>, area: &Area) {
    match area.kind {
        AreaKind::NoEntry => raised(tiles, &area.outline),
        AreaKind::Walking if is_off_roads(ground, &area.outline) => raised(tiles, &area.outline),
        AreaKind::Walking => paved(tiles, flags(), &area.outline, PAVED_M),
        AreaKind::Parking => {
            paved(tiles, asphalt().with_class(SemanticClass::Parking), &area.outline, PAVED_M);
        }
        AreaKind::NoStopping | AreaKind::Other => {}
    }
}

/// True if no corner and no middle of an edge is on a road, 0.3 m inside the outline.
fn is_off_roads(ground: &MapGround<'_>, outline: &[Point2]) -> bool {
    let count = outline.len();
    let middle = outline.iter().fold(Point2::new(0.0, 0.0), |sum, p| {
        Point2::new(sum.x_m + p.x_m / count as f64, sum.y_m + p.y_m / count as f64)
    });
    let within = |point: Point2| {
        let off = middle - point;
        point + off * (0.3 / off.norm().max(0.3))
    };
    (0..count).all(|k| {
        let (from, to) = (outline[k], outline[(k + 1) % count]);
        [from, from + (to - from) * 0.5].into_iter().all(|point| !ground.is_road(within(point)))
    })
}

fn raised(tiles: &mut Tiles, outline: &[Point2]) {
    paved(tiles, flags(), outline, KERB_FACE_M[1]);
    let count = outline.len();
    for k in 0..count {
        let edge = [outline[k], outline[(k + 1) % count]];
        // Counter-clockwise, the outside is to the right.
        let edge = if doubled_area_m2(outline) > 0.0 { edge } else { [edge[1], edge[0]] };
        tiles.wall(kerb(), edge, KERB_FACE_M);
    }
}

fn paved(tiles: &mut Tiles, material: Material, outline: &[Point2], height_m: f64) {
    for triangle in triangles(outline) {
        tiles.triangle(material, triangle.map(|point| (point, height_m)));
    }
}

/// Twice the area of a polygon, square metres: positive if its corners run counter-clockwise.
fn doubled_area_m2(outline: &[Point2]) -> f64 {
    let first = outline[0];
    outline.windows(2).map(|two| (two[0] - first).cross(two[1] - first)).sum()
}

/// Triangles of a polygon, by cutting off ears; of an outline that crosses itself, some are missing.
fn triangles(outline: &[Point2]) -> Vec<[Point2; 3]> {
    let mut rest = outline.to_vec();
    if doubled_area_m2(outline) < 0.0 {
        rest.reverse();
    }
    let mut found = Vec::with_capacity(rest.len());
    while rest.len() > 2 {
        let count = rest.len();
        let corner = |k: usize| [rest[(k + count - 1) % count], rest[k], rest[(k + 1) % count]];
        let Some(ear) = (0..count).find(|k| is_ear(corner(*k), &rest)) else { break };
        found.push(corner(ear));
        rest.remove(ear);
    }
    found
}

/// True if a corner of a counter-clockwise polygon is convex, and its triangle contains no other corner.
fn is_ear([a, b, c]: [Point2; 3], all: &[Point2]) -> bool {
    let turn = |from: Point2, to: Point2, point: Point2| (to - from).cross(point - from);
    let is_inside = |p: &&Point2| {
        ![a, b, c].contains(p) && turn(a, b, **p) >= 0.0 && turn(b, c, **p) >= 0.0 && turn(c, a, **p) >= 0.0
    };
    turn(a, b, c) >= 0.0 && !all.iter().any(|p| is_inside(&p))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(pairs: &[(f64, f64)]) -> Vec<Point2> {
        pairs.iter().map(|&(x, y)| Point2::new(x, y)).collect()
    }

    #[test]
    fn triangles_cover_a_polygon_once() {
        // An L and a star, both ways round.
        let l = points(&[(0.0, 0.0), (4.0, 0.0), (4.0, 1.0), (1.0, 1.0), (1.0, 3.0), (0.0, 3.0)]);
        let star = points(&[(0.0, 3.0), (1.0, 1.0), (3.0, 0.0), (1.0, -1.0), (0.0, -3.0), (-0.5, 0.0)]);
        for mut outline in [l, star] {
            for _ in 0..2 {
                let area_m2 = |triangle: &[Point2; 3]| 0.5 * doubled_area_m2(triangle);
                let all = triangles(&outline);
                assert_eq!(all.len(), outline.len() - 2);
                assert!(all.iter().all(|triangle| area_m2(triangle) >= 0.0));
                let sum_m2: f64 = all.iter().map(area_m2).sum();
                assert!((sum_m2 - 0.5 * doubled_area_m2(&outline).abs()).abs() < 1e-12, "{sum_m2}");
                outline.reverse();
            }
        }
    }

    #[test]
    fn outline_that_crosses_itself_ends() {
        let bow = points(&[(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)]);
        assert!(triangles(&bow).len() <= 2);
        assert!(triangles(&points(&[(1.0, 1.0); 5])).len() <= 3);
    }
}
