use std::collections::BTreeMap;

use proptest::prelude::*;
use swerve_map::router::{CHANGE_M, Stop, find};
use swerve_map::{Lane, LaneId, LaneKind, Map};
use swerve_tests::data_or_skip;

use crate::import::import;
use crate::links::Links;
use crate::opendrive::Network;

/// A lane, and true if it is entered beside the start rather than at its begin.
type Node = (LaneId, bool);

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
        let found = find(&map, stops[0], stops[1], &[]).map(|way| way.length_m + CHANGE_M * way.changes() as f64);
        let expected = relaxed_m(&map, stops[0], stops[1]);
        prop_assert_eq!(found.is_some(), expected.is_some());
        if let (Some(found), Some(expected)) = (found, expected) {
            prop_assert!((found - expected).abs() < 1e-6, "{} {}", found, expected);
        }
    }
}
