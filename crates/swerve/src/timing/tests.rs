use std::path::Path;

use swerve_core::Span;
use swerve_flow::{Anchor, Full, Policy, Reaction, RuntimeModel};

use super::*;

const GOOD: &str = r#"span_ms = 2000
[[operator]]
name = "camera"
every_ms = 50
runtime = { fixed_ms = 5 }
[[operator]]
name = "detector"
at = ["camera"]
runtime = { fixed_ms = 80 }
policy = "skip_to_latest"
deadline = { ms = 100, anchor = "arrival", reaction = "reuse_last" }
uses = "gpu0"
[resource.gpu0]
slots = 1
"#;

/// The problems of the good file with `from` replaced by `to`.
fn problems(from: &str, to: &str) -> Vec<String> {
    assert!(GOOD.contains(from), "{from} is not in the file");
    match parse(Path::new("p.toml"), &GOOD.replacen(from, to, 1)) {
        Ok(pipeline) => panic!("{to}: read as {pipeline:?}"),
        Err(problems) => problems.lines().to_vec(),
    }
}

/// The first problem starts as `start` says and holds every one of `parts`.
#[track_caller]
fn refused(from: &str, to: &str, start: &str, parts: &[&str]) {
    let problem = &problems(from, to)[0];
    assert!(problem.starts_with(start), "{problem}");
    for part in parts {
        assert!(problem.contains(part), "no {part:?} in {problem:?}");
    }
}

fn good() -> Pipeline {
    parse(Path::new("p.toml"), GOOD).expect("the file is good")
}

#[test]
fn every_key_of_the_form_is_read() {
    let pipeline = good();
    assert_eq!(pipeline.span, Span::from_ms(2000));
    assert_eq!(pipeline.resources, [Resource { name: "gpu0".to_owned(), slots: 1 }]);
    let [camera, detector] = &pipeline.operators[..] else { panic!("two operators") };
    assert_eq!(camera.timer, Some(Timer { period: Span::from_ms(50), phase: Span::ZERO }));
    assert_eq!((camera.policy, camera.deadline, camera.uses), (Policy::SkipToLatest, None, None));
    assert_eq!((&detector.at[..], detector.uses), (&[0][..], Some(0)));
    assert_eq!(detector.runtime, RuntimeModel::Fixed(Span::from_ms(80)));
    let expected =
        BoxDeadline { length: Span::from_ms(100), anchor: Anchor::Arrival, reaction: Reaction::ReuseLast };
    assert_eq!(detector.deadline, Some(expected));
}

#[test]
fn a_deadline_counts_from_arrival_and_skips_by_default() {
    let text = GOOD.replace(", anchor = \"arrival\", reaction = \"reuse_last\"", "");
    let pipeline = parse(Path::new("p.toml"), &text).expect("the file is good");
    let deadline = pipeline.operators[1].deadline.expect("it has one");
    assert_eq!((deadline.anchor, deadline.reaction), (Anchor::Arrival, Reaction::Skip));
}

#[test]
fn every_policy_and_run_time_has_its_form() {
    let policy = |text: &str| {
        let text = GOOD.replace("policy = \"skip_to_latest\"", &format!("policy = \"{text}\""));
        parse(Path::new("p.toml"), &text).expect("a good policy").operators[1].policy
    };
    assert_eq!(policy("queue(2)"), Policy::Queue { capacity: 2, full: Full::DropOldest });
    assert_eq!(policy("queue(2, drop_oldest)"), policy("queue(2)"));
    assert_eq!(policy("queue(7,drop_newest)"), Policy::Queue { capacity: 7, full: Full::DropNewest });
    assert_eq!(policy("pipelined(4)"), Policy::Pipelined { places: 4, overtaking: false });
    assert_eq!(policy("pipelined(4, overtaking)"), Policy::Pipelined { places: 4, overtaking: true });

    let runtime = |text: &str| {
        let text = GOOD.replace("{ fixed_ms = 80 }", text);
        parse(Path::new("p.toml"), &text).expect("a good run time").operators[1].runtime.clone()
    };
    let ms = Span::from_ms;
    assert_eq!(runtime("{ zero = true }"), RuntimeModel::Zero);
    assert_eq!(runtime("{ fixed_ms = 0.5 }"), RuntimeModel::Fixed(Span::from_us(500)));
    assert_eq!(runtime("{ cycle_ms = [300, 100] }"), RuntimeModel::Cycle(vec![ms(300), ms(100)]));
    assert_eq!(runtime("{ normal_ms = [80, 10] }"), RuntimeModel::Normal { mean: ms(80), deviation: ms(10) });
    assert_eq!(
        runtime("{ percentiles_ms = [[50, 70], [99, 120]] }"),
        RuntimeModel::Percentiles(vec![(50.0, ms(70)), (99.0, ms(120))])
    );
}

