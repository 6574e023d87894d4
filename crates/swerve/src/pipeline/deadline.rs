//! What the model of execution adds: the deadline policy, rungs that fit a deadline, detector and planner on timers.

use anyhow::anyhow;
use swerve_core::{Span, Time};
use swerve_flow::{
    Anchor, At, Context, Deadline, Every, Feedback, Graph, Latest, Operator, Port, RuntimeModel, Stream,
    Timer,
};
use swerve_msg::truth::Surroundings;
use swerve_msg::{Detections, EgoState, PredictionList, ResponseBudget, Route, RungTaken};
use swerve_perception::detector::Detector;
use swerve_perception::tracker;
use swerve_planning::deadline::{Overhead, Params, Situation, nearest_hazard, obstacles_near, respond};
use swerve_vehicle::VehicleParams;

use crate::config::Config;
use crate::config::model::{Model, Rung};

/// What a unit of work of an operator on a ladder lasts.
const UNIT_NS: i64 = 1000;

/// An operator on a ladder takes what its rung takes.
pub(super) fn on_ladder() -> RuntimeModel {
    RuntimeModel::Work { base: Span::ZERO, per_unit_ns: UNIT_NS as f64 }
}

/// The finest rung that is done by the deadline, the fastest where none is; its time is spent.
pub(super) fn take<'a, T>(rungs: &'a mut [Rung<T>], cx: &mut Context<'_>) -> (&'a mut T, RungTaken) {
    let left = cx.deadline().map(|deadline| deadline - cx.now());
    let fits = rungs.iter().rposition(|rung| left.is_none_or(|left| rung.run_time <= left)).unwrap_or(0);
    let Rung { name, run_time, what } = &mut rungs[fits];
    // In two parts: one that does not fit is not cut, it is late.
    let units = run_time.ns().unsigned_abs().div_ceil(UNIT_NS.unsigned_abs());
    cx.spend(units.saturating_sub(1));
    cx.spend(1);
    let taken = RungTaken { stamp: cx.stamp(), rung: name.clone(), run_time: *run_time, left };
    (what, taken)
}

/// Sets deadlines from frame to frame.
struct Policy {
    params: Params,
    overhead: Overhead,
    route: Route,
    vehicle: VehicleParams,
}

impl Policy {
    fn new(config: &Config, route: &Route) -> anyhow::Result<Self> {
        let wrong = |message| anyhow!("execution.params: {message}");
        let period_s = config.sensing.period_ms * 1e-3;
        let params = config.deadline_params().map_err(wrong)?;
        // What takes longer than a period makes the next frame wait.
        let params = Params {
            detector_max_s: params.detector_max_s.min(period_s).max(params.detector_min_s),
            planner_max_s: params.planner_max_s.min(period_s).max(params.planner_min_s),
            ..params
        };
        let seen_s = period_s + config.control.period_ms * 1e-3 + config.sim.vehicle.dead_time_s;
        let confirmed = frames_to_confirm(config)?.saturating_sub(1);
        let overhead = Overhead { seen_s, hidden_s: seen_s + confirmed as f64 * period_s };
        Ok(Self { params, overhead, route: route.clone(), vehicle: config.sim.vehicle.clone() })
    }
}

/// Frames until something that comes into sight is reported.
fn frames_to_confirm(config: &Config) -> anyhow::Result<usize> {
    let wrong = |(key, message): (&str, String)| anyhow!("perception.{key}: {message}");
    let Some(emulated) = config.perception.emulated().map_err(wrong)? else { return Ok(1) };
    let tracker: tracker::Params =
        config.perception.tracker(&emulated.params, config.prediction.past_steps).map_err(wrong)?;
    Ok(tracker.hits_min)
}

impl Operator for Policy {
    type In = (At<PredictionList>, Latest<EgoState>);
    type Out = (Port<ResponseBudget>, Port<Span>, Port<Span>);

    fn step(&mut self, cx: &mut Context<'_>, (predictions, ego): &Self::In, out: &mut Self::Out) {
        let Some(predictions) = predictions.get() else { return };
        let Some(ego) = ego.get().filter(|ego| ego.is_plausible()) else { return };
        let situation = Situation {
            now: cx.now(),
            ego,
            route: &self.route,
            shape: &self.vehicle.shape,
            limits: &self.vehicle.limits,
            predictions: &predictions.predictions,
        };
        let hazard = nearest_hazard(&self.params, &situation, self.overhead);
        let obstacles = obstacles_near(&self.params, &situation);
        let answer = respond(&self.params, hazard, self.overhead, obstacles);
        let (response, detector) = (Span::from_secs(answer.total_s), Span::from_secs(answer.detector_s));
        // What the detector left of it, or took beyond its part.
        let left = response - (cx.now() - predictions.stamp);
        let most = Span::from_secs(self.params.planner_max_s);
        let planner = left.min(most).max(Span::from_secs(self.params.planner_min_s));
        let budget = ResponseBudget {
            stamp: predictions.stamp,
            left_s: hazard.map(|hazard| hazard.left_s),
            hazard: hazard.map(|hazard| hazard.id),
            hidden: hazard.is_some_and(|hazard| hazard.hidden),
            obstacles: u32::try_from(obstacles).unwrap_or(u32::MAX),
            response,
            detector,
            planner,
        };
        out.0.send(budget);
        out.1.send(detector);
        out.2.send(planner);
    }
}

