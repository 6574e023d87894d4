//! Runs with several egos.

use serde_json::Value;
use swerve_drive::{Outcome, drive_observed, read_scenario};
use swerve_scenario::Scenario;
use swerve_stack::Setup;

use crate::support::Bench;

/// A lane with an ego at its start, and another one far ahead, or alone.
fn lane(egos: &str) -> Scenario {
    let text = format!(
        "name = \"x\"\n[road]\nsegments = [{{ length_m = 1500.0 }}, {{ length_m = 200.0, curvature_1pm = 0.005 }}]\n\
         left_m = 6.0\n{egos}[end]\ntimeout_s = 60.0\n"
    );
    Scenario::parse("x.toml", &text).unwrap()
}

fn drive(scenario: &Scenario, threads: usize) -> Outcome {
    drive_observed(&Setup::default(), scenario, threads, &mut []).unwrap()
}

#[test]
fn stack_of_an_ego_is_that_of_a_run_with_it_alone() {
    let table =
        |name: &str| format!("[ego{name}]\nstart_speed_mps = 6.0\ntarget_speed_mps = 12.0\nend_m = 200.0\n");
    let far = "[ego.far]\ns_m = 1200.0\ntarget_speed_mps = 9.0\nend_m = 1560.0\n";
    let alone = drive(&lane(&table("")), 1);
    let both = drive(&lane(&(table(".near") + far)), 1);
    assert_eq!(both.metrics.drive, alone.metrics.drive);
    assert_eq!(both.road_margin_m, alone.road_margin_m);
    let other = &both.others[0];
    assert_eq!((other.ego.as_str(), other.metrics.verdict.name()), ("far", "avoided"));
    // 360 m at 9 m/s, of which a seed may change 0.5 m and 0.2 m/s; it goes on after the first has arrived.
    assert!((other.metrics.drive.duration_s - 40.0).abs() < 1.5, "{} s", other.metrics.drive.duration_s);
    assert!(other.metrics.drive.duration_s > both.metrics.drive.duration_s + 10.0);
    let steps = |name: &str| both.report.operators.iter().find(|o| o.name == name).map(|o| o.steps);
    assert!(steps("far/planner") > steps("planner").map(|n| n / 2) && steps("far/world").is_none());
}

#[test]
fn run_of_two_egos_repeats_replays_and_is_told_for_each() {
    let scenario = read_scenario(std::path::Path::new("maps/two_egos")).unwrap();
    let [one, three] = [1, 3].map(|threads| drive(&scenario, threads));
    assert_eq!(one.digest, three.digest);
    let bench = Bench::new();
    let json: Value =
        serde_json::from_str(&bench.good(&["run", "maps/two_egos", "--json", "--strict", "--out", "o"]))
            .unwrap();
    assert_eq!(json["digest"], one.digest.to_string());
    let other = &json["egos"]["from_east"];
    assert_eq!((&json["verdict"], &other["verdict"]), (&"avoided".into(), &"avoided".into()));
    let near = |metrics: &Value| metrics["min_distance_m"].as_f64().unwrap();
    assert!((near(&json) - near(other)).abs() < 1e-9, "each is the other's nearest");
    assert_eq!(
        (&json["min_distance_name"], &other["min_distance_name"]),
        (&"from_east".into(), &"from_south".into())
    );
    assert_ne!(json["drive"], other["drive"]);
    assert!(bench.good(&["replay", "o", "--verify"]).contains("from_east/planner"));
    assert!(bench.good(&["why", "o", "--ego", "from_east"]).contains("from_south"));
    assert!(bench.good(&["why", "o"]).contains("from_east"));
    bench.good(&["report", "o", "--ego", "from_east", "--out", "r.html"]);
    assert!(bench.read("r.html").contains("from_south"));
    let refused = bench.swerve(&["why", "o", "--ego", "from_est"]).stderr;
    assert!(
        refused.contains("--ego from_est: expected one of from_south, from_east; did you mean `from_east`?"),
        "{refused}"
    );
}

#[test]
fn expectation_is_that_of_every_ego() {
    let text = "name = \"x\"\n[road]\nsegments = [{ length_m = 300.0 }]\nleft_m = 6.0\n\
                [ego.a]\ns_m = 100.0\ntarget_speed_mps = 10.0\nend_m = 200.0\n\
                [ego.b]\ns_m = 2.0\ntarget_speed_mps = 10.0\nend_m = 200.0\n\
                [expect]\nverdict = \"avoided\"\nduration_s = { max = 15.0 }\n";
    let scenario = Scenario::parse("x.toml", text).unwrap();
    let broken = drive(&scenario, 1).broken(&scenario.expect[0]);
    assert!(
        matches!(&broken[..], [one] if one.starts_with("b: ") && one.contains("duration_s")),
        "{broken:?}"
    );
}

#[test]
fn drive_of_several_egos_counts_by_the_one_that_fared_worst() {
    let bench = Bench::new();
    let text = "name = \"x\"\n[road]\nsegments = [{ length_m = 300.0 }]\n\
                [ego.a]\ns_m = 100.0\ntarget_speed_mps = 10.0\nend_m = 150.0\n\
                [ego.b]\ns_m = 2.0\ntarget_speed_mps = 10.0\nend_m = 290.0\n\
                [end]\ntimeout_s = 15.0\n";
    bench.write("x.toml", text);
    bench.swerve(&["suite", "x.toml", "--seeds", "1..2", "--out", "o"]);
    let cells = bench.read("o/cells.csv");
    let mut lines = cells.lines().map(|line| line.split(',').collect::<Vec<_>>());
    let head = lines.next().unwrap();
    let column = |name| head.iter().position(|column| *column == name).unwrap();
    for line in lines {
        // The first arrives; the other has 288 m to go, 15 s and 10 m/s.
        assert_eq!((line[column("verdict")], line[column("ego")]), ("timeout", "b"), "{cells}");
    }
    // The first is observed until it arrives, although its stack drives on.
    bench.good(&["run", "x.toml", "--out", "r"]);
    let json: Value = serde_json::from_str(&bench.read("r/metrics.json")).unwrap();
    let arrived_s = json["drive"]["duration_s"].as_f64().unwrap();
    assert!(arrived_s < 9.0, "{arrived_s}");
    let log = swerve_log::Log::read(&bench.path("r/log.mcap")).unwrap();
    let scenario = Scenario::parse("x.toml", text).unwrap();
    let [first, other] = ["a", "b"].map(|ego| {
        let of_ego = swerve_drive::of_ego(&log, &Setup::default(), &scenario, Some(ego));
        of_ego.unwrap().unwrap().log.all_publications().last().unwrap().header.visible_at.as_secs()
    });
    assert!((first - arrived_s).abs() < 0.1 && other > 14.9, "{first} s, {other} s");
}
