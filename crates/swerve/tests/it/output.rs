//! Outputs, and the options that change them.

use std::process::Command;

use serde_json::Value;
use swerve_gpu::{AdapterKind, Gpu};

use crate::support::{Bench, SHORT, Said};

fn json(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|e| panic!("not one JSON value: {e}: {text}"))
}

#[test]
fn json_output_is_one_object() {
    let bench = Bench::new();
    let said = bench.swerve(&["run", "short.toml", "--json", "--out", "o"]);
    assert_eq!((said.code, said.stderr.as_str()), (Some(0), ""));
    let object = json(&said.stdout);
    assert!(object.is_object());
    assert_eq!(object["verdict"], "avoided");
    assert_eq!(object["as_expected"], true);
    assert_eq!(said.stdout, bench.read("o/metrics.json"));
    let digest =
        object["digest"].as_str().expect("a digest is text: a number of 64 bits is not safe in JSON");
    assert!(digest.len() == 16 && digest.chars().all(|c| c.is_ascii_hexdigit()), "{digest}");
    let text = bench.good(&["run", "short.toml", "--out", "p"]);
    assert!(text.contains(digest) && text.contains("AVOIDED"), "{text}");
    for name in ["report.html", "story.svg", "log.mcap", "trace.json", "metrics.json"] {
        assert!(std::fs::metadata(bench.path("o").join(name)).unwrap().len() > 100, "{name}");
    }
    assert!(text.ends_with("in p: report.html, story.svg, log.mcap, trace.json, metrics.json\n"), "{text}");
    let again = bench.good(&["run", "short.toml", "--out", "p"]);
    assert_eq!(again, text);
    json(&bench.read("o/trace.json"));
    assert!(bench.read("o/story.svg").trim_end().ends_with("</svg>"));
}

#[test]
fn seed_varies_the_run_and_threads_do_not() {
    let bench = Bench::new();
    let digest = |extra: &[&str]| {
        let args = [&["run", "short.toml", "--json", "--out", "o"][..], extra].concat();
        json(&bench.good(&args))["digest"].clone()
    };
    let first = digest(&[]);
    assert_eq!(digest(&["--seed", "1"]), first);
    assert_eq!(digest(&["--set", "seed=1", "--threads", "4"]), first);
    assert_ne!(digest(&["--seed", "2"]), first);
    assert_eq!(digest(&["--seed", "2"]), digest(&["--set", "seed=2"]));
}

/// With one thread every frame is drawn in turn; with several, all frames of an instant are left to the adapter
/// meanwhile.
#[test]
fn threads_do_not_change_the_images_of_an_adapter() {
    if swerve_tests::or_skip(Gpu::shared(AdapterKind::Software)).is_none() {
        return;
    }
    let bench = Bench::new();
    let camera = "{ width_px = 160, height_px = 90, period_ms = 100, outputs = [\"rgb\", \"depth\"] }";
    bench.write(
        "c.toml",
        &format!(
            "[render]\nbackend = \"software\"\n[log]\nsensors = [\"left\", \"right\"]\n\
             [camera]\nleft = {camera}\nright = {camera}\n"
        ),
    );
    let digest = |threads: &str| {
        let args = ["run", "short.toml", "-c", "c.toml", "--json", "--out", "o", "--threads", threads];
        json(&bench.good(&args))["digest"].clone()
    };
    assert_eq!(digest("3"), digest("1"));
}

#[test]
fn pictures_have_the_requested_format() {
    let bench = Bench::new();
    let forms = [("svg", &b"<svg "[..]), ("pdf", b"%PDF-"), ("png", b"\x89PNG")];
    for (format, begins) in forms {
        bench.good(&["run", "short.toml", "--out", "o", "--format", format]);
        let drawn = std::fs::read(bench.path("o").join(format!("story.{format}"))).unwrap();
        assert!(drawn.starts_with(begins), "{format}: {:?}", &drawn[..20]);
        let others = forms.iter().filter(|(other, _)| *other != format);
        assert!(others.map(|(other, _)| bench.path(&format!("o/story.{other}"))).all(|path| !path.exists()));
    }
    let said = bench.swerve(&["run", "short.toml", "--format", "gif"]);
    assert_eq!(said.code, Some(2), "{said:?}");
    assert!(["svg", "pdf", "png"].iter().all(|form| said.stderr.contains(form)), "{said:?}");
}

#[test]
fn set_run_time_takes_precedence_over_the_log() {
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "o", "--set", "operator.planner.runtime={fixed_ms=20}"]);
    let digest = |extra: &[&str]| {
        let args = [&["run", "short.toml", "--json", "--out", "p"][..], extra].concat();
        json(&bench.good(&args))["digest"].clone()
    };
    let log = ["--runtimes", "o/log.mcap"];
    let set = ["--set", "operator.planner.runtime={fixed_ms=400}"];
    assert_eq!(digest(&log), json(&bench.read("o/metrics.json"))["digest"]);
    assert_eq!(digest(&[log, set].concat()), digest(&set));
    assert_ne!(digest(&set), digest(&log));
}

