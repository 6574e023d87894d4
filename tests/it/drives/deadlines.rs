//! Deadlines, ladders and timers: of detector and planner by the models of `[execution]`, of any operator by its own keys.

use std::path::{Path, PathBuf};

use swerve::replay::replay;
use swerve_core::{Digest, Span, Time};
use swerve_drive::{Outcome, drive_pipeline, read_scenario, run_start};
use swerve_flow::{Event, Observer};
use swerve_log::{Log, Recorder};
use swerve_msg::{ActorKind, Detections, PredictionList, ResponseBudget, RungTaken};
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;
use swerve_text::{Document, parse_assignment};

use crate::common;

fn file(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(name)
}

fn config(sets: &[&str]) -> Setup {
    let sets = common::sets(sets);
    Setup::from_document(&Document::read(&file("configs/deadlines.toml")).unwrap(), &sets).unwrap()
}

/// Effects of deadlines.
#[derive(Default)]
struct Recorded {
    /// Operator, stamp, rung.
    rungs: Vec<(String, Time, String)>,
    budgets: Vec<ResponseBudget>,
    /// Stamp of the frame, and publication.
    boxes: Vec<(Time, Time)>,
    /// Operator, start and run time of every step.
    steps: Vec<(String, Time, Span)>,
    /// Number of lists of predictions.
    predicted: usize,
    /// Time at which a person was first tracked.
    person_at: Option<Time>,
}

impl Recorded {
    fn steps_of(&self, operator: &str) -> impl Iterator<Item = (Time, Span)> {
        self.steps.iter().filter(move |(name, ..)| name == operator).map(|&(_, start, lasts)| (start, lasts))
    }
}

impl Observer for Recorded {
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::StepEnd(step) => {
                self.steps.push((step.operator.to_owned(), step.start, step.end - step.start));
            }
            Event::Publication(publication) => {
                let Some(payload) = publication.payload else { return };
                if let Some(taken) = payload.downcast_ref::<RungTaken>() {
                    self.rungs.push((publication.operator.to_owned(), taken.stamp, taken.rung.clone()));
                } else if let Some(budget) = payload.downcast_ref::<ResponseBudget>() {
                    self.budgets.push(*budget);
                } else if let Some(boxes) = payload.downcast_ref::<Detections>() {
                    self.boxes.push((boxes.stamp, publication.visible_at));
                } else if let Some(all) = payload.downcast_ref::<PredictionList>() {
                    self.predicted += 1;
                    let seen = all.predictions.iter().any(|p| p.kind == ActorKind::Pedestrian);
                    self.person_at = self.person_at.or(seen.then_some(publication.visible_at));
                }
            }
            _ => {}
        }
    }
}

/// Drives the first seconds past the truck at 12 m/s.
fn drive(sets: &[&str], until_ms: i64, more: &mut [&mut dyn Observer]) -> (Recorded, Outcome) {
    let config = config(&[&["ego.speed_mps=12"], sets].concat());
    let scenario = read_scenario(&file("scenarios/person_behind_truck.toml")).unwrap();
    let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
    pipeline.until = Time::from_ms(until_ms);
    let mut seen = Recorded::default();
    let mut all: Vec<&mut dyn Observer> = vec![&mut seen];
    all.extend(more.iter_mut().map(|o| &mut **o as &mut dyn Observer));
    let outcome = drive_pipeline(pipeline, config.seed, 1, &mut all).unwrap();
    (seen, outcome)
}

#[test]
fn dynamic_deadlines_trade_accuracy_for_speed_where_a_person_may_step_out() {
    let (seen, outcome) = drive(&[], 12_000, &mut []);
    let person_at = seen.person_at.expect("the person was seen");
    let taken = |operator: &str, from: Time, to: Time| -> Vec<&str> {
        let rungs =
            seen.rungs.iter().filter(|(name, stamp, _)| name == operator && (from..to).contains(stamp));
        rungs.map(|(.., rung)| rung.as_str()).collect()
    };
    // On an empty road there is time: as much as a sensor period leaves.
    let early = (Time::ZERO, Time::from_ms(3000));
    assert!(taken("detector", early.0, early.1).iter().all(|rung| *rung == "efficientdet-d6@d3"));
    assert!(taken("planner", early.0, early.1).iter().all(|rung| *rung == "fot-148"));
    // In a hurry because of the truck before the person is seen, and after; the first step may belong to the previous
    // budget.
    let late = (person_at - Span::from_ms(400), person_at + Span::from_ms(400));
    let (detectors, planners) = (taken("detector", late.0, late.1), taken("planner", late.0, late.1));
    assert!(
        detectors.len() >= 3 && detectors[1..].iter().all(|rung| *rung == "efficientdet-d2@d3"),
        "{detectors:?}"
    );
    assert!(planners.len() >= 3 && planners.iter().all(|rung| *rung == "fot-30"), "{planners:?}");
    let hidden = seen.budgets.iter().any(|budget| budget.hidden && budget.stamp < person_at);
    let least = seen.budgets.iter().map(|budget| budget.response).min();
    assert!(hidden && least == Some(Span::from_ms(50)), "{least:?}");
    // The logged rungs are those taken, and the summary counts them.
    let counted: u64 = outcome.rungs.counts().iter().map(|count| count.steps).sum();
    assert_eq!(counted, seen.rungs.len() as u64);
    assert!(outcome.rungs.text().contains("planner took fot-30 "), "{}", outcome.rungs.text());
}

