//! Future poses of scripted actors, as far as they are determined.
//!
//! A triggered actor follows its script whatever the ego does, and one with a time trigger starts at that time. Not
//! determined are triggers by the ego or another actor, and motion after a collision: the former count as standing
//! until triggered, for the latter no pose is returned.

use std::sync::Arc;

use swerve_core::Time;
use swerve_geom::Pose2;
use swerve_map::Map;
use swerve_msg::ActorId;
use swerve_msg::truth::WorldState;
use swerve_scenario::Scenario;
use swerve_vehicle::Shape;
use swerve_world::{Driver, View};

use crate::SimParams;
use crate::scripted::Scripted;
use crate::traffic::is_of_traffic;

/// Distance from its scripted pose at which an actor counts as hit, metres.
const OFF_SCRIPT_M: f64 = 0.05;

/// Predicted motion of the actors of one run, based on the states observed so far.
#[derive(Clone, Debug)]
pub struct Ahead {
    shape: Shape,
    map: Arc<Map>,
    actors: Vec<Settled>,
    /// Stamp of the newest state observed.
    newest: Option<Time>,
}

/// Determined motion of one actor.
#[derive(Clone, Debug)]
struct Settled {
    id: ActorId,
    driver: Scripted,
    is_off_script: bool,
}

impl Ahead {
    /// Creates the predictor before the first step of a scenario, which is taken without further random draws.
    pub fn new(scenario: &Scenario, params: &SimParams) -> Self {
        let line = Arc::new(scenario.road.line());
        let settled = |actor| Settled {
            driver: Scripted::new(actor, scenario, &line, params.dt),
            id: actor.id,
            is_off_script: false,
        };
        let scripted = scenario.actors.iter().filter(|actor| !is_of_traffic(scenario, actor.id));
        let actors = scripted.map(settled).collect();
        Self { shape: params.vehicle.shape, map: scenario.road.map(), actors, newest: None }
    }

    /// Observes a world state. All steps must be observed in order, or events are detected late. States that are not
    /// newer than the last one are ignored.
    pub fn watch(&mut self, world: &WorldState) {
        if self.newest.is_some_and(|newest| world.stamp <= newest) {
            return;
        }
        self.newest = Some(world.stamp);
        let ego = self.shape.footprint(world.ego.state.pose);
        for actor in &mut self.actors {
            let view = View { own: actor.id, world, ego, map: &self.map };
            let Some(seen) = world.actor(actor.id) else { continue };
            let off_m = actor.pose(world.stamp).point().distance(seen.pose.point());
            actor.is_off_script |= off_m > OFF_SCRIPT_M;
            actor.driver.observe(&view);
        }
    }

    /// Pose of an actor at an instant, past or future; `None` if unknown.
    pub fn pose(&self, id: ActorId, at: Time) -> Option<Pose2> {
        let actor = &self.actors[self.actors.binary_search_by_key(&id, |actor| actor.id).ok()?];
        (!actor.is_off_script).then(|| actor.pose(at))
    }

    /// Poses of all actors with a known pose at an instant.
    pub fn all_at(&self, at: Time) -> impl Iterator<Item = (ActorId, Pose2)> {
        self.actors.iter().filter_map(move |actor| Some((actor.id, self.pose(actor.id, at)?)))
    }
}

impl Settled {
    fn pose(&self, at: Time) -> Pose2 {
        self.driver.at(at, self.driver.sets_off()).pose
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Simulator;
    use swerve_core::Span;
    use swerve_msg::Command;

    /// One actor starts at once, one at 1.003 s, one when the ego is near, one never.
    const TEXT: &str = "name = \"x\"\n[road]\nsegments = [{ length_m = 200.0 }]\nleft_m = 9.0\n\
        [ego]\ntarget_speed_mps = 8.0\nstart_speed_mps = 8.0\nend_m = 150.0\n\
        [[actor]]\nname = \"a\"\nkind = \"car\"\ns_m = 60.0\nd_m = 6.0\n\
        motion = [{ wait = { for_s = 0.7 } }, { drive = { speeds = [[0.0, 5.0], [4.0, 0.0]] } }]\n\
        [[actor]]\nname = \"b\"\nkind = \"pedestrian\"\ns_m = 80.0\nd_m = 8.0\ntrigger = { time = { at_s = 1.003 } }\n\
        motion = [{ walk = { speed_mps = 1.5, distance_m = 5.0, direction = \"right\" } }]\n\
        [[actor]]\nname = \"c\"\nkind = \"pedestrian\"\ns_m = 50.0\nd_m = 8.0\n\
        trigger = { distance = { to = \"ego\", within_m = 40.0 } }\n\
        motion = [{ walk = { speed_mps = 1.2, distance_m = 3.0, direction = \"ahead\" } }]\n\
        [[actor]]\nname = \"d\"\nkind = \"car\"\ns_m = 120.0\nd_m = 6.0\n\
        [expect]\nverdict = \"avoided\"\nduration_s = { max = 60.0 }\n";

    #[test]
    fn predicted_poses_match_the_simulation_once_determined() {
        let scenario = Scenario::parse("x.toml", TEXT).unwrap_or_else(|p| panic!("{p:#?}"));
        let params = SimParams::default();
        let mut simulator = Simulator::exact(scenario.clone(), &params).unwrap();
        let mut ahead = Ahead::new(&scenario, &params);
        let (mut predicted, mut set_off) = (Vec::new(), None);
        for step in 0..800 {
            let world = simulator.state().clone();
            ahead.watch(&world);
            if step % 40 == 0 {
                let at = world.stamp + Span::from_ms(1200);
                predicted.push((world.stamp, at, ahead.all_at(at).collect::<Vec<_>>()));
            }
            for (stamp, _, poses) in predicted.iter().filter(|(_, at, _)| *at == world.stamp) {
                assert_eq!(poses.len(), 4);
                for ((id, pose), actor) in poses.iter().zip(&world.actors) {
                    let off_m = pose.point().distance(actor.pose.point());
                    // The third is not determined before the ego comes near.
                    let settled = id.0 != 3 || set_off.is_some_and(|set_off| set_off <= *stamp);
                    assert!(off_m < 1e-9 || !settled, "{id:?} predicted at {stamp}: {off_m} m off");
                }
            }
            if set_off.is_none() && ahead.actors[2].driver.sets_off().is_some() {
                set_off = Some(world.stamp);
            }
            simulator.step(Command::default());
        }
        assert!(set_off.is_some_and(|set_off| set_off > Time::from_ms(200)), "{set_off:?}");
        assert_eq!(ahead.actors[1].driver.sets_off(), Some(Time::from_ms(1005)));
    }

    #[test]
    fn hit_actor_has_no_prediction_and_old_states_are_ignored() {
        let scenario = Scenario::parse("x.toml", TEXT).unwrap_or_else(|p| panic!("{p:#?}"));
        let params = SimParams::default();
        let simulator = Simulator::exact(scenario.clone(), &params).unwrap();
        let mut ahead = Ahead::new(&scenario, &params);
        let mut world = simulator.state().clone();
        ahead.watch(&world);
        world.actors[3].pose.x_m += 1.0;
        ahead.watch(&world);
        assert!(ahead.pose(ActorId(4), world.stamp).is_some(), "no newer than the first");
        world.stamp += params.dt;
        ahead.watch(&world);
        assert_eq!(ahead.pose(ActorId(4), world.stamp), None);
        assert_eq!(ahead.all_at(world.stamp).count(), 3);
        for id in [0, 5, u32::MAX] {
            assert_eq!(ahead.pose(ActorId(id), world.stamp), None);
        }
    }
}