#[test]
fn an_unknown_key_is_named_with_its_line_and_the_nearest_one() {
    refused(
        "policy",
        "polcy",
        "p.toml:10: operator \"detector\".polcy: unknown key",
        &["did you mean \"policy\"?"],
    );
    refused(
        "slots = 1",
        "slot = 1",
        "p.toml:14: resource.gpu0.slot: unknown key",
        &["did you mean \"slots\"?"],
    );
    refused("span_ms", "spam_ms", "p.toml:1: spam_ms: unknown key", &["did you mean \"span_ms\"?"]);
    refused("ms = 100", "length = 1", "p.toml:11: operator \"detector\".deadline.length: unknown key", &[]);
}

#[test]
fn an_unknown_name_is_met_with_the_nearest_one() {
    refused(
        "[\"camera\"]",
        "[\"camra\"]",
        "p.toml:8: operator \"detector\".at: unknown operator",
        &["\"camera\"?"],
    );
    refused("\"gpu0\"", "\"gpu\"", "p.toml:12: operator \"detector\".uses: unknown resource", &["\"gpu0\"?"]);
    refused(
        "\"arrival\"",
        "\"arival\"",
        "p.toml:11: operator \"detector\".deadline.anchor:",
        &["\"arrival\"?"],
    );
    refused(
        "\"reuse_last\"",
        "\"on_deadline\"",
        "p.toml:11: operator \"detector\".deadline.reaction:",
        &["\"skip\""],
    );
    refused(
        "fixed_ms = 80",
        "fixd_ms = 80",
        "p.toml:9: operator \"detector\".runtime.fixd_ms:",
        &["\"fixed_ms\"?"],
    );
}

#[test]
fn times_that_are_none_are_refused() {
    for bad in ["nan", "-5", "inf", "1e300", "\"50\"", "0", "1e-9", "99999999999999999999"] {
        let start =
            if bad.starts_with('9') { "p.toml:4" } else { "p.toml:4: operator \"camera\".every_ms: found" };
        refused("every_ms = 50", &format!("every_ms = {bad}"), start, &[]);
    }
    refused(
        "every_ms = 50",
        "every_ms = 1e-6",
        "p.toml:4: operator \"camera\".every_ms: ticks 2000000000",
        &[],
    );
    refused(
        "fixed_ms = 80",
        "fixed_ms = -1",
        "p.toml:9: operator \"detector\".runtime.fixed_ms: found -1",
        &[],
    );
    refused(
        "fixed_ms = 80",
        "cycle_ms = [5, 0]",
        "p.toml:9: operator \"detector\".runtime.cycle_ms: found 0",
        &[],
    );
    refused("ms = 100", "ms = 0", "p.toml:11: operator \"detector\".deadline.ms: found 0", &["above 0"]);
    refused("span_ms = 2000", "span_ms = nan", "p.toml:1: span_ms: found nan", &[]);
}

