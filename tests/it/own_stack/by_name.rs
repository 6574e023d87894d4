//! Algorithms of an external package that configurations name as they name built-in ones.

use swerve_core::ParamError;
use swerve_drive::{drive_pipeline, read_scenario};
use swerve_eval::Metrics;
use swerve_geom::Pose2;
use swerve_msg::{Plan, PlanPoint, PlanStatus};
use swerve_planning::{Budget, Planner, Request};
use swerve_stack::pipeline::Pipeline;
use swerve_stack::{NamedPlanner, NoKeys, PlannerDefaults, Setup};
use swerve_text::Problems;

use super::registry;
use crate::common::{scenario_file, sets};

fn with(assignments: &[&str]) -> Result<Setup, Problems> {
    Setup::load_with(&registry(), None, &sets(assignments))
}

/// Metrics of a drive through a scenario.
fn drive(scenario: &str, assignments: &[&str]) -> Metrics {
    let config = with(assignments).unwrap_or_else(|problems| panic!("{problems:?}"));
    let scenario = read_scenario(&scenario_file(scenario)).unwrap();
    let pipeline = Pipeline::build(&config, &scenario).unwrap();
    drive_pipeline(pipeline, config.seed, 1, &mut []).unwrap().metrics
}

/// First problem of a configuration.
fn problem(assignments: &[&str]) -> String {
    with(assignments).unwrap_err().iter().next().unwrap().to_string()
}

/// Median run time of an operator, ms.
fn p50_ms(metrics: &Metrics, operator: &str) -> f64 {
    metrics.operators.iter().find(|o| o.operator == operator).unwrap().p50_ms
}

/// Smallest distance to a road user, metres.
fn nearest_m(metrics: &Metrics) -> f64 {
    metrics.actors.iter().map(|actor| actor.min_distance_m).fold(f64::MAX, f64::min)
}

/// Parameters with ranges, the comfort layer, run times.
#[test]
fn planner_of_another_crate_is_used_by_name() {
    let drive = |assignments: &[&str]| drive("lane", assignments);
    let alone = ["planning.planner=cautious", "planning.comfort.enabled=false"];
    let metrics = drive(&alone);
    let planned = &metrics.plans.counts;
    assert!(planned.route > 20 && planned.comfortable == 0, "{planned:?}");
    assert!(metrics.drive.speed_end_mps < 0.9 * drive(&["planning.planner=fot"]).drive.speed_end_mps);
    assert!(drive(&["planning.planner=cautious"]).plans.counts.comfortable > 20);
    let slower = drive(&[&alone[..], &["planning.params.share=0.5"]].concat());
    assert!(slower.drive.speed_end_mps < metrics.drive.speed_end_mps);
    let timed = drive(&[&alone[..], &["planning.cost.cautious.fast={ fixed_ms = 30 }"]].concat());
    assert_eq!(p50_ms(&timed, "planner"), 30.0);
    let range = problem(&["planning.planner=cautious", "planning.params.share=2"]);
    assert_eq!(range, "--set: planning.params.share: expected 0.1 to 1, found 2");
    let name = problem(&["planning.planner=cautios"]);
    assert!(
        name.starts_with("--set: planning.planner: expected one of \"fot\", ")
            && name.ends_with("did you mean `cautious`?"),
        "{name}"
    );
}

/// Plans to drive to nowhere.
struct Nowhere;

impl Planner for Nowhere {
    fn plan(&mut self, request: &Request<'_>, _: &mut dyn Budget) -> Plan {
        let pose = Pose2::new(f64::NAN, f64::NAN, 0.0);
        let point = PlanPoint { at: request.stamp, pose, speed_mps: 9.0, ..PlanPoint::default() };
        Plan { stamp: request.stamp, points: vec![point], status: PlanStatus::Found, ..Plan::default() }
    }
}

impl NamedPlanner for Nowhere {
    const NAME: &'static str = "nowhere";
    type Params = NoKeys;

    fn defaults(_: PlannerDefaults) -> NoKeys {
        NoKeys {}
    }

    fn with_params(_: NoKeys) -> Result<Self, ParamError> {
        Ok(Self)
    }
}