/// The world is constant between its steps: a time-out is found at the next one.
#[test]
fn timeout_between_world_steps_takes_effect_at_the_next_step() {
    let bench = Bench::new();
    for (timeout_s, ends_at_s) in [("1.0", 1.0), ("1.0031", 1.005)] {
        bench.write("late.toml", &SHORT.replace("timeout_s = 10.0", &format!("timeout_s = {timeout_s}")));
        let metrics = json(&bench.good(&["run", "late.toml", "--json", "--out", "o"]));
        assert_eq!(metrics["verdict"], "timeout", "{timeout_s}");
        assert_eq!(metrics["drive"]["duration_s"], ends_at_s, "{timeout_s}");
    }
}

#[test]
fn why_of_a_log_equals_that_of_its_run() {
    let bench = Bench::new();
    let run = json(&bench.good(&["run", "short.toml", "--json", "--out", "o"]));
    let again = json(&bench.good(&["why", "o/log.mcap", "--json"]));
    assert_eq!(again, run["why"]);
    assert_eq!((&again["actor"], &again["steps"][0]["what"]), (&"person".into(), &"visible".into()));
    assert!(bench.good(&["why", "o/log.mcap", "--actor", "person"]).starts_with("why: it came within "));
    assert!(bench.read("o/trace.json").contains("\"person: visible\""));
    assert!(bench.read("o/story.svg").contains("Why: it came within "));
    let end_s = run["drive"]["duration_s"].as_f64().unwrap();
    for (wrong, told) in [
        (["--actor", "persn"], "did you mean `person`?".to_owned()),
        (
            ["--at", "500"],
            format!("--at 500: no state of the world at that instant: expected 0.00 to {end_s:.2} ("),
        ),
    ] {
        let said = bench.swerve(&[&["why", "o/log.mcap"], &wrong[..]].concat());
        assert!(said.code == Some(1) && said.stderr.contains(&told), "{}", said.stderr);
    }
}

#[test]
fn renamed_expected_verdict_is_accepted_with_a_note() {
    let bench = Bench::new();
    let (head, rest) = SHORT.split_once("[[actor]]").unwrap();
    let rest = rest.split_once("[expect]").unwrap().1.replace("min_distance_m = { min", "duration_s = { min");
    bench.write("alone.toml", &format!("{head}[expect]{rest}"));
    bench.write("late.toml", &SHORT.replace("\"avoided\"", "\"timeout\""));
    for (file, old, now) in [("alone", "avoided", "completed"), ("late", "timeout", "stopped")] {
        let said = bench.swerve(&["check", &format!("{file}.toml")]);
        let told = said.stderr.contains(&format!("note: {file}.toml: [expect] verdict `{old}`: "));
        assert!(said.code == Some(0) && told && said.stderr.contains(now), "{said:?}");
    }
    assert_eq!(bench.swerve(&["check", "short.toml"]).stderr, "");
    let said = bench.good(&["run", "alone.toml", "--out", "o"]);
    assert!(said.contains("\nCOMPLETED\n") && said.contains("as the scenario expects\n"), "{said}");
    assert!(said.contains("[expect] verdict `avoided`: such a run is called `completed` now\n"), "{said}");
    let why = &json(&bench.read("o/metrics.json"))["why"];
    assert_eq!((&why["actor"], &why["steps"][0]["what"]), (&serde_json::Value::Null, &"end".into()));
    // There is no actor that `why` could be asked about.
    for (wrong, told) in [
        (["--actor", "x"], "--actor x: there is no actor in the scenario"),
        (["--at", "500"], "--at 500: no state of the world at that instant: expected 0.00 to "),
    ] {
        let said = bench.swerve(&[&["why", "o"], &wrong[..]].concat());
        assert!(said.code == Some(1) && said.stderr.contains(told), "{}", said.stderr);
    }
}

/// The README's picture is the output of the command beside it.
#[test]
fn readme_picture_and_digest_match_its_first_command() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let read = |name: &str| std::fs::read_to_string(format!("{root}/{name}")).unwrap();
    let scenario = format!("{root}/scenarios/person_behind_truck.toml");
    let bench = Bench::new();
    let said = bench.good(&["run", &scenario, "--out", "o"]);
    let head: Vec<&str> = said.lines().take_while(|line| !line.starts_with("operator")).collect();
    assert!(read("README.md").contains(&head.join("\n")), "{said}");
    let is_same = bench.read("o/story.svg") == read("docs/img/story.svg");
    assert!(is_same, "docs/img/story.svg is not what `swerve run {scenario}` draws");
}

