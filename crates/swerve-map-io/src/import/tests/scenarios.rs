//! The maps of scenarios, which `scenarios/maps/make.py` makes, against counts worked out by hand.

use std::collections::BTreeSet;

use swerve_geom::{angle_between, wrap_angle};
use swerve_map::{Lane, LaneId, LaneKind, Map, StopSign};

use super::{id, imported};
use crate::import::Imported;
use crate::links::Links;
use crate::opendrive::Network;
use swerve_map::router::{Way, find};

use crate::route::stop;
use crate::testing::{networks, scenario_maps};

/// Lanes for driving, shoulders and sidewalks; junctions, lanes inside, rights of way; signals, stop lines.
///
/// Driving lanes inside the junctions of the town: 6 at 10 T junctions, 12 and 14 at two crossings each, 4 at four ramps'
/// ends, 3 at six arms of roundabouts, 6 at two places where ramps join and leave; 122 others. Rights of way: 4 at seven
/// T junctions, 3 at two ends of exits, 1 at each arm of a roundabout.
const MAPS: [(&str, [usize; 8]); 8] = [
    ("crossing.xodr", [20, 0, 12, 1, 16, 0, 4, 4]),
    ("crossing_priority.xodr", [20, 0, 12, 1, 16, 20, 0, 2]),
    ("crossing_right_first.xodr", [20, 0, 12, 1, 16, 0, 0, 0]),
    ("ramp.xodr", [14, 7, 0, 1, 5, 0, 0, 0]),
    ("roundabout.xodr", [24, 0, 20, 4, 20, 4, 0, 4]),
    ("town.xodr", [280, 70, 102, 26, 230, 40, 14, 35]),
    ("two_lane_road.xodr", [2, 2, 0, 0, 0, 0, 0, 0]),
    ("two_ways.xodr", [20, 0, 14, 2, 18, 0, 0, 0]),
];

fn read(name: &str) -> (Network, Imported) {
    imported(&std::fs::read_to_string(scenario_maps().join(name)).unwrap())
}

fn counts(map: &Map) -> [usize; 8] {
    let lanes = |kind| map.lanes().iter().filter(|lane| lane.kind == kind).count();
    let junctions = map.junctions();
    [
        lanes(LaneKind::Driving),
        lanes(LaneKind::Shoulder),
        lanes(LaneKind::Walking),
        junctions.len(),
        junctions.iter().map(|junction| junction.lanes.len()).sum(),
        junctions.iter().map(|junction| junction.rights_of_way.len()).sum(),
        map.signals().len(),
        map.stop_lines().len(),
    ]
}

fn way(network: &Network, imported: &Imported, from: &str, to: &str) -> Way {
    let [from, to] = [from, to].map(|place| stop(network, imported, place).unwrap());
    find(&imported.map, from, to, &[]).unwrap()
}

#[test]
fn maps_of_scenarios_have_no_defects_and_the_expected_counts() {
    let files = networks(&scenario_maps());
    let names: Vec<_> = files.iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect();
    assert_eq!(names, MAPS.map(|(name, _)| name));
    for (name, expected) in MAPS {
        let (network, imported) = read(name);
        assert_eq!((network.defects.count(), network.unknown.len()), (0, 0), "{name}: {}", network.defects);
        let links = Links::of(&network);
        assert!(links.dangling.is_empty(), "{name}: {:?}", links.dangling);
        for link in &links.all {
            assert!(link.gap_m < 1e-4 && link.width_gap_m < 1e-4, "{name}: {link:?}");
        }
        assert_eq!(counts(&imported.map), expected, "{name}");
        assert!(imported.map.lanes().iter().all(|lane| lane.speed_limit_mps.is_some()), "{name}");
    }
}

#[test]
fn driving_lanes_of_scenario_maps_continue_without_a_corner() {
    for (name, _) in MAPS {
        let map = read(name).1.map;
        for lane in map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving) {
            let end = lane.line.at(lane.line.length()).pose.heading_rad;
            for next in &lane.successors {
                let begin = map.lane(*next).unwrap().line.at(0.0).pose.heading_rad;
                // Chords of the polylines turn by up to 0.02 rad.
                assert!(
                    wrap_angle(begin - end).abs() < 0.03,
                    "{name}: {:?} {next:?}: {end} {begin}",
                    lane.id
                );
            }
        }
    }
}

#[test]
fn every_arm_of_a_scenario_map_leads_to_every_other() {
    for (name, arms_m) in [("crossing.xodr", 150.0), ("roundabout.xodr", 120.0)] {
        let (network, imported) = read(name);
        for (from, to) in (1..5).flat_map(|from| (1..5).map(move |to| (from, to))).filter(|(a, b)| a != b) {
            let way = way(&network, &imported, &format!("{from}:-1:0"), &format!("{to}:1:0"));
            assert_eq!(way.changes(), 0);
            assert!(
                (2.0 * arms_m..2.0 * arms_m + 90.0).contains(&way.length_m),
                "{name}: {from} {to}: {way:?}"
            );
        }
    }
}

