mod pictures;

use std::path::{Path, PathBuf};

use swerve_drive::{Recording, RunInput, drive_pipeline, load, run_start, set_up};
use swerve_log::Recorder;

use super::ego_only::EgoOnly;
use super::*;

/// Runs a shipped scenario; returns its log and its metrics.
fn driven(folder: &Path, scenario: &str, set: &[&str]) -> (Logged, Metrics) {
    driven_with(folder, scenario, Vec::new(), set)
}

/// Same as [`driven`], with configuration files.
fn driven_with(folder: &Path, scenario: &str, config: Vec<PathBuf>, set: &[&str]) -> (Logged, Metrics) {
    let registry = Registry::standard();
    let input = RunInput {
        scenario: scenario.into(),
        config,
        set: set.iter().map(|&set| set.to_owned()).collect(),
        seed: None,
        allow_code: false,
    };
    let (config, scenario) = load(&registry, &input).unwrap();
    let pipeline = Pipeline::build(&config, &scenario).unwrap();
    let path = folder.join("log.mcap");
    let mut recorder = Recorder::create(&path, &run_start(&config, &scenario, &input.scenario)).unwrap();
    set_up(&mut recorder, &config, &pipeline);
    let mut recording = Recording::new(recorder, pipeline.clock, pipeline.graph.stop_handle());
    let outcome = drive_pipeline(pipeline, config.seed, 1, &mut [&mut recording]).unwrap();
    recording.finish().unwrap();
    (Logged::read(&path, &registry, None).unwrap(), outcome.metrics)
}

/// Metrics of a drive past one car, modified by `of`.
fn measured(of: impl Fn(&mut Metrics)) -> Metrics {
    let mut metrics = swerve_eval::Evaluation::new(swerve_eval::Params {
        ego: swerve_eval::Outline { length_m: 5.0, width_m: 2.0, center_ahead_m: 1.5 },
        dead_time: Span::ZERO,
        operators: Vec::new(),
        actors: [(ActorId(1), "lead".into())].into(),
        route: None,
        lights: Vec::new(),
        norm: swerve_eval::Norm::default(),
        tracks_boxes: false,
    })
    .metrics();
    metrics.actors = vec![ActorMetrics {
        actor: ActorId(1),
        name: "lead".into(),
        kind: swerve_msg::ActorKind::Car,
        min_distance_m: 0.7,
        min_distance_at_s: 4.0,
        first_sight_s: None,
        tracked_s: None,
        velocity_known_s: None,
    }];
    of(&mut metrics);
    metrics
}

fn words(of: impl Fn(&mut Metrics)) -> String {
    let metrics = measured(of);
    ending(&metrics, &metrics.actors[0])
}

#[test]
fn departure_comes_before_a_later_standstill() {
    let left = |metrics: &mut Metrics| {
        (metrics.verdict, metrics.left_road_at_s) = (Verdict::LeftRoad, Some(6.131));
    };
    assert_eq!(words(left), "it left the road at 6.13 s; it came within 0.70 m of lead");
    let stood = |metrics: &mut Metrics| {
        left(metrics);
        metrics.stands_before = Some(ActorId(1));
    };
    assert_eq!(words(stood), "it left the road at 6.13 s; later it stood before lead");
    let stopped = |metrics: &mut Metrics| {
        (metrics.verdict, metrics.stands_before) = (Verdict::Stopped, Some(ActorId(1)));
    };
    assert_eq!(words(stopped), "it stands before lead");
}

#[test]
fn stationary_ego_is_hit() {
    let hit = |ego_speed_mps: f64| {
        words(|metrics| {
            metrics.verdict = Verdict::Collision;
            let (actor, closing_speed_mps) = (ActorId(1), 4.2);
            let impact = Impact {
                actor,
                at_s: 5.0,
                ego_speed_mps,
                closing_speed_mps,
                impulse_n_s: 900.0,
                at_fault: true,
            };
            metrics.impact = Some(impact);
        })
    };
    assert_eq!(hit(5.26), "it hit lead at 5.00 s with 5.3 m/s");
    // The lead approaches from behind, or the other way round.
    let both = "it and lead collided at 5.00 s: it drove 3.3 m/s, closing at 4.2 m/s";
    assert_eq!(hit(3.26), both);
    for ego_speed_mps in [0.0, 0.05, -0.01] {
        assert_eq!(hit(ego_speed_mps), "lead hit it at 5.00 s with 4.2 m/s while it stood");
    }
}