#[test]
fn run_under_dynamic_deadlines_is_repeatable_and_replays_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("log.mcap");
    let config = config(&["ego.speed_mps=12"]);
    let scenario = file("scenarios/person_behind_truck.toml");
    let start = run_start(&config, &read_scenario(&scenario).unwrap(), &scenario);
    let mut recorder = Recorder::create(&path, &start).unwrap();
    let digest = |more: &mut [&mut dyn Observer]| -> Digest { drive(&[], 10_500, more).1.digest };
    assert_eq!(digest(&mut [&mut recorder]), digest(&mut []));
    recorder.finish().unwrap();
    let log = Log::read(&path).unwrap();
    for cut in ["detector", "tracker", "deadlines", "planner"] {
        let comparison = replay(&log, cut, &[], 2).unwrap();
        assert!(comparison.is_same(), "from {cut}");
    }
}

#[test]
fn every_model_runs_the_detector_as_specified() {
    let model = |sets: &[&str]| drive(sets, 2500, &mut []).0;
    let after = |seen: &Recorded| -> Vec<f64> {
        let mut ms: Vec<f64> = seen.boxes.iter().map(|(stamp, at)| (*at - *stamp).as_ms()).collect();
        assert!(ms.len() >= 5, "{ms:?}");
        ms.sort_by(f64::total_cmp);
        ms
    };
    let all =
        |seen: &Recorded, ms: f64| assert!(after(seen).iter().all(|after| *after == ms), "{:?}", after(seen));
    let d3 = "perception.detector=efficientdet-d3@d3";
    all(&model(&["execution.model=data_driven", d3]), 50.0);
    // The finest rung that fits.
    let fixed = ["execution.model=static_deadlines", "execution.detector_ms=99", "execution.planner_ms=40"];
    let seen = model(&fixed);
    all(&seen, 80.0);
    assert!(seen.steps_of("planner").all(|(_, lasts)| lasts == Span::from_ms(40)));
    all(&model(&["execution.model=dynamic_deadlines"]), 200.0);
    // A frame waits for the next tick of the detector's timer.
    let seen = model(&["execution.model=periodic", d3, "planning.rung_ms=67"]);
    let ms = after(&seen);
    assert!(ms[0] >= 50.0 && ms[ms.len() - 1] <= 100.0, "{ms:?}");
    assert!(seen.boxes.windows(2).all(|two| two[0].0 < two[1].0), "no frame twice");
    for (operator, period_ms) in [("detector", 50), ("planner", 67)] {
        let starts: Vec<Time> = seen.steps_of(operator).map(|(start, _)| start).collect();
        let even = |two: &[Time]| (two[1] - two[0]).ns() % Span::from_ms(period_ms).ns() == 0;
        assert!(starts.len() > 20 && starts.windows(2).all(even), "{operator}");
    }
}

#[test]
fn late_results_are_missed_and_counted() {
    let misses = |outcome: &Outcome, name: &str| {
        outcome.metrics.operators.iter().find(|operator| operator.operator == name).unwrap().misses
    };
    // One detector that is too slow for its deadline: no frame has a result.
    let fixed = ["execution.model=static_deadlines", "execution.detector_ms=99"];
    let keeps = ["perception.ladder=false", "perception.detector=efficientdet-d5@d3"];
    let (seen, outcome) = drive(&[&fixed[..], &keeps].concat(), 2500, &mut []);
    assert!(misses(&outcome, "detector") >= 10 && seen.boxes.is_empty());
    // With the ladder none is late.
    let (seen, outcome) = drive(&fixed, 2500, &mut []);
    assert!(misses(&outcome, "detector") == 0 && seen.boxes.len() >= 10);
    // Too slow, but occasionally in time: the last result replaces a late one.
    let sometimes = ["execution.reaction=reuse_last", "operator.detector.runtime={ cycle_ms = [50, 150] }"];
    let (seen, outcome) = drive(&[&fixed[..], &keeps, &sometimes].concat(), 2500, &mut []);
    let fresh = seen.boxes.windows(2).filter(|two| two[0].0 < two[1].0).count();
    assert!(misses(&outcome, "detector") >= 5 && fresh >= 5 && seen.boxes.len() > fresh + 4);
}

