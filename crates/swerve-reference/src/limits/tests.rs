//! Ranges of keys, compared with the readers.

use swerve_scenario::Scenario;
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_text::{Document, parse_assignment};

use super::*;
use crate::files::FileKind;
use crate::key::Key;
use crate::keys::keys;

/// A key with a range, an open range, and the ranges of an array in the schema.
#[test]
fn schema_has_the_ranges_of_the_fields() {
    let schema = FileKind::Config.schema(&Registry::standard()).to_value();
    let at = |place: &str| {
        let node = schema.pointer(place).unwrap_or_else(|| panic!("no {place}"));
        ["minimum", "maximum"].map(|keyword| node.get(keyword).and_then(Value::as_f64))
    };
    assert_eq!(at("/properties/seed"), [Some(0.0), None]);
    assert_eq!(at("/$defs/SimConfig/properties/dt_ms"), [Some(1.0), Some(20.0)]);
    assert_eq!(at("/$defs/CameraConfig/properties/at_m/items"), [Some(-100.0), Some(100.0)]);
    assert_eq!(at("/$defs/TyreParams/properties/friction"), [Some(0.01), Some(4.0)]);
}

/// Settings without which the check does not reach a key, by key prefix: a preset, or adjacent keys without a default.
const NEEDED: [(&str, &str); 9] = [
    ("execution.detector_ms", "execution.model = \"periodic\"\nperception.detector = \"efficientdet-d5@d3\""),
    ("execution.planner_ms", "execution.model = \"periodic\""),
    ("operator.NAME.runtime.work", "operator.any.runtime.work = { per_unit_us = 1.0 }"),
    ("perception.params", "perception.detector = \"custom\""),
    ("planning.cost.NAME.NAME.work", "planning.cost.fot.fast.work = { per_unit_us = 1.0 }"),
    ("planning.rules", "planning.preset = \"paper\""),
    ("sensing.mount", "sensing.mount = { x_m = 1.0, y_m = 0.0, z_m = 1.9, yaw_rad = 0.0 }"),
    (
        "sim.vehicle.tyre.lateral",
        "sim.vehicle.tyre.lateral = { stiffness = 22.0, shape = 1.4, curvature = 0.0 }",
    ),
    (
        "sim.vehicle.tyre.longitudinal",
        "sim.vehicle.tyre.longitudinal = { stiffness = 22.0, shape = 1.6, curvature = 0.4 }",
    ),
];

/// Configuration as TOML in which a key of the list can be set, and its path there.
fn surroundings(key: &Key) -> (toml::Table, String) {
    let needed = NEEDED.iter().find(|(start, _)| key.key.starts_with(start)).map_or("", |(_, needed)| needed);
    let mut table: toml::Table = needed.parse().expect("a test asks for every key");
    let place = key.key.replace("planning.cost.NAME.NAME", "planning.cost.fot.fast").replace("NAME", "any");
    let section = ["planning", "perception.tracker", "operator.any"]
        .into_iter()
        .find(|section| place.starts_with(section));
    for setting in key.only_with.iter().flat_map(|with| with.split(", ")) {
        let setting = setting.replace(" = ", "=");
        if let (Ok((name, value)), Some(section)) = (parse_assignment(&setting), section) {
            let _is_table = swerve_text::set(&mut table, &format!("{section}.{name}"), value);
        }
    }
    (table, place)
}

/// A number in the form of a key: an array holds it at every position.
fn of_form(form: &str, number: &toml::Value) -> Option<toml::Value> {
    if matches!(form, "number" | "whole number") {
        return Some(number.clone());
    }
    let of = form.strip_prefix("array of ")?;
    let counted = of.split_once(" x ").and_then(|(count, of)| Some((count.parse().ok()?, of)));
    let (count, of) = counted.unwrap_or((1, of));
    Some(toml::Value::Array(vec![of_form(of, number)?; count]))
}

/// Problems of a key with a value, and with other keys.
fn problems(key: &Key, value: &str, with: &[(String, toml::Value)]) -> Vec<String> {
    let (mut table, place) = surroundings(key);
    let (_, number) = parse_assignment(&format!("x={value}")).unwrap();
    let number = of_form(&key.form, &number).unwrap();
    for (key, value) in with.iter().chain(&[(place.clone(), number)]) {
        swerve_text::set(&mut table, key, value.clone()).unwrap();
    }
    let document = Document::parse("range", table.to_string()).unwrap();
    let problems = Setup::from_document(&document, &[]).err().unwrap_or_default();
    let is_here =
        |key: &str| key.strip_prefix(&place).is_some_and(|rest| rest.is_empty() || rest.starts_with('['));
    problems.iter().filter(|problem| is_here(&problem.key)).map(|problem| problem.message.clone()).collect()
}

