//! The state of the world as others see it.

use std::sync::Arc;

use swerve_core::Time;
use swerve_map::Map;
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorId, Command};
use swerve_world::{OthersError, View, World};

use super::Simulator;
use crate::track::is_parked;

impl Simulator {
    /// Shows the present state to all drivers, and keeps what is seen of it.
    pub(super) fn show(&mut self) {
        let ego = self.outline();
        for (player, actor) in self.actors.iter_mut().zip(&self.state.actors) {
            player.driver.observe(&View { own: actor.id, world: &self.state, ego, map: &self.map });
        }
        if self.scenario.actors.iter().any(|actor| actor.track().is_some()) {
            let mut shown = self.state.clone();
            shown.actors.retain(|actor| !is_parked(actor.pose));
            self.shown = Some(shown);
        }
    }
}

impl World for Simulator {
    fn start(&mut self) -> Result<(), OthersError> {
        self.lead(self.state.stamp);
        match self.failure() {
            Some(error) => Err(error.clone()),
            None => {
                self.show();
                Ok(())
            }
        }
    }

    fn failure(&self) -> Option<&OthersError> {
        self.outside.as_ref()?.failure.as_ref()
    }

    fn map(&self) -> &Arc<Map> {
        &self.map
    }

    fn state(&self) -> &WorldState {
        self.state()
    }

    fn state_of(&self, ego: ActorId) -> Option<&WorldState> {
        core::iter::once(self.state()).chain(&self.views).find(|view| view.ego.id == ego)
    }

    fn advance(&mut self, until: Time, commands: &[(ActorId, Command)]) -> &WorldState {
        for (id, command) in commands {
            if let Some(ego) = self.egos.iter_mut().find(|ego| ego.car.id() == *id) {
                ego.command = *command;
            }
        }
        while self.state.stamp < until && self.failure().is_none() {
            self.step(self.egos[0].command);
        }
        self.state()
    }
}

impl core::fmt::Debug for Simulator {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Simulator")
            .field("scenario", &self.scenario.name)
            .field("stamp", &self.state.stamp)
            .finish_non_exhaustive()
    }
}