#[test]
fn collision_of_others_is_named_at_the_end() {
    let metrics = measured(|metrics| {
        let names = ["lead", "truck"].map(str::to_owned);
        let first = swerve_eval::OthersImpact { names, at_s: 3.204, closing_speed_mps: 6.0 };
        (metrics.collisions_of_others, metrics.first_collision_of_others) = (1, Some(first));
    });
    let why = |metrics: &Metrics| {
        let why = Why::without_actor(Verdict::Completed, "it came to the end of its way".into(), &[]);
        with_collision_of_others(why, metrics).sentence
    };
    assert_eq!(why(&metrics), "it came to the end of its way; lead and truck collided at 3.20 s");
    assert_eq!(why(&measured(|_| {})), "it came to the end of its way");
}

/// The ego comes to a red light, waits up to 18 s, and turns.
#[test]
fn states_of_a_drive_to_a_red_light_are_measured_and_logged() {
    use swerve_msg::DrivingState::{ApproachLight, InJunction, WaitAtLight};
    let folder = tempfile::tempdir().unwrap();
    let (logged, metrics) = driven(folder.path(), "maps/light_red", &[]);
    let behaviour = metrics.behaviour.as_ref().unwrap();
    let first_s = |state| {
        let change = behaviour.changes.iter().find(|change| change.state == Some(state));
        change.unwrap_or_else(|| panic!("{state:?}: {:?}", behaviour.changes)).at_s
    };
    let [approaches_s, waits_s, turns_s] = [ApproachLight, WaitAtLight, InJunction].map(first_s);
    assert!(approaches_s < waits_s && waits_s < 18.0 && turns_s > 18.0, "{:?}", behaviour.changes);
    let all_s: f64 = behaviour.seconds.values().sum();
    let begin_s = behaviour.changes[0].at_s;
    assert!((begin_s + all_s - metrics.drive.duration_s).abs() < 1e-6, "{begin_s} {all_s}");
    assert_eq!(behaviour.stands_since_s, None);
    // The log has the same states.
    assert_eq!(logged.why(&metrics).unwrap(), logged.why_of(None, None).unwrap());
}

#[test]
fn states_because_of_the_actor_and_at_the_end_are_named() {
    use swerve_eval::{BehaviourMetrics, StateChange};
    use swerve_msg::DrivingState::{Cruise, Follow, GiveWay, WaitForGap};
    let sentence = |of: &dyn Fn(&mut Metrics)| {
        let metrics = measured(|metrics| {
            let change = |at_s, state, because: Option<&str>| StateChange {
                at_s,
                state: Some(state),
                because: because.map(str::to_owned),
            };
            let changes = vec![
                change(0.1, Cruise, None),
                change(2.0, Follow, Some("lead")),
                change(4.0, GiveWay, Some("lead")),
                change(6.25, WaitForGap, Some("van")),
            ];
            metrics.behaviour = Some(BehaviourMetrics { changes, ..BehaviourMetrics::default() });
            of(metrics);
        });
        states::with_states(
            Why::new("lead".into(), Verdict::Avoided, ("it passed", Until::End), &[]),
            &metrics,
        )
        .sentence
    };
    let without = Why::new("lead".into(), Verdict::Avoided, ("it passed", Until::End), &[]).sentence;
    let follows = "; the car follows lead from 2.00 s on";
    let of_lead = format!("{without}{follows}, gives way to lead from 4.00 s on");
    assert_eq!(sentence(&|_| {}), of_lead);
    let at_end = "; at the end the car waits for a gap, because of van, since 6.25 s";
    assert_eq!(sentence(&|metrics| metrics.verdict = Verdict::Timeout), format!("{of_lead}{at_end}"));
    let at_impact = sentence(&|metrics| {
        let (actor, at_s) = (ActorId(1), 3.0);
        let impact = Impact {
            actor,
            at_s,
            ego_speed_mps: 1.0,
            closing_speed_mps: 1.0,
            impulse_n_s: 1.0,
            at_fault: true,
        };
        metrics.impact = Some(impact);
    });
    assert_eq!(at_impact, format!("{without}{follows}; at the collision the car follows lead, since 2.00 s"));
    assert_eq!(sentence(&|metrics| metrics.behaviour = None), without);
}