/// Keys without a range of numbers: seeds, and keys that are elsewhere or alternatives; and keys whose range depends on
/// another key.
const WITHOUT: [&str; 8] = [
    "fault.NAME.seed",
    "lidar.NAME.params.rate_hz",
    "lidar.NAME.params.seed",
    "perception.tracker.cyclist.limit",
    "perception.tracker.pedestrian.limit",
    "perception.tracker.vehicle.limit",
    "planning.rung_ms",
    "seed",
];

/// Arrays of numbers with different meanings and ranges.
const MIXED: [&str; 10] = [
    "camera.NAME.matrix",
    "lidar.NAME.at_m",
    "lidar.NAME.beams_deg",
    "localization.stored_pose",
    "operator.NAME.runtime.log_normal_ms",
    "operator.NAME.runtime.percentiles_ms",
    "planning.cost.NAME.NAME.log_normal_ms",
    "planning.cost.NAME.NAME.percentiles_ms",
    "radar.NAME.at_m",
    "sim.vehicle.steering.curve",
];

/// Keys whose range is narrowed by another key, and the value of that key that leaves the full range.
const PARTNERS: [(&str, &str, f64); 13] = [
    ("execution.params.detector_max_s", "execution.params.detector_min_s", 0.001),
    ("execution.params.planner_max_s", "execution.params.planner_min_s", 0.001),
    ("execution.params.planner_share_full", "execution.params.planner_share_empty", 0.0),
    ("fault.NAME.until_ms", "fault.any.from_ms", 0.0),
    ("gate.release_at_ms", "gate.enable_at_ms", 0.0),
    ("lidar.NAME.params.range_min_m", "lidar.any.params.range_max_m", 10_000.0),
    ("lidar.NAME.rate_hz", "sim.dt_ms", 1.0),
    ("operator.NAME.period_ms", "sim.dt_ms", 1.0),
    ("planning.params.horizon_max_s", "planning.params.horizon_min_s", 0.1),
    ("planning.params.lateral_step_m", "planning.params.horizon_max_s", 2.0),
    ("planning.params.left_m", "planning.params.right_m", 100.0),
    ("planning.params.time_step_s", "planning.params.horizon_max_s", 2.0),
    ("radar.NAME.params.range_min_m", "radar.any.params.range_max_m", 10_000.0),
];

/// Numeric keys with a numeric range.
fn numeric() -> Vec<Key> {
    let is_numeric = |key: &Key| {
        key.form.ends_with("number")
            && !WITHOUT.contains(&key.key.as_str())
            && !MIXED.contains(&key.key.as_str())
    };
    keys(&Registry::standard()).into_iter().filter(is_numeric).collect()
}

/// Minimum and maximum of a range such as `0.1 to 20 m`.
fn floor_and_ceiling(range: &str) -> Option<[f64; 2]> {
    let mut words = range.split([' ', ',']);
    let low = words.next()?.parse().ok()?;
    let high = (words.next() == Some("to")).then(|| words.next()?.parse().ok())??;
    Some([low, high])
}

/// Numbers outside a range: off by orders of magnitude, and just beyond the limits.
fn outside_of([low, high]: [f64; 2], is_whole: bool) -> Vec<String> {
    if is_whole {
        let near = [low - 1.0, high + 1.0].into_iter().filter(|x| *x >= 0.0).map(|x| format!("{x}"));
        return near.chain(["4000000000000000000".into()]).collect();
    }
    let beside = |x: f64| (x.abs() * 1e-3).max(1e-9);
    let near = [low - beside(low), high + beside(high)].map(|x| format!("{x:e}"));
    let tiny = (low > 0.0).then(|| "1e-300".to_owned());
    ["nan", "inf", "-inf", "-1e300", "1e300"].map(str::to_owned).into_iter().chain(near).chain(tiny).collect()
}

#[test]
fn every_number_of_a_configuration_has_a_minimum_and_a_maximum() {
    let mut wrong = Vec::new();
    let all = numeric();
    assert!(all.len() >= 390, "{}", all.len());
    for key in &all {
        let name = format!("{} [{}]", key.key, key.only_with.as_deref().unwrap_or_default());
        let Some(range) = &key.range else {
            wrong.push(format!("{name}: no range"));
            continue;
        };
        let Some(ends) = floor_and_ceiling(range) else {
            wrong.push(format!("{name}: the range `{range}` is not of the form `0.1 to 20`"));
            continue;
        };
        for value in outside_of(ends, key.form.contains("whole")) {
            let told = problems(key, &value, &[]);
            let expected = format!("expected {range}, found");
            if !told.iter().any(|told| told.starts_with(&expected) || told.contains("whole number")) {
                wrong.push(format!("{name}: {value} is not refused by `{range}`: {told:?}"));
            }
        }
        for end in ends {
            let told = at_end(key, end);
            if !told.is_empty() {
                wrong.push(format!("{name}: the end {end} of `{range}` is refused: {told:?}"));
            }
        }
    }
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), all.len(), wrong.join("\n"));
}

