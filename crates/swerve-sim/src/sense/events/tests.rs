use swerve_core::Time;
use swerve_geom::Pose2;
use swerve_msg::truth::{Collision, InfractionKind};
use swerve_msg::{ActorId, ActorKind, Command, RoadLine};
use swerve_scenario::{Course, SignalProgram};

use super::*;
use crate::sense::tests::{actor, person, world};
use crate::tests::{PERSON_BEHIND_TRUCK, drive, exact, keep, scenario};

const RIGHT: RoadLine = RoadLine::RightEdge;
const MIDDLE: RoadLine = RoadLine::LaneLeft;
const LEFT: RoadLine = RoadLine::LeftEdge;

/// A straight road of 220 m: edges at -2 and 6 m, the lane border at 2 m.
fn road() -> Road {
    scenario(PERSON_BEHIND_TRUCK).road
}

/// World with the ego's rear axle at (x, y).
fn at(stamp: Time, x_m: f64, y_m: f64) -> WorldState {
    let mut world = WorldState { stamp, ..world(Vec::new()) };
    world.ego.state.pose = Pose2::new(x_m, y_m, 0.0);
    world
}

/// Messages of the line sensor of a car 1.86 m wide that moves through these offsets.
fn crossed(offsets: &[f64]) -> Vec<(usize, RoadLine, Side)> {
    let mut sensor = LaneInvasionSensor::new(&road(), Shape::default());
    let mut found = Vec::new();
    for (k, d) in offsets.iter().enumerate() {
        let message = sensor.sense(&at(Time::from_ms(5 * k as i64), 20.0 + 0.1 * k as f64, *d));
        assert_eq!(message.stamp, Time::from_ms(5 * k as i64), "a message for every step");
        found.extend(message.events.iter().map(|event| (k, event.line, event.side)));
    }
    found
}

#[test]
fn lines_are_crossed_to_the_left_and_to_the_right() {
    // The left side is 0.93 m left of the centre: on the line at 2 m with the centre at 1.07 m.
    assert_eq!(crossed(&[0.0, 1.0, 1.06, 1.08, 1.5]), [(3, MIDDLE, Side::Left)]);
    assert_eq!(crossed(&[0.0, -1.06, -1.08]), [(2, RIGHT, Side::Right)]);
    assert_eq!(crossed(&[4.0, 2.94, 2.92]), [(2, MIDDLE, Side::Right)]);
    assert_eq!(crossed(&[4.0, 5.0, 5.08]), [(2, LEFT, Side::Left)]);
    // Over and back are two events if the line was left in between.
    let there_and_back = [0.0, 1.5, 3.5, 2.5, 0.5];
    assert_eq!(crossed(&there_and_back), [(1, MIDDLE, Side::Left), (3, MIDDLE, Side::Right)]);
}

#[test]
fn driving_along_a_line_is_one_event_and_starting_on_it_is_none() {
    assert_eq!(crossed(&[1.0, 1.08, 1.06, 1.08, 1.0, 1.08]), [(1, MIDDLE, Side::Left)]);
    assert_eq!(crossed(&[1.0, 1.08, 0.96, 1.08]), [(1, MIDDLE, Side::Left), (3, MIDDLE, Side::Left)]);
    assert_eq!(crossed(&[2.0, 2.1, 2.0]), []);
}

#[test]
fn jump_over_a_line_is_reported() {
    assert_eq!(crossed(&[0.0, 4.0]), [(1, MIDDLE, Side::Left)]);
    assert_eq!(crossed(&[0.0, 9.0]), [(1, MIDDLE, Side::Left), (1, LEFT, Side::Left)]);
}

#[test]
fn position_along_the_road_and_line_are_reported() {
    let mut sensor = LaneInvasionSensor::new(&road(), Shape::default());
    sensor.sense(&at(Time::ZERO, 30.0, 0.0));
    let message = sensor.sense(&at(Time::from_ms(5), 30.1, 1.2));
    let event = message.events[0];
    assert_eq!(event.line_d_m, 2.0);
    assert!((event.s_m - 30.1 - Shape::default().center_ahead_m()).abs() < 1e-9, "{event:?}");
}