/// On a slippery road the car leaves the road soon after 2 s without a new pose: the gap decides.
#[test]
fn departure_without_a_pose_names_the_gap() {
    let folder = tempfile::tempdir().unwrap();
    let road = "name = \"bend\"\n[road]\nsegments = [{ length_m = 100 }, { length_m = 180, curvature_1pm = 0.003 }, \
                { length_m = 120 }]\nlane_width_m = 3.5\n[ego]\ntarget_speed_mps = 25\nend_m = 360\n[end]\n\
                timeout_s = 45\n";
    let file = folder.path().join("bend.toml");
    std::fs::write(&file, road).unwrap();
    let fault = "fault.f={ stream=\"pose\", freeze_ms=2000, from_ms=3600, until_ms=3900 }";
    let slippery = "sim.vehicle.tyre.friction=0.3";
    let (logged, metrics) = driven(folder.path(), file.to_str().unwrap(), &[fault, slippery]);
    let why = logged.why(&metrics).unwrap();
    assert_eq!((&why.actor, why.verdict), (&None, Verdict::LeftRoad), "{}", why.text());
    assert!(why.sentence.contains("no new pose came from 3.60 to 5.60 s"), "{}", why.sentence);
    assert!(why.sentence.starts_with("it left the road at "), "{}", why.sentence);
    adds_up(&why);
    assert_eq!(logged.why_of(None, None).unwrap(), why, "the log alone is enough");
}

/// A pose too uncertain for the lane is also detected from the log alone.
#[test]
fn stop_for_an_uncertain_pose_is_known_from_the_log_alone() {
    let folder = tempfile::tempdir().unwrap();
    let city = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/urban_gnss.toml");
    let (logged, metrics) = driven_with(folder.path(), "lane", vec![city], &[]);
    let why = logged.why(&metrics).unwrap();
    assert!(why.sentence.contains("its pose was too uncertain for the lane"), "{}", why.sentence);
    assert_eq!(logged.why_of(None, None).unwrap(), why);
}

/// Checks that each step's waits add up to the time since the step before.
fn adds_up(why: &Why) {
    for pair in why.steps.windows(2) {
        let waited: f64 = pair[1].waited.iter().map(|wait| wait.ms).sum();
        let took = (pair[1].at_s - pair[0].at_s) * 1e3;
        assert!((waited - took).abs() < 1e-6 && pair[1].waited.iter().all(|w| w.ms > 0.0), "{why:?}");
    }
}

fn waited(why: &Why, what: Milestone, reason: &str) -> f64 {
    let step = why.steps.iter().find(|step| step.what == what).unwrap();
    step.waited.iter().filter(|wait| wait.reason == reason).map(|wait| wait.ms).sum()
}

#[test]
fn chain_accounts_for_the_wait_of_each_step() {
    use Milestone::{Commanded, Detected, Effect, Planned, Tracked, Visible};
    let cases: [(&str, &[&str], &str, &[Milestone]); 4] = [
        ("person_behind_truck", &[], "person", &[Visible, Tracked, Planned, Commanded, Effect]),
        (
            "person_behind_truck",
            &["operator.planner.runtime={fixed_ms=400}"],
            "person",
            &[Visible, Tracked, Planned, Commanded, Effect],
        ),
        (
            "person_behind_truck",
            &["planning.added_latency_ms=160", "perception.detector=\"efficientdet-d4@v100\""],
            "person",
            &[Visible, Detected, Tracked, Planned, Commanded, Effect],
        ),
        ("traffic_jam", &[], "motorcycle", &[Visible, Tracked, Planned, Commanded, Effect]),
    ];
    for (k, (scenario, set, actor, expected)) in cases.into_iter().enumerate() {
        let folder = tempfile::tempdir().unwrap();
        let (logged, metrics) = driven(folder.path(), scenario, set);
        let why = logged.why(&metrics).unwrap();
        println!("{}", why.text());
        assert_eq!((why.actor.as_deref(), why.verdict), (Some(actor), metrics.verdict), "{scenario} {set:?}");
        let steps: Vec<Milestone> = why.steps.iter().map(|step| step.what).collect();
        assert_eq!(steps, expected, "{scenario} {set:?}: {}", why.sentence);
        adds_up(&why);
        assert_eq!(logged.why_of(None, None).unwrap(), why.clone(), "the log alone is enough");
        match k {
            0 => assert!(waited(&why, Planned, "run time of planner") > 0.0),
            1 => assert_eq!(waited(&why, Planned, "run time of planner"), 400.0, "{}", why.text()),
            2 => {
                assert_eq!(waited(&why, Commanded, "delay of planner"), 160.0);
                assert!(waited(&why, Detected, "run time of detector") > 0.0);
            }
            _ => {}
        }
    }
}

