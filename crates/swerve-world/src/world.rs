//! Worlds.

use std::sync::Arc;

use swerve_core::Time;
use swerve_map::Map;
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorId, Command};

use crate::OthersError;

/// A simulated world.
pub trait World: Send {
    /// Starts whatever simulates parts of the world outside; called once, before the first state is read.
    ///
    /// # Errors
    /// If it cannot be started.
    fn start(&mut self) -> Result<(), OthersError> {
        Ok(())
    }

    /// Reason why the world cannot advance any more; `None` while it can.
    fn failure(&self) -> Option<&OthersError> {
        None
    }

    /// Lanes of the world, the same for the whole run.
    fn map(&self) -> &Arc<Map>;

    /// State at the instant that the world has reached, in the view of the first ego.
    fn state(&self) -> &WorldState;

    /// The same in the view of an ego; `None` if there is no such ego.
    fn state_of(&self, ego: ActorId) -> Option<&WorldState>;

    /// Advances to the instant `until`, under one command for each ego that has one, and returns the state. An ego
    /// without a command, or with one that is not finite, keeps its previous command. A world with a fixed step length
    /// takes as many steps as reach `until`; nothing happens if it is not in the future.
    fn advance(&mut self, until: Time, commands: &[(ActorId, Command)]) -> &WorldState;
}
