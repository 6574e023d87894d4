mod places;
mod published;

use swerve_geom::{Point2, Polyline};
use swerve_map::{
    Area, AreaId, AreaKind, Borders, Crossing, CrossingId, Features, Junction, JunctionId, Lane, LaneId,
    LaneKind, LaneMarks, Map, Mark, MarkColour, MarkKind, Neighbour, StopLine,
};

use super::*;
use crate::material::Material;
use crate::{SemanticClass, paving};

fn lane(id: u32, points: &[(f64, f64)], half_m: f64) -> Lane {
    let points: Vec<_> = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
    Lane::new(LaneId(id), Polyline::new(&points).unwrap(), Borders::constant(half_m, half_m))
}

fn beside(id: u32, opposite: bool) -> Option<Neighbour> {
    Some(Neighbour { lane: LaneId(id), opposite })
}

fn marks(left: &[Mark], right: &[Mark]) -> LaneMarks {
    LaneMarks::new(left.to_vec(), right.to_vec()).unwrap()
}

/// A road along x of 100 m: lanes of 3 m to both sides of y = 0, a pavement of 2 m at the right.
fn road() -> Vec<Lane> {
    let yellow = Mark { colour: MarkColour::Yellow, ..Mark::new(50.0, MarkKind::SolidBroken) };
    let middle = [Mark::new(0.0, MarkKind::Broken), yellow];
    let edge = [Mark::new(0.0, MarkKind::Solid)];
    vec![
        Lane {
            left: beside(2, true),
            right: beside(3, false),
            marks: marks(&middle, &[]),
            ..lane(1, &[(0.0, -1.5), (100.0, -1.5)], 1.5)
        },
        Lane {
            left: beside(1, true),
            marks: marks(&[Mark::new(0.0, MarkKind::Solid)], &edge),
            ..lane(2, &[(100.0, 1.5), (0.0, 1.5)], 1.5)
        },
        Lane {
            kind: LaneKind::Walking,
            left: beside(1, false),
            ..lane(3, &[(0.0, -4.0), (100.0, -4.0)], 1.0)
        },
    ]
}

/// Height and material of the uppermost surface at a place, and the texture coordinates there.
fn top(pieces: &[RoadPiece], x: f64, y: f64) -> (f32, Material) {
    let found = surfaces(pieces, x, y).into_iter().max_by(|a, b| a.0.total_cmp(&b.0));
    let (height_m, material, _) = found.expect("the ground has no holes");
    (height_m, material)
}

/// Surfaces seen from above at a place: height, material, texture coordinates.
fn surfaces(pieces: &[RoadPiece], x: f64, y: f64) -> Vec<(f32, Material, [f32; 2])> {
    let mut found = Vec::new();
    for piece in pieces {
        let origin = piece.map_from_body.origin().coords;
        let at = [(x - origin.x) as f32, (y - origin.y) as f32];
        let mesh = &piece.mesh;
        for (corners, material) in mesh.triangles().iter().zip(mesh.triangle_materials()) {
            let [a, b, c] = corners.map(|corner| mesh.positions()[corner as usize]);
            let cross =
                |p: [f32; 3], q: [f32; 3]| (q[0] - p[0]) * (at[1] - p[1]) - (q[1] - p[1]) * (at[0] - p[0]);
            let weights = [cross(b, c), cross(c, a), cross(a, b)];
            let sum: f32 = weights.iter().sum();
            if sum > 1e-6 && weights.iter().all(|weight| *weight >= 0.0) {
                let blend = |values: [f32; 3]| (0..3).map(|k| values[k] * weights[k]).sum::<f32>() / sum;
                let uvs = corners.map(|corner| mesh.uvs()[corner as usize]);
                let uv = [0, 1].map(|k| blend(uvs.map(|uv| uv[k])));
                let height_m = f64::from(blend([a[2], b[2], c[2]])) + origin.z;
                found.push((height_m as f32, mesh.materials()[usize::from(*material)], uv));
            }
        }
    }
    found
}

fn is_paint((height_m, material): (f32, Material), colour: [f32; 3]) -> bool {
    (height_m - paving::PAINT_M).abs() < 1e-4 && material == paving::paint(colour)
}

