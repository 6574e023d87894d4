use super::super::tests::Folder;

/// Two routes and both together, with their results; computed by hand.
const GOOD: &str = r#"{
 "meta": { "what": "made for this test" },
 "cases": [
  { "name": "clean", "route_length_m": 500, "route_completion": 100, "counts": {},
    "status": { "1.0": "Completed", "2.x": "Perfect" },
    "expect": { "1.0": { "penalty": 1.0, "driving_score": 100.0 }, "2.0": { "driving_score": 100 } } },
  { "name": "blocked", "route_length_m": 1000, "route_completion": 40.0,
    "counts": { "collisions_vehicle": 1, "red_light": 1 }, "outside_route_lanes_percent": 10,
    "status": { "2.x": "Failed - Agent got blocked" },
    "expect": { "1.0": { "penalty": 0.378, "driving_score": 15.12 },
                "2.1": { "penalty": 0.428571, "driving_score": 17.142857 } } },
  { "name": "both", "routes": [{ "route": "clean" }, { "route": "second case above" }],
    "expect": { "1.0": { "driving_scores": [100, 15.12], "mean": 57.56, "std_dev": 60.019224,
                         "per_km": { "collisions_vehicle": 2.5, "outside_route_lanes": 2.5 } },
                "2.0": { "std_dev": 60.019, "per_km": { "red_light": 1.111, "vehicle_blocked": 1.111,
                         "outside_route_lanes_km": 0.04 } } } }
 ],
 "counting": {
  "events": [[1.0, "vehicle", 7, 0.0, 5.0], [2.0, "layout", 0, 4.0, 5.0], [20.0, "pedestrian", 9, 50.0, 0.0]],
  "expect": { "1.0": { "counted_at_s": [1.0, 2.0, 20.0] }, "2.x": { "counted_at_s": [1.0] } }
 }
}"#;

#[test]
fn results_equal_those_worked_by_hand() {
    let folder = Folder::with(&[("cases.json", GOOD)]);
    let report = folder.numbers("score @cases.json");
    assert_eq!(report["differing"], serde_json::json!([]));
    assert_eq!(report["compared"], 25);
    assert_eq!(report["cases"][1]["scores"]["2.0"]["status"], "Failed - Agent got blocked");
    assert_eq!(report["cases"][2]["scores"]["2.1"]["status"], "Failed");
    assert!(report["cases"][2]["largest_difference"]["1.0"].as_f64().unwrap() < 5e-7);
    assert_eq!(report["cases"][2]["largest_difference"].get("2.1"), None);
    assert_eq!(report["counting"]["counted_at_s"]["2.1"], serde_json::json!([1.0]));
    let table = folder.eval("score @cases.json --version 2.1", false).unwrap();
    let has = |words: &str| table.lines().any(|line| line.split_whitespace().eq(words.split(' ')));
    assert!(has("blocked 2.1 40 0.428571 17.142857 - 0 Failed - Agent got blocked"), "{table}");
    assert!(has("both 2.1 red_light 1.111"), "{table}");
    assert!(has("2.1 1"), "{table}");
    assert!(table.contains("5 values compared with the file: all equal within their rounding"), "{table}");
    assert!(!table.contains("1.0 "), "{table}");
}

#[test]
fn differences_are_listed_and_fail_the_command() {
    let wrong = GOOD.replace("15.12 },", "15.13 },").replace("\"Perfect\"", "\"Completed\"");
    let wrong = wrong.replace("\"red_light\": 1.111", "\"red_lights\": 1.111");
    let folder = Folder::with(&[("cases.json", &wrong), ("good.json", GOOD)]);
    let report = folder.numbers("score @cases.json");
    let differing: Vec<String> = report["differing"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| {
            ["case", "version", "value", "expected", "found"].map(|key| one[key].as_str().unwrap()).join(" ")
        })
        .collect();
    assert_eq!(
        differing,
        [
            "clean 2.0 status Completed Perfect",
            "clean 2.1 status Completed Perfect",
            "blocked 1.0 driving_score 15.13 15.12",
            "both 2.0 per_km.red_lights 1.111 -",
        ]
    );
    assert_eq!(folder.problem("score @cases.json").unwrap(), "cases.json: 4 of 25 values differ");
    assert_eq!(folder.problem("score @good.json"), None);
    let table = folder.eval("score @cases.json --version 1.0", false).unwrap();
    let row = ["blocked", "1.0", "40", "0.378", "15.12", "-", "0.01", "Failed"];
    assert!(table.lines().any(|line| line.split_whitespace().eq(row)), "{table}");
    let row = ["blocked", "1.0", "driving_score", "15.13", "15.12"];
    assert!(table.lines().any(|line| line.split_whitespace().eq(row)), "{table}");
}

