use swerve_geom::FrenetPoint;
use swerve_msg::{ActorId, Signal as Shown};

use super::*;
use crate::{Course as Ground, Scenario};

/// A scenario on a map of the folder of scenarios, from the lines of its tables.
fn parsed(map: &str, ego: &str, rest: &str) -> Result<Scenario, String> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/maps/test.toml");
    let text = format!("name = \"test\"\n[map]\nfile = \"{map}\"\n{rest}\n[ego]\n{ego}\n");
    Scenario::parse(file, &text).map_err(|problems| problems.to_string())
}

const START: &str = "start = { road = \"4\", lane = -1, s_m = 50.0 }";
const GOAL: &str = "goal = { road = \"3\", lane = 1, s_m = 60.0 }";

fn sound(map: &str, ego: &str, rest: &str) -> Scenario {
    parsed(map, ego, rest).unwrap_or_else(|problems| panic!("{problems}"))
}

#[test]
fn route_leads_from_the_start_over_the_junction_to_the_goal_and_beyond() {
    let scenario = sound("crossing.xodr", &format!("{START}\n{GOAL}"), "");
    let (line, ego) = (scenario.road.line(), &scenario.ego);
    // South of the crossing at (0, -161), heading north in the right lane; the goal is in the western arm, whose s
    // leads towards the crossing.
    let at = |s_m: f64| line.at(s_m).pose;
    assert!(at(ego.s_m).point().distance(Point2::new(1.75, -111.0)) < 1e-6, "{:?}", at(ego.s_m));
    assert!(at(ego.end_m).point().distance(Point2::new(-101.0, 1.75)) < 1e-3, "{:?}", at(ego.end_m));
    // 100 m to the end of the arm, an arc of 12.75 m, 90 m from the crossing to the goal.
    let arc_m = 12.75 * core::f64::consts::FRAC_PI_2;
    assert!((ego.end_m - ego.s_m - 190.0 - arc_m).abs() < 0.05, "{}", ego.end_m - ego.s_m);
    assert!(line.length() > ego.end_m + 50.0, "to the end of the map");
    assert_eq!((ego.target_speed_mps, ego.start_speed_mps), (50.0 / 3.6, None));
    let turn = scenario.road.route().stretches().iter().position(|stretch| stretch.in_junction);
    assert_eq!(turn, Some(1));
    let lines = scenario.road.lines();
    assert_eq!(lines.at(160.0).count(), 0, "no lines inside the crossing");
    assert_eq!(lines.at(100.0).count(), 3);
}

#[test]
fn places_may_be_points_with_a_direction() {
    let ego = "start = { x_m = 2.0, y_m = -100.0 }\ngoal = { x_m = 0.0, y_m = 100.0, heading_rad = 1.5 }\nd_m = 0.5";
    let scenario = sound("crossing_right_first.xodr", ego, "");
    let start = scenario.road.line().at(scenario.ego.s_m).pose;
    assert!(start.point().distance(Point2::new(1.75, -100.0)) < 1e-6);
    assert_eq!(scenario.ego.d_m, 0.5);
}

#[test]
fn ego_goes_over_all_places_on_the_way() {
    let via = "via = [{ road = \"1\", lane = 1, s_m = 75.0 }]";
    let around = parsed("roundabout.xodr", &format!("{START}\n{GOAL}\n{via}"), "");
    // The arms have ends: from the eastern one nothing leads back.
    let message = around.unwrap_err();
    assert!(
        message.contains("ego.goal: no way leads over driving lanes from 1:0:1 at 45.0 m to 3:0:1"),
        "{message}"
    );
    let ring = "via = [{ x_m = 16.0, y_m = 0.0, heading_rad = 1.57 }]";
    let scenario = sound("roundabout.xodr", &format!("{START}\n{GOAL}\n{ring}"), "");
    let near = scenario.road.line().project(Point2::new(16.0, 0.0));
    assert!(near.d_m.abs() < 0.1 && (scenario.ego.s_m..scenario.ego.end_m).contains(&near.s_m), "{near:?}");
}