#[test]
fn car_brakes_when_no_car_can_follow_the_plan() {
    let own = registry().with_planner::<Nowhere>();
    let setup =
        Setup::load_with(&own, None, &sets(&["planning.planner=nowhere", "planning.comfort.enabled=false"]));
    let config = setup.unwrap_or_else(|problems| panic!("{problems:?}"));
    let scenario = read_scenario(&scenario_file("person_crossing")).unwrap();
    let pipeline = Pipeline::build(&config, &scenario).unwrap();
    let metrics = drive_pipeline(pipeline, config.seed, 1, &mut []).unwrap().metrics;
    let planned = &metrics.plans.counts;
    assert!(planned.refused > 20 && planned.found == 0, "{planned:?}");
    assert_eq!(metrics.plans.refused, planned.refused);
    assert!(metrics.drive.speed_end_mps.abs() < 0.1 && metrics.impact.is_none(), "{:?}", metrics.drive);
}

/// Parameters with ranges, the safety gate, run times.
#[test]
fn controller_of_another_crate_is_used_by_name() {
    let drive = |assignments: &[&str]| {
        drive("person_crossing", &[&["control.controller=pursuit"], assignments].concat())
    };
    let metrics = drive(&[]);
    assert_eq!(metrics.verdict, self::drive("person_crossing", &[]).verdict);
    let weak = drive(&["control.params.gain_ps=0.1"]);
    assert!(weak.drive.speed_end_mps != metrics.drive.speed_end_mps);
    assert_eq!(drive(&["gate.enabled=true"]).verdict, metrics.verdict);
    assert_eq!(p50_ms(&drive(&["operator.controller.runtime={ fixed_ms = 2 }"]), "controller"), 2.0);
    let range = problem(&["control.controller=pursuit", "control.params.gain_ps=9"]);
    assert_eq!(range, "--set: control.params.gain_ps: expected 0.1 to 5, found 9");
    let name = problem(&["control.controller=pursit"]);
    let expected = "--set: control.controller: expected one of \"pid\", \"pure_pursuit\", \"stanley\", \"mpc\", \
                    \"pursuit\", found \"pursit\"; did you mean `pursuit`?";
    assert_eq!(name, expected);
    let none = problem(&["control.params.gain_ps=1"]);
    assert_eq!(none, "--set: control.params.gain_ps: unknown key; expected none");
}

/// Parameters with ranges, run times, effect on the plans.
#[test]
fn predictor_of_another_crate_is_used_by_name() {
    let drive = |assignments: &[&str]| {
        drive("person_crossing", &[&["prediction.predictor=fading"], assignments].concat())
    };
    let metrics = drive(&[]);
    assert_ne!(nearest_m(&metrics), nearest_m(&self::drive("person_crossing", &[])));
    assert_ne!(nearest_m(&metrics), nearest_m(&drive(&["prediction.params.fade_s=0.1"])));
    assert_eq!(p50_ms(&drive(&["operator.predictor.runtime={ fixed_ms = 7 }"]), "predictor"), 7.0);
    let range = problem(&["prediction.predictor=fading", "prediction.params.fade_s=0"]);
    assert_eq!(range, "--set: prediction.params.fade_s: expected 0.1 to 100, found 0");
    let name = problem(&["prediction.predictor=fadin"]);
    assert!(
        name.starts_with("--set: prediction.predictor: expected one of \"linear\", ")
            && name.ends_with("\"truth\", \"fading\", found \"fadin\"; did you mean `fading`?"),
        "{name}"
    );
}

