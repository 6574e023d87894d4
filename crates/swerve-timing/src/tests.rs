use swerve_core::{Span, Time};
use swerve_flow::{Anchor, Deadline, Policy, Reaction, RuntimeModel};

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

/// Returns the problems of the good file with `from` replaced by `to`.
fn problems(from: &str, to: &str) -> Vec<String> {
    assert!(GOOD.contains(from), "{from} is not in the file");
    match parse("p.toml", &GOOD.replacen(from, to, 1)) {
        Ok(pipeline) => panic!("{to}: read as {pipeline:?}"),
        Err(problems) => problems.iter().map(ToString::to_string).collect(),
    }
}

/// Asserts that there is only one problem, which starts with `start` after the file's name and contains `part`.
#[track_caller]
fn refused(from: &str, to: &str, start: &str, part: &str) {
    let [problem] = &problems(from, to)[..] else { panic!("not one problem: {:?}", problems(from, to)) };
    assert!(problem.starts_with(&format!("p.toml:{start}")), "{problem}");
    assert!(problem.contains(part), "no {part:?} in {problem:?}");
}

fn good() -> Pipeline {
    parse("p.toml", GOOD).expect("the file is good")
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
    assert_eq!(detector.deadline, Some(Deadline::after(Span::from_ms(100)).reaction(Reaction::ReuseLast)));
}

#[test]
fn a_deadline_counts_from_arrival_and_skips_by_default() {
    let text = GOOD.replace(", anchor = \"arrival\", reaction = \"reuse_last\"", "");
    let pipeline = parse("p.toml", &text).expect("the file is good");
    let expected = Deadline::after(Span::from_ms(100)).anchor(Anchor::Arrival).reaction(Reaction::Skip);
    assert_eq!(pipeline.operators[1].deadline, Some(expected));
}

#[test]
fn an_unknown_key_is_named_with_its_line_and_the_nearest_one() {
    refused("policy", "polcy", "10: operator[1].polcy: unknown key", "did you mean `policy`?");
    refused("slots = 1", "slot = 1", "14: resource.gpu0.slot: unknown key", "did you mean `slots`?");
    refused("span_ms", "spam_ms", "1: spam_ms: unknown key", "did you mean `span_ms`?");
    refused("ms = 100", "msec = 100", "11: operator[1].deadline.msec: unknown key", "did you mean `ms`?");
    refused("fixed_ms = 80", "fixd_ms = 80", "9: operator[1].runtime.fixd_ms:", "did you mean `fixed_ms`?");
}

#[test]
fn unknown_name_is_reported_with_the_nearest_one() {
    refused(
        "[\"camera\"]",
        "[\"camra\"]",
        "8: operator[1].at[0]: unknown operator",
        "did you mean `camera`?",
    );
    refused("\"gpu0\"", "\"gpu\"", "12: operator[1].uses: unknown resource", "did you mean `gpu0`?");
    refused(
        "\"arrival\"",
        "\"arival\"",
        "11: operator[1].deadline.anchor: expected one of ",
        "did you mean `arrival`?",
    );
    refused(
        "\"reuse_last\"",
        "\"reuse\"",
        "11: operator[1].deadline.reaction: expected one of \"skip\", ",
        "`reuse_last`?",
    );
    refused(
        "\"reuse_last\"",
        "\"on_deadline\"",
        "11: operator[1].deadline: a black box has no handler",
        "skip",
    );
}

#[test]
fn invalid_times_are_refused() {
    for bad in ["nan", "-5", "inf", "1e300", "\"50\"", "0", "1e-9"] {
        refused("every_ms = 50", &format!("every_ms = {bad}"), "4: operator[0].every_ms: ", "");
        refused("span_ms = 2000", &format!("span_ms = {bad}"), "1: span_ms: ", "");
        refused("ms = 100", &format!("ms = {bad}"), "11: operator[1].deadline", "");
    }
    for bad in ["nan", "-5", "inf", "1e300"] {
        refused(
            "fixed_ms = 80",
            &format!("fixed_ms = {bad}"),
            "9: operator[1].runtime.fixed_ms: expected 0 to 86400000",
            "found",
        );
        refused(
            "every_ms = 50",
            &format!("every_ms = 50\nphase_ms = {bad}"),
            "5: operator[0].phase_ms: ",
            "found",
        );
    }
    refused("every_ms = 50", "every_ms = 99999999999999999999", "4: ", "99999999999999999999");
    refused("every_ms = 50", "every_ms = 1e-6", "4: operator[0].every_ms: ticks 2000000000 times", "at most");
}

