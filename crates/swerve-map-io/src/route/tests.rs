use proptest::prelude::*;
use swerve_geom::Polyline;
use swerve_map::{Borders, Lane, Neighbour};
use swerve_tests::data_or_skip;

use super::*;
use crate::import::import;
use crate::links::Links;

fn lane(id: u32, y: f64, [from, to]: [f64; 2], successors: &[u32]) -> Lane {
    let line = Polyline::new(&[Point2::new(from, y), Point2::new(to, y)]).unwrap();
    let successors = successors.iter().map(|id| LaneId(*id)).collect();
    Lane { successors, ..Lane::new(LaneId(id), line, Borders::constant(1.5, 1.5)) }
}

/// Two lanes side by side, twice; only the right ones are joined.
fn map() -> Map {
    let beside = |id| Some(Neighbour { lane: LaneId(id), opposite: false });
    let pair = |left: Lane, right: Lane| {
        let (a, b) = (left.id.0, right.id.0);
        [Lane { right: beside(b), ..left }, Lane { left: beside(a), ..right }]
    };
    let first = pair(lane(0, 3.0, [0.0, 100.0], &[]), lane(1, 0.0, [0.0, 100.0], &[3]));
    let second = pair(lane(2, 3.0, [100.0, 200.0], &[]), lane(3, 0.0, [100.0, 200.0], &[]));
    Map::new(first.into_iter().chain(second).collect()).unwrap()
}

fn way(from: (u32, f64), to: (u32, f64)) -> Option<Way> {
    let stop = |(lane, s_m)| Stop { lane: LaneId(lane), s_m };
    find(&map(), stop(from), stop(to))
}

#[test]
fn route_changes_lanes_only_where_it_must() {
    let along = way((1, 10.0), (3, 50.0)).unwrap();
    assert_eq!(
        (along.length_m, along.lanes),
        (140.0, vec![(Step::Begin, LaneId(1)), (Step::Follow, LaneId(3))])
    );
    let line = way((1, 10.0), (3, 50.0)).unwrap();
    let ends = [(0, 10.0, 100.0), (1, 100.0, 150.0)];
    for (k, from, to) in ends {
        assert_eq!(line.line(&map(), k), [Point2::new(from, 0.0), Point2::new(to, 0.0)]);
    }
    let across = way((0, 10.0), (2, 50.0)).unwrap();
    assert_eq!((across.length_m, across.changes()), (140.0, 2));
    let steps: Vec<Step> = across.lanes.iter().map(|(step, _)| *step).collect();
    assert_eq!(steps, [Step::Begin, Step::ChangeRight, Step::Follow, Step::ChangeLeft]);
}

#[test]
fn places_behind_the_start_are_not_reached_on_its_lane() {
    assert_eq!(way((1, 50.0), (1, 40.0)), None);
    assert_eq!(way((1, 50.0), (0, 40.0)), None);
    assert_eq!(way((1, 40.0), (1, 50.0)).unwrap().length_m, 10.0);
    assert_eq!(way((3, 0.0), (1, 50.0)), None);
}

/// Costs of all nodes by relaxation until nothing changes.
fn relaxed_m(map: &Map, from: Stop, to: Stop) -> Option<f64> {
    let mut costs: BTreeMap<Node, (f64, f64)> = BTreeMap::from([((from.lane, true), (0.0, from.s_m))]);
    loop {
        let mut changed = false;
        for ((id, initial), (cost_m, entry_m)) in costs.clone() {
            let lane = map.lane(id).unwrap();
            let length_m = lane.line.length();
            let follow =
                lane.successors.iter().map(|next| ((*next, false), cost_m + length_m - entry_m, 0.0));
            let beside = [lane.left, lane.right].into_iter().flatten().filter(|beside| !beside.opposite);
            let change = beside.map(|beside| {
                let scale = map.lane(beside.lane).unwrap().line.length() / length_m;
                ((beside.lane, initial), cost_m + CHANGE_M, entry_m * scale)
            });
            for (node, cost_m, entry_m) in follow.chain(change) {
                let is_driving = map.lane(node.0).unwrap().kind == LaneKind::Driving;
                if is_driving && costs.get(&node).is_none_or(|known| cost_m < known.0 - 1e-9) {
                    costs.insert(node, (cost_m, entry_m));
                    changed = true;
                }
            }
        }
        if !changed {
            break;
        }
    }
    let ends = [true, false].into_iter().filter_map(|initial| costs.get(&(to.lane, initial)));
    ends.filter(|(_, entry_m)| *entry_m <= to.s_m)
        .map(|(cost_m, entry_m)| cost_m + to.s_m - entry_m)
        .reduce(f64::min)
}

proptest! {
    #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), cases: 24, ..ProptestConfig::default() })]
    #[test]
    fn routes_through_a_town_are_the_shortest(picks in proptest::collection::vec((0..10_000_usize, 0.0..1.0), 2..3)) {
        let Some(path) = data_or_skip("external/carla/Town01.xodr") else { return Ok(()) };
        let network = Network::read("m.xodr", &std::fs::read_to_string(path).unwrap()).unwrap();
        let map = import(&network, &Links::of(&network)).unwrap().map;
        let driving: Vec<&Lane> = map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving).collect();
        let stops: Vec<Stop> = picks
            .iter()
            .map(|(k, _)| driving[k % driving.len()])
            .zip(&picks)
            .map(|(lane, (_, share))| Stop { lane: lane.id, s_m: share * lane.line.length() })
            .collect();
        let found = find(&map, stops[0], stops[1]).map(|way| way.length_m + CHANGE_M * way.changes() as f64);
        let expected = relaxed_m(&map, stops[0], stops[1]);
        prop_assert_eq!(found.is_some(), expected.is_some());
        if let (Some(found), Some(expected)) = (found, expected) {
            prop_assert!((found - expected).abs() < 1e-6, "{} {}", found, expected);
        }
    }
}