/// Problems of a key at a limit of its range.
fn at_end(key: &Key, end: f64) -> Vec<String> {
    let partner = PARTNERS.iter().find(|(name, ..)| *name == key.key);
    let with: Vec<_> =
        partner.iter().map(|(_, partner, value)| ((*partner).to_owned(), (*value).into())).collect();
    let text = if key.form.contains("whole") { format!("{end}") } else { format!("{end:?}") };
    problems(key, &text, &with)
}

/// Every actor, light and end condition of the text form, with values within their ranges.
const SCENARIO: &str = r#"
    name = "all"
    road = { segments = [{ length_m = 900.0, curvature_1pm = 0.0 }], lane_width_m = 4.0, left_m = 40.0, right_m = 40.0,
      friction = 0.9, light = [{ name = "a", s_m = 52.0, d_m = -3.0, stop_s_m = 50.0, green_s = 10.0, yellow_s = 3.0,
      red_s = 10.0, offset_s = 1.0 }] }
    ego = { s_m = 5.0, d_m = 0.0, heading_rad = 0.0, target_speed_mps = 10.0, start_speed_mps = 5.0, end_m = 500.0 }
    slippery = [{ name = "ice", friction = 0.2, s_m = 60.0, length_m = 15.0, d_m = 0.0, width_m = 4.0 }]
    end = { timeout_s = 9.0, after_collision_s = 1.0, standstill = { near = "box", within_m = 9.0, for_s = 1.0 } }
    [[actor]]
    name = "box"
    kind = "static"
    s_m = 100.0
    d_m = 20.0
    heading_rad = 0.0
    mass_kg = 100.0
    size = { length_m = 1.0, width_m = 1.0, height_m = 1.0 }
    [[actor]]
    name = "walker"
    kind = "pedestrian"
    s_m = 200.0
    d_m = 20.0
    size = { radius_m = 0.3 }
    trigger = { distance = { within_m = 20.0 } }
    motion = [{ wait = { for_s = 1.0 } }, { walk = { speed_mps = 1.0, distance_m = 9.0, direction = "left" } }]
    [[actor]]
    name = "driver"
    kind = "car"
    s_m = 300.0
    d_m = 20.0
    trigger = { time = { at_s = 1.0 } }
    motion = [{ drive = { speed_mps = 9.0, distance_m = 50.0 } }]
    [[actor]]
    name = "cyclist"
    kind = "cyclist"
    s_m = 400.0
    d_m = 20.0
    trigger = { reaches = { s_m = 60.0 } }
    motion = [{ path = { speed_mps = 3.0, points = [[410.0, 20.0]] } }]
    [expect]
    verdict = "avoided"
"#;

/// A map, lights and ways with values within their ranges; places have the form of either.
const ON_MAP: &str = r#"
    name = "on_map"
    map = { file = "crossing.xodr", friction = 0.9, light = [{ controller = "north_south", green_s = 10.0, yellow_s = 3.0,
      red_s = 10.0, offset_s = 1.0 }], closure = [{ at = TO, reported_s = 1.0 }] }
    ego = { start = FROM, via = [VIA], goal = TO, target_speed_mps = 10.0 }
    actor = [{ name = "box", kind = "car", start = FROM_2, via = [VIA], goal = TO },
      { name = "recorded", kind = "car", track = { from_s = 1.0, step_s = 0.1, at = [[1.75, -90.0]], heading_rad = [1.57] } }]
    slippery = [{ name = "ice", friction = 0.2, start = FROM_2, via = [VIA], goal = TO, length_m = 15.0 }]
    traffic = { vehicles = 3, pedestrians = 2, cyclists = 1 }
"#;

/// Another simulator in place of the traffic.
const WORLD: &str = "world = { sumo = 'x.sumocfg', begin_s = 1.0, warmup_s = 1.0, step_s = 0.1, range_m = 99.0, \
                     timeout_s = 9.0, offset_x_m = 0.0, offset_y_m = 0.0 }";