#[test]
fn a_run_time_is_required_and_one() {
    refused(
        "runtime = { fixed_ms = 80 }\n",
        "",
        "p.toml:6: operator \"detector\".runtime: missing",
        &["fixed_ms"],
    );
    refused("fixed_ms = 80", "", "p.toml:9: operator \"detector\".runtime: found 0 keys", &[]);
    refused(
        "fixed_ms = 80",
        "fixed_ms = 80, zero = true",
        "p.toml:9: operator \"detector\".runtime: found 2",
        &[],
    );
    refused(
        "fixed_ms = 80",
        "zero = false",
        "p.toml:9: operator \"detector\".runtime.zero: found false",
        &[],
    );
    refused(
        "fixed_ms = 80",
        "cycle_ms = []",
        "p.toml:9: operator \"detector\".runtime.cycle_ms: found an empty",
        &[],
    );
    refused(
        "fixed_ms = 80",
        "normal_ms = [1]",
        "p.toml:9: operator \"detector\".runtime.normal_ms:",
        &["mean"],
    );
    for bad in ["[[50, 70], [50, 80]]", "[[50, 70], [60, 60]]", "[[101, 7]]", "[[5]]", "[3]"] {
        let to = format!("percentiles_ms = {bad}");
        refused("fixed_ms = 80", &to, "p.toml:9: operator \"detector\".runtime.percentiles_ms:", &[]);
    }
}

#[test]
fn policies_that_are_none_are_refused() {
    for bad in
        ["queue", "queue()", "queue(0)", "queue(-1)", "pipelined(2, drop_newest)", "queue(1, 2, 3)", "latest"]
    {
        let to = format!("policy = \"{bad}\"");
        refused(
            "policy = \"skip_to_latest\"",
            &to,
            "p.toml:10: operator \"detector\".policy: found",
            &["pipelined(n)"],
        );
    }
}

#[test]
fn inputs_are_named_once_and_something_fires() {
    let at = "at = [\"camera\"]";
    refused(
        at,
        "at = [\"camera\", \"camera\"]",
        "p.toml:8: operator \"detector\".at: \"camera\" is an input",
        &[],
    );
    refused(
        at,
        "at = [\"camera\"]\nfeedback = [\"camera\"]",
        "p.toml:9: operator \"detector\".feedback:",
        &["once"],
    );
    refused(
        at,
        "latest = [\"camera\"]",
        "p.toml:6: operator \"detector\": nothing makes it fire",
        &["every_ms"],
    );
    refused(
        at,
        "at = [\"camera\"]\nphase_ms = 3",
        "p.toml:9: operator \"detector\".phase_ms:",
        &["every_ms"],
    );
    refused("name = \"detector\"", "name = \"camera\"", "p.toml:7: operator \"camera\".name: another", &[]);
}

#[test]
fn a_cycle_without_feedback_is_refused_and_names_its_operators() {
    let cycle = "every_ms = 50\nlatest = [\"detector\"]";
    refused(
        "every_ms = 50",
        cycle,
        "p.toml:5: operator \"camera\".latest: a cycle",
        &["detector -> camera -> detector"],
    );
    refused(
        "[\"camera\"]",
        "[\"detector\"]",
        "p.toml:8: operator \"detector\".at: a cycle",
        &["detector -> detector"],
    );
    let text = GOOD.replace("every_ms = 50", "every_ms = 50\nfeedback = [\"detector\"]");
    assert_eq!(parse(Path::new("p.toml"), &text).expect("feedback closes a loop").operators[0].feedback, [1]);
}

#[test]
fn all_problems_are_reported_in_the_order_of_the_lines() {
    let text = GOOD
        .replace("every_ms = 50", "every_ms = nan")
        .replace("ms = 100", "ms = 0")
        .replace("= 1\n", "= 0\n");
    let problems = parse(Path::new("p.toml"), &text).expect_err("three problems");
    let lines: Vec<&str> = problems.lines().iter().map(|line| &line[..9]).collect();
    assert_eq!(lines, ["p.toml:4:", "p.toml:11", "p.toml:14"]);
}

#[test]
fn text_that_is_no_toml_is_refused_with_its_line() {
    refused("name = \"camera\"", "name = \"camera", "p.toml:3: ", &[]);
    refused("[resource.gpu0]", "[resource.gpu0", "p.toml:13: ", &[]);
    assert!(parse(Path::new("p.toml"), "").is_err());
}

