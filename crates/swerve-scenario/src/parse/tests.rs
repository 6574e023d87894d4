use swerve_msg::ActorId;

use crate::{
    Direction, Motion, Scenario, SignalProgram, SpeedPoint, Subject, TrafficLight, Trigger, Verdict,
};

const TRUCK: &str = include_str!("../../../../scenarios/person_behind_truck.toml");

#[test]
fn person_behind_truck_is_read_as_written() {
    let scenario = Scenario::parse("person.toml", TRUCK).unwrap();
    let (truck, person) = (&scenario.actors[0], &scenario.actors[1]);
    assert_eq!((truck.s_m, truck.d_m), (110.0, 4.0));
    assert_eq!((truck.extent.length_m, truck.extent.width_m, truck.extent.height_m), (5.2, 2.6, 2.5));
    assert_eq!(
        (person.s_m, person.d_m, person.extent.width_m, person.extent.height_m),
        (117.0, 4.5, 0.5, 1.8)
    );
    assert_eq!(person.trigger, Some(Trigger::Distance { to: Subject::Ego, within_m: 26.0 }));
    let walk = Motion::Walk { speed_mps: 2.75, distance_m: 4.5, direction: Direction::Right, turn_rad: 0.0 };
    assert_eq!(person.motion, [walk]);
    let road = &scenario.road;
    let strip = road.strip().unwrap();
    assert_eq!((strip.lane_width_m, strip.left_m, strip.right_m, road.friction), (4.0, 6.0, 2.0, 0.9));
    assert_eq!((scenario.ego.s_m, scenario.ego.d_m, scenario.ego.end_m), (0.0, 0.0, 180.0));
    assert_eq!(scenario.ego.start_speed(), scenario.ego.target_speed_mps);
    assert_eq!(scenario.expectation("any").unwrap().verdict, Verdict::Collision);
}

#[test]
fn shipped_scenarios_are_valid_and_named_after_their_files() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let mut names = Vec::new();
    let files =
        |folder: std::path::PathBuf| std::fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    let folders = ["everyday", "seeing"].into_iter().flat_map(|name| files(folder.join(name)));
    for path in files(folder.clone()).filter(|path| path.is_file()).chain(folders) {
        let scenario = Scenario::read(&path).unwrap_or_else(|problems| panic!("{problems:#?}"));
        assert_eq!(path.file_stem().unwrap().to_str().unwrap(), scenario.name);
        names.push(scenario.name);
    }
    assert!(names.len() >= 34, "{names:?}");
}

const FULL: &str = r#"
name = "full"
[road]
segments = [{ length_m = 200.0, curvature_1pm = 0.005 }]
[ego]
target_speed_mps = 10
end_m = 150.0
[[actor]]
name = "bus"
kind = "truck"
s_m = 40.0
d_m = 4.0
motion = [{ drive = { speeds = [[0.0, 5.0], [4.0, 0.0]] } }, { wait = { for_s = 2.0 } }, { path = { speed_mps = 3.0, points = [[60.0, 3.0]] } }]
[[actor]]
name = "bike"
kind = "cyclist"
s_m = 20.0
d_m = 4.0
trigger = { reaches = { who = "bus", s_m = 44.0 } }
motion = [{ drive = { along = "heading", speed_mps = 3.0 } }]
[end]
timeout_s = 20.0
standstill = { near = "bus", within_m = 10.0, for_s = 1.0 }
[expect]
verdict = "avoided"
min_distance_m = { min = 0.5 }
[expect.pipeline.slow]
verdict = "collision"
impact_speed_mps = { min = 2.0, max = 8.0 }
"#;

#[test]
fn parser_reads_all_forms() {
    let scenario = Scenario::parse("full.toml", FULL).unwrap_or_else(|problems| panic!("{problems:#?}"));
    assert_eq!(
        scenario.actors[1].trigger,
        Some(Trigger::Reaches { who: Subject::Actor(ActorId(1)), s_m: 44.0 })
    );
    let Motion::Drive { speeds, distance_m: None, .. } = &scenario.actors[0].motion[0] else { panic!() };
    assert_eq!(speeds[1], SpeedPoint { at_s: 4.0, speed_mps: 0.0 });
    assert_eq!(scenario.actors[0].motion.len(), 3);
    assert_eq!(scenario.end.standstill.unwrap().near, Some(ActorId(1)));
    assert_eq!(scenario.expectation("slow").unwrap().verdict, Verdict::Collision);
    assert_eq!(scenario.expectation("fast").unwrap().verdict, Verdict::Avoided);
    assert_eq!(scenario.ego.target_speed_mps, 10.0, "a whole number is a number");
}

