use super::*;
use crate::{Border, Borders, LaneKind, Station};
use swerve_geom::Polyline;

fn line(points: &[(f64, f64)]) -> Polyline {
    Polyline::new(&points.iter().map(|&(x, y)| Point2::new(x, y)).collect::<Vec<_>>()).unwrap()
}

fn lane(id: u32, points: &[(f64, f64)]) -> Lane {
    Lane::new(LaneId(id), line(points), Borders::constant(2.0, 2.0))
}

fn beside(lane: u32, opposite: bool) -> Option<Neighbour> {
    Some(Neighbour { lane: LaneId(lane), opposite })
}

/// A street with a lane in each direction, 1 and 2, and a lane 3, the successor of 1.
fn street() -> Vec<Lane> {
    vec![
        Lane { successors: vec![LaneId(3)], left: beside(2, true), ..lane(1, &[(0.0, 0.0), (100.0, 0.0)]) },
        Lane { left: beside(1, true), ..lane(2, &[(100.0, 4.0), (0.0, 4.0)]) },
        Lane { kind: LaneKind::Driving, ..lane(3, &[(100.0, 0.0), (150.0, 0.0), (150.0, 50.0)]) },
    ]
}

fn ids(map: &Map, x_m: f64, y_m: f64) -> Vec<u32> {
    map.at(Point2::new(x_m, y_m)).map(|found| found.lane.0).collect()
}

#[test]
fn lanes_are_found_by_identity_and_by_point() {
    let map = Map::new(street().into_iter().rev().collect()).unwrap();
    assert_eq!(map.lanes().iter().map(|lane| lane.id.0).collect::<Vec<_>>(), [1, 2, 3]);
    assert_eq!(map.lane(LaneId(2)).map(|lane| lane.id), Some(LaneId(2)));
    assert_eq!(map.lane(LaneId(9)), None);
    assert_eq!(map.predecessors(LaneId(3)), [LaneId(1)]);
    assert_eq!(map.predecessors(LaneId(1)), []);
    assert_eq!(ids(&map, 50.0, 1.0), [1]);
    assert_eq!(ids(&map, 50.0, 2.0), [1, 2], "on the border between the two");
    assert_eq!(ids(&map, 50.0, 6.5), [] as [u32; 0]);
    assert_eq!(ids(&map, -1.0, 0.0), [] as [u32; 0], "before its beginning");
    let on_second = map.at(Point2::new(30.0, 5.0)).next().unwrap();
    assert_eq!((on_second.place.s_m, on_second.place.d_m), (70.0, -1.0), "along its own direction");
}

#[test]
fn nearest_lane_has_the_nearest_centre_line_between_its_ends() {
    let map = Map::new(street()).unwrap();
    let nearest = |x, y| map.nearest(Point2::new(x, y)).unwrap().lane.0;
    assert_eq!((nearest(50.0, 1.9), nearest(50.0, 2.1), nearest(50.0, 99.0)), (1, 2, 2));
    // On the straight extension of lane 1, where lane 3 has turned off.
    assert_eq!((nearest(170.0, 0.0), nearest(152.0, 40.0)), (3, 3));
    assert_eq!(Map::new(Vec::new()).unwrap().nearest(Point2::default()), None);
}

#[test]
fn point_lookup_follows_the_borders_of_a_narrowing_lane() {
    let stations = [(20.0, 3.0), (40.0, 1.0)].map(|(s_m, distance_m)| Station { s_m, distance_m });
    let borders = Borders::new(Border::linear(&stations).unwrap(), Border::constant(1.0));
    let map = Map::new(vec![Lane::new(LaneId(7), line(&[(0.0, 0.0), (60.0, 0.0)]), borders)]).unwrap();
    assert_eq!((ids(&map, 10.0, 2.9), ids(&map, 30.0, 1.9)), (vec![7], vec![7]));
    assert_eq!((ids(&map, 30.0, 2.1), ids(&map, 50.0, 1.1)), (vec![], vec![]));
    assert_eq!(map.lanes()[0].width_m(30.0), 3.0);
}

#[test]
fn inconsistent_lanes_are_rejected() {
    let broken = |change: fn(&mut Vec<Lane>)| {
        let mut lanes = street();
        change(&mut lanes);
        Map::new(lanes).unwrap_err().to_string()
    };
    assert_eq!(broken(|l| l[1].id = LaneId(1)), "lane 1 is there twice");
    assert_eq!(broken(|l| l[2].successors.push(LaneId(8))), "lane 3 names lane 8, which is not there");
    assert_eq!(
        broken(|l| l[1].left = beside(1, false)),
        "lane 1 has lane 2 beside it, but not the other way round"
    );
    assert_eq!(broken(|l| l[1].successors.push(LaneId(3))), "lane 3 begins 100.08 m from where lane 2 ends");
    assert_eq!(
        broken(|l| l[2].borders = Borders::constant(-2.0, 1.0)),
        "the borders of lane 3 cross at 0.0 m"
    );
}

#[test]
fn map_text_is_the_list_of_lanes_and_is_checked() {
    let map = Map::new(street()).unwrap();
    let text = serde_json::to_string(&map).unwrap();
    assert_eq!(serde_json::from_str::<Map>(&text).unwrap(), map);
    let twice = text.replace("\"id\":2", "\"id\":1");
    assert!(serde_json::from_str::<Map>(&twice).unwrap_err().to_string().contains("lane 1 is there twice"));
}

#[test]
fn lanes_at_a_point_are_all_that_contain_it() {
    use proptest::prelude::*;
    let coordinate = |reach: f64| -reach..reach;
    let one = |reach: f64| prop::array::uniform4(coordinate(reach));
    let maps = prop_oneof![Just(30.0), Just(300.0), Just(100_000.0)]
        .prop_flat_map(move |reach| (prop::collection::vec(one(reach), 1..30), Just(reach)));
    let mut runner = proptest::test_runner::TestRunner::deterministic();
    runner
        .run(
            &(maps, prop::collection::vec((0_usize..30, 0.0..1.0, -3.0..3.0), 30)),
            |((ends, reach), near)| {
                let lanes = (0..).zip(&ends).map(|(k, [a, b, c, d])| lane(k, &[(*a, *b), (*c + reach, *d)]));
                let map = Map::new(lanes.collect()).unwrap();
                for (k, along, aside_m) in near {
                    // Points in lanes and just beside them, and some anywhere.
                    let line = &map.lanes()[k % map.lanes().len()].line;
                    let at = line.at(along * line.length()).pose;
                    let point = at.point() + at.direction().left() * aside_m;
                    let brute: Vec<u32> = map
                        .lanes()
                        .iter()
                        .filter(|lane| lane.place_of(point).is_some())
                        .map(|lane| lane.id.0)
                        .collect();
                    prop_assert_eq!(ids(&map, point.x_m, point.y_m), brute);
                }
                Ok(())
            },
        )
        .unwrap();
}
