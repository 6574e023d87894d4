use super::*;
use crate::verdict::tests::{actor, hit, world};
use swerve_geom::{Pose2, Vector2};
use swerve_msg::truth::Collision;
use swerve_msg::{Extent, Obstacle};

fn evaluation() -> Evaluation {
    Evaluation::new(Params {
        ego: Outline { length_m: 4.93, width_m: 1.86, center_ahead_m: 1.425 },
        dead_time: Span::ZERO,
        operators: vec!["planner".into()],
        actors: [(ActorId(1), "parked truck".into()), (ActorId(2), "person".into())].into(),
        route: None,
        lights: Vec::new(),
        norm: Norm::default(),
        tracks_boxes: false,
    })
}

fn seen(ms: i64, share: f64) -> ObstacleList {
    let person = Obstacle {
        id: ActorId(2),
        kind: ActorKind::Pedestrian,
        pose: Pose2::default(),
        extent: Extent::default(),
        velocity_mps: Vector2::new(0.0, 0.0),
        visible_share: share,
    };
    ObstacleList { stamp: Time::from_ms(ms), obstacles: vec![person] }
}

fn imu(ms: i64, y: f64) -> Imu {
    Imu { stamp: Time::from_ms(ms), accel_mps2: [0.0, y, 9.81], ..Imu::default() }
}

#[test]
fn collision_with_a_person_is_reported_in_full() {
    let mut e = evaluation();
    for k in 0..=40_i64 {
        let mut state = world(k * 50, k as f64);
        state.actors = vec![actor(2, ActorKind::Pedestrian, Pose2::new(42.89, 0.0, 0.0), 0.5, 0.5)];
        if k == 39 {
            state.collisions = vec![hit(1948, 2)];
        }
        state.ended = (k == 40).then_some(EndReason::Collision);
        e.world(&state);
        e.imu(&imu(k * 50, if k < 39 { 0.1 } else { 80.0 }));
        e.seen(&seen(k * 50, if k < 12 { 0.0 } else { 0.4 }));
    }
    e.plan(&Plan { stamp: Time::from_ms(650), status: PlanStatus::GaveUp, ..Plan::default() });
    e.command(Time::from_ms(2000), Some(Time::from_ms(1980)));
    e.world(&world(2005, 41.0));
    e.runtimes().step(0, Span::from_ms(25));
    let m = e.metrics();
    assert_eq!((m.verdict, m.end), (Verdict::Collision, Some(EndReason::Collision)));
    assert_eq!((m.min_distance_m, m.min_distance_at_s), (Some(0.0), Some(1.95)));
    assert_eq!((m.impact_speed_mps, m.impact.unwrap().actor), (Some(12.0), ActorId(2)));
    assert_eq!(m.lateral_jerk.raw_max_mps3, Some(0.0), "the crash is not the driving");
    assert_eq!(m.actors[0].first_sight_s, Some(0.6));
    assert_eq!((m.impact_name.as_deref(), m.actors[0].name.as_str()), (Some("person"), "person"));
    assert_eq!(m.response.unwrap().p50_ms, 25.0);
    assert_eq!((m.plans.counts.gave_up, m.operators[0].p99_ms), (1, 25.0));
    assert_eq!((m.drive.duration_s, m.drive.path_length_m), (2.005, 41.0));
}

#[test]
fn collision_of_others_is_counted_and_changes_nothing_else() {
    let drive = |of_others: bool| {
        let mut e = evaluation();
        for k in 0..=40_i64 {
            let mut state = world(k * 50, k as f64);
            state.ego.state.speed_mps = 20.0;
            let truck = actor(1, ActorKind::Truck, Pose2::new(60.0, 5.0, 0.0), 5.2, 2.6);
            let person = actor(2, ActorKind::Pedestrian, Pose2::new(60.0, 3.4, 0.0), 0.5, 0.5);
            state.actors = vec![truck, person];
            if of_others && (k == 10 || k == 30) {
                let (parties, speeds_mps) = ([ActorId(1), ActorId(2)], [0.0, 1.4]);
                state.collisions = vec![Collision { parties, speeds_mps, ..hit(k * 50, 2) }];
            }
            state.ended = (k == 40).then_some(EndReason::Goal);
            e.world(&state);
            e.imu(&imu(k * 50, (k % 7) as f64));
        }
        e.metrics()
    };
    let (mut with, without) = (drive(true), drive(false));
    assert_eq!((with.verdict, with.impact, with.collisions_of_others), (Verdict::Avoided, None, 2));
    let first = with.first_collision_of_others.take().unwrap();
    assert_eq!((first.at_s, first.words().as_str()), (0.5, "parked truck and person collided at 0.50 s"));
    with.collisions_of_others = 0;
    assert_eq!(with, without);
}