/// Time attributed to missed deadlines is their cost: the same drive without a deadline plans earlier by that time.
#[test]
fn deadline_accounts_for_the_time_of_held_back_results() {
    const DEADLINE: [&str; 2] =
        ["operator.planner.deadline.ms=150", "operator.planner.deadline.reaction=reuse_last"];
    let run_time = ["operator.planner.runtime.fixed_ms=180"];
    let asked = |set: &[&str]| {
        let folder = tempfile::tempdir().unwrap();
        let (logged, metrics) = driven(folder.path(), "people_crossing", set);
        let why = logged.why(&metrics).unwrap();
        adds_up(&why);
        why
    };
    let planned_s = |why: &Why| {
        let planned = why.steps.iter().find(|step| step.what == Milestone::Planned);
        planned.unwrap().at_s
    };
    let (held_back, free) = (asked(&[&run_time[..], &DEADLINE].concat()), asked(&run_time));
    let later_ms = (planned_s(&held_back) - planned_s(&free)) * 1e3;
    let of = |why: &Why, reason| waited(why, Milestone::Planned, reason);
    assert!((later_ms - 110.0).abs() < 1e-6, "{later_ms}");
    assert!((of(&held_back, "deadline of planner") - later_ms).abs() < 1e-6, "{}", held_back.text());
    for reason in ["no difference to planner", "busy planner", "run time of planner"] {
        assert_eq!(of(&held_back, reason), of(&free, reason), "{reason}: {}", held_back.text());
    }
}

#[test]
fn any_actor_can_be_explained_and_an_unknown_name_gets_the_nearest() {
    let folder = tempfile::tempdir().unwrap();
    let (logged, metrics) = driven(folder.path(), "person_behind_truck", &[]);
    let names: Vec<&str> = metrics.actors.iter().map(|actor| actor.name.as_str()).collect();
    for name in names {
        let why = logged.why_of(Some(name), None).unwrap();
        assert_eq!(why.actor.as_deref(), Some(name));
        adds_up(&why);
    }
    let error = logged.why_of(Some("persn"), None).unwrap_err().to_string();
    assert!(error.contains("did you mean `person`?"), "{error}");
    let at = metrics.actors.iter().find(|actor| actor.name == "person").unwrap().min_distance_at_s;
    assert_eq!(logged.why_of(None, Some(at)).unwrap().actor.as_deref(), Some("person"));
    assert!(logged.why_of(None, Some(1e4)).is_err());
}

/// A slow planner's first plan that accounts for the person is published 0.36 s after the collision.
#[test]
fn chain_excludes_events_after_the_impact() {
    let folder = tempfile::tempdir().unwrap();
    let paper = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../configs/paper.toml");
    let set = ["planning.planner=hybrid_astar", "planning.discretisation=slow"];
    let (logged, metrics) = driven_with(folder.path(), "person_behind_truck", vec![paper], &set);
    let why = logged.why(&metrics).unwrap();
    let steps: Vec<Milestone> = why.steps.iter().map(|step| step.what).collect();
    assert_eq!(
        (why.verdict, &steps[..]),
        (Verdict::Collision, &[Milestone::Visible, Milestone::Tracked][..])
    );
    let missing = "; no plan had changed because of it before the collision";
    assert!(why.sentence.contains(missing), "{}", why.sentence);
    let impact_s = metrics.impact.unwrap().at_s;
    for actor in &metrics.actors {
        let why = logged.why_of(Some(&actor.name), None).unwrap();
        assert!(why.steps.iter().all(|step| step.at_s < impact_s), "{}", why.text());
    }
    assert_eq!(logged.why_of(None, None).unwrap(), why, "the log alone is enough");
}

/// A scenario, its settings, and the expected verdict, words and steps.
type Decided<'a> = (&'a str, &'a [&'a str], Verdict, &'a [&'a str], &'a [Milestone]);