/// Parameters with ranges, run times, effect on the plans, with an emulated detector.
#[test]
fn tracker_of_another_crate_is_used_by_name() {
    let detector = "perception.detector=efficientdet-d3@v100";
    let drive = |assignments: &[&str]| drive("person_crossing", &[&[detector], assignments].concat());
    let named = "perception.tracker.algorithm=nearest_box";
    let metrics = drive(&[named]);
    assert_ne!(nearest_m(&metrics), nearest_m(&drive(&[])));
    assert_ne!(nearest_m(&metrics), nearest_m(&drive(&[named, "perception.tracker.gate_m=0.1"])));
    assert_eq!(p50_ms(&drive(&[named, "operator.tracker.runtime={ fixed_ms = 4 }"]), "tracker"), 4.0);
    let range = problem(&[named, "perception.tracker.gate_m=0"]);
    assert_eq!(range, "--set: perception.tracker.gate_m: expected 0.1 to 20, found 0");
    let name = problem(&["perception.tracker.algorithm=nearest_bx"]);
    let expected = "--set: perception.tracker.algorithm: expected one of \"sort\", \"ab3dmot\", \"nearest_box\", \
                    found \"nearest_bx\"; did you mean `nearest_box`?";
    assert_eq!(name, expected);
}

/// Parameters with ranges, rungs with run times, the ladder, effect on the tracks.
#[test]
fn detector_of_another_crate_is_used_by_name() {
    let camera = ["camera.front={width_px=320, height_px=160}", "operator.eye.kind=camera_objects"];
    let named =
        [camera[0], camera[1], "operator.eye.detector=colourful", "operator.tracker.reads={boxes=\"eye\"}"];
    let drive = |assignments: &[&str]| drive("person_crossing", &[&named, assignments].concat());
    let metrics = drive(&[]);
    assert_eq!(p50_ms(&metrics, "eye"), 12.0, "its last rung");
    let blind = drive(&["operator.eye.params.colour_min=254"]);
    assert_ne!(metrics.drive.speed_end_mps, blind.drive.speed_end_mps);
    assert_eq!(p50_ms(&drive(&["operator.eye.rung=coarse"]), "eye"), 4.0);
    assert_eq!(p50_ms(&drive(&["operator.eye.run_times_ms.fine=20"]), "eye"), 20.0);
    let late = [
        "operator.eye.ladder=true",
        "execution.model=static_deadlines",
        "execution.detector_ms=8",
        "execution.planner_ms=50",
    ];
    assert_eq!(p50_ms(&drive(&late), "eye"), 4.0, "the rung that fits");
    let problem = |wrong: &str| problem(&[&named, &[wrong][..]].concat());
    let range = problem("operator.eye.params.colour_min=0");
    assert_eq!(range, "--set: operator.eye.params.colour_min: expected 1 to 255, found 0");
    let rung = problem("operator.eye.rung=fin");
    assert_eq!(
        rung,
        "--set: operator.eye.rung: no rung `fin`; did you mean `fine`?; expected \"coarse\", \"fine\""
    );
    let name = problem("operator.eye.detector=colorful");
    assert!(
        name.contains("no detector `colorful`; did you mean `colourful`?; expected \"street\""),
        "{name}"
    );
}

/// Keys with ranges, run times, effect on the tracks.
#[test]
fn lidar_detector_of_another_crate_is_a_kind() {
    let named =
        ["lidar.roof={}", "operator.cloud.kind=nearest_points", "operator.tracker.reads={boxes=\"cloud\"}"];
    let drive = |assignments: &[&str]| drive("person_crossing", &[&named, assignments].concat());
    let metrics = drive(&["operator.cloud.runtime={ fixed_ms = 6 }"]);
    assert_eq!(p50_ms(&metrics, "cloud"), 6.0);
    let narrow = drive(&["operator.cloud.half_width_m=0.5"]);
    assert_ne!(nearest_m(&metrics), nearest_m(&narrow));
    let range = problem(&[&named, &["operator.cloud.half_width_m=99"][..]].concat());
    assert_eq!(range, "--set: operator.cloud.half_width_m: expected 0.5 to 10, found 99");
}