#[test]
fn planner_without_a_ladder_stops_early_with_the_best_plan_so_far() {
    let sets = |model: &'static str| {
        [
            model,
            "perception.detector=efficientdet-d2@d3",
            "operator.planner.runtime={ work = { per_unit_us = 20000 } }",
        ]
    };
    let run = |model: &'static str| {
        let text = std::fs::read_to_string(file("configs/deadlines.toml")).unwrap();
        let text = text.replace("ladder = \"fot@d3\"\n", "");
        let sets = common::sets(&sets(model));
        let more = parse_assignment("execution.planner_ms=60").unwrap();
        let more = (model.ends_with("static_deadlines")).then_some(more);
        let sets: Vec<_> = sets.into_iter().chain(more).collect();
        let config = Setup::from_document(&Document::parse("c", text).unwrap(), &sets).unwrap();
        let scenario = read_scenario(&file("scenarios/person_behind_truck.toml")).unwrap();
        let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
        pipeline.until = Time::from_ms(4000);
        let mut seen = Recorded::default();
        let outcome = drive_pipeline(pipeline, config.seed, 1, &mut [&mut seen]).unwrap();
        let longest = seen.steps_of("planner").map(|(_, lasts)| lasts).max().unwrap();
        (longest, outcome.metrics.plans, outcome.metrics.operators)
    };
    let (free, ..) = run("execution.model=data_driven");
    let (cut, plans, operators) = run("execution.model=static_deadlines");
    let planner = operators.iter().find(|operator| operator.operator == "planner").unwrap();
    assert!(free > Span::from_ms(60) && cut <= Span::from_ms(60), "{free:?} {cut:?}");
    assert!(planner.misses == 0 && planner.steps >= 10, "{planner:?} {plans:?}");
}

/// A predictor, which no execution model schedules.
#[test]
fn any_operator_takes_the_rung_that_meets_its_deadline() {
    let rungs = "operator.predictor.rungs=[{ name = 'imm', ms = 40, predictor = 'imm' }, \
                 { name = 'lines', ms = 5, predictor = 'linear' }]";
    for (deadline, rung, lasts_ms) in [
        ("operator.predictor.deadline={ ms = 20 }", "lines", 5),
        ("operator.predictor.deadline={ ms = 60 }", "imm", 40),
        ("seed=1", "imm", 40),
    ] {
        let (seen, outcome) = drive(&[rungs, deadline], 3000, &mut []);
        let taken = seen.rungs.iter().filter(|(operator, ..)| operator == "predictor");
        let taken: Vec<&str> = taken.map(|(.., rung)| rung.as_str()).collect();
        assert!(taken.len() >= 10 && taken.iter().all(|taken| *taken == rung), "{deadline}: {taken:?}");
        assert!(seen.steps_of("predictor").all(|(_, lasts)| lasts == Span::from_ms(lasts_ms)), "{deadline}");
        assert!(
            outcome.rungs.text().contains(&format!("predictor took {rung} ")),
            "{}",
            outcome.rungs.text()
        );
    }
}

#[test]
fn any_operator_runs_on_a_timer() {
    let every =
        ["operator.tracker.every_ms=70", "operator.predictor.every_ms=30", "execution.model=data_driven"];
    let (seen, _) = drive(&every, 4000, &mut []);
    for (operator, period_ms) in [("tracker", 70), ("predictor", 30)] {
        let starts: Vec<Time> = seen.steps_of(operator).map(|(start, _)| start).collect();
        let is_even = |two: &[Time]| two[1] - two[0] == Span::from_ms(period_ms);
        assert!(starts.len() > 50 && starts.windows(2).all(is_even), "{operator}");
    }
    // Frames come every 200 ms: no list of tracks is predicted twice.
    let predicted = seen.predicted;
    assert!((10..=20).contains(&predicted), "{predicted}");
}