/// Adds the deadline policy where the model has one, and gives detector and planner their deadlines. The policy reads
/// what lies behind the detector, so that its word is for frames to come; the planner hears it at once.
///
/// Static deadlines count from a frame's arrival. Dynamic ones count from the start of its step: they become short
/// while a long step still runs, and the frame that waits for it is the one that matters; it is late then, but an answer
/// that is late is better than none.
pub(super) fn set_deadlines(
    graph: &mut Graph,
    config: &Config,
    (predictions, pose, route): (Stream<PredictionList>, Stream<EgoState>, &Route),
) -> anyhow::Result<Option<Deadline>> {
    let execution = &config.execution;
    let react = |deadline: Deadline| deadline.reaction(execution.reaction);
    let set = |graph: &mut Graph, deadline: Deadline| {
        if let Ok(detector) = graph.operator("detector") {
            let _configured = detector.deadline(react(deadline));
        }
    };
    match execution.model {
        Model::Periodic | Model::DataDriven => Ok(None),
        Model::StaticDeadlines => {
            let length = |name: &str| config.length_of(name).map_err(|m| anyhow!("execution.{name}_ms: {m}"));
            if let Some(detector) = length("detector")? {
                set(graph, Deadline::after(detector));
            }
            Ok(length("planner")?.map(|planner| react(Deadline::after(planner))))
        }
        Model::DynamicDeadlines => {
            let policy = Policy::new(config, route)?;
            let before = respond(&policy.params, None, policy.overhead, 0);
            let node = graph.add("deadlines", policy, (predictions, pose));
            let (_, detector, planner) = node.outputs(&["budget", "detector", "planner"]).out();
            let behind: Feedback<Span> = graph.feedback("detector deadline");
            graph.connect(behind, detector);
            let (before_detector, before_planner) =
                (Span::from_secs(before.detector_s), Span::from_secs(before.planner_s));
            set(graph, Deadline::from_policy(behind, before_detector).anchor(Anchor::Start));
            Ok(Some(react(Deadline::from_policy(planner, before_planner).anchor(Anchor::Start))))
        }
    }
}

/// The timer of an operator under the periodic model.
pub(super) fn own_timer(config: &Config, operator: &str) -> anyhow::Result<Option<Timer>> {
    let period = config.period_of(operator).map_err(|m| anyhow!("execution.{operator}_ms: {m}"))?;
    Ok(period.map(|period| super::timer(config, operator, period.as_ms())))
}

/// An emulated detector that takes the rung that fits.
pub(super) struct LadderDetector(pub(super) Vec<Rung<Detector>>);

impl Operator for LadderDetector {
    type In = (At<Surroundings>,);
    type Out = (Port<Detections>, Port<RungTaken>);

    fn step(&mut self, cx: &mut Context<'_>, (seen,): &Self::In, out: &mut Self::Out) {
        let Some(seen) = seen.get() else { return };
        let (detector, taken) = take(&mut self.0, cx);
        out.0.loan().send(detector.detect(seen));
        out.1.send(taken);
    }
}

/// An emulated detector that runs on a timer, on the newest frame there is; on none twice.
pub(super) struct PeriodicDetector {
    pub(super) detector: Detector,
    /// What it takes, where a ladder says that.
    pub(super) rung: Option<Rung<()>>,
    pub(super) last: Option<Time>,
}

impl Operator for PeriodicDetector {
    type In = (Every, Latest<Surroundings>);
    type Out = (Port<Detections>, Port<RungTaken>);

    fn step(&mut self, cx: &mut Context<'_>, (_, seen): &Self::In, out: &mut Self::Out) {
        let Some(seen) = seen.get().filter(|seen| self.last != Some(seen.stamp)) else { return };
        self.last = Some(seen.stamp);
        if let Some(rung) = &mut self.rung {
            let (_, taken) = take(core::slice::from_mut(rung), cx);
            out.1.send(taken);
        }
        out.0.loan().send(self.detector.detect(seen));
    }
}

#[cfg(test)]
mod tests {
    use std::path::{Path, PathBuf};

