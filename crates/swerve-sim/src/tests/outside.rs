//! Road users of another simulator, which come and go.

use swerve_geom::{Obb, Pose2, Vector2};
use swerve_msg::truth::EgoTruth;
use swerve_msg::{ActorKind, Extent};
use swerve_world::{Movement, Other, Others, OthersError, World as _};

use super::*;

/// A car beside the road between two instants, a car on it from the start, and an error at an instant.
struct Passing {
    there_ms: [i64; 2],
    stands_at_m: f64,
    fails_ms: i64,
    shown: Vec<Other>,
}

impl Others for Passing {
    fn at(&mut self, to: Time, _: &EgoTruth, _: &Obb) -> Result<&[Other], OthersError> {
        if to >= Time::from_ms(self.fails_ms) {
            return Err(OthersError("the peer has ended".to_owned()));
        }
        let extent = Extent { length_m: 4.0, width_m: 1.8, height_m: 1.5 };
        let car = |id, x_m, y_m, velocity_mps| Other {
            id: ActorId(id),
            kind: ActorKind::Car,
            extent,
            movement: Movement { pose: Pose2::new(x_m, y_m, 0.0), velocity_mps },
        };
        self.shown.clear();
        let [from, until] = self.there_ms.map(Time::from_ms);
        if (from..until).contains(&to) {
            self.shown.push(car(7, 20.0 + 10.0 * to.as_secs(), 7.0, Vector2::new(10.0, 0.0)));
        }
        self.shown.push(car(9, self.stands_at_m, 0.0, Vector2::default()));
        Ok(&self.shown)
    }
}

const ROAD: &str = "name = \"x\"\n[road]\nsegments = [{ length_m = 300.0 }]\nleft_m = 9.0\n\
    [ego]\ntarget_speed_mps = 10.0\nend_m = 250.0\n\
    [[actor]]\nname = \"a\"\nkind = \"static\"\ns_m = 200.0\nd_m = 6.0\n\
    size = { length_m = 1.0, width_m = 1.0, height_m = 1.0 }\n";

fn among(there_ms: [i64; 2], stands_at_m: f64, fails_ms: i64) -> Simulator {
    let mut sim = exact(&scenario(ROAD), 200);
    let others = Passing { there_ms, stands_at_m, fails_ms, shown: Vec::new() };
    sim.set_others(Box::new(others), ActorId(7));
    sim
}

fn ids(state: &WorldState) -> Vec<u32> {
    state.actors.iter().map(|actor| actor.id.0).collect()
}

#[test]
fn road_users_of_another_simulator_come_move_and_go() {
    let mut sim = among([100, 1_000], 150.0, 60_000);
    assert_eq!(ids(sim.state()), [1]);
    sim.start().unwrap();
    assert_eq!(ids(sim.state()), [1, 9]);
    for k in 1..=400 {
        let state = sim.step(Command::default());
        let ms = 5 * k;
        let is_there = (100..1_000).contains(&ms);
        assert_eq!(ids(state), if is_there { vec![1, 7, 9] } else { vec![1, 9] }, "{ms} ms");
        if let Some(car) = state.actor(ActorId(7)) {
            let x_m = 20.0 + 0.001 * 10.0 * f64::from(ms);
            assert!((car.pose.x_m - x_m).abs() < 1e-12 && car.velocity_mps == Vector2::new(10.0, 0.0));
        }
        assert_eq!(state.actor(ActorId(9)).map(|car| car.pose.x_m), Some(150.0));
    }
}

#[test]
fn road_user_of_another_simulator_that_is_hit_is_moved_by_physics() {
    let mut sim = among([0, 0], 30.0, 60_000);
    sim.start().unwrap();
    let mut collisions = Vec::new();
    drive(
        &mut sim,
        |state| keep(state, 10.0),
        |state| collisions.extend(state.collisions.iter().map(|hit| hit.parties)),
    );
    assert_eq!(collisions, [[ActorId::EGO, ActorId(9)]]);
    let x_m = sim.state().actor(ActorId(9)).unwrap().pose.x_m;
    assert!(x_m > 31.0, "it is pushed from 30 m to {x_m} m");
}

#[test]
fn world_stands_still_once_another_simulator_has_failed() {
    let mut sim = among([0, 0], 150.0, 100);
    assert_eq!((sim.start(), sim.failure().is_none()), (Ok(()), true));
    sim.advance(Time::from_ms(500), &[]);
    assert_eq!(sim.state().stamp, Time::from_ms(95));
    assert_eq!(sim.failure(), Some(&OthersError("the peer has ended".to_owned())));
    let mut sim = among([0, 0], 150.0, 0);
    assert_eq!(sim.start(), Err(OthersError("the peer has ended".to_owned())));
}