#[test]
fn actors_have_ways_of_their_own() {
    let actor = "[[actor]]\nname = \"a\"\nkind = \"car\"\nstart = { road = \"1\", lane = -1, s_m = 50.0 }\n\
                 goal = { road = \"2\", lane = 1, s_m = 60.0 }\n[[actor]]\nname = \"b\"\nkind = \"car\"\n\
                 start = { road = \"3\", lane = -1, s_m = 10.0 }\nd_m = 0.2";
    let scenario = sound("crossing.xodr", &format!("{START}\n{GOAL}"), actor);
    let road = scenario.road.line();
    let [a, b] = &scenario.actors[..] else { panic!("two actors") };
    assert!(a.pose(&road).point().distance(Point2::new(111.0, 1.75)) < 1e-6, "{:?}", a.pose(&road));
    let end = a.line(&road).project(Point2::new(1.75, 90.0));
    assert!(end.d_m.abs() < 1e-3, "it turns to the north: {end:?}");
    // Without a goal, straight over the crossing.
    assert!(b.line(&road).project(Point2::new(100.0, -1.75)).d_m.abs() < 1e-3);
    assert!((b.s_m - 10.0).abs() < 1e-6 && b.d_m == 0.2, "{} {}", b.s_m, b.d_m);
}

#[test]
fn lights_of_the_ego_have_their_stop_line_on_its_route() {
    let lights = "[[map.light]]\ncontroller = \"north_south\"\ngreen_s = 10.0\nred_s = 20.0\n[[map.light]]\n\
                  signals = [\"light_east\"]\ngreen_s = 5.0\nred_s = 5.0\noffset_s = 9.0";
    let scenario = sound("crossing.xodr", &format!("{START}\n{GOAL}"), lights);
    let rounded = |s_m: f64| (s_m * 1e6).round() * 1e-6;
    let lights = scenario.road.lights.iter();
    let lights: Vec<_> = lights.map(|light| (light.name.as_str(), light.stop_s_m.map(rounded))).collect();
    // The stop line is 2 m before the end of the arm of 150 m.
    assert_eq!(lights, [("light_east", None), ("light_north", None), ("light_south", Some(148.0))]);
    let south = &scenario.road.lights[2];
    assert!((south.pose.heading_rad - core::f64::consts::FRAC_PI_2).abs() < 1e-9, "{:?}", south.pose);
    assert_eq!(scenario.road.lights[0].signal(swerve_core::Time::ZERO), Shown::Red);
}

#[test]
fn all_lights_of_a_map_may_be_lights_that_are_off() {
    let lights = |rest: &str| {
        let scenario = sound("crossing.xodr", &format!("{START}\n{GOAL}"), rest);
        let shown = |light: &crate::TrafficLight| light.signal(swerve_core::Time::ZERO);
        let lights = scenario.road.lights.iter();
        lights.map(|light| (light.name.clone(), light.stop_s_m.is_some(), shown(light))).collect::<Vec<_>>()
    };
    assert_eq!(lights("all_lights = false"), []);
    let all =
        lights("all_lights = true\n[[map.light]]\nsignals = [\"light_east\"]\ngreen_s = 5.0\nred_s = 5.0");
    let of = |name: &str| all.iter().find(|light| light.0 == name).map(|light| (light.1, light.2));
    assert_eq!(of("light_east"), Some((false, Shown::Green)));
    assert_eq!(of("light_south"), Some((true, Shown::Off)));
    assert_eq!(all.len(), 4, "{all:?}");
    let wrong = parsed("crossing.xodr", &format!("{START}\n{GOAL}"), "all_lights = 1").unwrap_err();
    assert!(wrong.contains("map.all_lights"), "{wrong}");
}

/// A crossing of SUMO with a light, and a way over it.
const NET: &str = "../../crates/swerve-map-io/maps/junction.net.xml";
const OVER: &str = "start = { lane = \"in_2\", s_m = 20.0 }\ngoal = { lane = \"out_0\", s_m = 30.0 }";