#[test]
fn heights_are_those_of_lanes_pavements_and_grass() {
    let map = Map::new(road()).unwrap();
    let (pieces, ground) = (map_pieces(&map), MapGround::new(&map));
    for (y, height_m, material) in [
        (1.0, 0.0, Some(paving::asphalt())),
        (-1.0, 0.0, Some(paving::asphalt())),
        (-4.0, 0.12, Some(paving::flags())),
        (-3.05, 0.12, Some(paving::kerb())),
        (8.0, -0.06, None),
        (-8.0, -0.06, None),
        (60.0, -0.06, None),
    ] {
        let (drawn_m, drawn) = top(&pieces, 33.3, y);
        assert!((drawn_m - height_m).abs() < 1e-4, "at {y}: {drawn_m}");
        assert!(material.is_none_or(|material| drawn == material), "at {y}: {drawn:?}");
        let solid_m = ground.height_m(Point2::new(33.3, y));
        assert_eq!(solid_m, if height_m > 0.0 { f64::from(paving::KERB_M) } else { 0.0 }, "at {y}");
    }
    // Soil goes down from the edge of the asphalt to below the grass.
    assert_eq!(top(&pieces, 33.3, 3.1).1, paving::soil());
}

#[test]
fn lines_are_painted_by_kind_and_colour() {
    let pieces = map_pieces(&Map::new(road()).unwrap());
    let white = |x, y| is_paint(top(&pieces, x, y), paving::WHITE);
    let yellow = |x, y| is_paint(top(&pieces, x, y), paving::YELLOW);
    // Strokes of 3 m, gaps of 6 m; the lane with the lower identity decides where both have marks.
    assert_eq!([1.0, 4.0, 8.0, 10.0].map(|x| white(x, 0.02)), [true, false, false, true]);
    // Lines of 12 cm, 12 cm apart, the solid one towards the lane at the right.
    let across = [-0.2, -0.12, -0.02, 0.12, 0.2];
    assert_eq!(across.map(|y| yellow(51.0, y)), [false, true, false, true, false]);
    assert_eq!(across.map(|y| yellow(55.0, y)), [false, true, false, false, false]);
    // The line at the edge is inside the asphalt.
    assert_eq!([2.78, 2.86, 2.96].map(|y| white(40.0, y)), [false, true, false]);
    assert!(!white(40.0, -2.9), "unknown marks are not painted");
}

/// A junction: lanes of 4 m along x and along y, and one that turns.
fn junction(inside_marks: bool) -> Map {
    let solid = [Mark::new(0.0, MarkKind::Solid)];
    let solid = if inside_marks { &solid[..] } else { &[] };
    let turn: Vec<(f64, f64)> = (0..=20)
        .map(|k| {
            let (sin, cos) = swerve_geom::math::sin_cos(f64::from(k) / 20.0 * core::f64::consts::FRAC_PI_2);
            (-20.0 + 20.0 * sin, -20.0 + 20.0 * cos)
        })
        .collect();
    let lanes = vec![
        Lane { marks: marks(solid, solid), ..lane(1, &[(-20.0, 0.0), (20.0, 0.0)], 2.0) },
        Lane { marks: marks(solid, solid), ..lane(2, &[(0.0, -20.0), (0.0, 20.0)], 2.0) },
        lane(3, &turn, 2.0),
    ];
    let inside = Junction {
        id: JunctionId(1),
        name: String::new(),
        lanes: vec![LaneId(1), LaneId(2), LaneId(3)],
        incoming: Vec::new(),
        rights_of_way: Vec::new(),
    };
    Map::with_features(lanes, Features { junctions: vec![inside], ..Features::default() }).unwrap()
}

#[test]
fn lanes_that_overlap_look_like_one_surface_without_lines() {
    let pieces = map_pieces(&junction(true));
    let mut overlaps = 0;
    for k in 0..400 {
        let (x, y) = (-19.9 + f64::from(k % 20) * 1.997, -19.9 + f64::from(k / 20) * 1.997);
        let all = surfaces(&pieces, x, y);
        let asphalt: Vec<_> = all.iter().filter(|(height_m, ..)| *height_m == 0.0).collect();
        assert!(all.iter().all(|(height_m, ..)| *height_m <= 0.0), "no paint at {x} {y}");
        overlaps += usize::from(asphalt.len() > 1);
        for (_, material, uv) in &asphalt {
            assert_eq!(*material, paving::asphalt());
            // Patterns are fixed to the map: 4 m per tile of the texture.
            let off = |uv: f32, m: f64| (f64::from(uv) - m).rem_euclid(4.0);
            let shifted = [off(uv[0], x), off(uv[1], y)];
            assert!(shifted.iter().all(|m| !(1e-3..4.0 - 1e-3).contains(m)), "{shifted:?}");
        }
    }
    assert!(overlaps > 10, "{overlaps}");
}