#[test]
fn operator_requires_exactly_one_run_time() {
    refused("runtime = { fixed_ms = 80 }\n", "", "6: operator[1].runtime: is missing: expected a table", "");
    for (bad, part) in [
        ("", "exactly one"),
        ("fixed_ms = 80, zero = true", "exactly one"),
        ("zero = false", "expected true"),
        ("cycle_ms = []", "at least one"),
        ("cycle_ms = [5, 0]", "expected 0.001 to 86400000"),
        ("normal_ms = [1]", "normal_ms"),
        ("percentiles_ms = [[50, 70], [50, 80]]", "rising"),
        ("percentiles_ms = [[50, 70], [60, 60]]", "rising"),
        ("percentiles_ms = [[101, 7]]", "0 to 100"),
        ("percentiles_ms = [[nan, 7]]", "0 to 100"),
        ("percentiles_ms = [[5]]", "percentiles_ms"),
        ("work = { per_unit_us = 3 }", "a black box does no work"),
        ("measured = 1.0", "a black box does no work"),
    ] {
        refused("fixed_ms = 80", bad, "9: operator[1].runtime", part);
    }
}

#[test]
fn invalid_policies_and_resources_are_refused() {
    let unknown = ["unknown policy", "pipelined(N)"];
    let count = ["expected an N from 1 to 1000000 in `queue(N)`", "found `queue("];
    for (bad, [start, part]) in [
        ("queue", unknown),
        ("queue()", count),
        ("queue(0)", count),
        ("queue(-1)", count),
        ("pipelined(2, drop_newest)", unknown),
        ("queue(1, 2, 3)", unknown),
        ("latest", unknown),
    ] {
        let start = format!("10: operator[1].policy: {start}");
        refused("policy = \"skip_to_latest\"", &format!("policy = \"{bad}\""), &start, part);
    }
    for bad in ["0", "-1", "1.5", "9999999"] {
        refused("slots = 1", &format!("slots = {bad}"), "14: resource.gpu0.slots: ", "");
    }
}

#[test]
fn operator_requires_distinct_inputs_and_a_trigger() {
    let at = "at = [\"camera\"]";
    refused(
        at,
        "at = [\"camera\", \"camera\"]",
        "8: operator[1].at[1]: \"camera\" is an input already",
        "once",
    );
    refused(
        at,
        "at = [\"camera\"]\nfeedback = [\"camera\"]",
        "9: operator[1].feedback[0]: \"camera\" is an",
        "once",
    );
    refused(at, "latest = [\"camera\"]", "6: operator[1]: nothing makes \"detector\" fire", "every_ms");
    refused(at, "at = [\"camera\"]\nphase_ms = 3", "9: operator[1].phase_ms: a phase without", "every_ms");
    refused("name = \"detector\"", "name = \"camera\"", "7: operator[1].name: another operator", "unique");
    refused("name = \"detector\"", "name = \" \"", "7: operator[1].name: expected a name", "");
    let none = parse("p.toml", "span_ms = 5\noperator = []").expect_err("no operator");
    assert_eq!(none[0].to_string(), "p.toml:2: operator: expected at least one [[operator]]");
}

#[test]
fn a_cycle_without_feedback_is_refused_and_names_its_operators() {
    let cycle = "every_ms = 50\nlatest = [\"detector\"]";
    refused("every_ms = 50", cycle, "5: operator[0].latest[0]: a cycle", "detector -> camera -> detector");
    refused("[\"camera\"]", "[\"detector\"]", "8: operator[1].at[0]: a cycle", "detector -> detector");
    let text = GOOD.replace("every_ms = 50", "every_ms = 50\nfeedback = [\"detector\"]");
    assert_eq!(parse("p.toml", &text).expect("feedback closes a loop").operators[0].feedback, [1]);
}

#[test]
fn all_problems_of_values_are_reported() {
    let text = GOOD
        .replace("every_ms = 50", "every_ms = nan")
        .replace("ms = 100", "ms = 0")
        .replace("= 1\n", "= 0\n");
    let problems = parse("p.toml", &text).expect_err("three problems");
    let mut lines: Vec<_> = problems.iter().filter_map(|problem| problem.line).collect();
    lines.sort_unstable();
    assert_eq!(lines, [4, 11, 14]);
}

#[test]
fn invalid_toml_is_refused_with_its_line() {
    refused("name = \"camera\"", "name = \"camera", "3: ", "");
    refused("[resource.gpu0]", "[resource.gpu0", "13: ", "");
    assert!(parse("p.toml", "").is_err());
}