#[test]
fn lights_have_the_phases_of_the_file_unless_the_scenario_has_others() {
    let shown = |rest: &str| {
        let scenario = sound(NET, OVER, rest);
        let lights = scenario.road.lights.iter().map(|light| {
            let at = |s: i64| light.signal(swerve_core::Time::from_ms(1000 * s));
            (light.name.clone(), light.stop_s_m, [0, 5, 34, 35, 40, 60].map(at))
        });
        lights.collect::<Vec<_>>()
    };
    use Shown::{Green, Red, Yellow};
    // A cycle of 30, 3 and 20 s that begins at 5 s. The ego obeys the light of its link, 1 m before the junction.
    let by_file = [Red, Green, Green, Yellow, Red, Green];
    let light = |name: &str, stop_s_m, shown| (name.to_owned(), stop_s_m, shown);
    let walk = light("L:2", None, [Green, Red, Red, Red, Green, Red]);
    assert_eq!(shown(""), [light("L:0", None, by_file), light("L:1", Some(89.0), by_file), walk.clone()]);
    let one = "[[map.light]]\nsignals = [\"L:1\"]\ngreen_s = 1.0\nyellow_s = 3.0\nred_s = 500.0";
    let given = [Green, Red, Red, Red, Red, Red];
    assert_eq!(shown(one), [light("L:0", None, by_file), light("L:1", Some(89.0), given), walk]);
    let all = shown(&one.replace("signals = [\"L:1\"]", "controller = \"L\""));
    assert!(all.iter().all(|(.., shown)| *shown == given), "{all:?}");
}

/// A scenario on a road with this grade from 300 m on, and this bank from 350 m on, which begins to rise 50 m before.
fn on_slope(grade: f64, bank: f64) -> Result<Scenario, String> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/maps/two_lane_road.xodr");
    let map = std::fs::read_to_string(file).unwrap();
    let record = |name: &str, s_m: f64, a: f64, b: f64| {
        format!("<{name} s=\"{s_m}\" a=\"{a}\" b=\"{b}\" c=\"0\" d=\"0\"/>")
    };
    let profiles = [
        "<elevationProfile>".to_owned(),
        record("elevation", 0.0, 0.0, 0.0),
        record("elevation", 300.0, 0.0, grade),
        "</elevationProfile><lateralProfile>".to_owned(),
        record("superelevation", 300.0, 0.0, bank / 50.0),
        record("superelevation", 350.0, bank, 0.0),
        "</lateralProfile>\n    <lanes>".to_owned(),
    ]
    .concat();
    let map: MapText = map.replacen("<lanes>", &profiles, 1).into();
    let text = "name = \"test\"\n[map]\nfile = \"m.xodr\"\n[ego]\nstart = { road = \"1\", lane = -1, s_m = 20.0 }\n\
                goal = { road = \"1\", lane = -1, s_m = 500.0 }\n";
    Scenario::parse_on("x.toml", text, Some(&map), &[]).map_err(|problems| problems.to_string())
}

#[test]
fn small_slopes_are_a_warning_and_large_ones_are_refused() {
    const FLAT: &str = "vehicles are driven on the flat projection of the map";
    let warnings = |grade: f64, bank: f64| on_slope(grade, bank).unwrap().warnings();
    for (grade, bank) in [(0.019, 0.0), (0.0, -0.039)] {
        assert_eq!(warnings(grade, bank), [] as [&str; 0]);
    }
    let expected = format!("map.file: road \"1\" has a grade of -2.5 % (0.25 m/s²) at s = 426.1 m: {FLAT}");
    assert_eq!(warnings(-0.025, 0.0), [expected]);
    let both = warnings(0.07, 0.09);
    assert!(
        both.len() == 1 && both[0].contains("grade of 7.") && both[0].contains("bank of 9.0 %"),
        "{both:?}"
    );
    let limits = format!("{FLAT}, expected a grade of at most 8 % and a bank of at most 10 %");
    let steep = on_slope(-0.094, 0.05).unwrap_err();
    let expected = "x.toml:3: map.file: road \"1\" has a grade of -9.4 % (0.92 m/s²) at s = 307.2 m: ";
    assert_eq!(steep, format!("{expected}{limits}"));
    let banked = on_slope(0.0, 0.12).unwrap_err();
    assert!(
        banked.contains("has a bank of 12.1 % (1.17 m/s²) at s = 351.8 m") && banked.ends_with(&limits),
        "{banked}"
    );
}