#[test]
fn hole_between_lanes_of_a_junction_is_paved_and_an_island_is_not() {
    // Four lanes around a square of 5 m, or of 16 m.
    let square = |half_m: f64| {
        let (a, b) = (half_m + 2.0, half_m + 10.0);
        let lanes = [[(-b, -a), (b, -a)], [(a, -b), (a, b)], [(b, a), (-b, a)], [(-a, b), (-a, -b)]];
        let lanes: Vec<Lane> = (1..).zip(&lanes).map(|(id, points)| lane(id, points, 2.0)).collect();
        let inside = Junction {
            id: JunctionId(1),
            name: String::new(),
            lanes: lanes.iter().map(|lane| lane.id).collect(),
            incoming: Vec::new(),
            rights_of_way: Vec::new(),
        };
        let features = Features { junctions: vec![inside], ..Features::default() };
        map_pieces(&Map::with_features(lanes, features).unwrap())
    };
    assert_eq!(top(&square(2.5), 0.1, 0.1).1, paving::asphalt());
    assert!(top(&square(8.0), 0.1, 0.1).0 < -0.05);
}

#[test]
fn pavement_is_left_out_where_a_road_crosses_it() {
    let mut lanes = road();
    lanes.push(lane(4, &[(50.0, -30.0), (50.0, -3.0)], 2.0));
    let map = Map::new(lanes).unwrap();
    let pieces = map_pieces(&map);
    assert!((top(&pieces, 40.0, -4.0).0 - 0.12).abs() < 1e-4);
    assert_eq!(top(&pieces, 50.0, -4.0), (0.0, paving::asphalt()));
    assert_eq!(MapGround::new(&map).height_m(Point2::new(50.0, -4.0)), 0.0);
}

#[test]
fn kerb_without_a_pavement_is_a_row_of_stones() {
    let kerb = [Mark::new(20.0, MarkKind::Kerb)];
    let alone = Lane { marks: marks(&kerb, &[]), ..lane(1, &[(0.0, 0.0), (60.0, 0.0)], 2.0) };
    let pieces = map_pieces(&Map::new(vec![alone]).unwrap());
    let (height_m, material) = top(&pieces, 40.0, 2.08);
    assert!((height_m - 0.12).abs() < 1e-4 && material == paving::kerb(), "{height_m}");
    assert_eq!(top(&pieces, 40.0, 1.95).0, 0.0);
    assert!(top(&pieces, 10.0, 2.08).0 < 0.0 && top(&pieces, 40.0, 2.3).0 < 0.0);
}

#[test]
fn crossing_has_bars_along_the_traffic_on_the_road_only() {
    let outline = [(50.0, -6.0), (54.0, -6.0), (54.0, 6.0), (50.0, 6.0)];
    let outline = outline.map(|(x, y)| Point2::new(x, y)).to_vec();
    let crossing = Crossing { id: CrossingId(1), name: String::new(), outline, lanes: vec![LaneId(1)] };
    let features = Features { crossings: vec![crossing], ..Features::default() };
    let pieces = map_pieces(&Map::with_features(road(), features).unwrap());
    let white = |x, y| is_paint(top(&pieces, x, y), paving::WHITE);
    // Bars of half a metre from y = -5.75 on, each over the whole depth.
    assert_eq!([-2.5, -2.0, -1.5, 1.5, 2.0].map(|y| white(50.2, y)), [true, false, true, true, false]);
    assert!(white(53.8, -2.5) && !white(54.2, -2.5) && !white(49.8, -2.5));
    assert!(!white(52.0, -4.5), "not on the pavement");
}

#[test]
fn stop_line_is_across_its_lane_and_broken_where_traffic_gives_way() {
    let painted = |line: StopLine| {
        let features = Features { stop_lines: vec![line], ..Features::default() };
        let pieces = map_pieces(&Map::with_features(road(), features).unwrap());
        let white = |x: f64, y: f64| is_paint(top(&pieces, x, y), paving::WHITE);
        [white(94.2, -0.3), white(94.2, -0.5), white(94.2, -0.7), white(93.8, -0.3), white(94.2, 0.3)]
    };
    let stop = StopLine::new(LaneId(1), 94.0);
    assert_eq!(painted(stop.clone()), [true, true, true, false, false]);
    let gives_way = StopLine { sign: Some(swerve_map::StopSign::Yield), ..stop };
    assert_ne!(painted(gives_way)[..3], [true; 3]);
}