    use swerve_core::Digest;
    use swerve_flow::{Event, Observer};
    use swerve_log::{Log, Recorder};
    use swerve_msg::ActorKind;
    use swerve_text::{Document, parse_assignment};

    use super::super::Pipeline;
    use super::*;
    use crate::config::OPERATORS;
    use crate::replay::replay;
    use crate::run::{Outcome, drive_pipeline, read_scenario, run_start};

    fn file(name: &str) -> PathBuf {
        Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(name)
    }

    fn config(sets: &[&str]) -> Config {
        let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
        Config::from_document(&Document::read(&file("configs/deadlines.toml")).unwrap(), &sets).unwrap()
    }

    /// What became of deadlines.
    #[derive(Default)]
    struct Seen {
        /// Operator, stamp, rung.
        rungs: Vec<(String, Time, String)>,
        budgets: Vec<ResponseBudget>,
        /// Stamp of the frame, and publication.
        boxes: Vec<(Time, Time)>,
        /// Operator, start and run time of every step.
        steps: Vec<(String, Time, Span)>,
        /// When a person was tracked first.
        person_at: Option<Time>,
    }

    impl Seen {
        fn steps_of(&self, operator: &str) -> impl Iterator<Item = (Time, Span)> {
            self.steps
                .iter()
                .filter(move |(name, ..)| name == operator)
                .map(|&(_, start, lasts)| (start, lasts))
        }
    }

    impl Observer for Seen {
        fn event(&mut self, event: &Event<'_>) {
            match event {
                Event::StepEnd(step) => {
                    self.steps.push((step.operator.to_owned(), step.start, step.end - step.start));
                }
                Event::Publication(publication) => {
                    let Some(payload) = publication.payload.map(|payload| payload.as_any()) else { return };
                    if let Some(taken) = payload.downcast_ref::<RungTaken>() {
                        self.rungs.push((publication.operator.to_owned(), taken.stamp, taken.rung.clone()));
                    } else if let Some(budget) = payload.downcast_ref::<ResponseBudget>() {
                        self.budgets.push(*budget);
                    } else if let Some(boxes) = payload.downcast_ref::<Detections>() {
                        self.boxes.push((boxes.stamp, publication.visible_at));
                    } else if let Some(all) = payload.downcast_ref::<PredictionList>() {
                        let seen = all.predictions.iter().any(|p| p.kind == ActorKind::Pedestrian);
                        self.person_at = self.person_at.or(seen.then_some(publication.visible_at));
                    }
                }
                _ => {}
            }
        }
    }

    /// The first seconds past the truck at 12 m/s.
    fn drive(sets: &[&str], until_ms: i64, more: &mut [&mut dyn Observer]) -> (Seen, Outcome) {
        let config = config(&[&["ego.speed_mps=12"], sets].concat());
        let scenario = read_scenario(&file("scenarios/person_behind_truck.toml")).unwrap();
        let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
        pipeline.until = Time::from_ms(until_ms);
        let mut seen = Seen::default();
        let mut all: Vec<&mut dyn Observer> = vec![&mut seen];
        all.extend(more.iter_mut().map(|o| &mut **o as &mut dyn Observer));
        let outcome = drive_pipeline(pipeline, config.seed, 1, &mut all).unwrap();
        (seen, outcome)
    }

    #[test]
    fn under_dynamic_deadlines_accuracy_gives_way_where_somebody_may_step_out() {
        let (seen, outcome) = drive(&[], 12_000, &mut []);
        let person_at = seen.person_at.expect("the person was seen");
        let taken = |operator: &str, from: Time, to: Time| -> Vec<&str> {
            let rungs =
                seen.rungs.iter().filter(|(name, stamp, _)| name == operator && (from..to).contains(stamp));
            rungs.map(|(.., rung)| rung.as_str()).collect()
        };
        // With nothing but road ahead there is time; as much as a period of the sensor leaves.
        let early = (Time::ZERO, Time::from_ms(3000));
        assert!(taken("detector", early.0, early.1).iter().all(|rung| *rung == "efficientdet-d6@d3"));
        assert!(taken("planner", early.0, early.1).iter().all(|rung| *rung == "fot-148"));
        // In a hurry before the person is seen, because of the truck, and after.
        let late = (person_at - Span::from_ms(400), person_at + Span::from_ms(400));
        let (detectors, planners) = (taken("detector", late.0, late.1), taken("planner", late.0, late.1));
        assert!(
            detectors.len() >= 3 && detectors.iter().all(|rung| *rung == "efficientdet-d2@d3"),
            "{detectors:?}"
        );
        assert!(planners.len() >= 3 && planners.iter().all(|rung| *rung == "fot-30"), "{planners:?}");
        let hidden = seen.budgets.iter().any(|budget| budget.hidden && budget.stamp < person_at);
        let least = seen.budgets.iter().map(|budget| budget.response).min();
        assert!(hidden && least == Some(Span::from_ms(50)), "{least:?}");
        // What the log says of rungs is what they took, and the summary counts them.
        let counted: u64 = outcome.rungs.counts().iter().map(|count| count.steps).sum();
        assert_eq!(counted, seen.rungs.len() as u64);
        assert!(outcome.rungs.text().contains("planner took fot-30 "), "{}", outcome.rungs.text());
    }

