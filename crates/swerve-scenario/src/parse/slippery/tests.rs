use swerve_geom::Point2;

use crate::Scenario;

const ROAD: &str = "name = \"ice\"\nego = { target_speed_mps = 5.0, end_m = 60.0 }\n[road]\n\
                    segments = [{ length_m = 80.0 }]\n";
const MAP: &str = "name = \"ice\"\nego = { start = { road = \"4\", lane = -1, s_m = 50.0 }, \
                   goal = { road = \"3\", lane = 1, s_m = 60.0 } }\n[map]\nfile = \"crossing.xodr\"\n";

fn parsed(ground: &str, patch: &str) -> Result<Scenario, Vec<String>> {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/maps/ice.toml");
    let text = format!("{ground}[[slippery]]\n{patch}\n");
    let printed = |problem: &swerve_text::Problem| {
        format!("{} {}: {}", problem.line.unwrap_or(0), problem.key, problem.message)
    };
    Scenario::parse(file, &text).map_err(|problems| problems.iter().map(printed).collect())
}

/// `[[slippery]]` is line 5.
#[test]
fn wrong_patches_are_reported_once_with_line_and_key() {
    let sound = "name = \"a\"\nfriction = 0.2\ns_m = 10.0\nlength_m = 15.0";
    assert!(parsed(ROAD, sound).is_ok());
    let start = "start = { road = \"4\", lane = -1, s_m = 20.0 }";
    #[rustfmt::skip]
    let cases = [
        (ROAD, "friction = 0.2", "friction = 5", "7 slippery.a.friction: expected a number from 0.01 to 4, found 5"),
        (ROAD, "friction = 0.2", "friction = 0", "7 slippery.a.friction: expected a number from 0.01 to 4, found 0"),
        (ROAD, "friction = 0.2\n", "", "5 slippery.a.friction: is missing: expected a number from 0.01 to 4"),
        (ROAD, "s_m = 10.0\n", "", "5 slippery.a.s_m: is missing: expected a number from -100000 to 100000"),
        (ROAD, "s_m = 10.0", "s_m = 70.0", "8 slippery.a.s_m: from 70 m to 85 m: expected a place on the road, 0 to 80.0 m"),
        (ROAD, "s_m = 10.0", "s_m = -1.0", "8 slippery.a.s_m: from -1 m to 14 m: expected a place on the road, 0 to 80.0 m"),
        (ROAD, "s_m = 10.0", start, "8 slippery.a.start: unknown key; expected one of \"d_m\""),
        (ROAD, "length_m = 15.0", "length_m = nan", "9 slippery.a.length_m: expected a number from 0.1 to 10000, found nan"),
        (ROAD, "length_m = 15.0", "length_m = 15.0\nwidth_m = 0", "10 slippery.a.width_m: expected a number from 0.1 to 200, found 0"),
        (ROAD, "length_m = 15.0", "length_m = 15.0\nwith_m = 2", "10 slippery.a.with_m: unknown key; did you mean `width_m`?"),
        (ROAD, "name = \"a\"\n", "", "5 slippery[0].name: is missing: expected a text"),
        (ROAD, "name = \"a\"", "name = \"a.b\"", "6 slippery.a.b.name: expected a name without `.` and `=`, which separate keys in --set; found `.`"),
        (ROAD, "length_m = 15.0", "length_m = 15.0\nd_m = 3.5\nwidth_m = 2.0", "10 slippery.a.d_m: from 2.5 m to 4.5 m across, all beside the road: expected a place on the road"),
        (MAP, "s_m = 10.0", "s_m = 10.0\nd_m = -30.0", "9 slippery.a.d_m: from -31.75 m to -28.25 m across, all beside the road: expected a place on a lane of the map"),
        (MAP, "s_m = 10.0", "start = { road = \"9\", lane = -1, s_m = 20.0 }", "8 slippery.a.start: expected the identity of a road, found \"9\""),
        (MAP, "s_m = 10.0", "start = 3", "8 slippery.a.start: expected a table, found 3"),
        (MAP, "s_m = 10.0\nlength_m = 15.0", &format!("{start}\nlength_m = 900.0"), "9 slippery.a.length_m: ends"),
    ];
    for (ground, old, new, wanted) in cases {
        let patch = sound.replacen(old, new, 1);
        assert_ne!(patch, sound);
        let found = parsed(ground, &patch).expect_err(wanted);
        let missing_s = new == start && ground == ROAD;
        assert_eq!(found.len(), if missing_s { 2 } else { 1 }, "{found:?}");
        assert!(found.iter().any(|one| one.starts_with(wanted)), "{found:?}, expected {wanted}");
    }
    let twice = format!("{sound}\n[[slippery]]\n{sound}");
    let wanted = "11 slippery.a.name: another patch is named \"a\" already";
    assert_eq!(parsed(ROAD, &twice).unwrap_err(), [wanted]);
}