/// Replaces `old` in `FULL` and returns the reported problems as `line key: message`.
fn problems(old: &str, new: &str) -> Vec<String> {
    assert!(FULL.contains(old), "{old}");
    let text = FULL.replacen(old, new, 1);
    match Scenario::parse("full.toml", &text) {
        Ok(_) => Vec::new(),
        Err(problems) => {
            problems.iter().map(|p| format!("{} {}: {}", p.line.unwrap_or(0), p.key, p.message)).collect()
        }
    }
}

/// Text to replace in `FULL`, its replacement, and the expected problems.
type Case<'a> = (&'a str, &'a str, Vec<&'a str>);

fn check(table: &[Case<'_>]) {
    let mut differs = Vec::new();
    for (old, new, want) in table {
        let got = problems(old, new);
        if got != *want {
            differs.push(format!("after {old:?} -> {new:?}\n  got  {got:#?}\n  want {want:#?}"));
        }
    }
    assert!(differs.is_empty(), "{}", differs.join("\n"));
}

#[test]
fn wrong_values_and_impossible_starts_are_reported_with_line_and_key() {
    #[rustfmt::skip]
    let table = [
        ("target_speed_mps = 10", "target_sped_mps = 10", vec![
            "5 ego.target_speed_mps: is missing: expected a number from 0 to 100",
            "6 ego.target_sped_mps: unknown key; did you mean `target_speed_mps`?",
        ]),
        ("target_speed_mps = 10", "target_speed_mps = nan", vec![
            "6 ego.target_speed_mps: expected a number from 0 to 100, found nan",
        ]),
        ("target_speed_mps = 10", "target_speed_mps = inf", vec![
            "6 ego.target_speed_mps: expected a number from 0 to 100, found inf",
        ]),
        ("target_speed_mps = 10", "target_speed_mps = \"fast\"", vec![
            "6 ego.target_speed_mps: expected a number from 0 to 100, found the text \"fast\"",
        ]),
        ("target_speed_mps = 10", "target_speed_mps = 500", vec![
            "6 ego.target_speed_mps: expected a number from 0 to 100, found 500",
        ]),
        ("target_speed_mps = 10", "target_speed_mps = 0.0", vec![
            "6 ego.target_speed_mps: a target speed of 0 never reaches the goal: expected a number above 0",
        ]),
        ("length_m = 200.0", "length_m = 0.0", vec![
            "4 road.segments: the route has no length: expected at least one piece with length_m above 0",
        ]),
        ("end_m = 150.0", "end_m = 250.0", vec![
            "7 ego.end_m: the goal at 250 m is beyond the end of the road at 200 m",
        ]),
        ("end_m = 150.0", "end_m = -1.0", vec![
            "7 ego.end_m: the goal at -1 m is not ahead of the start at 0 m",
        ]),
        ("end_m = 150.0", "end_m = 150.0\nd_m = 2.0", vec![
            "5 ego: the ego starts 0.93 m outside the drivable ground",
        ]),
        ("s_m = 40.0\nd_m = 4.0", "s_m = 1.0\nd_m = 0.5", vec![
            "5 ego: the ego's start at s = 0 m, d = 0 m is inside the actor \"bus\"",
        ]),
        ("s_m = 40.0\nd_m = 4.0", "s_m = 5.4\nd_m = 0.5", vec![
            "5 ego: the ego's start at s = 0 m, d = 0 m, or can be as a seed draws it (within 0.5 m), is inside the \
             actor \"bus\"",
        ]),
        ("s_m = 20.0\nd_m = 4.0", "s_m = 500.0\nd_m = 4.0", vec![
            "17 actor.bike.s_m: starts at 500 m: expected a place on the road, 0 to 200 m, or at most 100 m beyond its ends",
        ]),
        ("s_m = 20.0\nd_m = 4.0", "s_m = 42.0\nd_m = 3.0", vec![
            "14 actor.bike: starts inside the actor \"bus\"",
        ]),
        ("kind = \"truck\"", "kind = \"static\"\nsize = { length_m = 99.0, width_m = 9.0, height_m = 2.0 }", vec![
            "5 ego: the ego's start at s = 0 m, d = 0 m is inside the actor \"bus\"",
            "14 actor.bus.motion: an actor of kind \"static\" cannot move",
            "15 actor.bike: starts inside the actor \"bus\"",
        ]),
    ];
    check(&table);
}

#[test]
fn wrong_names_are_reported_with_the_nearest_valid_one() {
    #[rustfmt::skip]
    let table = [
        ("kind = \"truck\"", "kind = \"trukc\"", vec![
            "10 actor.bus.kind: expected one of \"car\", \"truck\", \"motorcycle\", \"cyclist\", \"pedestrian\", \
             \"static\", found \"trukc\"; did you mean `truck`?",
        ]),
        ("kind = \"truck\"", "kind = \"static\"", vec![
            "8 actor.bus.size: is missing: expected { length_m, width_m, height_m } of what cannot move",
            "13 actor.bus.motion: an actor of kind \"static\" cannot move",
        ]),
        ("kind = \"truck\"", "kind = \"person\"\nsize = { radius_m = 0.4 }", vec![
            "10 actor.bus.kind: expected one of \"car\", \"truck\", \"motorcycle\", \"cyclist\", \"pedestrian\", \
             \"static\", found \"person\"; did you mean `pedestrian`?",
        ]),
        ("who = \"bus\"", "who = \"bsu\"", vec![
            "19 actor.bike.trigger.reaches.who: unknown actor \"bsu\"; did you mean `bus`?",
        ]),
        ("who = \"bus\"", "who = \"bike\"", vec![
            "19 actor.bike.trigger.reaches.who: an actor cannot wait for itself",
        ]),
        ("near = \"bus\"", "near = \"tram\"", vec![
            "23 end.standstill.near: unknown actor \"tram\"; expected one of \"bus\", \"bike\"",
        ]),
        ("{ reaches = ", "{ reach = ", vec![
            "19 actor.bike.trigger: expected one of \"distance\", \"time\", \"reaches\"; did you mean `reaches`?",
            "19 actor.bike.trigger.reach: unknown key; did you mean `reaches`?",
        ]),
        ("{ reaches = ", "{ time = { at_s = 1.0 }, reaches = ", vec![
            "19 actor.bike.trigger: expected only one of \"distance\", \"time\", \"reaches\", found \"time\", \"reaches\"",
        ]),
        ("name = \"bike\"", "name = \"bus\"", vec![
            "15 actor.bus.name: another actor is named \"bus\" already",
        ]),
        ("name = \"bike\"", "name = \"bike.2\"", vec![
            "15 actor.bike.2.name: expected a name without `.` and `=`, which separate keys in --set; found `.`",
        ]),
        ("name = \"bike\"", "name = 7", vec!["15 actor[1].name: expected a text that is not blank, without control characters, found 7"]),
    ];
    check(&table);
}

#[test]
fn table_in_place_of_an_array_of_tables_is_answered_with_the_form() {
    let head = FULL.split("[[actor]]").next().unwrap();
    let found = Scenario::parse("a.toml", &format!("{head}[actor]\nname = \"bus\"\n")).unwrap_err();
    assert_eq!(
        found.iter().next().unwrap().to_string(),
        "a.toml:8: actor: expected an array of tables, each after `[[actor]]`, found a table"
    );
}

#[test]
fn wrong_motion_expectation_and_text_are_reported() {
    #[rustfmt::skip]
    let table = [
        ("[4.0, 0.0]", "[4.0, -1.0]", vec![
            "13 actor.bus.motion[0].drive.speeds[1]: expected a pair of a number from 0 to 86400 and a number \
             from 0 to 100, found an array of 2",
        ]),
        ("[[0.0, 5.0], [4.0, 0.0]]", "[[0.0, 5.0], [4.0, 1.0], [4.0, 0.0]]", vec![
            "13 actor.bus.motion[0].drive.speeds: expected increasing times, found 4 s after 4 s",
        ]),
        ("[4.0, 0.0]", "[4.0, 1.0]", vec![
            "13 actor.bus.motion[1]: is never reached: the drive before it has no distance_m and does not come to a stop",
        ]),
        ("points = [[60.0, 3.0]]", "points = []", vec![
            "13 actor.bus.motion[2].path.points: expected an array of pairs [s, d] in metres, found an empty array",
        ]),
        ("verdict = \"avoided\"", "verdict = \"fine\"", vec![
            "25 expect.verdict: expected one of \"avoided\", \"completed\", \"collision\", \"left_road\", \"stopped\", \"timeout\", found \"fine\"",
        ]),
        ("min_distance_m = { min = 0.5 }", "min_distance_m = {}", vec![
            "26 expect.min_distance_m: expected { min = ... }, { max = ... } or both",
        ]),
        ("{ min = 2.0, max = 8.0 }", "{ min = 9.0, max = 8.0 }", vec![
            "29 expect.pipeline.slow.impact_speed_mps: the lowest value 9 is above the highest 8",
        ]),
        ("timeout_s = 20.0", "timeout_s = 1e-12", vec![
            "22 end.timeout_s: expected a number from 0.1 to 86400, found 1e-12",
        ]),
        ("name = \"full\"", "name = \"full\"\ngoal = 1", vec![
            "3 goal: unknown key; expected one of \"actor\", \"description\", \"ego\", \"end\", \"expect\", \"map\", \"name\", \"reactive\", \"road\", \"seeded\", \"slippery\", \"traffic\", \"world\"",
        ]),
        ("kind = \"cyclist\"", "kind = \"cyclist\"\nkind = \"car\"", vec!["17 : the key `kind` is there twice: expected each key once in a table"]),
        ("[road]", "[road", vec!["3 : not TOML: unclosed table, expected `]`"]),
    ];
    check(&table);
}

/// Adds a traffic light to the road of `FULL`, from line 5 on.
fn light(lines: &str) -> String {
    format!("curvature_1pm = 0.005 }}]\n[[road.light]]\n{lines}")
}

#[test]
fn traffic_light_is_read_as_written_with_defaults_beside_its_stop_line() {
    let read = |lines: &str| {
        let text = FULL.replacen("curvature_1pm = 0.005 }]", &light(lines), 1);
        Scenario::parse("full.toml", &text).unwrap_or_else(|problems| panic!("{problems:#?}")).road.lights
    };
    let short = read("name = \"a\"\nstop_s_m = 60\ngreen_s = 10.0\nred_s = 20.0\n");
    let line = Scenario::parse("full.toml", FULL).unwrap().road.line();
    let program = SignalProgram::green_yellow_red([10.0, 3.0, 20.0], 0.0);
    let pose = crate::model::on_road(&line, 62.0, -3.0, 0.0);
    let stop_s_m = Some(60.0);
    let want = TrafficLight { name: "a".into(), pose, stop_s_m, signal: None, program };
    assert_eq!(short, core::slice::from_ref(&want));
    let full = read(
        "name = \"a\"\nstop_s_m = 60\ns_m = 61.0\nd_m = 4.0\ngreen_s = 10.0\nyellow_s = 0\nred_s = 20.0\n\
         offset_s = 29.9\n[[road.light]]\nname = \"b\"\nstop_s_m = 200.0\ngreen_s = 1\nred_s = 1\n",
    );
    let program = SignalProgram::green_yellow_red([10.0, 0.0, 20.0], 29.9);
    let first = TrafficLight { pose: crate::model::on_road(&line, 61.0, 4.0, 0.0), program, ..want };
    assert_eq!((full.len(), &full[0], full[1].name.as_str()), (2, &first, "b"));
    assert!(Scenario::parse("full.toml", FULL).unwrap().road.lights.is_empty());
}

#[test]
fn wrong_traffic_lights_are_reported_with_line_and_key() {
    let road = "curvature_1pm = 0.005 }]";
    let with =
        |line: &str| light(&format!("name = \"a\"\nstop_s_m = 60.0\ngreen_s = 9.0\nred_s = 9.0\n{line}\n"));
    let without = |key: &str| {
        let all = ["name = \"a\"", "stop_s_m = 60.0", "green_s = 9.0", "red_s = 9.0"];
        light(&format!(
            "{}\n",
            all.into_iter().filter(|l| !l.starts_with(key)).collect::<Vec<_>>().join("\n")
        ))
    };
    let table: Vec<(String, &str)> = vec![
        (
            without("stop_s_m"),
            "5 road.light.a.stop_s_m: is missing: expected a number from -100000 to 100000",
        ),
        (without("green_s"), "5 road.light.a.green_s: is missing: expected a number from 0.001 to 86400"),
        (without("red_s"), "5 road.light.a.red_s: is missing: expected a number from 0.001 to 86400"),
        (
            with("s_m = \"here\""),
            "10 road.light.a.s_m: expected a number from -100000 to 100000, found the text \"here\"",
        ),
        (with("d_m = nan"), "10 road.light.a.d_m: expected a number from -100000 to 100000, found nan"),
        (with("yellow_s = -1"), "10 road.light.a.yellow_s: expected a number from 0 to 3600, found -1"),
        (with("offset_s = -1"), "10 road.light.a.offset_s: expected a number from 0 to 86400, found -1"),
        (
            with("offset_s = 21.0"),
            "10 road.light.a.offset_s: an offset of 21 s is not within the cycle of 21 s",
        ),
        (with("yelow_s = 3.0"), "10 road.light.a.yelow_s: unknown key; did you mean `yellow_s`?"),
        (
            with("").replace("60.0", "200.5"),
            "7 road.light.a.stop_s_m: the stop line at 200.5 m is not on the road, which is 200 m long",
        ),
        (
            with("").replace("60.0", "-1.0"),
            "7 road.light.a.stop_s_m: the stop line at -1 m is not on the road, which is 200 m long",
        ),
        (
            with("").replace("green_s = 9.0", "green_s = 0"),
            "8 road.light.a.green_s: expected a number from 0.001 to 86400, found 0",
        ),
        (
            with("[[road.light]]\nname = \"a\"\nstop_s_m = 70.0\ngreen_s = 9.0\nred_s = 9.0"),
            "11 road.light.a.name: another light is named \"a\" already",
        ),
        (
            "curvature_1pm = 0.005 }]\nlight = 3".to_owned(),
            "5 road.light: expected an array of tables, found 3",
        ),
        (
            "curvature_1pm = 0.005 }]\nlights = []".to_owned(),
            "5 road.lights: unknown key; did you mean `light`?",
        ),
    ];
    let cases: Vec<Case<'_>> = table.iter().map(|(new, want)| (road, new.as_str(), vec![*want])).collect();
    check(&cases);
    let nameless = problems(road, &without("name"));
    assert!(
        nameless.len() == 1 && nameless[0].ends_with(".name: is missing: expected a text"),
        "{nameless:?}"
    );
    let number = problems(road, "curvature_1pm = 0.005 }]\nlight = [3]");
    assert!(number.len() == 1 && number[0].ends_with(": expected a table, found 3"), "{number:?}");
}

#[test]
fn problems_of_a_file_are_reported_together_in_line_order() {
    let text = FULL
        .replace("end_m = 150.0", "end_m = 150.0\nspeed = 3")
        .replace("kind = \"cyclist\"", "kind = \"horse\"")
        .replace("for_s = 1.0", "for_s = -1.0")
        .replace("verdict = \"avoided\"", "");
    let found = Scenario::parse("full.toml", &text).unwrap_err();
    let lines: Vec<usize> = found.iter().filter_map(|p| p.line).collect();
    assert_eq!(lines, [8, 17, 24, 25], "{found:#?}");
    assert!(found[0].to_string().starts_with("full.toml:8: ego.speed: unknown key"), "{}", found[0]);
}

#[test]
fn expectations_are_optional() {
    let text = FULL.split("[expect]").next().unwrap();
    assert_eq!(Scenario::parse("full.toml", text).unwrap().expect, []);
    let verdict_alone = format!("{text}[expect]\nverdict = \"avoided\"\n");
    assert_eq!(Scenario::parse("full.toml", &verdict_alone).unwrap().expect[0].bounds, []);
}

#[test]
fn documented_form_is_valid() {
    let documentation = include_str!("../lib.rs");
    let form = documentation.split("```toml").nth(1).and_then(|rest| rest.split("```").next()).unwrap();
    let text: Vec<&str> = form.lines().map(|line| line.trim_start_matches("//!")).collect();
    let scenario =
        Scenario::parse("doc.toml", &text.join("\n")).unwrap_or_else(|problems| panic!("{problems:#?}"));
    assert_eq!((scenario.actors[0].motion.len(), scenario.expect.len()), (4, 2));
    let form = documentation.split("```toml").nth(2).and_then(|rest| rest.split("```").next()).unwrap();
    let text: Vec<&str> = form.lines().map(|line| line.trim_start_matches("//!")).collect();
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/maps/doc.toml");
    let text = format!("name = \"doc\"\n{}", text.join("\n"));
    let on_map = Scenario::parse(file, &text).unwrap_or_else(|problems| panic!("{problems:#?}"));
    assert_eq!((on_map.actors.len(), on_map.road.lights.len()), (2, 2));
}

#[test]
fn missing_file_is_one_problem() {
    let found = Scenario::read(std::path::Path::new("no/such.toml")).unwrap_err();
    assert_eq!(found.len(), 1);
    assert!(found[0].to_string().starts_with("no/such.toml: cannot be read"), "{}", found[0]);
}

#[test]
fn parser_never_panics_on_arbitrary_text() {
    use proptest::prelude::*;
    let mut runner = proptest::test_runner::TestRunner::new(ProptestConfig {
        cases: 400,
        failure_persistence: None,
        ..ProptestConfig::default()
    });
    let cut = (0..FULL.len(), 0..FULL.len(), "[\\[\\]{}=\"a-z0-9 .\n-]{0,12}");
    runner
        .run(&cut, |(a, b, put)| {
            let (a, b) = (a.min(b), a.max(b));
            let text = format!("{}{put}{}", &FULL[..a], &FULL[b..]);
            let _ = Scenario::parse("fuzz.toml", &text);
            Ok(())
        })
        .unwrap();
}

/// Ten thousand pedestrians in rows, two of them overlapping: comparing all pairs or all keys would take minutes.
#[test]
fn overlap_in_a_large_crowd_is_found() {
    use std::fmt::Write as _;
    let mut text = FULL.split("[[actor]]").next().unwrap().to_owned();
    for k in 0..10_000 {
        let (s_m, d_m) = (10 + k % 400, 20 + k / 400);
        write!(text, "[[actor]]\nname = \"p{k}\"\nkind = \"pedestrian\"\ns_m = {s_m}\nd_m = {d_m}\n")
            .unwrap();
    }
    text += "[[actor]]\nname = \"twin\"\nkind = \"pedestrian\"\ns_m = 210.1\nd_m = 30.0\n";
    let found = Scenario::parse("crowd.toml", &text).unwrap_err();
    let twin: Vec<_> = found.iter().filter(|problem| problem.key.contains("twin")).collect();
    assert_eq!(twin.len(), 1, "{found}");
    assert_eq!(twin[0].message, "starts inside the actor \"p4200\"");
}

#[test]
fn several_egos_have_identities_after_the_actors_and_views_of_their_own() {
    let text = "name = \"x\"\n[road]\nsegments = [{ length_m = 200.0 }]\nleft_m = 6.0\n\
                [ego.zulu]\ntarget_speed_mps = 10.0\nend_m = 150.0\n\
                [ego.alpha]\ns_m = 30.0\nd_m = 4.0\ntarget_speed_mps = 8.0\nend_m = 100.0\n\
                [[actor]]\nname = \"person\"\nkind = \"pedestrian\"\ns_m = 60.0\nd_m = 5.0\n\
                trigger = { distance = { to = \"alpha\", within_m = 12.0 } }\n\
                motion = [{ walk = { speed_mps = 1.0, distance_m = 2.0, direction = \"left\" } }]\n";
    let scenario = Scenario::parse("x.toml", text).unwrap();
    let [zulu, alpha] = [ActorId::EGO, ActorId(2)];
    assert_eq!(scenario.egos(), [(zulu, "zulu"), (alpha, "alpha")], "in the order of the text");
    assert_eq!(
        scenario.actors[0].trigger,
        Some(Trigger::Distance { to: Subject::Actor(alpha), within_m: 12.0 })
    );
    let view = scenario.of_ego(alpha).unwrap();
    assert_eq!((view.ego_id, &*view.ego_name, view.ego.s_m, view.ego.end_m), (alpha, "alpha", 30.0, 100.0));
    assert_eq!(view.actors[0].trigger, Some(Trigger::Distance { to: Subject::Ego, within_m: 12.0 }));
    assert_eq!(view.egos(), scenario.egos());
    assert_eq!(view.of_ego(zulu).unwrap().ego, scenario.ego);
    assert_eq!(scenario.of_ego(ActorId(1)), None);
    assert_eq!(view.names().into_values().collect::<Vec<_>>(), ["zulu", "person"]);
    let alone = view.alone(&swerve_vehicle::Shape::default());
    assert_eq!(alone.actors.iter().map(|actor| actor.id.0).collect::<Vec<_>>(), [0, 1]);
    assert_eq!(alone.egos(), [(alpha, "alpha")]);
    let drawn = scenario.drawn(5);
    let moved = |a: f64, b: f64| (a - b).abs() > 1e-6;
    assert!(moved(drawn.ego.s_m, 0.0) && moved(drawn.other_egos[0].start.s_m, 30.0));
    assert!(moved(drawn.ego.s_m, drawn.other_egos[0].start.s_m - 30.0), "each has its own draws");
}

#[test]
fn problems_of_several_egos_name_the_ego() {
    let with = |egos: &str| {
        let text = format!("name = \"x\"\n[road]\nsegments = [{{ length_m = 200.0 }}]\n{egos}");
        let problems = Scenario::parse("x.toml", &text).unwrap_err();
        problems.iter().map(|p| format!("{}: {}", p.key, p.message)).collect::<Vec<_>>()
    };
    let first = "[ego.a]\ntarget_speed_mps = 10.0\nend_m = 150.0\n";
    for (second, expected) in [
        (
            "[ego.b]\ns_m = 2.0\ntarget_speed_mps = 10.0\nend_m = 150.0\n",
            "ego.b: starts inside the ego \"a\"",
        ),
        (
            "[ego.b]\ns_m = 50.0\ntarget_speed_mps = 10.0\nend_m = 20.0\n",
            "ego.b.end_m: the goal at 20 m is not ahead",
        ),
        ("[ego.b]\ns_m = 50.0\nd_m = 9.0\ntarget_speed_mps = 10.0\nend_m = 150.0\n", "ego.b: the ego starts"),
        ("[ego.b]\ns_m = 50.0\nend_m = 150.0\n", "ego.b.target_speed_mps: is missing"),
        (
            "[ego.\"b c\"]\ns_m = 50.0\ntarget_speed_mps = 10.0\nend_m = 150.0\n",
            "ego.b c: expected a table of an ego",
        ),
        ("[ego]\ntarget_speed_mps = 10.0\n", "ego.target_speed_mps: expected a table of an ego"),
        (
            "[[actor]]\nname = \"a\"\nkind = \"car\"\ns_m = 50.0\nd_m = 0.0\n",
            "actor.a.name: an ego is named \"a\" already",
        ),
    ] {
        let problems = match second.strip_prefix("[ego]\n") {
            Some(keys) => with(&format!("[ego]\n{keys}{first}")),
            None => with(&format!("{first}{second}")),
        };
        assert!(problems.iter().any(|problem| problem.starts_with(expected)), "{expected}: {problems:#?}");
    }
    let many: String = (0..65).map(|k| first.replace(".a]", &format!(".e{k}]"))).collect();
    assert!(with(&many)[0].starts_with("ego: expected at most 64 egos, found 65"));
}