#[test]
fn all_problems_of_a_file_are_reported_with_line_and_key() {
    let bad = r#"{
 "cases": [
  { "name": "one", "route_length_m": -1, "route_completion": 101,
    "counts": { "red_lights": 1 } },
  { "route_length_m": 10, "route_completion": "all" }
 ]
}"#;
    let meant = r#"{
 "cases": [
  { "route_length_m": 0, "route_completion": 101,
    "min_speed_checkpoints_percent": [90, -1],
    "status": { "1.0": "Failed - Agent got stuck" } },
  { "name": "all", "routes": [
    { "route": "tenth case above" },
    { "routes": [], "expect": { "2.x": { "mean": 1 } } } ],
    "route_completion": 1 },
  { "name": "all", "route_length_m": 1, "route_completion": 1, "counts": { "route_dev": 1 }, "route_dev": 0 }
 ],
 "counting": { "events": [[2, "vehicle", 1, 0, 0], [1, "vehicle", 1, 0, 0]] }
}"#;
    let folder = Folder::with(&[
        ("bad.json", bad),
        ("meant.json", meant),
        ("empty.json", "{ \"cases\": [] }"),
        ("null.json", "{ \"cases\": [\n null ] }"),
        ("cut.json", "{ \"cases\": ["),
    ]);
    assert_eq!(
        folder.error("score @bad.json"),
        "bad.json:4: cases[0].counts.red_lights: unknown key; did you mean `red_light`?\n\
         bad.json:5: cases[1].route_completion: expected a number, found the text \"all\""
    );
    let error = folder.error("score @meant.json");
    let lines: Vec<&str> = error.lines().collect();
    for (k, start) in [
        "meant.json:3: cases[0].name: is missing: expected a text",
        "meant.json:3: cases[0].route_length_m: expected 0.001 to 1000000000, found 0",
        "meant.json:3: cases[0].route_completion: expected 0 to 100, found 101",
        "meant.json:4: cases[0].min_speed_checkpoints_percent[1]: expected 0 to 1000000000, found -1",
        "meant.json:5: cases[0].status.1.0: expected the reason \"Agent got blocked\"",
        "meant.json:6: cases[1].routes: expected either several routes, or the length and completion of one",
        "meant.json:7: cases[1].routes[0].route: expected the name of an earlier case of one route",
        "meant.json:8: cases[1].routes[1].expect: expected only in a case",
        "meant.json:8: cases[1].routes[1].routes: expected no routes inside of routes",
        "meant.json:10: cases[2].name: another case is named \"all\" already",
        "meant.json:10: cases[2].route_dev: expected 1 as in `counts`, found 0",
        "meant.json:12: counting.events[1]: expected at least 2 s, the instant before, found 1",
    ]
    .into_iter()
    .enumerate()
    {
        assert!(lines[k].starts_with(start), "{}\nexpected: {start}", lines[k]);
    }
    assert_eq!(folder.error("score @empty.json"), "empty.json:1: cases: expected at least one case");
    assert_eq!(folder.error("score @null.json"), "null.json:2: cases[0]: expected a value, found null");
    assert!(folder.error("score @cut.json").starts_with("cut.json:1: cases"));
    assert!(folder.error("score @none.json").starts_with("none.json: cannot be read"));
}

#[test]
fn worked_cases_of_the_leaderboard_are_reproduced() {
    let Some(path) = swerve_tests::data_or_skip("oracles/leaderboard_cases.json") else { return };
    let text = std::fs::read_to_string(path).unwrap();
    let folder = Folder::with(&[("cases.json", &text)]);
    let report = folder.numbers("score @cases.json");
    assert_eq!(report["differing"], serde_json::json!([]));
    assert_eq!((report["cases"].as_array().unwrap().len(), &report["compared"]), (5, &62.into()));
}

#[test]
fn example_of_the_page_is_valid() {
    let page = include_str!("../../../../../docs/scores.md");
    let (_, rest) = page.split_once("```json\n").unwrap();
    let (example, _) = rest.split_once("```").unwrap();
    let report = Folder::with(&[("my_routes.json", example)]).numbers("score @my_routes.json");
    assert_eq!((&report["compared"], &report["differing"]), (&2.into(), &serde_json::json!([])));
}