/// A scenario on a map of the text, from one lane to another.
fn over(file: &str, map: &str, start: &str, goal: &str) -> Result<Scenario, String> {
    let text = format!("name = \"test\"\n[map]\nfile = \"{file}\"\n[ego]\nstart = {start}\ngoal = {goal}\n");
    Scenario::parse_on("x.toml", &text, Some(&map.into()), &[]).map_err(|problems| problems.to_string())
}

#[test]
fn left_hand_traffic_is_a_warning_and_a_way_far_from_the_origin_is_refused() {
    let net = include_str!("../../../../swerve-map-io/maps/junction.net.xml");
    let (start, goal) = ("{ lane = \"in_2\", s_m = 20.0 }", "{ lane = \"in_2\", s_m = 60.0 }");
    let left = over("m.net.xml", &net.replace("<net ", "<net lefthand=\"true\" "), start, goal).unwrap();
    assert_eq!(left.warnings(), [format!("map.file: {LEFT_HAND}")]);
    // A net in coordinates far from the origin is moved; one that reaches far is refused.
    let utm = net.replace("netOffset=\"100.00,50.00\"", "netOffset=\"0.00,-200000.00\"");
    assert!(over("m.net.xml", &utm, start, goal).is_ok());
    let (here, there) = ("shape=\"0.00,48.25 90.00,48.25\"", "shape=\"150000.00,48.25 150090.00,48.25\"");
    let far = over("m.net.xml", &net.replace(here, there), start, goal);
    let error = far.unwrap_err();
    assert!(
        error.starts_with("x.toml:3: map.file: the way leads over (")
            && error.contains("expected coordinates up to 100000 m"),
        "{error}"
    );
}

#[test]
fn names_of_the_traffic_are_taken() {
    let net = include_str!("../../../../swerve-map-io/maps/junction.net.xml");
    let text = "name = \"test\"\n[map]\nfile = \"m.net.xml\"\n[ego.cyclist_2]\nstart = { lane = \"in_2\", s_m = 20.0 }\n\
                goal = { lane = \"in_2\", s_m = 60.0 }\n[traffic]\nvehicles = 3\ncyclists = 2\n";
    let read = |text: &str| {
        let read = Scenario::parse_on("x.toml", text, Some(&net.into()), &[]);
        read.map(drop).map_err(|problems| problems.to_string())
    };
    let error = read(text).unwrap_err();
    assert!(
        error.contains("ego.cyclist_2: a road user of `[traffic]` is named \"cyclist_2\" already"),
        "{error}"
    );
    for (name, is_taken) in
        [("vehicle_3", true), ("vehicle_4", false), ("vehicle_03", false), ("pedestrian_1", false)]
    {
        let actor = format!(
            "[[actor]]\nname = \"{name}\"\nkind = \"car\"\nstart = {{ lane = \"in_2\", s_m = 50.0 }}\n"
        );
        let found = read(&(text.replace("ego.cyclist_2", "ego") + &actor));
        assert_eq!(found.is_err_and(|error| error.contains("`[traffic]`")), is_taken, "{name}");
    }
}

