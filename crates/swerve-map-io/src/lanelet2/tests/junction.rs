//! Kinds, speed limits and rules of `junction.osm`.

use std::collections::BTreeMap;

use serde_json::Value;
use swerve_map::{AreaKind, Map, StopSign};

use super::*;

/// Identities of the lanelets by their names in the script that made the map.
fn ids() -> BTreeMap<String, String> {
    let text = include_str!("../../../../../tests/reference/lanelet2/golden.json");
    let all: Value = serde_json::from_str(text).unwrap();
    let junction = all["junction"].as_object().unwrap();
    junction.iter().map(|(name, one)| (name.clone(), one["id"].as_str().unwrap().to_owned())).collect()
}

struct Junction {
    map: Lanelet2,
    ids: BTreeMap<String, String>,
}

impl Junction {
    fn new() -> Self {
        Self { map: good(JUNCTION), ids: ids() }
    }

    fn map(&self) -> &Map {
        &self.map.lanes.map
    }

    fn lane(&self, name: &str) -> &Lane {
        self.map().lane(self.map.lanes.lane_named(&self.ids[name]).unwrap()).unwrap()
    }

    /// Names of lanes, sorted.
    fn names(&self, lanes: &[LaneId]) -> Vec<&str> {
        let name = |lane: &LaneId| {
            let id = self.map.lanes.name(*lane);
            &**self.ids.iter().find(|(_, one)| *one == id).unwrap().0
        };
        let mut names: Vec<&str> = lanes.iter().map(name).collect();
        names.sort_unstable();
        names
    }
}

#[test]
fn kinds_and_speed_limits_are_those_of_the_tags() {
    let junction = Junction::new();
    assert_eq!(junction.map.lanes.defects.count(), 0, "{}", junction.map.lanes.defects);
    let (driving, city) = (LaneKind::Driving, Some(50.0 / 3.6));
    for (name, kind, speed_mps) in [
        ("w_in", driving, city),
        ("w_out", driving, city),
        ("e_out", driving, Some(30.0 / 3.6)),
        ("e_in", driving, Some(30.0 * 0.44704)),
        ("s_out", driving, Some(13.9)),
        ("s_in", driving, None),
        ("shoulder", LaneKind::Shoulder, None),
        ("bicycles", LaneKind::Cycling, None),
        ("crossing", LaneKind::Walking, None),
        ("walkway", LaneKind::Walking, None),
    ] {
        let lane = junction.lane(name);
        assert_eq!((lane.kind, lane.speed_limit_mps), (kind, speed_mps), "{name}");
    }
}

#[test]
fn lights_and_stop_lines_are_at_their_lanes() {
    let junction = Junction::new();
    let [light] = &junction.map().features().signals[..] else { panic!("one light") };
    assert!(light.position.distance(swerve_geom::Point2::new(16.0, -5.4)) < 1e-9);
    assert_eq!((junction.names(&light.lanes), light.height_m), (vec!["w_in"], Some(5.0)));
    assert!((light.heading_rad.abs() - core::f64::consts::PI).abs() < 1e-6, "{}", light.heading_rad);
    let lines: Vec<(&str, f64, usize, Option<StopSign>)> = junction
        .map()
        .features()
        .stop_lines
        .iter()
        .map(|line| (junction.names(&[line.lane])[0], line.s_m, line.signals.len(), line.sign))
        .collect();
    let expected = [
        ("w_in", 64.0, 1, None),
        ("e_in", 62.0, 0, None),
        // The sign is stricter than the right of way and the crosswalk.
        ("s_in", 57.0, 0, Some(StopSign::Stop)),
    ];
    assert_eq!(lines.len(), expected.len(), "{lines:?}");
    for (found, expected) in lines.iter().zip(expected) {
        assert_eq!((found.0, found.2, found.3), (expected.0, expected.2, expected.3));
        assert!((found.1 - expected.1).abs() < 1e-6, "{found:?}");
    }
}

#[test]
fn junctions_crossings_and_areas_are_in_the_map() {
    let junction = Junction::new();
    let features = junction.map().features();
    let [one] = &features.junctions[..] else { panic!("{:?}", features.junctions) };
    assert_eq!(junction.names(&one.lanes), ["e_w", "s_e", "s_w", "w_e"]);
    assert_eq!(junction.names(&one.incoming), ["e_in", "s_in", "w_in"]);
    let rights: Vec<_> =
        one.rights_of_way.iter().map(|right| junction.names(&[right.lane, right.to])).collect();
    assert_eq!(rights, [["s_e", "w_e"], ["e_w", "s_e"], ["s_w", "w_e"], ["e_w", "s_w"]]);
    let [crossing] = &features.crossings[..] else { panic!("{:?}", features.crossings) };
    assert_eq!((crossing.name == junction.ids["crossing"], crossing.outline.len()), (true, 4));
    assert_eq!(junction.names(&crossing.lanes), ["s_in"]);
    let mut kinds: BTreeMap<AreaKind, usize> = BTreeMap::new();
    features.areas.iter().for_each(|area| *kinds.entry(area.kind).or_default() += 1);
    // A parking lot, a parking space, a parking area; a detection area.
    assert_eq!(
        kinds,
        BTreeMap::from([(AreaKind::Parking, 3), (AreaKind::NoStopping, 1), (AreaKind::Other, 1)])
    );
    let space = features.areas.iter().find(|area| area.outline.iter().any(|at| at.x_m == -63.75)).unwrap();
    assert_eq!(space.outline.len(), 4);
}

#[test]
fn regulatory_elements_are_counted_by_subtype() {
    let junction = Junction::new();
    let count = |name: &str| junction.map.lanes.contents.get(name).copied().unwrap_or_default();
    for subtype in
        ["traffic_light", "speed_limit", "detection_area", "no_stopping_area", "speed_bump", "crosswalk"]
    {
        assert_eq!(count(&format!("regulatory element {subtype}")), 1, "{subtype}");
    }
    assert_eq!(count("area parking"), 1);
}
