//! Actors that no sensor sees, `sensing.unseen`: a car that is blind to them, as a baseline.

use std::borrow::Cow;

use swerve_msg::ActorId;
use swerve_msg::truth::WorldState;
use swerve_scenario::Scenario;
use swerve_text::{did_you_mean, list};

use crate::config::SensingConfig;

/// Actors that the sensors of an ego do not see. Every sensor of other road users takes the world from
/// [`seen`](Self::seen).
pub(crate) struct Unseen(Vec<ActorId>);

impl Unseen {
    /// Looks up the names of `sensing.unseen` in a scenario.
    ///
    /// # Errors
    /// A name is not that of an actor, nor of another ego.
    pub(crate) fn new(sensing: &SensingConfig, scenario: &Scenario) -> anyhow::Result<Self> {
        let actors = scenario.actors.iter().map(|actor| (actor.id, actor.name.as_str()));
        // Every ego of several is an actor to the others, which have the same configuration.
        let egos = if scenario.other_egos.is_empty() { Vec::new() } else { scenario.egos() };
        let known: Vec<(ActorId, &str)> = actors.chain(egos).collect();
        let id_of = |name: &String| {
            let found = known.iter().find(|(_, known)| known == name).map(|(id, _)| *id);
            found.ok_or_else(|| anyhow::anyhow!("sensing.unseen: {}", unknown(name, &known)))
        };
        Ok(Self(sensing.unseen.iter().map(id_of).collect::<anyhow::Result<_>>()?))
    }

    /// The world without the unseen actors: they are not seen, and they hide nothing.
    pub(crate) fn seen<'w>(&self, world: &'w WorldState) -> Cow<'w, WorldState> {
        if self.0.is_empty() {
            return Cow::Borrowed(world);
        }
        let mut seen = world.clone();
        seen.actors.retain(|actor| !self.0.contains(&actor.id));
        Cow::Owned(seen)
    }
}

/// Names listed in an error if none is near.
const LISTED: usize = 12;

fn unknown(name: &str, known: &[(ActorId, &str)]) -> String {
    let names: Vec<&str> = known.iter().map(|(_, name)| *name).collect();
    let near = did_you_mean(name, names.iter().copied());
    match names.len() {
        _ if !near.is_empty() => format!("the scenario has no actor \"{name}\"{near}"),
        0 => format!("the scenario has no actor \"{name}\": it has none"),
        1..=LISTED => format!("the scenario has no actor \"{name}\": expected one of {}", list(&names)),
        count => format!("the scenario has no actor \"{name}\" among its {count}"),
    }
}

#[cfg(test)]
mod tests;
