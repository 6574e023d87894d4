//! Drivers of other crates in the simulated world.

use std::sync::Arc;

use swerve_geom::Pose2;
use swerve_map::LaneId;
use swerve_world::{Driver, Movement, View, World};

use super::*;

/// Drives straight on at a speed that halves as long as the ego is within 20 m.
struct Wary {
    speed_mps: f64,
    now: Movement,
}

impl Driver for Wary {
    fn observe(&mut self, view: &View<'_>) {
        let own = view.world.actor(view.own).unwrap();
        let is_near = view.ego.center.point().distance(own.pose.point()) < 20.0;
        let speed_mps = if is_near { 0.5 * self.speed_mps } else { self.speed_mps };
        self.now = Movement { pose: own.pose, velocity_mps: own.pose.direction() * speed_mps };
    }

    fn movement(&self, from: Time, to: Time) -> Option<Movement> {
        let pose = self.now.pose.ahead(self.now.velocity_mps.norm() * (to - from).as_secs());
        Some(Movement { pose, ..self.now })
    }
}

const BESIDE: &str = "name = \"x\"\n[road]\nsegments = [{ length_m = 300.0 }]\nleft_m = 9.0\n\
    [ego]\ntarget_speed_mps = 10.0\nend_m = 250.0\n\
    [[actor]]\nname = \"a\"\nkind = \"car\"\ns_m = 60.0\nd_m = 6.0\n\
    [[actor]]\nname = \"b\"\nkind = \"static\"\ns_m = 200.0\nd_m = 6.0\n\
    size = { length_m = 1.0, width_m = 1.0, height_m = 1.0 }\n\
    [expect]\nverdict = \"avoided\"\nduration_s = { max = 60.0 }\n";

fn wary(speed_mps: f64) -> Box<Wary> {
    Box::new(Wary { speed_mps, now: Movement::at_rest(Pose2::default()) })
}

#[test]
fn driver_sees_the_ego_and_moves_its_actor() {
    let mut sim = exact(&scenario(BESIDE), 200);
    assert!(sim.set_driver(ActorId(1), wary(4.0)));
    let speeds = |sim: &mut Simulator, until_s: f64| {
        let mut seen = Vec::new();
        while sim.state().stamp < Time::from_ms((1000.0 * until_s) as i64) {
            let command = keep(sim.state(), 10.0);
            let before = sim.state().actors[0].pose.x_m;
            let until = sim.state().stamp + sim.params().dt;
            let actor = sim.advance(until, &[(ActorId::EGO, command)]).actors[0].clone();
            // The state holds the movement that the driver gave.
            assert!((actor.pose.x_m - before - actor.velocity_mps.norm() * 0.005).abs() < 1e-9);
            assert_eq!((actor.pose.y_m, actor.velocity_mps.y), (6.0, 0.0));
            seen.push(actor.velocity_mps.x);
        }
        seen
    };
    // The ego closes 60 m at 6 m/s: it is 20 m behind after 6.9 s, and beside it then.
    assert!(speeds(&mut sim, 6.0).iter().all(|&v| v == 4.0));
    assert!(speeds(&mut sim, 9.0)[300..].iter().all(|&v| v == 2.0));
    assert!(sim.state().collisions.is_empty());
}

/// Drives along the centre of its lane.
struct InLane {
    lane: Option<LaneId>,
    now: Movement,
}

impl Driver for InLane {
    fn observe(&mut self, view: &View<'_>) {
        let own = view.world.actor(view.own).unwrap().pose;
        let lane = *self.lane.get_or_insert_with(|| view.map.at(own.point()).next().unwrap().lane);
        let line = &view.map.lane(lane).unwrap().line;
        let pose = line.at(line.project(own.point()).s_m).pose;
        self.now = Movement { pose, velocity_mps: pose.direction() * 5.0 };
    }

    fn movement(&self, from: Time, to: Time) -> Option<Movement> {
        let pose = self.now.pose.ahead(5.0 * (to - from).as_secs());
        Some(Movement { pose, ..self.now })
    }
}

#[test]
fn driver_follows_a_lane_of_the_map_that_it_sees() {
    let bend = BESIDE.replace("{ length_m = 300.0 }", "{ length_m = 300.0, curvature_1pm = -0.01 }");
    let mut sim = exact(&scenario(&bend.replace("d_m = 6.0", "d_m = 4.5")), 200);
    let map = Arc::clone(sim.map());
    assert_eq!(*map, *sim.scenario().road.map());
    let start = sim.state().actors[0].pose;
    // An oncoming lane: the driver turns round and drives back along it.
    assert!(sim.set_driver(ActorId(1), Box::new(InLane { lane: None, now: Movement::at_rest(start) })));
    sim.advance(Time::from_ms(8000), &[(ActorId::EGO, Command::FULL_BRAKE)]);
    let end = sim.state().actors[0].pose;
    let place = map.at(end.point()).next().unwrap();
    assert_eq!(place.lane, map.at(start.point()).next().unwrap().lane);
    let on = map.lane(place.lane).unwrap().line.project(end.point());
    assert!(on.d_m.abs() < 0.02 && end.point().distance(start.point()) > 35.0, "{on:?} {start:?} {end:?}");
}

#[test]
fn actors_that_are_missing_or_never_move_have_no_driver() {
    let mut sim = exact(&scenario(BESIDE), 200);
    assert!(!sim.set_driver(ActorId(2), wary(1.0)) && !sim.set_driver(ActorId(9), wary(1.0)));
    assert!(!sim.set_driver(ActorId::EGO, wary(1.0)));
}

#[test]
fn world_takes_as_many_steps_as_reach_an_instant_under_the_command_in_force() {
    let (mut by_step, mut at_once) = (exact(&scenario(BESIDE), 200), exact(&scenario(BESIDE), 200));
    let brake = Command { steering_rad: 0.0, throttle: 0.0, brake: 0.4 };
    for _ in 0..40 {
        by_step.step(brake);
    }
    let broken = Command { throttle: f64::NAN, ..brake };
    at_once.advance(Time::from_ms(99), &[(ActorId::EGO, brake)]);
    assert_eq!(at_once.state().stamp, Time::from_ms(100));
    at_once.advance(Time::from_ms(150), &[]);
    at_once.advance(Time::from_ms(200), &[(ActorId::EGO, broken), (ActorId(7), Command::default())]);
    at_once.advance(Time::from_ms(120), &[(ActorId::EGO, Command::default())]);
    assert_eq!(digest_of(&[by_step.state()]), digest_of(&[at_once.state()]));
}
