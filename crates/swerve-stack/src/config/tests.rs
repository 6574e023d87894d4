use super::execution::Runtime;
use super::*;
use crate::Setup;
use crate::registry::Registry;
use swerve_text::{Document, parse_assignment};

/// Configuration from a text and assignments, or its problems, one on a line.
pub(super) fn config(text: &str, sets: &[&str]) -> Result<Setup, String> {
    let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
    let document = Document::parse("c.toml", text).unwrap();
    Setup::from_document(&document, &sets)
        .map_err(|problems| problems.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))
}

fn problems(text: &str, sets: &[&str]) -> Vec<String> {
    let problems = config(text, sets).expect_err("wrong on purpose");
    problems.lines().map(str::to_owned).collect()
}

#[test]
fn every_problem_is_reported_with_file_line_and_key() {
    let text = "[sim]\ndt_ms = nan\n[sensing]\nrange_m = -1\n[operator.planer]\npolicy = \"queue(0)\"\n[operator.planner]\nuses = \"gpu0\"\n";
    let found = problems(text, &[]);
    assert_eq!(found[0], "c.toml:2: sim.dt_ms: expected 1 to 20, found NaN");
    assert_eq!(found[1], "c.toml:4: sensing.range_m: expected 0.1 to 10000, found -1");
    assert!(found[2].starts_with("c.toml:5: operator.planer: unknown operator"), "{}", found[2]);
    assert!(found[2].ends_with("; did you mean `planner`?"), "{}", found[2]);
    assert!(
        found[3]
            .starts_with("c.toml:6: operator.planer.policy: expected an N from 1 to 1000000 in `queue(N)`")
    );
    assert!(found[4].starts_with("c.toml:8: operator.planner.uses: unknown resource `gpu0`"));
}

/// Misspelt keys and names together with wrong values: both are reported at once, without their consequences.
#[test]
fn misspelt_keys_and_wrong_values_are_reported_together() {
    let cases: [(&str, &[&str]); 5] = [
        (
            "[planning]\nplaner = \"fot\"\n[sim]\ndt_ms = 50\n[operator.planer]\n",
            &[
                "c.toml:2: planning.planer: unknown key; did you mean `planner`?",
                "c.toml:4: sim.dt_ms: expected 1 to 20, found 50",
                "c.toml:5: operator.planer: unknown operator, expected one of supervisor, ",
            ],
        ),
        // With the intended preset the era is valid.
        (
            "[planning]\nprest = \"paper\"\nera = \"pylot_2020_11\"\n[control]\nperiod_ms = 0\n",
            &[
                "c.toml:2: planning.prest: unknown key; did you mean `preset`?",
                "c.toml:5: control.period_ms: expected 1 to 1000, found 0",
            ],
        ),
        (
            "[planning]\npreset = \"papr\"\nera = \"pylot_2020_11\"\n",
            &["c.toml:2: planning.preset: expected one of \"paper\", \"best\", found \"papr\""],
        ),
        // A wrong value under a misspelt key is reported once the key is corrected.
        ("[sim]\ndt_sm = 50\n", &["c.toml:2: sim.dt_sm: unknown key; did you mean `dt_ms`?"]),
        (
            "[operator.front]\nkind = \"camera\"\nperiod_sm = 50\n[sensing]\nrange_m = -1\n",
            &[
                "c.toml:3: operator.front.period_sm: unknown key",
                "c.toml:5: sensing.range_m: expected 0.1 to 10000, found -1",
            ],
        ),
    ];
    for (text, expected) in cases {
        let told = problems(text, &[]);
        let is_told =
            told.len() == expected.len() && told.iter().zip(expected).all(|(a, b)| a.starts_with(b));
        assert!(is_told, "{text}{told:#?}");
    }
}

#[test]
fn unknown_names_are_reported_with_the_nearest_one() {
    let unknown = &problems("[planning]\nplanner = \"rrtstar\"\n", &[])[0];
    assert!(unknown.starts_with("c.toml:2: planning.planner: expected one of \"fot\", "), "{unknown}");
    assert!(unknown.ends_with("found \"rrtstar\"; did you mean `rrt_star`?"), "{unknown}");
    assert_eq!(
        problems("", &["planning.planer=fot"]),
        ["--set: planning.planer: unknown key; did you mean `planner`?"]
    );
    assert_eq!(problems("", &["sim.dt_ms=100"]), ["--set: sim.dt_ms: expected 1 to 20, found 100"]);
}

#[test]
fn every_planner_has_a_built_in_cost() {
    let cost = PlanningConfig::default().cost;
    for planner in Registry::standard().planners().map(PlannerName::new) {
        for fineness in [Fineness::Fast, Fineness::Slow] {
            assert!(cost[&planner][&fineness].model().is_ok(), "{} {}", planner.as_str(), fineness.as_str());
        }
    }
}

#[test]
fn pipeline_with_a_planner_in_python_has_the_name_of_the_class() {
    let text = "[process.plan]\noperators = [\"OPERATOR\"]\npython = \"a.py:Along\"\n";
    let name =
        |operator: &str| swerve_text::built_in::<Config>(&text.replace("OPERATOR", operator)).pipeline_name();
    assert_eq!(["planner", "tracker"].map(name), ["Along", "fot"]);
}