#[test]
fn the_json_has_every_key_and_the_reads_by_name() {
    let text = GOOD.replace("span_ms = 2000", "span_ms = 85").replace("fixed_ms = 80", "zero = true");
    let pipeline = parse(Path::new("p.toml"), &text).expect("the file is good");
    let trace = simulate(&pipeline, 1, 1).expect("it runs");
    let rows: Vec<serde_json::Value> = serde_json::from_str(&json(&pipeline, &trace)).expect("JSON");
    assert_eq!(rows[0]["operator"], "camera");
    assert_eq!((&rows[0]["stamp_ns"], &rows[0]["watermark_ns"]), (&serde_json::Value::Null, &(-1).into()));
    assert_eq!(rows[0]["reads"], serde_json::json!({}));
    let expected = serde_json::json!({
        "operator": "detector", "stamp_ns": 50_000_000, "watermark_ns": 99_999_999, "visible_at_ns": 55_000_000,
        "reused_from_ns": null, "reads": { "camera": 50_000_000 },
    });
    assert_eq!(rows.last(), Some(&expected));
}

#[test]
fn random_run_times_go_by_the_seed_alone() {
    let text = GOOD.replace("fixed_ms = 80", "normal_ms = [60, 15]");
    let pipeline = parse(Path::new("p.toml"), &text).expect("the file is good");
    let run = |seed, threads| simulate(&pipeline, seed, threads).expect("it runs").publications;
    assert_eq!(run(1, 1), run(1, 2));
    assert_ne!(run(1, 1), run(2, 1));
}

#[test]
fn a_full_queue_that_fails_ends_the_run_with_its_name() {
    let text = GOOD.replace("skip_to_latest", "queue(1, fail)");
    let pipeline = parse(Path::new("p.toml"), &text).expect("the file is good");
    let error = simulate(&pipeline, 1, 1).expect_err("80 ms do not fit into 50 ms").to_string();
    assert!(error.contains("detector"), "{error}");
}

#[test]
fn the_table_counts_what_happened() {
    // The detector takes 80 of every 100 ms: two frames of three in 200 ms are answered.
    let pipeline = good();
    let trace = simulate(&pipeline, 1, 1).expect("it runs");
    let table = table(&pipeline, &trace);
    let words = |start: &str| -> Vec<String> {
        let line =
            table.lines().rev().find(|line| line.trim_start().starts_with(start)).expect("a line of its own");
        line.split_whitespace().map(str::to_owned).collect()
    };
    assert_eq!(words("camera")[..3], ["camera", "41", "40"]);
    let started = trace.steps.iter().filter(|step| step.operator == 1).count();
    assert_eq!(words("detector")[1], started.to_string());
    assert_eq!(words("gpu0")[..4], ["gpu0", "1", &words("detector")[8], "%"]);
}

#[test]
fn a_busy_operator_is_busy_all_the_time() {
    let text =
        GOOD.replace("deadline", "#").replace("every_ms = 50", "every_ms = 10").replace("= 80", "= 25");
    let pipeline = parse(Path::new("p.toml"), &text).expect("the file is good");
    let trace = simulate(&pipeline, 1, 1).expect("it runs");
    // It starts when the first image is there, after 5 ms, and never stops.
    assert_eq!(trace.busy(1, pipeline.span), Span::from_ms(1995));
}

#[test]
fn the_chart_has_a_bar_for_each_step_and_survives_any_name() {
    let text = GOOD.replace("camera", "<cam & era>");
    let pipeline = parse(Path::new("p.toml"), &text).expect("the file is good");
    let trace = simulate(&pipeline, 1, 1).expect("it runs");
    let svg = svg(&pipeline, &trace);
    assert_eq!(svg.matches("<title>").count(), trace.steps.len());
    assert!(svg.contains("&lt;cam &amp; era&gt;") && !svg.contains("<cam"));
    assert!(svg.trim_end().ends_with("</svg>"));
}

#[test]
fn the_examples_are_good_and_say_what_they_promise() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/timing");
    for entry in std::fs::read_dir(folder).expect("the examples are there") {
        let path = entry.expect("a readable entry").path();
        let pipeline = read_file(&path).unwrap_or_else(|error| panic!("{error:#}"));
        let trace = simulate(&pipeline, 1, 1).expect("an example runs");
        assert!(!trace.publications.is_empty(), "{}", path.display());
    }
}