#[test]
fn hills_of_other_formats_are_refused_with_their_lane_and_place() {
    const LIMITS: &str = "vehicles are driven on the flat projection of the map, expected a grade of at most 8 % and a \
                          bank of at most 10 %";
    let net = include_str!("../../../../swerve-map-io/maps/junction.net.xml");
    let (start, goal) = ("{ lane = \"in_2\", s_m = 20.0 }", "{ lane = \"out_0\", s_m = 30.0 }");
    let on = |shape: &str| {
        over("m.net.xml", &net.replace("0.00,48.25 90.00,48.25", shape), start, goal)
            .map(|scenario| scenario.warnings())
    };
    assert_eq!(sound(NET, OVER, "").warnings(), [] as [&str; 0], "flat where it drives");
    assert_eq!(
        on("0,48.25,0 20,48.25,9 90,48.25,9").unwrap(),
        [] as [&str; 0],
        "the hill is before the start"
    );
    let warned = on("0,48.25,0 90,48.25,2.7").unwrap();
    let expected = "map.file: lane \"in_2\" has a grade of 3.0 % (0.29 m/s²) at s = 22.5 m: ";
    assert!(warned.len() == 1 && warned[0].starts_with(expected), "{warned:?}");
    let expected = "x.toml:3: map.file: lane \"in_2\" has a grade of 12.0 % (1.17 m/s²) at s = 47.5 m: ";
    assert_eq!(
        on("0,48.25 45,48.25,0 90,48.25,5.4").map_err(drop),
        Ok(vec![]),
        "heights of some points only"
    );
    assert_eq!(on("0,48.25,0 45,48.25,0 90,48.25,5.4").unwrap_err(), format!("{expected}{LIMITS}"));
    let node = |id: u32, x_m: f64, y_m: f64, z_m: f64| {
        format!(
            "<node id=\"{id}\"><tag k=\"local_x\" v=\"{x_m}\"/><tag k=\"local_y\" v=\"{y_m}\"/>\
             <tag k=\"ele\" v=\"{z_m}\"/></node>"
        )
    };
    let banked = [
        "<osm>".to_owned(),
        node(1, 0.0, 4.0, 30.5),
        node(2, 100.0, 4.0, 30.5),
        node(3, 0.0, 0.0, 30.0),
        node(4, 100.0, 0.0, 30.0),
        "<way id=\"5\"><nd ref=\"1\"/><nd ref=\"2\"/></way><way id=\"6\"><nd ref=\"3\"/><nd ref=\"4\"/></way>".to_owned(),
        "<relation id=\"88\"><member type=\"way\" ref=\"5\" role=\"left\"/>".to_owned(),
        "<member type=\"way\" ref=\"6\" role=\"right\"/><tag k=\"type\" v=\"lanelet\"/>".to_owned(),
        "<tag k=\"subtype\" v=\"road\"/><tag k=\"speed_limit\" v=\"50\"/></relation></osm>".to_owned(),
    ]
    .concat();
    let (start, goal) = ("{ lane = \"88\", s_m = 20.0 }", "{ lane = \"88\", s_m = 80.0 }");
    let expected = "x.toml:3: map.file: lane \"88\" has a bank of 12.5 % (1.22 m/s²) at s = 22.5 m: ";
    assert_eq!(over("m.osm", &banked, start, goal).unwrap_err(), format!("{expected}{LIMITS}"));
    let less = banked.replace("30.5", "30.14");
    assert_eq!(over("m.osm", &less, start, goal).unwrap().warnings(), [] as [&str; 0]);
}

#[test]
fn map_is_read_once_and_its_text_makes_the_same_scenario() {
    let ego = format!("{START}\n{GOAL}");
    let scenario = sound("crossing.xodr", &ego, "");
    let map = scenario.road.map_text().unwrap();
    let again = Scenario::parse_on("elsewhere.toml", &scenario.text, Some(map), &[]).unwrap();
    assert_eq!(again, scenario);
    assert!(matches!(&scenario.road.course, Ground::Map(course) if course.file == "crossing.xodr"));
    let place = scenario.road.line().project(Point2::new(1.75, -100.0));
    assert!(scenario.road.route().borders().contains(FrenetPoint { d_m: 0.0, ..place }));
}

/// A file packed by gzip: stored blocks.
fn packed(text: &str) -> Vec<u8> {
    let mut packed = vec![0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 3];
    let blocks: Vec<&[u8]> = text.as_bytes().chunks(0xffff).collect();
    for (k, block) in blocks.iter().enumerate() {
        let length = u16::try_from(block.len()).unwrap();
        packed.push(u8::from(k + 1 == blocks.len()));
        packed.extend([length.to_le_bytes(), (!length).to_le_bytes()].concat());
        packed.extend(*block);
    }
    packed
}

#[test]
fn map_packed_by_gzip_is_the_same_map() {
    let plain = sound("crossing.xodr", &format!("{START}\n{GOAL}"), "");
    let Ground::Map(course) = &plain.road.course else { panic!("it is on a map") };
    let folder = tempfile::tempdir().unwrap();
    std::fs::write(folder.path().join("crossing.xodr.gz"), packed(&course.text)).unwrap();
    let text = plain.text.replace("crossing.xodr", "crossing.xodr.gz");
    let parsed = Scenario::parse(folder.path().join("a.toml").to_str().unwrap(), &text).unwrap();
    assert_eq!(parsed.road.line(), plain.road.line());
    std::fs::write(folder.path().join("crossing.xodr.gz"), &packed(&course.text)[..999]).unwrap();
    let broken = Scenario::parse(folder.path().join("a.toml").to_str().unwrap(), &text).unwrap_err();
    assert!(broken.to_string().contains("packed by gzip, but broken"), "{broken}");
}