/// With an independent reader, which needs Python.
#[test]
fn traces_follow_their_format() {
    let reader = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/reference/trace_events.py");
    let has_python = Command::new("python3").arg("--version").output().is_ok_and(|o| o.status.success());
    if !has_python {
        swerve_tests::skipped("there is no python3");
        return;
    }
    let bench = Bench::new();
    let late: [&[&str]; 3] = [
        &[],
        &[
            "--set",
            "operator.planner.runtime={ fixed_ms = 120 }",
            "--set",
            "operator.planner.deadline={ ms = 90 }",
        ],
        &[
            "--set",
            "operator.planner.runtime={ cycle_ms = [150, 20] }",
            "--set",
            "operator.planner.policy=pipelined(4, overtaking)",
        ],
    ];
    for set in late {
        bench.good(&[&["run", "short.toml", "--out", "o"], set].concat());
        let read =
            Said::of(&Command::new("python3").arg(reader).arg(bench.path("o/trace.json")).output().unwrap());
        assert!(read.code == Some(0) && read.stdout.contains(" flows ("), "{set:?}: {read:?}");
    }
}

#[test]
fn every_run_has_a_separate_folder_and_the_newest_is_linked_as_the_scenario() {
    let bench = Bench::new();
    for seed in ["1", "2"] {
        let said = bench.good(&["run", "short.toml", "--seed", seed]);
        assert!(said.contains(&format!("in out/short-{seed} (out/short): ")), "{said}");
        assert_eq!(
            bench.read("out/short/metrics.json"),
            bench.read(&format!("out/short-{seed}/metrics.json"))
        );
    }
    assert_ne!(bench.read("out/short-1/metrics.json"), bench.read("out/short-2/metrics.json"));
    // A path that is not this program's link is kept.
    std::fs::remove_file(bench.path("out/short")).unwrap();
    std::fs::create_dir(bench.path("out/short")).unwrap();
    let said = bench.good(&["run", "short.toml"]);
    assert!(said.contains("in out/short-3: "), "{said}");
}

#[test]
fn earlier_run_is_replaced_only_with_overwrite() {
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "o"]);
    let before = bench.read("o/metrics.json");
    let again = ["run", "short.toml", "--out", "o", "--seed", "2"];
    let said = Said::of(&bench.plain_command(&again).output().unwrap());
    assert_eq!(said.code, Some(1));
    assert!(
        said.stderr.contains("o: an earlier run's results are there: expected another --out, or --overwrite")
    );
    assert_eq!(bench.read("o/metrics.json"), before);
    bench.good(&["run", "short.toml", "--out", "o", "--seed", "2", "--overwrite"]);
    assert_ne!(bench.read("o/metrics.json"), before);
}

#[test]
fn strict_turns_unexpected_results_into_errors() {
    let bench = Bench::new();
    let stops = bench.read("short.toml").replace("verdict = \"avoided\"", "verdict = \"collision\"");
    bench.write("other.toml", &stops);
    bench.good(&["run", "other.toml"]);
    bench.good(&["run", "short.toml", "--strict"]);
    let said = bench.swerve(&["run", "other.toml", "--strict"]);
    assert_eq!(said.code, Some(1), "{said:?}");
    assert!(said.stderr.contains("not as the scenario expects (--strict)"), "{said:?}");
}

#[test]
fn run_times_may_come_from_the_log_being_replaced() {
    let bench = Bench::new();
    let modelled = ["run", "short.toml", "--json", "--out", "o", "--set"];
    let first = bench.good(&[&modelled[..], &["operator.planner.runtime={ normal_ms = [60, 20] }"]].concat());
    let again =
        bench.good(&["run", "short.toml", "--json", "--out", "o", "--overwrite", "--runtimes", "o/log.mcap"]);
    assert_eq!(json(&again)["digest"], json(&first)["digest"]);
    assert_eq!(json(&again)["unrecorded"], 0);
}

#[test]
fn replay_verifies_after_the_scenario_file_is_deleted() {
    let bench = Bench::new();
    bench.good(&["run", "short.toml", "--out", "o"]);
    std::fs::remove_file(bench.path("short.toml")).unwrap();
    for from in ["perception", "prediction", "planning", "control", "tracker"] {
        bench.good(&["replay", "o/log.mcap", "--verify", "--from", from]);
    }
    let what_if = ["replay", "o/log.mcap", "--from", "planning", "--set", "ego.speed_mps=8"];
    assert!(bench.good(&what_if).contains("planner: first difference at "));
    // The log of a replay can itself be replayed from the same cut.
    let replayed = "out/short_replayed-1/log.mcap";
    bench.good(&["replay", replayed, "--verify", "--from", "planning"]);
    assert!(bench.read("out/short_replayed-1/comparison.html").contains("swerve replay o/log.mcap"));
    assert!(!bench.swerve(&["replay", "o/log.mcap", "--set", "plannig.planner=fot"]).stderr.is_empty());
    assert!(!bench.path("out/short_replayed-2").exists());
    let again = [&what_if[..], &["--out", "out/short_replayed-1"]].concat();
    let told = bench.swerve(&again).stderr;
    assert!(
        told.contains("short_replayed-1: an earlier run's results are there: expected another --out"),
        "{told}"
    );
}
