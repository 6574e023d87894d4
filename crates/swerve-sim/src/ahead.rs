//! Future poses of scripted actors, as far as they are determined.
//!
//! A triggered actor follows its script whatever the ego does, and one with a time trigger starts at that time. Not
//! determined are triggers by the ego or another actor, and motion after a collision: the former count as standing
//! until triggered, for the latter no pose is returned.

use swerve_core::{Span, Time};
use swerve_geom::Pose2;
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorId, Route};
use swerve_scenario::{Scenario, Trigger};
use swerve_vehicle::Shape;

use crate::SimParams;
use crate::rules::Rules;
use crate::script::Script;
use crate::trigger::Situation;

/// Distance from its scripted pose at which an actor counts as hit, metres.
const OFF_SCRIPT_M: f64 = 0.05;

/// Predicted motion of the actors of one run, based on the states observed so far.
#[derive(Clone, Debug)]
pub struct Ahead {
    shape: Shape,
    route: Route,
    rules: Rules,
    actors: Vec<Settled>,
    /// Stamp of the newest state observed.
    newest: Option<Time>,
}

/// Determined motion of one actor.
#[derive(Clone, Debug)]
struct Settled {
    script: Script,
    trigger: Option<Trigger>,
    /// Time at which it starts or started.
    set_off: Option<Time>,
    is_off_script: bool,
}

impl Ahead {
    /// Creates the predictor before the first step of a scenario, which is taken without further random draws.
    pub fn new(scenario: &Scenario, params: &SimParams) -> Self {
        let route = scenario.road.route();
        let settled = |actor: &swerve_scenario::Actor| {
            let script = Script::new(actor, route.line());
            let set_off = match actor.trigger {
                None => script.moves().then_some(Time::ZERO),
                Some(Trigger::Time { at_s }) => Some(first_step(Span::from_secs(at_s), params.dt)),
                Some(_) => None,
            };
            Settled { script, trigger: actor.trigger, set_off, is_off_script: false }
        };
        let actors = scenario.actors.iter().map(settled).collect();
        Self { shape: params.vehicle.shape, rules: Rules::new(scenario), actors, newest: None, route }
    }

    /// Observes a world state. All steps must be observed in order, or events are detected late. States that are not
    /// newer than the last one are ignored.
    pub fn watch(&mut self, world: &WorldState) {
        if self.newest.is_some_and(|newest| world.stamp <= newest) {
            return;
        }
        let center = self.shape.footprint(world.ego.state.pose).center;
        if self.newest.is_some() {
            self.rules.follow(&self.route, center.point());
        }
        self.newest = Some(world.stamp);
        let pose = |i: usize| world.actors.get(i).map_or_else(Pose2::default, |actor| actor.pose);
        let ego = (center, self.rules.s_m());
        let situation = Situation { now: world.stamp, route: &self.route, ego, actor: &pose };
        for (i, actor) in self.actors.iter_mut().enumerate().take(world.actors.len()) {
            let scripted = actor.pose(world.stamp, &self.route);
            actor.is_off_script |= scripted.point().distance(pose(i).point()) > OFF_SCRIPT_M;
            if actor.set_off.is_none() && situation.meets(actor.trigger, pose(i)) {
                actor.set_off = Some(world.stamp);
            }
        }
    }

    /// Pose of an actor at an instant, past or future; `None` if unknown.
    pub fn pose(&self, id: ActorId, at: Time) -> Option<Pose2> {
        let actor = self.actors.get(usize::try_from(id.0).ok()?.checked_sub(1)?)?;
        (!actor.is_off_script).then(|| actor.pose(at, &self.route))
    }

    /// Poses of all actors with a known pose at an instant.
    pub fn all_at(&self, at: Time) -> impl Iterator<Item = (ActorId, Pose2)> {
        let ids = (0..self.actors.len()).map(Scenario::id);
        ids.filter_map(move |id| Some((id, self.pose(id, at)?)))
    }
}

impl Settled {
    fn pose(&self, at: Time, route: &Route) -> Pose2 {
        let after = self.set_off.map(|set_off| (at - set_off).as_secs()).filter(|after_s| *after_s >= 0.0);
        self.script.at(after, route.line()).pose
    }
}

/// First simulation step that is not earlier.
fn first_step(after: Span, dt: Span) -> Time {
    let steps = after.ns().div_euclid(dt.ns()) + i64::from(after.ns().rem_euclid(dt.ns()) > 0);
    Time::ZERO + dt * steps.max(0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Simulator;
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
        let (mut told, mut set_off) = (Vec::new(), None);
        for step in 0..800 {
            let world = simulator.state().clone();
            ahead.watch(&world);
            if step % 40 == 0 {
                let at = world.stamp + Span::from_ms(1200);
                told.push((world.stamp, at, ahead.all_at(at).collect::<Vec<_>>()));
            }
            for (stamp, _, told) in told.iter().filter(|(_, at, _)| *at == world.stamp) {
                assert_eq!(told.len(), 4);
                for ((id, pose), actor) in told.iter().zip(&world.actors) {
                    let off_m = pose.point().distance(actor.pose.point());
                    // The third is not determined before the ego comes near.
                    let settled = id.0 != 3 || set_off.is_some_and(|set_off| set_off <= *stamp);
                    assert!(off_m < 1e-9 || !settled, "{id:?} told at {stamp}: {off_m} m off");
                }
            }
            if set_off.is_none() && ahead.actors[2].set_off.is_some() {
                set_off = Some(world.stamp);
            }
            simulator.step(Command::default());
        }
        assert!(set_off.is_some_and(|set_off| set_off > Time::from_ms(200)), "{set_off:?}");
        assert_eq!(ahead.actors[1].set_off, Some(Time::from_ms(1005)));
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