/// The second table is lines 8 to 11.
#[test]
fn signal_has_the_phases_of_one_table() {
    let first = "[[map.light]]\ncontroller = \"north_south\"\ngreen_s = 1.0\nred_s = 1.0";
    let two = |second: &str| {
        let lights = format!("{first}\n[[map.light]]\n{second}\ngreen_s = 2.0\nred_s = 2.0");
        parsed("crossing.xodr", &format!("{START}\n{GOAL}"), &lights).map(drop)
    };
    assert_eq!(two("controller = \"east_west\""), Ok(()));
    for (second, wanted) in [
        (
            "controller = \"north_south\"",
            ":9: map.light[1].controller: the signal \"light_north\" has its phases by map.light[0] already",
        ),
        (
            "signals = [\"light_east\", \"light_south\"]",
            ":9: map.light[1].signals: the signal \"light_south\" has its phases by map.light[0] already",
        ),
    ] {
        let message = two(second).unwrap_err();
        assert!(message.ends_with(wanted) && message.lines().count() == 1, "{message}");
    }
}

/// The eastern light of the crossing names a lane that its road does not have.
#[test]
fn light_for_no_lane_is_refused_if_it_gets_phases() {
    let text = include_str!("../../../../../scenarios/maps/crossing.xodr");
    let light = text.find("<signal name=\"light_east\"").unwrap();
    let lane = "<validity fromLane=\"-1\" toLane=\"-1\" />";
    let other = text[light..].replacen(lane, "<validity fromLane=\"-7\" toLane=\"-7\" />", 1);
    let map = MapText::from(format!("{}{other}", &text[..light]));
    let read = |lights: &str| {
        let text =
            format!("name = \"test\"\n[map]\nfile = \"crossing.xodr\"\n{lights}\n[ego]\n{START}\n{GOAL}\n");
        Scenario::parse_on("test.toml", &text, Some(&map), &[]).map_err(|problems| problems.to_string())
    };
    assert!(read("").is_ok());
    let named = |names: &str| read(&format!("[[map.light]]\n{names}\ngreen_s = 5.0\nred_s = 5.0"));
    let wanted = "test.toml:5: map.light[0].signals: the signal \"light_east\" is for no lane: the map has none of the \
                  lanes that it names";
    assert_eq!(named("signals = [\"light_east\"]").unwrap_err(), wanted);
    assert!(named("controller = \"east_west\"").is_ok(), "the western light has a lane");
}

#[test]
fn traffic_has_identities_after_the_actors_and_before_other_egos() {
    let rest = "[traffic]\nvehicles = 20\npedestrians = 5\n\
                [[actor]]\nname = \"parked\"\nkind = \"car\"\ns_m = 80.0\nd_m = -3.5\n";
    let both = format!("{START}\n{GOAL}");
    let scenario = sound("crossing.xodr", &both, rest);
    let traffic = scenario.traffic.unwrap();
    assert_eq!((traffic.vehicles, traffic.pedestrians, traffic.cyclists), (20, 5, 0));
    assert_eq!((traffic.first_id, traffic.count(), traffic.seed), (ActorId(2), 25, None));
    let second = format!("{both}\n[ego.b]\nstart = {{ road = \"1\", lane = -1, s_m = 50.0 }}\n{GOAL}");
    let text = format!("name = \"test\"\n[map]\nfile = \"crossing.xodr\"\n{rest}\n[ego.a]\n{second}\n");
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/maps/test.toml");
    let egos = Scenario::parse(file, &text).unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!(egos.egos(), [(ActorId::EGO, "a"), (ActorId(27), "b")]);
    for (wrong, expected) in [
        ("vehicles = -1", "traffic.vehicles: expected a whole number from 0 to 2000"),
        (
            "vehicles = 1500\npedestrians = 501",
            "traffic: expected at most 2000 road users in total, found 2001",
        ),
        ("cars = 5", "traffic.cars: unknown key"),
    ] {
        let found = parsed("crossing.xodr", &both, &format!("[traffic]\n{wrong}\n")).unwrap_err();
        assert!(found.contains(expected), "{wrong}: {found}");
    }
    let road = "name = \"x\"\n[road]\nsegments = [{ length_m = 50.0 }]\n[traffic]\nvehicles = 1\n\
                [ego]\ntarget_speed_mps = 5.0\nend_m = 40.0\n";
    let found = Scenario::parse("x.toml", road).unwrap_err().to_string();
    assert!(found.contains("traffic: expected a scenario on a `[map]`"), "{found}");
}