#[test]
fn islands_are_raised_and_parking_places_are_flush() {
    let square = |x: f64| {
        let corners = [(0.0, 0.0), (0.0, 4.0), (4.0, 4.0), (4.0, 0.0)];
        corners.map(|(dx, dy)| Point2::new(x + dx, 10.0 + dy)).to_vec()
    };
    let area =
        |id: u32, kind| Area { id: AreaId(id), name: String::new(), kind, outline: square(f64::from(id)) };
    let areas = vec![area(10, AreaKind::NoEntry), area(30, AreaKind::Parking), area(50, AreaKind::Walking)];
    let pieces = map_pieces(&Map::with_features(road(), Features { areas, ..Features::default() }).unwrap());
    assert!((top(&pieces, 12.0, 12.0).0 - 0.12).abs() < 1e-4);
    let (height_m, material) = top(&pieces, 32.0, 12.0);
    assert!(height_m.abs() < 0.01 && material.class == Some(SemanticClass::Parking));
    assert!((top(&pieces, 52.0, 12.0).0 - 0.12).abs() < 1e-4);
    // On a road, an area for pedestrians is not raised.
    let on_road = Area {
        outline: square(70.0).iter().map(|p| Point2::new(p.x_m, p.y_m - 12.0)).collect(),
        ..area(1, AreaKind::Walking)
    };
    let features = Features { areas: vec![on_road], ..Features::default() };
    let pieces = map_pieces(&Map::with_features(road(), features).unwrap());
    assert_eq!(top(&pieces, 72.0, -1.0), (0.0, paving::asphalt()));
}

#[test]
fn tiles_are_small_and_cover_a_long_lane() {
    let long = lane(1, &[(0.0, 0.0), (1000.0, 300.0)], 2.0);
    let pieces = map_pieces(&Map::new(vec![long.clone()]).unwrap());
    let roads: Vec<_> = pieces.iter().filter(|piece| piece.class == SemanticClass::Road).collect();
    assert!((20..60).contains(&roads.len()), "{}", roads.len());
    for piece in roads {
        let (low, high) = piece.mesh.bounds();
        assert!((0..2).all(|axis| high[axis] - low[axis] < 48.0 + 14.0));
    }
    for k in 0..=200 {
        let at = long.line.at(5.0 * f64::from(k).min(200.0)).pose;
        assert_eq!(top(&pieces, at.x_m, at.y_m).0, 0.0);
    }
}

#[test]
fn wrong_widths_and_outlines_end_without_a_surface() {
    let wide = Lane {
        marks: marks(&[Mark::new(0.0, MarkKind::Solid)], &[]),
        ..lane(1, &[(0.0, 0.0), (50.0, 0.0)], 1e300)
    };
    let gives_way = StopLine { sign: Some(swerve_map::StopSign::Yield), ..StopLine::new(LaneId(1), 20.0) };
    let outline = [(0.0, 0.0), (1e12, 1e12), (0.0, 1e12)].map(|(x, y)| Point2::new(x, y)).to_vec();
    let crossing = Crossing { id: CrossingId(1), name: String::new(), outline, lanes: vec![LaneId(1)] };
    let features = Features { stop_lines: vec![gives_way], crossings: vec![crossing], ..Features::default() };
    let map = Map::with_features(vec![wide, lane(2, &[(0.0, 0.0), (50.0, 0.0)], 2.0)], features).unwrap();
    let mut scene = Scene::default();
    add_map(&mut scene, &map, 1);
    assert!(scene.statics().instances().iter().all(|instance| {
        let at = instance.map_from_body.origin().coords;
        at.x.abs() < 1e4 && at.y.abs() < 1e4
    }));
    assert!(scene.lights.iter().flat_map(|light| light.position_m).all(|m| m.abs() < 1e4));
}

#[test]
fn map_without_lanes_is_empty() {
    let map = Map::new(Vec::new()).unwrap();
    assert!(map_pieces(&map).is_empty() && signal_masts(&map).is_empty());
    assert_eq!(MapGround::new(&map).height_m(Point2::new(0.0, 0.0)), 0.0);
}