#[test]
fn stop_lines_of_scenario_maps_have_their_lights_and_signs() {
    let (network, lights) = read("crossing.xodr");
    for (arm, name) in ["east", "north", "west", "south"].into_iter().enumerate() {
        let lane = id(&network, &lights, (&(arm + 1).to_string(), 0, -1));
        let line = lights.map.stop_lines().iter().find(|line| line.lane == lane).unwrap();
        let [light] = line.signals[..] else { panic!("{line:?}") };
        let light = lights.map.signal(light).unwrap();
        let controller = if arm % 2 == 0 { "east_west" } else { "north_south" };
        assert!((line.s_m - 148.0).abs() < 1e-6 && line.sign.is_none(), "{line:?}");
        assert_eq!((&*light.name, &*light.lanes), (&*format!("light_{name}"), &[lane][..]));
        assert_eq!(light.controller.as_deref(), Some(controller));
    }
    for (name, s_m) in [("crossing_priority.xodr", 149.5), ("roundabout.xodr", 119.5)] {
        for line in read(name).1.map.stop_lines() {
            assert_eq!(line.sign, Some(StopSign::Yield), "{name}");
            assert!((line.s_m - s_m).abs() < 1e-6, "{name}: {line:?}");
        }
    }
}

#[test]
fn ramp_leads_to_the_motorway_by_one_lane_change() {
    let (network, imported) = read("ramp.xodr");
    for section in [0, 1] {
        let [lane, beside] = [-3, -2].map(|lane| id(&network, &imported, ("2", section, lane)));
        let left = imported.map.lane(lane).unwrap().left.unwrap();
        assert_eq!((left.lane, left.opposite), (beside, false));
    }
    let end = imported.map.lane(id(&network, &imported, ("2", 1, -3))).unwrap();
    assert!(end.successors.is_empty() && end.width_m(end.line.length()) < 0.01, "{end:?}");
    assert_eq!(way(&network, &imported, "3:-1:0", "2:-2:560").changes(), 1);
}

/// Lanes for driving that a car reaches from one: those that continue lanes, and those beside them.
fn reached(map: &Map, from: LaneId, next: impl Fn(&Lane) -> Vec<LaneId>) -> BTreeSet<LaneId> {
    let (mut reached, mut open) = (BTreeSet::from([from]), vec![from]);
    while let Some(lane) = open.pop() {
        for id in next(map.lane(lane).unwrap()) {
            if map.lane(id).unwrap().kind == LaneKind::Driving && reached.insert(id) {
                open.push(id);
            }
        }
    }
    reached
}

#[test]
fn every_driving_lane_of_the_town_leads_to_every_other() {
    let (network, imported) = read("town.xodr");
    let map = &imported.map;
    let beside = |lane: &Lane| {
        let beside = [lane.left, lane.right].into_iter().flatten().filter(|beside| !beside.opposite);
        beside.map(|beside| beside.lane).collect::<Vec<_>>()
    };
    let onwards = |lane: &Lane| [beside(lane), lane.successors.to_vec()].concat();
    let before = |id: LaneId| map.lanes().iter().filter(move |lane| lane.successors.contains(&id));
    let backwards = |lane: &Lane| [beside(lane), before(lane.id).map(|lane| lane.id).collect()].concat();
    let from = id(&network, &imported, ("22", 0, -1));
    let driving: BTreeSet<LaneId> =
        map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving).map(|lane| lane.id).collect();
    assert_eq!(reached(map, from, onwards), driving);
    assert_eq!(reached(map, from, backwards), driving);
    // The second lanes of the motorway before the roundabouts, and the lanes of joining traffic.
    let ends = driving.iter().filter(|id| map.lane(**id).unwrap().successors.is_empty());
    assert_eq!(ends.count(), 4);
}

#[test]
fn lanes_of_the_town_turn_with_radii_for_cars_and_crossings_have_lanes() {
    let map = read("town.xodr").1.map;
    for lane in map.junctions().iter().flat_map(|junction| &junction.lanes).filter_map(|id| map.lane(*id)) {
        let [begin, end] = [0.0, lane.line.length()].map(|s_m| lane.line.at(s_m).pose.heading_rad);
        let turn = angle_between(begin, end);
        if lane.kind == LaneKind::Driving && turn.abs() > 1.0 {
            let radius_m = lane.line.length() / turn.abs();
            assert!(radius_m > if turn > 0.0 { 12.0 } else { 8.0 }, "{:?}: {radius_m} m", lane.id);
        }
    }
    assert_eq!(map.crossings().len(), 26);
    assert!(map.crossings().iter().all(|crossing| matches!(crossing.lanes.len(), 2 | 4)));
}