    #[test]
    fn a_run_under_dynamic_deadlines_is_the_same_again_and_replays_bit_for_bit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("log.mcap");
        let config = config(&["ego.speed_mps=12"]);
        let scenario = file("scenarios/person_behind_truck.toml");
        let mut recorder = Recorder::create(&path, &run_start(&config, &scenario).unwrap()).unwrap();
        let digest = |more: &mut [&mut dyn Observer]| -> Digest { drive(&[], 10_500, more).1.digest };
        assert_eq!(digest(&mut [&mut recorder]), digest(&mut []));
        recorder.finish().unwrap();
        let log = Log::read(&path).unwrap();
        for cut in ["detector", "tracker", "deadlines", "planner"] {
            let cut = OPERATORS.iter().position(|operator| *operator == cut).unwrap();
            let comparison = replay(&log, cut, &[], 2).unwrap();
            assert!(comparison.is_same(), "from {}", OPERATORS[cut]);
        }
    }

    #[test]
    fn every_model_runs_the_detector_in_its_own_way() {
        let model = |sets: &[&str]| drive(sets, 2500, &mut []).0;
        let after = |seen: &Seen| -> Vec<f64> {
            let mut ms: Vec<f64> = seen.boxes.iter().map(|(stamp, at)| (*at - *stamp).as_ms()).collect();
            assert!(ms.len() >= 5, "{ms:?}");
            ms.sort_by(f64::total_cmp);
            ms
        };
        let all =
            |seen: &Seen, ms: f64| assert!(after(seen).iter().all(|after| *after == ms), "{:?}", after(seen));
        let d3 = "perception.detector=efficientdet-d3@d3";
        all(&model(&["execution.model=data_driven", d3]), 50.0);
        // The finest that fits.
        let fixed =
            ["execution.model=static_deadlines", "execution.detector_ms=99", "execution.planner_ms=40"];
        let seen = model(&fixed);
        all(&seen, 80.0);
        assert!(seen.steps_of("planner").all(|(_, lasts)| lasts == Span::from_ms(40)));
        all(&model(&["execution.model=dynamic_deadlines"]), 200.0);
        // A frame waits for the next tick of the detector's own timer.
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
    fn what_is_late_is_missed_and_counted() {
        let misses = |outcome: &Outcome, name: &str| {
            outcome.metrics.operators.iter().find(|operator| operator.operator == name).unwrap().misses
        };
        // One detector that is too slow for its deadline: every frame is answered by nothing.
        let fixed = ["execution.model=static_deadlines", "execution.detector_ms=99"];
        let keeps = ["perception.ladder=false", "perception.detector=efficientdet-d5@d3"];
        let (seen, outcome) = drive(&[&fixed[..], &keeps].concat(), 2500, &mut []);
        assert!(misses(&outcome, "detector") >= 10 && seen.boxes.is_empty());
        // With the ladder none is late.
        let (seen, outcome) = drive(&fixed, 2500, &mut []);
        assert!(misses(&outcome, "detector") == 0 && seen.boxes.len() >= 10);
        // Too slow, but now and then in time: the last result stands in for what is late.
        let sometimes =
            ["execution.reaction=reuse_last", "operator.detector.runtime={ cycle_ms = [50, 150] }"];
        let (seen, outcome) = drive(&[&fixed[..], &keeps, &sometimes].concat(), 2500, &mut []);
        let fresh = seen.boxes.windows(2).filter(|two| two[0].0 < two[1].0).count();
        assert!(misses(&outcome, "detector") >= 5 && fresh >= 5 && seen.boxes.len() > fresh + 4);
    }

    #[test]
    fn a_planner_off_the_ladder_stops_early_with_the_best_so_far() {
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
            let sets: Vec<_> = sets(model).iter().map(|set| parse_assignment(set).unwrap()).collect();
            let more = parse_assignment("execution.planner_ms=60").unwrap();
            let more = (model.ends_with("static_deadlines")).then_some(more);
            let sets: Vec<_> = sets.into_iter().chain(more).collect();
            let config = Config::from_document(&Document::parse("c", text).unwrap(), &sets).unwrap();
            let scenario = read_scenario(&file("scenarios/person_behind_truck.toml")).unwrap();
            let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
            pipeline.until = Time::from_ms(4000);
            let mut seen = Seen::default();
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
}
