//! The driver that follows a script, from the start or from the event that triggers it.

use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Polyline, Pose2};
use swerve_scenario::{Actor, Scenario, Subject, Trigger};
use swerve_world::{Driver, Movement, View};

use crate::script::Script;

/// Search range around the ego's last position along the road, metres.
pub(crate) const REACH_M: f64 = 15.0;

/// A script, and the event that starts it.
#[derive(Clone, Debug)]
pub(crate) struct Scripted {
    script: Script,
    /// Line of the actor.
    line: Arc<Polyline>,
    /// Line of the ego's lanes.
    road: Arc<Polyline>,
    trigger: Option<Trigger>,
    /// Instant at which it started.
    set_off: Option<Time>,
    /// Length of a step of the world.
    dt: Span,
    /// Position along the road of the ego's centre, metres.
    ego_m: f64,
}

impl Scripted {
    /// Driver of an actor of this scenario, given the line of its road.
    pub(crate) fn new(actor: &Actor, scenario: &Scenario, road: &Arc<Polyline>, dt: Span) -> Self {
        let line = actor.line.as_ref().unwrap_or(road);
        let script = Script::new(actor, line);
        let set_off = (actor.trigger.is_none() && script.moves()).then_some(Time::ZERO);
        let ego_m = scenario.ego.s_m;
        Self {
            script,
            line: Arc::clone(line),
            road: Arc::clone(road),
            trigger: actor.trigger,
            set_off,
            dt,
            ego_m,
        }
    }

    /// Instant at which it started, or at which it will start for certain.
    pub(crate) fn sets_off(&self) -> Option<Time> {
        let at = |trigger: Trigger| match trigger {
            Trigger::Time { at_s } => Some(first_step(Span::from_secs(at_s), self.dt)),
            Trigger::Distance { .. } | Trigger::Reaches { .. } => None,
        };
        self.set_off.or_else(|| self.trigger.and_then(at))
    }

    /// Pose and velocity at an instant, if it started at `set_off`.
    pub(crate) fn at(&self, at: Time, set_off: Option<Time>) -> Movement {
        let after_s = set_off.map(|set_off| (at - set_off).as_secs()).filter(|after_s| *after_s >= 0.0);
        self.script.at(after_s, &self.line)
    }

    /// True if a trigger is met; `own` is the pose of the actor that it starts.
    fn is_met(&self, trigger: Trigger, view: &View<'_>, own: Pose2) -> bool {
        let place = |point: Point2| self.road.project(point).s_m;
        match trigger {
            Trigger::Distance { to, within_m } => {
                center(to, view).is_some_and(|center| center.distance(own.point()) <= within_m)
            }
            Trigger::Time { at_s } => view.now() - Time::ZERO >= Span::from_secs(at_s),
            Trigger::Reaches { who: Subject::Ego, s_m } => self.ego_m >= s_m,
            Trigger::Reaches { who, s_m } => center(who, view).is_some_and(|center| place(center) >= s_m),
        }
    }
}

impl Driver for Scripted {
    fn observe(&mut self, view: &View<'_>) {
        if self.set_off.is_some() {
            return;
        }
        let Some(trigger) = self.trigger else { return };
        if matches!(trigger, Trigger::Reaches { who: Subject::Ego, .. }) && view.now() > Time::ZERO {
            self.ego_m = self.road.project_near(view.ego.center.point(), self.ego_m, REACH_M).s_m;
        }
        let Some(own) = view.world.actor(view.own) else { return };
        if self.is_met(trigger, view, own.pose) {
            self.set_off = Some(view.now());
        }
    }

    fn movement(&self, from: Time, to: Time) -> Option<Movement> {
        let set_off = self.set_off?;
        // The step in which the script ends still counts: it brings the road user to rest.
        (!self.script.is_over((from - set_off).as_secs())).then(|| self.at(to, Some(set_off)))
    }
}

/// Centre of the ego's outline or of an actor.
fn center(who: Subject, view: &View<'_>) -> Option<Point2> {
    match who {
        Subject::Ego => Some(view.ego.center.point()),
        Subject::Actor(id) => view.world.actor(id).map(|actor| actor.pose.point()),
    }
}

/// First simulation step that is not earlier.
fn first_step(after: Span, dt: Span) -> Time {
    let steps = after.ns().div_euclid(dt.ns()) + i64::from(after.ns().rem_euclid(dt.ns()) > 0);
    Time::ZERO + dt * steps.max(0)
}