#[test]
fn chain_without_a_deciding_actor_names_the_cause() {
    use Milestone::{Effect, End, GateStop, Standstill};
    let cases: [Decided<'_>; 2] = [
        (
            "person_behind_truck",
            &["gate.enabled=true", "gate.emergency_at_ms=2000"],
            Verdict::Stopped,
            &[
                "the safety gate stopped it from 2.00 s on (emergency stop)",
                "truck was nearest, 38.51 m away",
            ],
            &[GateStop, Effect, Standstill],
        ),
        (
            "traffic_light",
            &["sensing.traffic_lights=false"],
            Verdict::Completed,
            &["it came to the end of its way at 11.", "went over the stop line of crossing at 6.", "at red"],
            &[End],
        ),
    ];
    for (scenario, set, verdict, parts, expected) in cases {
        let folder = tempfile::tempdir().unwrap();
        let (logged, metrics) = driven(folder.path(), scenario, set);
        let why = logged.why(&metrics).unwrap();
        println!("{}", why.text());
        assert_eq!((&why.actor, why.verdict), (&None, verdict), "{scenario} {set:?}");
        assert!(parts.iter().all(|part| why.sentence.contains(part)), "{}", why.sentence);
        let steps: Vec<Milestone> = why.steps.iter().map(|step| step.what).collect();
        assert_eq!(steps, expected, "{}", why.sentence);
        adds_up(&why);
        assert_eq!(logged.why_of(None, None).unwrap(), why, "the log alone is enough");
    }
}

#[test]
fn truncated_log_is_explained_up_to_its_end() {
    let folder = tempfile::tempdir().unwrap();
    let (logged, _) = driven(folder.path(), "person_behind_truck", &[]);
    let whole = std::fs::read(folder.path().join("log.mcap")).unwrap();
    let cut = |bytes: usize| {
        let path = folder.path().join("cut.mcap");
        std::fs::write(&path, &whole[..bytes]).unwrap();
        Logged::read(&path, &Registry::standard(), None).unwrap().why_of(None, None).unwrap()
    };
    assert_eq!(cut(whole.len() - 1), logged.why_of(None, None).unwrap());
    for part in [3, 5, 8] {
        let why = cut(whole.len() * part / 10);
        assert_eq!(why.verdict, Verdict::Unfinished);
        assert!(
            why.sentence.starts_with("it was not over at ") && !why.sentence.contains("passed"),
            "{}",
            why.sentence
        );
    }
}

/// The effect is the first state that differs from a drive without the actor in the scenario. Neither a bend of the
/// road nor a stop by the gate is an effect.
#[test]
fn effect_is_the_first_deviation_from_a_drive_without_the_actor() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../scenarios");
    let cases: [(&str, &str, &[&str]); 4] = [
        ("person_behind_truck", "person", &[]),
        ("person_behind_truck", "person", &["gate.enabled=true", "gate.emergency_at_ms=4590"]),
        ("car_behind_truck", "car", &[]),
        ("street", "walker towards the ego", &["planning.planner=waypoint"]),
    ];
    for (scenario, actor, set) in cases {
        let folder = tempfile::tempdir().unwrap();
        let text = std::fs::read_to_string(root.join(scenario).with_extension("toml")).unwrap();
        let named = format!("name = \"{actor}\"");
        let is_kept = |part: &&str| !part.contains(&named);
        let alone: Vec<&str> = text.split("[[actor]]").filter(is_kept).collect();
        let alone = alone.join("[[actor]]");
        assert!(alone.len() < text.len(), "{scenario}");
        let file = folder.path().join(scenario).with_extension("toml");
        std::fs::write(&file, alone).unwrap();
        let (logged, metrics) = driven(folder.path(), scenario, set);
        let why = logged.why(&metrics).unwrap();
        let other = tempfile::tempdir().unwrap();
        let (without, _) = driven(other.path(), file.to_str().unwrap(), set);
        let states = |logged: &Logged| -> Vec<swerve_msg::EgoState> {
            let all = logged.log.publications("world");
            all.map(|p| p.decode::<EgoOnly>().unwrap().0.state).collect()
        };
        let until_s = metrics.impact.map_or(f64::INFINITY, |impact| impact.at_s);
        let (with, without) = (states(&logged), states(&without));
        let differs = |(a, b): &(&swerve_msg::EgoState, &swerve_msg::EgoState)| {
            a.stamp.as_secs() < until_s && unaware::drives_otherwise(a, b)
        };
        let first = with.iter().zip(&without).find(differs).map(|(a, _)| a.stamp.as_secs());
        let told = why.at_s(Milestone::Effect);
        let is_same = told.is_some() == first.is_some()
            && told.zip(first).is_none_or(|(told, first)| (told - first).abs() < 1e-6);
        assert!(is_same, "{scenario} {set:?}, {first:?}: {}", why.text());
        if first.is_none() {
            assert!(why.sentence.contains("; no effect found"), "{}", why.sentence);
        }
    }
}