/// The road reaches 2 m to each side of its line; on the map, the lane of the oncoming traffic lies at -3.5 m.
#[test]
fn patch_may_reach_the_road_by_its_edge_and_lie_on_another_lane() {
    let across = |ground: &str, keys: &str| {
        parsed(ground, &format!("name = \"a\"\nfriction = 0.2\ns_m = 10.0\nlength_m = 15.0\n{keys}"))
    };
    for keys in ["d_m = 2.9\nwidth_m = 2.0", "d_m = -2.9\nwidth_m = 2.0", "d_m = 50.0\nwidth_m = 100.0"] {
        assert_eq!(across(ROAD, keys).map(|scenario| scenario.slippery.len()), Ok(1), "{keys}");
    }
    assert_eq!(across(MAP, "d_m = 3.5\nwidth_m = 1.0").map(|scenario| scenario.slippery.len()), Ok(1));
}

#[test]
fn at_most_200_patches_are_read() {
    let patch = |k: usize| format!("name = \"p{k}\"\nfriction = 0.2\ns_m = 10.0\nlength_m = 15.0");
    let patches = |count: usize| (0..count).map(patch).collect::<Vec<_>>().join("\n[[slippery]]\n");
    assert_eq!(parsed(ROAD, &patches(200)).unwrap().slippery.len(), 200);
    let found = parsed(ROAD, &patches(201)).unwrap_err();
    assert_eq!(found.len(), 1, "{found:?}");
    assert!(found[0].contains("slippery: expected at most 200 tables"), "{found:?}");
}

/// South of the crossing at (0, -161) the ego's lane leads north at x = 1.75 m; the lane of the oncoming traffic south.
#[test]
fn patch_on_a_map_lies_on_the_route_of_the_ego_or_on_a_lane() {
    let keys = "name = \"a\"\nfriction = 0.2\nlength_m = 15.0\n";
    let along = parsed(MAP, &format!("{keys}s_m = 50.0")).unwrap();
    let begin = along.road.line().at(50.0).pose.point();
    assert_eq!(along.slippery_at(begin + (along.road.line().at(51.0).pose.point() - begin)), Some(0.2));
    assert!((along.slippery[0].width_m - 3.5).abs() < 1e-6, "{}", along.slippery[0].width_m);
    let oncoming = parsed(MAP, &format!("{keys}start = {{ x_m = -1.75, y_m = -80.0 }}")).unwrap();
    for (x_m, y_m, wanted) in [
        (-1.75, -81.0, Some(0.2)),
        (-1.75, -94.0, Some(0.2)),
        (-1.75, -79.0, None),
        (-1.75, -96.0, None),
        (1.75, -90.0, None),
    ] {
        assert_eq!(oncoming.slippery_at(Point2::new(x_m, y_m)), wanted, "at {x_m}, {y_m}");
    }
}

#[test]
fn wrong_map_or_ego_is_the_only_problem_of_a_scenario_with_patches() {
    let patch =
        "name = \"a\"\nfriction = 0.2\nlength_m = 15.0\nstart = { road = \"4\", lane = -1, s_m = 20.0 }";
    for (old, new) in [("crossing.xodr", "none.xodr"), ("road = \"4\"", "road = \"9\"")] {
        let found = parsed(&MAP.replacen(old, new, 1), patch).unwrap_err();
        assert_eq!(found.len(), 1, "{found:?}");
    }
    let found =
        parsed(&ROAD.replacen("80.0", "0.0", 1), "name = \"a\"\nfriction = 0.2\ns_m = 1.0\nlength_m = 1.0");
    assert_eq!(found.unwrap_err().len(), 1);
}