#[test]
fn side_midpoints_count_on_a_bend() {
    let bend = swerve_scenario::Segment { length_m: 100.0, curvature_1pm: 0.05 };
    let mut road = road();
    let Course::Strip(strip) = &mut road.course else { panic!("it is a map") };
    strip.segments = vec![bend];
    let (line, shape) = (road.line(), Shape::default());
    // On a left circle of 20 m, the midpoint of the left side is 0.93 m left of the centre; the corners are at a radius
    // of hypot(20 - 0.93, 2.465) and so closer to the centre line.
    let mut sensor = LaneInvasionSensor::new(&road, shape);
    let mut say = |d_m: f64| {
        let center = line.to_map(FrenetPoint { s_m: 50.0, d_m });
        let mut world = world(Vec::new());
        let pose = Pose2::new(center.x_m, center.y_m, line.at(50.0).pose.heading_rad);
        world.ego.state.pose = pose.ahead(-shape.center_ahead_m());
        sensor.sense(&world).events.len()
    };
    assert_eq!((say(0.0), say(1.03), say(1.10)), (0, 0, 1));
}

#[test]
fn driving_off_the_road_crosses_its_lines_and_is_then_an_infraction() {
    let mut sim = exact(&scenario(PERSON_BEHIND_TRUCK), 200);
    let mut sensor = LaneInvasionSensor::new(&sim.scenario().road, sim.params().vehicle.shape);
    let (mut lines, mut left_road) = (Vec::new(), None);
    sensor.sense(sim.state());
    while sim.state().stamp < Time::from_ms(4000) && left_road.is_none() {
        let command = Command { steering_rad: -0.02, ..keep(sim.state(), 15.0) };
        let state = sim.step(command).clone();
        lines.extend(sensor.sense(&state).events.iter().map(|event| (state.stamp, event.line, event.side)));
        left_road = state.infractions.first().map(|i| (i.stamp, i.kind));
    }
    let (stamp, kind) = left_road.unwrap();
    assert_eq!((kind, lines), (InfractionKind::LeftRoad, vec![(stamp, RIGHT, Side::Right)]));
}

fn light(green_s: f64, yellow_s: f64, red_s: f64) -> Road {
    let light = TrafficLight {
        name: "light".into(),
        pose: Pose2::new(52.0, -3.0, 0.0),
        stop_s_m: Some(50.0),
        signal: None,
        program: SignalProgram::green_yellow_red([green_s, yellow_s, red_s], 0.0),
    };
    Road { lights: vec![light], ..road() }
}

/// Events of a front, 3.89 m ahead of the rear axle, at these positions along the road, one every 10 ms from `start`.
fn passed(road: &Road, start: Time, fronts: &[f64]) -> Vec<RedLightEvent> {
    let mut sensor = RedLightSensor::new(road, Shape::default());
    let ahead_m = Shape::default().length_m - Shape::default().rear_overhang_m;
    let mut found = Vec::new();
    for (k, s) in fronts.iter().enumerate() {
        let stamp = start + Span::from_ms(10) * k as i64;
        let message = sensor.sense(&at(stamp, s - ahead_m, 0.0));
        assert_eq!(message.stamp, stamp, "a message for every step");
        found.extend(message.events);
    }
    found
}

#[test]
fn red_light_counts_from_the_instant_it_is_red() {
    // The front passes the line in the middle of the 10 ms: at 12 s + 5 ms.
    let over = [49.75, 50.25];
    let start = Time::from_ms(12_000);
    let red_from = |s: f64| passed(&light(8.0, s - 8.0, 10.0), start, &over);
    assert_eq!(red_from(12.005_000_1), [], "yellow still, for 100 ns");
    let event = red_from(12.005)[0];
    assert_eq!((event.light, event.stop_s_m, event.passed), (0, 50.0, Time::from_ms(12_005)));
    assert!((event.red_for_s, (event.speed_mps - 50.0).abs() < 1e-6) == (0.0, true), "{event:?}");
    assert!((red_from(11.0)[0].red_for_s - 1.005).abs() < 1e-9);
    // Green again from 12.005 s on, and not before.
    let green_from = |s: f64| passed(&light(1.0, 1.0, s - 2.0), start, &over).len();
    assert_eq!((green_from(12.005), green_from(12.005_000_1)), (0, 1));
}

#[test]
fn waiting_car_causes_no_event_and_a_passing_one_causes_one() {
    let road = light(1.0, 1.0, 1000.0);
    let start = Time::from_ms(5000);
    assert_eq!(passed(&road, start, &[49.0, 49.9, 49.99, 49.99]), []);
    assert_eq!(passed(&road, start, &[49.0, 50.0, 50.5, 51.0]).len(), 1, "on the line is over it");
    assert_eq!(passed(&road, start, &[50.0, 50.5, 60.0]), [], "it started beyond");
    assert_eq!(passed(&road, start, &[49.9, 50.1, 49.8, 50.1]).len(), 1, "it rocks on the line");
    assert_eq!(passed(&road, start, &[49.9, 50.1, 49.4, 50.1]).len(), 2, "it went back and came again");
    assert_eq!(passed(&road, Time::from_ms(500), &[49.0, 50.5]), [], "green");
}

