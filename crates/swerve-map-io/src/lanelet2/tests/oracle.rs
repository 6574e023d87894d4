//! Borders, lengths, neighbours and followers as the library Lanelet2 finds them, stored in `golden.json`.

use std::collections::BTreeMap;

use serde_json::Value;
use swerve_geom::{Point2, Polyline};

use super::*;
use crate::strip::tests::worst_m;

/// Largest distance of the library's positions from ours, metres: the files have them with 1e-4 m and 1e-11 degrees.
const PLACE_M: f64 = 2e-6;

fn golden(map: &str) -> BTreeMap<String, Value> {
    let text = include_str!("../../../../../tests/reference/lanelet2/golden.json");
    let all: Value = serde_json::from_str(text).unwrap();
    serde_json::from_value(all[map].clone()).unwrap()
}

fn points(value: &Value) -> Vec<Point2> {
    let pairs: Vec<[f64; 2]> = serde_json::from_value(value.clone()).unwrap();
    pairs.into_iter().map(|[x, y]| Point2::new(x, y)).collect()
}

fn ids(value: &Value) -> Vec<String> {
    serde_json::from_value(value.clone()).unwrap()
}

/// The lane of a lanelet in its direction.
fn lane<'m>(map: &'m Lanelet2, id: &str) -> &'m Lane {
    map.lanes.map.lane(map.lanes.lane_named(id).unwrap()).unwrap()
}

#[test]
fn lanes_agree_with_the_library() {
    for (name, text, lanes) in [("junction", JUNCTION, 16), ("alley", ALLEY, 3)] {
        let map = good(text);
        let golden = golden(name);
        assert_eq!(golden.len(), lanes, "{name}");
        for (lanelet, expected) in &golden {
            let lane = lane(&map, expected["id"].as_str().unwrap());
            let [left, right] = ["left", "right"].map(|side| points(&expected[side]));
            let border_m = worst_m(&lane.line, &lane.borders, [&left, &right]);
            let mut center = points(&expected["center"]);
            if lanelet == "second" {
                // The library does not turn the centre line of the file into the direction of travel.
                center.reverse();
            }
            // The library joins nearest points; middles of pairs at equal shares are elsewhere where borders differ.
            let inner = &center[1..center.len() - 1];
            let center_m = inner.iter().map(|at| lane.line.project(*at).d_m.abs()).fold(0.0, f64::max);
            let ends = [lane.line.points()[0], *lane.line.points().last().unwrap()];
            let ends_m = ends[0].distance(center[0]).max(ends[1].distance(center[center.len() - 1]));
            let longer_m = lane.line.length() - expected["length_m"].as_f64().unwrap();
            println!(
                "{lanelet}: borders {border_m:.6} m, centre line {center_m:.3} m, ends {ends_m:.6} m, {longer_m:.3} m longer"
            );
            assert!(border_m < 1e-3, "{lanelet}: borders {border_m}");
            let (within_m, gap_m) = match &**lanelet {
                // Its borders diverge, and the library passes the middle of a diagonal.
                "walkway" => (0.5, 0.0),
                // Half of the gap between the two is closed on each side.
                "second" => (0.05, 0.1501),
                "third" => (0.3, 0.1501),
                _ => (0.05, 0.0),
            };
            assert!(center_m < within_m && longer_m.abs() < 0.3 * within_m + 2.0 * gap_m, "{lanelet}");
            assert!(ends_m < gap_m + PLACE_M, "{lanelet}: {ends_m}");
        }
    }
}

#[test]
fn borders_have_the_direction_of_the_library() {
    for (name, text) in [("junction", JUNCTION), ("alley", ALLEY)] {
        let map = good(text);
        for (lanelet, expected) in golden(name) {
            let lane = lane(&map, expected["id"].as_str().unwrap());
            for side in ["left", "right"] {
                let line = Polyline::new(&points(&expected[side])).unwrap();
                let along = lane.line.project(line.at(line.length()).pose.point()).s_m;
                assert!(along > 0.9 * lane.line.length(), "{lanelet} {side}: {along}");
            }
        }
    }
}

#[test]
fn neighbours_and_followers_are_those_of_the_library() {
    let map = good(JUNCTION);
    let name = |id: &LaneId| map.lanes.name(*id).to_owned();
    for (lanelet, expected) in golden("junction") {
        let lane = lane(&map, expected["id"].as_str().unwrap());
        let mut followers: Vec<String> = lane.successors.iter().map(name).collect();
        followers.sort();
        assert_eq!(followers, ids(&expected["followers"]), "{lanelet}");
        for (beside, same, against) in
            [(lane.left, "left_of_it", "left_against_it"), (lane.right, "right_of_it", "right_against_it")]
        {
            let found = |opposite| {
                beside.filter(|beside| beside.opposite == opposite).map(|beside| name(&beside.lane))
            };
            assert_eq!(Vec::from_iter(found(false)), ids(&expected[same]), "{lanelet} {same}");
            assert_eq!(Vec::from_iter(found(true)), ids(&expected[against]), "{lanelet} {against}");
        }
    }
}

#[test]
fn positions_are_those_of_the_local_cartesian_projection() {
    let map = good(ALLEY);
    let first = &golden("alley")["first"];
    let lane = lane(&map, first["id"].as_str().unwrap());
    for (side, border) in [("left", lane.borders.left()), ("right", lane.borders.right())] {
        for at in points(&first[side]) {
            let place = lane.line.project(at);
            if 0.0 < place.s_m && place.s_m < lane.line.length() {
                assert!((border.at(place.s_m) - place.d_m.abs()).abs() < 1e-3, "{side} {at:?}");
            }
        }
    }
    // Latitude and longitude of the first node.
    assert_eq!(map.origin_deg.map(|[latitude, _]| latitude.floor()), Some(35.0));
    let begin = lane.line.points()[0];
    let expected = points(&first["center"])[0];
    assert!(begin.distance(expected) < PLACE_M, "{begin:?} {expected:?}");
}

#[test]
fn gaps_and_both_directions_of_an_alley() {
    let map = good(ALLEY);
    let names: Vec<&str> = map.lanes.map.lanes().iter().map(|lane| map.lanes.name(lane.id)).collect();
    assert_eq!(names.len(), 5, "{names:?}");
    let golden = golden("alley");
    let id = |name: &str| golden[name]["id"].as_str().unwrap().to_owned();
    let successors = |name: &str| -> Vec<String> {
        let lane = lane(&map, name);
        lane.successors.iter().map(|next| map.lanes.name(*next).to_owned()).collect()
    };
    assert_eq!(successors(&id("first")), [id("second")]);
    assert_eq!(successors(&id("second")), [id("third")]);
    let back = |name: &str| format!("{}:backward", id(name));
    assert_eq!(successors(&back("second")), [back("first")]);
    assert!(successors(&back("first")).is_empty());
    let [gap] = &map.lanes.gaps[..] else { panic!("{:?}", map.lanes.gaps) };
    assert!(gap.joined && (gap.gap_m - 0.3).abs() < 1e-3, "{gap:?}");
    let [first, back] = [id("first"), back("first")].map(|name| lane(&map, &name).clone());
    assert!((first.line.length() - back.line.length()).abs() < 1e-9);
    assert_eq!((first.kind, first.left, back.right), (LaneKind::Driving, None::<Neighbour>, None));
}
