use proptest::prelude::*;
use swerve_geom::Polyline;

use super::*;
use crate::Borders;

fn lane(id: u32, points: &[(f64, f64)]) -> Lane {
    let points: Vec<Point2> = points.iter().map(|&(x, y)| Point2::new(x, y)).collect();
    Lane::new(LaneId(id), Polyline::new(&points).unwrap(), Borders::constant(1.5, 1.5))
}

/// Distance of a point from the lane of an answer, not beyond its ends.
fn distance_m(map: &Map, found: LanePlace, point: Point2) -> f64 {
    let lane = map.lane(found.lane).unwrap();
    lane.line.at(found.place.s_m.clamp(0.0, lane.line.length())).pose.point().distance(point)
}

/// Distance of a point from a lane, over all its pieces.
fn beside_m(lane: &Lane, point: Point2) -> f64 {
    let pieces = lane.line.points().windows(2).map(|two| {
        let along = two[1] - two[0];
        let t = ((point - two[0]).dot(along) / along.norm_squared()).clamp(0.0, 1.0);
        (two[0] + along * t).distance(point)
    });
    pieces.fold(f64::INFINITY, f64::min)
}

#[test]
fn index_without_lanes_finds_none() {
    let map = Map::new(Vec::new()).unwrap();
    assert_eq!(LaneIndex::new(&map).nearest(Point2::new(1.0, 2.0)), None);
}

#[test]
fn first_of_equally_near_lanes_is_found() {
    let map =
        Map::new(vec![lane(7, &[(0.0, 1.0), (9.0, 1.0)]), lane(3, &[(0.0, -1.0), (9.0, -1.0)])]).unwrap();
    let index = LaneIndex::new(&map);
    let found = index.nearest(Point2::new(4.0, 0.0)).unwrap();
    assert_eq!((found.lane, found.place), (LaneId(3), FrenetPoint { s_m: 4.0, d_m: 1.0 }));
    let only = LaneIndex::of(&map, |lane| lane.id == LaneId(7));
    assert_eq!(only.nearest(Point2::new(4.0, -9.0)).unwrap().lane, LaneId(7));
}

#[test]
fn lanes_that_are_too_far_apart_for_a_count_of_cells_are_found() {
    let map =
        Map::new(vec![lane(1, &[(0.0, 0.0), (9.0, 0.0)]), lane(2, &[(0.0, 5.0), (1e25, 5.0)])]).unwrap();
    let index = LaneIndex::new(&map);
    let found =
        [Point2::new(4.0, 1.0), Point2::new(1e24, 0.0)].map(|point| index.nearest(point).unwrap().lane);
    assert_eq!(found, [LaneId(1), LaneId(2)]);
}

#[test]
fn lanes_far_apart_take_memory_by_their_pieces() {
    let far = 1e6;
    let map =
        Map::new(vec![lane(1, &[(0.0, 0.0), (far, far)]), lane(2, &[(0.0, far), (50.0, far)])]).unwrap();
    let index = LaneIndex::new(&map);
    assert!(index.begins.len() < 10_000 && index.entries.len() < 10_000);
    assert_eq!(index.nearest(Point2::new(40.0, far - 5.0)).unwrap().lane, LaneId(2));
    assert_eq!(index.nearest(Point2::new(4e5, 5e5)).unwrap().lane, LaneId(1));
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
    #[test]
    fn index_and_search_of_all_lanes_agree(
        lines in proptest::collection::vec(proptest::collection::vec((-200.0..200.0, -90.0..90.0), 2..9), 1..12),
        points in proptest::collection::vec((-400.0..400.0, -400.0..400.0), 1..40),
    ) {
        let lanes = lines.iter().enumerate().map(|(k, line)| lane(k as u32, line)).collect();
        let map = Map::new(lanes).unwrap();
        let index = LaneIndex::new(&map);
        let mut hint = LaneHint::default();
        for (x, y) in points {
            let point = Point2::new(x, y);
            let (all, one) = (map.nearest(point).unwrap(), index.nearest(point).unwrap());
            let from = index.nearest_from(point, &mut hint).unwrap();
            prop_assert_eq!(one, from);
            // A line that doubles back may be nearer than its extension, which `Map::nearest` projects on.
            prop_assert!(distance_m(&map, one, point) <= distance_m(&map, all, point) + 1e-9, "{:?} {:?}", all, one);
            let brute_m = map.lanes().iter().map(|lane| beside_m(lane, point)).fold(f64::INFINITY, f64::min);
            prop_assert!((distance_m(&map, one, point) - brute_m).abs() < 1e-9, "{:?} {}", one, brute_m);
        }
    }
}