#[test]
fn each_light_of_a_road_is_judged_separately() {
    let mut road = light(1.0, 1.0, 1000.0);
    let first = &road.lights[0];
    let mut program = first.program.clone();
    program.phases[0].duration_s = 900.0;
    let second = TrafficLight { name: "second".into(), stop_s_m: Some(50.2), program, ..first.clone() };
    let third = TrafficLight { name: "third".into(), stop_s_m: Some(50.4), ..first.clone() };
    road.lights.extend([second, third]);
    let lights: Vec<u32> =
        passed(&road, Time::from_ms(5000), &[49.0, 51.0]).iter().map(|e| e.light).collect();
    assert_eq!(lights, [0, 2]);
}

#[test]
fn simulated_car_runs_a_red_light_at_the_expected_time() {
    let text = PERSON_BEHIND_TRUCK.replacen(
        "\n[ego]",
        "\n[[road.light]]\nname = \"early\"\nstop_s_m = 40.0\ngreen_s = 1.0\nyellow_s = 0.5\nred_s = 60.0\n\n[ego]",
        1,
    );
    let mut sim = exact(&scenario(&text), 200);
    let shape = sim.params().vehicle.shape;
    let speed_mps = sim.state().ego.state.speed_mps;
    let mut sensor = RedLightSensor::new(&sim.scenario().road, shape);
    sensor.sense(sim.state());
    let (mut events, mut messages) = (Vec::new(), 0);
    while sim.state().stamp < Time::from_ms(3500) {
        let command = keep(sim.state(), speed_mps);
        let message = sensor.sense(sim.step(command));
        messages += 1;
        events.extend(message.events);
    }
    // The front starts half a car's length ahead of s = 0.
    let want_s = (40.0 - 0.5 * shape.length_m) / speed_mps;
    assert_eq!((messages, events.len()), (700, 1));
    assert!((events[0].passed.as_secs() - want_s).abs() < 0.02, "{events:?} {want_s}");
    assert!((events[0].red_for_s - (want_s - 1.5)).abs() < 0.02, "{events:?} {want_s}");
}

#[test]
fn collisions_are_reported_with_the_actor_hit() {
    let mut world = world(vec![actor(4, ActorKind::Car, 9.0, 0.0, [4.0, 2.0, 1.5]), person(7, 3.0, 1.0)]);
    assert_eq!(collisions(&world), CollisionEvents { stamp: world.stamp, events: Vec::new() });
    let hit = |id: u32, impulse_n_s: f64| Collision {
        stamp: Time::from_ms(500),
        parties: [ActorId::EGO, ActorId(id)],
        impulse_n_s,
        closing_speed_mps: 3.5,
        speeds_mps: [9.0, 0.0],
    };
    let of_others = Collision { parties: [ActorId(4), ActorId(7)], ..hit(4, 50.0) };
    world.collisions = vec![hit(7, 300.0), of_others, hit(4, 9000.0)];
    let message: Vec<_> = collisions(&world)
        .events
        .iter()
        .map(|e| (e.actor.0, e.kind, e.impulse_n_s, e.closing_speed_mps))
        .collect();
    assert_eq!(message, [(4, ActorKind::Car, 9000.0, 3.5), (7, ActorKind::Pedestrian, 300.0, 3.5)]);
}

#[test]
fn simulated_collision_is_one_event() {
    let mut sim = exact(&scenario(PERSON_BEHIND_TRUCK), 200);
    let speed_mps = sim.state().ego.state.speed_mps;
    let (mut events, mut last) = (Vec::new(), Time::ZERO);
    drive(
        &mut sim,
        |state| keep(state, speed_mps),
        |state| {
            let message = collisions(state);
            assert!(message.stamp > last);
            last = message.stamp;
            events.extend(message.events);
        },
    );
    assert_eq!(events.len(), 1, "{events:?}");
    assert_eq!((events[0].actor, events[0].kind), (ActorId(2), ActorKind::Pedestrian));
    assert!(events[0].impulse_n_s > 100.0 && events[0].closing_speed_mps > 1.0, "{events:?}");
}