#[test]
fn wrong_places_are_one_clear_error_each() {
    let both = format!("{START}\n{GOAL}");
    let ego = |start: &str| format!("start = {start}\n{GOAL}");
    let cases = [
        ("nowhere.xodr", both.clone(), "", "map.file: ", "nowhere.xodr cannot be read"),
        ("make.py", both.clone(), "", "map.file: ", "expected a road network with the root element"),
        (
            "crossing.xodr",
            ego("{ road = \"9\", lane = -1, s_m = 5.0 }"),
            "",
            "ego.start: ",
            "expected the identity of a road, found \"9\"",
        ),
        (
            "crossing.xodr",
            ego("{ road = \"4\", lane = -3, s_m = 5.0 }"),
            "",
            "ego.start: ",
            "one of 2, 1, -1, -2; found -3",
        ),
        (
            "crossing.xodr",
            ego("{ road = \"4\", lane = -2, s_m = 5.0 }"),
            "",
            "ego.start: ",
            "expected a driving lane",
        ),
        ("crossing.xodr", ego("{ road = \"4\", lane = -1, s_m = 151.0 }"), "", "ego.start: ", "151"),
        ("crossing.xodr", ego("{ road = \"4\", lane = -1 }"), "", "ego.start.s_m: ", "is missing"),
        (
            "crossing.xodr",
            ego("{ road = \"4\", lane = -1, s_m = 5.0, x = 1 }"),
            "",
            "ego.start.x: ",
            "unknown key",
        ),
        ("crossing.xodr", ego("{ x_m = 80.0, y_m = 80.0 }"), "", "ego.start: ", "found one 78.3 m from it"),
        ("crossing.xodr", START.to_owned(), "", "ego.goal: ", "is missing"),
        (
            "crossing.xodr",
            format!("{START}\ngoal = {{ road = \"4\", lane = -1, s_m = 20.0 }}"),
            "",
            "ego.goal: ",
            "no way leads over driving lanes from 4:0:-1 at 50.0 m to 4:0:-1 at 20.0 m",
        ),
        ("crossing.xodr", format!("{both}\nd_m = -2.0"), "", "ego: ", "outside the drivable ground"),
        (
            "crossing.xodr",
            both.clone(),
            "[[actor]]\nname = \"a\"\nkind = \"car\"\nstart = { road = \"4\", lane = -1, s_m = 52.0 }",
            "ego: ",
            "is inside the actor \"a\"",
        ),
        (
            "crossing.xodr",
            both.clone(),
            "[[map.light]]\nsignals = [\"light_est\"]\ngreen_s = 1.0\nred_s = 1.0",
            "map.light[0].signals: ",
            "the map has no signal \"light_est\"; did you mean \"light_east\"?",
        ),
        (
            "crossing.xodr",
            both.clone(),
            "[road]\nsegments = []",
            "road: ",
            "expected only one of `map` and `road`",
        ),
        ("crossing.xodr", both.clone(), "flie = 1", "map.flie: ", "unknown key; did you mean `file`?"),
    ];
    let wrong = cases.into_iter().filter_map(|(map, ego, rest, key, part)| {
        let message = parsed(map, &ego, rest).err().unwrap_or_default();
        let is_right = message.lines().count() == 1 && message.contains(key) && message.contains(part);
        (!is_right).then(|| format!("expected {key}{part}, found\n{message}"))
    });
    let wrong: Vec<String> = wrong.collect();
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}
