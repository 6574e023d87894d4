//! Worlds with several egos.

use super::*;
use swerve_msg::truth::Collision;
use swerve_world::World;

const LEADER: ActorId = ActorId(2);

/// Two egos in one lane, the second 30 m ahead of the first; a person who steps out before the second.
fn convoy() -> Scenario {
    scenario(
        "name = \"x\"\n[road]\nsegments = [{ length_m = 300.0 }]\nleft_m = 6.0\n\
         [ego.rear]\ntarget_speed_mps = 10.0\nend_m = 150.0\n\
         [ego.leader]\ns_m = 30.0\nstart_speed_mps = 0.0\ntarget_speed_mps = 10.0\nend_m = 100.0\n\
         [[actor]]\nname = \"person\"\nkind = \"pedestrian\"\nsize = { radius_m = 0.25, height_m = 1.8 }\n\
         s_m = 60.0\nd_m = 5.0\ntrigger = { distance = { to = \"leader\", within_m = 12.0 } }\n\
         motion = [{ walk = { speed_mps = 1.0, distance_m = 2.0, direction = \"left\" } }]\n",
    )
}

/// Steps until every ego's scenario is over; returns all views of every step.
fn views(sim: &mut Simulator, speeds_mps: [f64; 2]) -> Vec<[WorldState; 2]> {
    let mut states = Vec::new();
    for _ in 0..10_000 {
        let both = [ActorId::EGO, LEADER].map(|id| sim.state_of(id).unwrap().clone());
        let is_over = both.iter().all(|view| view.ended.is_some());
        states.push(both);
        if is_over {
            return states;
        }
        let [rear, leader] = states.last().unwrap();
        let commands = [(ActorId::EGO, keep(rear, speeds_mps[0])), (LEADER, keep(leader, speeds_mps[1]))];
        let until = rear.stamp + sim.params().dt;
        sim.advance(until, &commands);
    }
    panic!("the scenario does not end");
}

#[test]
fn each_ego_sees_the_other_as_a_car_and_reaches_its_own_goal() {
    let mut sim = exact(&convoy(), 200);
    let states = views(&mut sim, [8.0, 10.0]);
    for [rear, leader] in &states {
        assert_eq!((rear.ego.id, leader.ego.id), (ActorId::EGO, LEADER));
        assert_eq!(rear.actors.iter().map(|actor| actor.id.0).collect::<Vec<_>>(), [1, 2]);
        assert_eq!(leader.actors.iter().map(|actor| actor.id.0).collect::<Vec<_>>(), [0, 1]);
        let seen = rear.actor(LEADER).unwrap();
        let own = sim.params().vehicle.shape.footprint(leader.ego.state.pose).center;
        assert_eq!((seen.pose, seen.kind), (own, swerve_msg::ActorKind::Car));
        assert_eq!(leader.actor(ActorId::EGO).unwrap().extent, seen.extent);
        assert_eq!(rear.actor(ActorId(1)), leader.actor(ActorId(1)), "the person is one for both");
    }
    let [rear, leader] = states.last().unwrap();
    assert_eq!((rear.ended, leader.ended), (Some(EndReason::Goal), Some(EndReason::Goal)));
    let goal = |k: usize| states.iter().position(|views| views[k].ended.is_some()).unwrap();
    assert_ne!(goal(0), goal(1), "each at its own time");
    let place = |k: usize| sim.params().vehicle.shape.footprint(states[goal(k)][k].ego.state.pose).center.x_m;
    assert!((place(0) - 150.0).abs() < 0.1 && (place(1) - 100.0).abs() < 0.1);
    assert!(rear.actor(ActorId(1)).unwrap().pose.y_m > 6.9, "the leader started the person");
}

#[test]
fn collision_of_two_egos_is_one_of_both() {
    let mut sim = exact(&convoy(), 200);
    let states = views(&mut sim, [12.0, 0.0]);
    let hits = |k: usize| -> Vec<Collision> {
        states.iter().flat_map(|views| views[k].collisions.clone()).collect()
    };
    let ([rear], [leader]) = (&hits(0)[..], &hits(1)[..]) else { panic!("one collision") };
    assert_eq!((rear.parties, leader.parties), ([ActorId::EGO, LEADER], [LEADER, ActorId::EGO]));
    assert_eq!(rear.speeds_mps, [leader.speeds_mps[1], leader.speeds_mps[0]]);
    assert!(rear.closing_speed_mps > 8.0 && rear.impulse_n_s > 1_000.0, "{rear:?}");
    let [last, pushed] = states.last().unwrap();
    assert_eq!((last.ended, pushed.ended), (Some(EndReason::Collision), Some(EndReason::Collision)));
    assert!(pushed.ego.state.pose.x_m > 31.0, "the car in front is pushed: {:?}", pushed.ego.state.pose);
}

#[test]
fn car_hit_by_another_ego_is_moved_by_physics_and_no_collision_of_the_first() {
    let text = "name = \"x\"\n[road]\nsegments = [{ length_m = 300.0 }]\nleft_m = 6.0\n\
                [ego.first]\ntarget_speed_mps = 5.0\nend_m = 40.0\n\
                [ego.second]\ns_m = 10.0\nd_m = 4.0\ntarget_speed_mps = 10.0\nend_m = 150.0\n\
                [[actor]]\nname = \"parked\"\nkind = \"car\"\nsize = { length_m = 4.0, width_m = 2.0, height_m = 1.5 }\n\
                s_m = 60.0\nd_m = 4.0\n";
    let mut sim = exact(&scenario(text), 200);
    let states = views(&mut sim, [5.0, 10.0]);
    let [first, second] = states.last().unwrap();
    assert_eq!((first.ended, second.ended), (Some(EndReason::Goal), Some(EndReason::Collision)));
    assert!(states.iter().all(|[first, _]| first.collisions_of_ego().next().is_none()));
    assert_eq!(states.iter().map(|[first, _]| first.collisions_of_others().count()).sum::<usize>(), 1);
    assert_eq!(states.iter().map(|[_, second]| second.collisions_of_ego().count()).sum::<usize>(), 1);
    assert!(second.actor(ActorId(1)).unwrap().pose.x_m > 61.0, "the parked car is pushed");
}