#[test]
fn one_entry_of_the_cost_keeps_the_others() {
    let built_in = PlanningConfig::default().cost;
    let waypoint = PlannerName::new("waypoint");
    let of_file = config("[planning.cost.waypoint]\nfast = { fixed_ms = 5 }\n", &[]).unwrap();
    let of_set = config("", &["planning.cost.waypoint.fast.fixed_ms=5"]).unwrap();
    for cost in [of_file.planning.cost.clone(), of_set.planning.cost.clone()] {
        assert_eq!(cost[&waypoint][&Fineness::Fast], Runtime::fixed(5.0));
        assert_eq!(cost[&waypoint][&Fineness::Slow], built_in[&waypoint][&Fineness::Slow]);
        assert_eq!(cost[&PlannerName::FOT], built_in[&PlannerName::FOT]);
    }
}

#[test]
fn resolved_text_reads_back_as_itself() {
    let mut config = Setup::default();
    config.operator.insert(
        "planner".into(),
        OperatorConfig { runtime: Some(Runtime::fixed(30.0)), ..OperatorConfig::default() },
    );
    let cost = config.planning.cost.entry(PlannerName::FOT).or_default();
    cost.insert(Fineness::Fast, Runtime::fixed(2.0));
    let document = Document::parse("resolved", config.to_text()).unwrap();
    assert_eq!(Setup::from_document(&document, &[]).unwrap().config, config.config);
}

#[test]
fn problems_of_the_papers_rules_are_reported_with_line_and_key() {
    let wrong = |preset: &str, rest: &str| {
        let text = format!("[planning]\npreset = \"{preset}\"\ncollision = \"swept_static\"\n{rest}");
        problems(&text, &[]).remove(0)
    };
    let era = wrong("paper", "era = \"pylot_2020_5\"\n");
    assert!(era.starts_with("c.toml:4: planning.era: expected "), "{era}");
    assert!(era.ends_with("did you mean `pylot_2020_05`?"), "{era}");
    let rules = |rule: &str| wrong("paper", &format!("[planning.rules]\n{rule}\n"));
    assert_eq!(
        rules("solid_lefft = true"),
        "c.toml:5: planning.rules.solid_lefft: unknown key; did you mean `solid_left`?"
    );
    assert_eq!(
        rules("solid_left = true"),
        "c.toml:5: planning.rules.solid_left: expected false: `borders_only` excludes it, found true"
    );
    assert_eq!(
        rules("heading_of_road_rad = nan"),
        "c.toml:5: planning.rules.heading_of_road_rad: expected -6.283185307179586 to 6.283185307179586, found NaN"
    );
    let fallback = rules("fallback = \"stop_on_rout\"");
    assert!(fallback.starts_with("c.toml:5: planning.rules.fallback: expected "), "{fallback}");
    assert!(fallback.ends_with("did you mean `stop_on_route`?"), "{fallback}");
    assert_eq!(
        wrong("best", "era = \"pylot_2020_05\"\n"),
        "c.toml:4: planning.era: only the preset `paper` has one"
    );
    assert_eq!(
        problems("", &["planning.rules.solid_lefft=true"]),
        ["--set: planning.rules.solid_lefft: unknown key; did you mean `solid_left`?"]
    );
    assert_eq!(
        problems("", &["planning.rules.solid_left=true"]),
        ["--set: planning.rules.solid_left: only the preset `paper` has one"]
    );
    for ours in ["may_stop", "risk"] {
        assert_eq!(
            problems(&format!("[planning]\npreset = \"paper\"\ncollision = \"{ours}\"\n"), &[]),
            ["c.toml:3: planning.collision: the paper's planners know `swept_static` and `time_indexed`"]
        );
    }
    assert_eq!(
        problems("", &["planning.risk_max=0.6"]),
        ["--set: planning.risk_max: expected 0 to 0.5, found 0.6"]
    );
}

#[test]
fn single_rules_override_the_eras() {
    let config = |text: &str| Setup::from_document(&Document::parse("c.toml", text).unwrap(), &[]).unwrap();
    let of = |rest: &str| {
        let planning =
            "[planning]\npreset = \"paper\"\nplanner = \"rrt_star\"\ncollision = \"swept_static\"\n";
        config(&format!("{planning}{rest}")).planning.rules().unwrap()
    };
    let (may, november) = (of(""), of("era = \"pylot_2020_11\"\n"));
    assert_eq!(may, of("era = \"pylot_2020_05\"\n"));
    assert_ne!(may.fallback, november.fallback);
    let open = of("[planning.rules]\nsolid_left = false\n");
    assert_eq!(open, swerve_pylot::Rules { solid_left: false, ..may });
}

#[test]
fn rule_for_hidden_places_needs_the_comfortable_layer_and_reacts_within_the_expected_latency() {
    let on = "planning.occlusion.enabled=true";
    let expected = "planning.occlusion.enabled: is a rule of the comfortable layer, which `planning.comfort.enabled` enables";
    for off in ["planning.comfort.enabled=false", "planning.preset=paper"] {
        let found = problems("", &[on, off]);
        assert!(found.iter().any(|problem| problem.ends_with(expected)), "{found:?}");
    }
    let reaction_s =
        |sets: &[&str]| config("", sets).unwrap().planning.occlusion().map(|rule| rule.reaction_s);
    assert_eq!(reaction_s(&[]), None);
    let soon = reaction_s(&[on]).unwrap();
    let later = reaction_s(&[on, "planning.added_latency_ms=300"]).unwrap();
    assert!((later - soon - 0.3).abs() < 1e-9 && soon > 0.25, "{soon} {later}");
    assert_eq!(reaction_s(&[on, "planning.occlusion.reaction_s=0.7"]), Some(0.7));
}