/// Keys, run times, accuracy in the metrics.
#[test]
fn localizer_of_another_crate_is_used_by_name() {
    let named = "localization.localizer=pulled";
    let drive = |assignments: &[&str]| drive("lane", &[&[named], assignments].concat());
    let exact = ["sensing.gnss.noise_m=0", "sensing.gnss.bias_m=0"];
    let off_m = |metrics: &Metrics| metrics.localization.as_ref().unwrap().max_m;
    let (metrics, pulled) = (drive(&[]), drive(&["operator.localizer.pull=0.05"]));
    let exact_m = off_m(&drive(&exact));
    assert!(exact_m < 0.35 && off_m(&metrics) > exact_m, "{exact_m}, {}", off_m(&metrics));
    assert!(off_m(&pulled) != off_m(&metrics));
    assert_eq!(p50_ms(&drive(&["operator.localizer.runtime={ fixed_ms = 3 }"]), "localizer"), 3.0);
    let key = problem(&[named, "operator.localizer.pul=1"]);
    assert!(key.ends_with("unknown key; did you mean `pull`?"), "{key}");
    let name = problem(&["localization.localizer=puled"]);
    let expected = "--set: localization.localizer: expected one of \"truth\", \"eskf\", \"ndt\", \"eskf_ndt\", \
                    \"odometry\", \"pulled\", found \"puled\"; did you mean `pulled`?";
    assert_eq!(name, expected);
}

#[test]
fn keys_list_algorithms_of_another_crate() {
    let keys = swerve_reference::keys::keys(&registry());
    for (key, name) in [
        ("planning.planner", "cautious"),
        ("control.controller", "pursuit"),
        ("prediction.predictor", "fading"),
        ("localization.localizer", "pulled"),
        ("operator.NAME.detector", "colourful"),
    ] {
        let names = &keys.iter().find(|one| one.key == key).unwrap().choices;
        assert_eq!(names.last().unwrap().name, name);
    }
}

/// Editors check and complete these names.
#[test]
fn schema_lists_algorithms_and_kinds_of_another_crate() {
    let schema =
        |registry| serde_json::to_string(&swerve_reference::FileKind::Config.schema(registry)).unwrap();
    let (own, standard) = (schema(&registry()), schema(&swerve::Registry::standard()));
    for name in ["cautious", "pursuit", "fading", "pulled", "slow_down"] {
        let name = format!("\"{name}\"");
        assert!(own.contains(&name) && !standard.contains(&name), "{name}");
    }
}

/// Runs a command with the registry.
fn command(words: &[&str]) -> Result<(), String> {
    let cli = swerve::cli::parse(["swerve"].iter().chain(words)).map_err(|error| error.to_string())?;
    swerve::cli::main(&cli, &registry()).map_err(|error| format!("{error:#}"))
}

#[test]
fn plan_solves_road_problems_with_a_planner_of_another_crate() {
    let folder = tempfile::tempdir().unwrap();
    let page = folder.path().join("page.html");
    let plan = |name: &str, sets: &[&str]| {
        let page = page.to_str().unwrap();
        let words = ["plan", "detour", "--planner", name, "--discretisation", "fast", "--report", page];
        let sets = sets.iter().flat_map(|set| ["--set", *set]);
        let words: Vec<&str> = words.into_iter().chain(["--overwrite"]).chain(sets).collect();
        command(&words).map(|()| std::fs::read_to_string(page).unwrap())
    };
    let length_m = |page: &str| {
        let row = &page[page.find("[\"free\"").unwrap_or_else(|| panic!("{page}"))..];
        row.split('"').nth(7).unwrap().parse::<f64>().unwrap()
    };
    let drawn = plan("cautious", &[]).unwrap();
    assert!(drawn.contains("swerve plan detour --planner cautious --discretisation fast"));
    // 5 s at the initial speed of 14 m/s.
    assert_eq!(length_m(&drawn), 70.0);
    assert_eq!(length_m(&plan("waypoint", &[]).unwrap()), 70.0, "a built-in one");
    assert!(
        plan("cautious", &["planning.params.share=0.5"]).unwrap().contains("--set planning.params.share=0.5")
    );
    let range = plan("cautious", &["planning.params.share=2"]).unwrap_err();
    assert_eq!(range, "--set: planning.params.share: expected 0.1 to 1, found 2");
    let name = plan("cautios", &[]).unwrap_err();
    assert!(name.starts_with("--planner: expected one of \"fot\""), "{name}");
    assert!(name.ends_with("did you mean `cautious`?"), "{name}");
    let fineness =
        command(&["plan", "detour", "--planner", "cautious", "--discretisation", "fats"]).unwrap_err();
    let expected = "--discretisation: expected one of \"fast\", \"slow\" for cautious, found \"fats\"; did you mean \
                    `fast`?";
    assert_eq!(fineness, expected);
}

