//! Triggers of actors.

use swerve_core::{Span, Time};
use swerve_geom::Pose2;
use swerve_msg::Route;
use swerve_scenario::{Subject, Trigger};

/// Positions of all actors at one simulation step.
pub(crate) struct Situation<'a> {
    pub(crate) now: Time,
    pub(crate) route: &'a Route,
    /// Centre of the ego's outline, and its position along the road, metres.
    pub(crate) ego: (Pose2, f64),
    /// The other actors, by index in the scenario.
    pub(crate) actor: &'a dyn Fn(usize) -> Pose2,
}

impl Situation<'_> {
    /// True if the trigger of an actor at `own` is met; always false without a trigger.
    pub(crate) fn meets(&self, trigger: Option<Trigger>, own: Pose2) -> bool {
        let center = |who: Subject| match who {
            Subject::Ego => self.ego.0,
            Subject::Actor(i) => (self.actor)(i),
        };
        match trigger {
            None => false,
            Some(Trigger::Distance { to, within_m }) => center(to).point().distance(own.point()) <= within_m,
            Some(Trigger::Time { at_s }) => self.now - Time::ZERO >= Span::from_secs(at_s),
            Some(Trigger::Reaches { who: Subject::Ego, s_m }) => self.ego.1 >= s_m,
            Some(Trigger::Reaches { who, s_m }) => self.route.project(center(who).point()).s_m >= s_m,
        }
    }
}