#[test]
fn time_at_rest_is_attributed_to_the_current_plan() {
    let mut e = evaluation();
    for k in 0..=10 {
        let mut state = world(100 * k, k as f64);
        state.ego.state.speed_mps = if k < 5 { 5.0 } else { 0.0 };
        e.world(&state);
        let status = if (3..7).contains(&k) { PlanStatus::PoseUncertain } else { PlanStatus::Comfortable };
        e.plan(&Plan { stamp: Time::from_ms(100 * k), status, ..Plan::default() });
    }
    // At rest from 0.4 s on; the plans of 0.4 to 0.6 s were current until 0.7 s.
    let PlanMetrics { stood_s, stood_uncertain_s, .. } = e.metrics().plans;
    assert!((stood_s - 0.6).abs() < 1e-9 && (stood_uncertain_s - 0.3).abs() < 1e-9);
}

#[test]
fn metrics_survive_serialization() {
    let mut e = evaluation();
    let mut state = world(0, 0.0);
    state.actors = vec![actor(1, ActorKind::Truck, Pose2::new(10.0, 4.0, 0.0), 5.2, 2.6)];
    e.world(&state);
    let text = serde_json::to_string_pretty(&e.metrics()).unwrap();
    assert_eq!(serde_json::from_str::<Metrics>(&text).unwrap(), e.metrics());
    assert!(text.contains("\"verdict\": \"unfinished\""), "{text}");
}

#[test]
fn leaving_the_road_without_a_pose_is_decided_by_the_gap() {
    let decided = |left_s: f64, until_s: Option<f64>| {
        let mut metrics = evaluation().metrics();
        metrics.verdict = Verdict::LeftRoad;
        metrics.left_road_at_s = Some(left_s);
        metrics.pose_gaps = vec![PoseGap { from_s: 3.6, until_s }];
        matches!(metrics.decided_by(), DecidedBy::LostPose(gap) if gap.from_s == 3.6)
    };
    for (left_s, until_s, is_lost) in [
        (3.5, Some(5.6), false),
        (4.0, Some(5.6), true),
        (9.5, Some(5.6), true),
        (9.7, Some(5.6), false),
        (9.7, None, true),
    ] {
        assert_eq!(decided(left_s, until_s), is_lost, "{left_s} {until_s:?}");
    }
}

#[test]
fn timeout_at_rest_for_the_pose_is_decided_by_the_pose() {
    let decided = |stood_s: f64, stood_uncertain_s: f64| {
        let mut metrics = evaluation().metrics();
        metrics.verdict = Verdict::Timeout;
        (metrics.plans.stood_s, metrics.plans.stood_uncertain_s) = (stood_s, stood_uncertain_s);
        metrics.decided_by() == DecidedBy::PoseDelay(stood_uncertain_s)
    };
    for (stood_s, uncertain_s, is_for_pose) in
        [(8.0, 6.0, true), (8.0, 3.9, false), (0.9, 0.9, false), (1.0, 1.0, true)]
    {
        assert_eq!(decided(stood_s, uncertain_s), is_for_pose, "{stood_s} {uncertain_s}");
    }
}

#[test]
fn run_without_actors_has_no_distance() {
    let mut e = evaluation();
    e.world(&world(0, 0.0));
    let m = e.metrics();
    assert_eq!((m.min_distance_m, m.response), (None, None));
    assert_eq!(m.decided_by(), DecidedBy::Nobody);
    let json = serde_json::to_string(&m).unwrap();
    assert!(["min_distance_m", "impact_speed_mps"].iter().all(|of| json.contains(&format!("\"{of}\":null"))));
}