/// Text of a scenario that has a key; with places of the form that the key belongs to.
fn scenario_with(key: &str) -> String {
    let is_place = ["start", "via", "goal", "at"].iter().any(|part| key.split('.').any(|one| one == *part));
    let is_of_map =
        ["map.", "traffic.", "world.", "actor.NAME.track."].iter().any(|start| key.starts_with(start));
    if !(is_of_map || is_place) {
        return SCENARIO.to_owned();
    }
    let places = match key.ends_with(".s_m") || !is_place {
        true => [("4", -1, 50.0), ("42", -1, 5.0), ("2", 1, 60.0), ("4", -1, 90.0)]
            .map(|(road, lane, s_m)| format!("{{ road = \"{road}\", lane = {lane}, s_m = {s_m:?} }}")),
        false => [-111.0, 0.0, 101.0, -71.0]
            .map(|y_m| format!("{{ x_m = 1.75, y_m = {y_m:?}, heading_rad = 1.57 }}")),
    };
    let [from, via, to, from_2] = places;
    // A scenario has one of the two.
    let text = match key.starts_with("world.") {
        true => ON_MAP.replace("traffic = { vehicles = 3, pedestrians = 2, cyclists = 1 }", WORLD),
        false => ON_MAP.to_owned(),
    };
    text.replace("FROM_2", &from_2).replace("FROM", &from).replace("VIA", &via).replace("TO", &to)
}

/// Path in the scenario of a key of the list.
fn place_in_scenario(key: &str) -> String {
    const PLACES: [(&str, &str); 10] = [
        ("actor.NAME.track", "actor.recorded.track"),
        ("actor.NAME.motion.NAME.wait", "actor.walker.motion.0.wait"),
        ("actor.NAME.motion.NAME.walk", "actor.walker.motion.1.walk"),
        ("actor.NAME.motion.NAME.drive", "actor.driver.motion.0.drive"),
        ("actor.NAME.motion.NAME.path", "actor.cyclist.motion.0.path"),
        ("actor.NAME.trigger.distance", "actor.walker.trigger.distance"),
        ("actor.NAME.trigger.time", "actor.driver.trigger.time"),
        ("actor.NAME.trigger.reaches", "actor.cyclist.trigger.reaches"),
        ("actor.NAME.size.radius_m", "actor.walker.size.radius_m"),
        ("expect.pipeline.NAME", "expect.pipeline.fot"),
    ];
    let place = PLACES.iter().find_map(|(start, place)| Some(format!("{place}{}", key.strip_prefix(start)?)));
    let place = place.unwrap_or_else(|| {
        key.replace("actor.NAME", "actor.box")
            .replace("slippery.NAME", "slippery.ice")
            .replace("light.NAME", "light.a")
            .replace("segments.NAME", "segments.0")
            .replace("via.NAME", "via.0")
            .replace("map.light.a", "map.light.0")
            .replace("closure.NAME", "closure.0")
    });
    format!("scenario.{place}")
}

#[test]
fn every_number_of_a_scenario_has_a_minimum_and_a_maximum() {
    let schema = FileKind::Scenario.schema(&Registry::standard());
    let all = crate::schema::keys(&schema, "", None, Arrays::Within);
    let numbers: Vec<&Key> =
        all.iter().filter(|key| matches!(key.form.as_str(), "number" | "whole number")).collect();
    assert!(numbers.len() > 80, "{}", numbers.len());
    let map: swerve_scenario::MapText = include_str!("../../../../scenarios/maps/crossing.xodr").into();
    for key in ["ego.start.s_m", "ego.start.x_m", "name"] {
        let read = Scenario::parse_on("s.toml", &scenario_with(key), Some(&map), &[]);
        assert!(read.is_ok(), "{key}: {}", read.err().unwrap());
    }
    let mut wrong = Vec::new();
    for key in numbers {
        let ends = key.range.as_deref().and_then(floor_and_ceiling);
        let Some(ends) = ends else {
            wrong.push(format!("{}: no range", key.key));
            continue;
        };
        let range = format!("a number from {} to {}", ends[0], ends[1]);
        let refused = |value: &str| {
            let (_, value) = parse_assignment(&format!("x={value}")).unwrap();
            let place = place_in_scenario(&key.key);
            let (text, sets) = (scenario_with(&key.key), [(place.clone(), value)]);
            let problems = Scenario::parse_on("s.toml", &text, Some(&map), &sets).err().unwrap_or_default();
            let names_range = |message: &str| message.replace("a whole number", "a number").contains(&range);
            problems.iter().any(|problem| problem.key == place && names_range(&problem.message))
        };
        let slips = outside_of(ends, false);
        wrong.extend(
            slips
                .iter()
                .filter(|value| !refused(value))
                .map(|value| format!("{}: {value} is not refused", key.key)),
        );
        let taken = ends.map(|end| match key.form.as_str() {
            "whole number" => format!("{end}"),
            _ => format!("{end:?}"),
        });
        wrong.extend(
            taken
                .iter()
                .filter(|end| refused(end))
                .map(|end| format!("{}: the end {end} is refused", key.key)),
        );
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
