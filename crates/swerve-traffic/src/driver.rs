//! Drivers of a simulated world that share one [`Traffic`].

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use swerve_core::Time;
use swerve_msg::ActorId;
use swerve_world::{Driver, Movement, View};

use crate::Traffic;

/// Driver of one actor of a [`Traffic`]. The first of them to observe a state lets the traffic decide; the world asks its
/// drivers one after the other, and their order has no effect.
#[derive(Clone, Debug)]
pub struct GroupDriver {
    id: ActorId,
    traffic: Arc<Mutex<Traffic>>,
    /// An instant before which the traffic does not decide.
    due: Time,
}

impl Traffic {
    /// Drivers of all actors, in order of identity, and the traffic that they share.
    pub fn drivers(self) -> (Arc<Mutex<Self>>, Vec<(ActorId, GroupDriver)>) {
        let ids: Vec<ActorId> = self.actors().iter().map(|actor| actor.id).collect();
        let traffic = Arc::new(Mutex::new(self));
        let driver = |id: ActorId| (id, GroupDriver { id, traffic: Arc::clone(&traffic), due: Time::ZERO });
        let drivers = ids.into_iter().map(driver).collect();
        (traffic, drivers)
    }
}

impl GroupDriver {
    /// A panic of another driver ends the run anyway.
    fn traffic(&self) -> MutexGuard<'_, Traffic> {
        self.traffic.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Driver for GroupDriver {
    fn observe(&mut self, view: &View<'_>) {
        if view.world.stamp < self.due {
            return;
        }
        let mut traffic = self.traffic();
        traffic.observe(view.world, view.ego);
        let due = traffic.due();
        drop(traffic);
        self.due = due;
    }

    fn movement(&self, _from: Time, to: Time) -> Option<Movement> {
        self.traffic().movement(self.id, to)
    }
}