/// Distances without densities: the example has no covariances.
#[test]
fn eval_prediction_evaluates_a_predictor_of_another_crate() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("walk.txt");
    let rows: String = (0..20).map(|k| format!("{} 1 {} 0\n", 10 * k, 0.5 * f64::from(k))).collect();
    std::fs::write(&file, rows).unwrap();
    let evaluate = |more: &[&str]| {
        let file = file.to_str().unwrap();
        let words = ["eval", "prediction", file, "--format", "eth_ucy", "--json"];
        command(&[&words, more].concat())
    };
    evaluate(&["--predictor", "fading"]).unwrap();
    evaluate(&["--predictor", "fading", "--set", "prediction.params.fade_s=5"]).unwrap();
    let range = evaluate(&["--predictor", "fading", "--set", "prediction.params.fade_s=0"]).unwrap_err();
    assert_eq!(range, "--set: prediction.params.fade_s: expected 0.1 to 100, found 0");
    let name = evaluate(&["--predictor", "fadin"]).unwrap_err();
    assert!(name.starts_with("--predictor: expected \"all\" or one of \"linear\""), "{name}");
    assert!(name.ends_with("\"r2p2\", \"fading\", found \"fadin\"; did you mean `fading`?"), "{name}");
}

/// The cells of a study differ by the algorithm.
#[test]
fn studies_compare_algorithms_of_another_crate_with_built_in_ones() {
    let folder = tempfile::tempdir().unwrap();
    let (file, out) = (folder.path().join("study.toml"), folder.path().join("out"));
    let scenario = scenario_file("lane");
    let study = format!(
        "base = {{ scenario = {scenario:?} }}\n[[axis]]\nkey = \"control.controller\"\nvalues = [\"stanley\", \
         \"pursuit\"]\n"
    );
    std::fs::write(&file, study).unwrap();
    let args = ["swerve", "study", file.to_str().unwrap(), "--out", out.to_str().unwrap()];
    let cli = swerve::cli::parse(args).unwrap();
    swerve::cli::main(&cli, &registry()).unwrap();
    let cells = std::fs::read_to_string(out.join("cells.csv")).unwrap();
    assert!(cells.contains("pursuit"), "{cells}");
    let figures = |cell: &str| cells.lines().find(|line| line.contains(cell)).unwrap().replace(cell, "");
    assert_ne!(figures("pursuit"), figures("stanley"));
}

/// A rung that fits a deadline, a timer, refused keys.
#[test]
fn operator_of_another_crate_is_scheduled_by_its_keys() {
    let named = "operator.clear.kind=nearest_ahead";
    let rungs = "operator.clear.rungs=[{ name = 'near', ms = 2, range_m = 40 }, { name = 'far', ms = 30 }]";
    let p50 =
        |assignments: &[&str]| p50_ms(&drive("lane", &[&[named, rungs][..], assignments].concat()), "clear");
    assert_eq!(p50(&["operator.clear.deadline={ ms = 10 }"]), 2.0);
    assert_eq!(p50(&["operator.clear.deadline={ ms = 30 }"]), 30.0);
    let steps = |assignments: &[&str]| {
        let metrics = drive("lane", &[&[named][..], assignments].concat());
        metrics.operators.iter().find(|operator| operator.operator == "clear").unwrap().steps
    };
    assert_eq!(steps(&[]) / steps(&["operator.clear.every_ms=200"]), 4, "frames come every 50 ms");
    let key = problem(&[named, "operator.clear.rungs=[{ name = 'near', ms = 2, range = 40 }]"]);
    assert!(key.starts_with("--set: operator.clear.rungs: `near`: "), "{key}");
    let stateful = problem(&["operator.tracker.rungs=[{ name = 'near', ms = 2 }]"]);
    assert!(stateful.contains("a `tracker` keeps its state from step to step"), "{stateful}");
    let timer = problem(&["operator.controller.every_ms=20"]);
    assert_eq!(timer, "--set: operator.controller.every_ms: expected none: a `controller` has a timer");
}