#[test]
fn the_json_has_every_key_and_the_reads_by_name() {
    let text = GOOD.replace("span_ms = 2000", "span_ms = 85").replace("fixed_ms = 80", "zero = true");
    let pipeline = parse("p.toml", &text).expect("the file is good");
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
fn random_run_times_depend_on_the_seed_alone() {
    let text = GOOD.replace("fixed_ms = 80", "normal_ms = [60, 15]");
    let pipeline = parse("p.toml", &text).expect("the file is good");
    let run = |seed, threads| simulate(&pipeline, seed, threads).expect("it runs").publications;
    assert_eq!(run(1, 1), run(1, 2));
    assert_ne!(run(1, 1), run(2, 1));
}

#[test]
fn a_full_queue_that_fails_ends_the_run_with_its_name() {
    let text = GOOD.replace("skip_to_latest", "queue(1, fail)");
    let pipeline = parse("p.toml", &text).expect("the file is good");
    let error = simulate(&pipeline, 1, 1).expect_err("80 ms do not fit into 50 ms").to_string();
    assert!(error.contains("detector"), "{error}");
}

#[test]
fn table_counts_steps_and_messages() {
    // The detector takes 80 ms per frame, and a frame arrives every 50 ms: it skips frames.
    let pipeline = good();
    let trace = simulate(&pipeline, 1, 1).expect("it runs");
    let table = table(&pipeline, &tally(&pipeline, 1, 1).expect("it runs"));
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
    let pipeline = parse("p.toml", &text).expect("the file is good");
    let tally = tally(&pipeline, 1, 1).expect("it runs");
    // It starts when the first image arrives, after 5 ms, and never stops.
    assert_eq!(tally.operators[1].busy, Span::from_ms(1995));
}

#[test]
fn the_chart_has_a_bar_for_each_step_and_survives_any_name() {
    let text = GOOD.replace("camera", "<cam & era>");
    let pipeline = parse("p.toml", &text).expect("the file is good");
    let trace = simulate(&pipeline, 1, 1).expect("it runs");
    let svg = draw(&pipeline, &trace).svg();
    assert_eq!(svg.matches("<title>").count(), 1 + trace.steps.len(), "the picture's own, and one a step");
    assert!(svg.contains("&lt;cam &amp; era&gt;") && !svg.contains("<cam"));
    assert!(svg.trim_end().ends_with("</svg>"));
}

#[test]
fn chart_of_a_long_run_shows_its_first_part_and_states_it() {
    let text = GOOD.replace("span_ms = 2000", "span_ms = 3600000");
    let pipeline = parse("p.toml", &text).expect("the file is good");
    let svg = draw(&pipeline, &simulate(&pipeline, 1, 1).expect("it runs")).svg();
    assert!(svg.contains("the first ") && svg.contains(" of 3600000 ms"), "{}", &svg[..600]);
    assert!(svg.len() < 2_000_000, "{} bytes", svg.len());
}

/// A controller at 100 Hz beside a camera at 20 Hz.
#[test]
fn chart_has_a_band_of_close_steps_and_the_slowest_chain() {
    let control = "[[operator]]\nname = \"control\"\nevery_ms = 10\nlatest = [\"detector\"]\nruntime = { zero = true }\n";
    let pipeline = parse("p.toml", &GOOD.replace("[resource", &format!("{control}[resource"))).expect("good");
    let trace = simulate(&pipeline, 1, 1).expect("it runs");
    let svg = draw(&pipeline, &trace).svg();
    let of = |operator| trace.steps.iter().filter(|step| step.operator == operator).count();
    assert!(svg.contains(&format!("<title>control: {} steps from 0 to 2000 ms</title>", of(2))), "{svg}");
    assert_eq!(svg.matches("<title>").count(), 1 + of(0) + of(1) + 1, "of the others each step has its bar");
    // The chain has the largest response time of the table, and begins with a frame of the camera.
    let chain = chain::Chain::slowest(&pipeline, &trace, Time::MAX).expect("there are responses");
    let operators: Vec<usize> = chain.links.iter().map(|(publication, _)| publication.operator).collect();
    assert_eq!(operators, [0, 1, 2]);
    let tally = tally(&pipeline, 1, 1).expect("it runs");
    assert_eq!(Some(&chain.took), tally.operators[2].responses.iter().max());
    for ((read, _), (_, by)) in chain.links.iter().zip(&chain.links[1..]) {
        assert!(read.visible_at <= by.start, "{read:?} is read by {by:?}");
    }
    assert!(svg.contains(&format!(", {} ms after its frame", table::ms(chain.took))), "{svg}");
}

#[test]
fn examples_are_valid_and_publish() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/timing");
    for entry in std::fs::read_dir(folder).expect("the examples are there") {
        let path = entry.expect("a readable entry").path();
        let pipeline = read_file(&path).unwrap_or_else(|problems| panic!("{problems:?}"));
        let trace = simulate(&pipeline, 1, 1).expect("an example runs");
        assert!(!trace.publications.is_empty(), "{}", path.display());
    }
}
