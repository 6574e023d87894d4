//! One ego of a run with several: the events of its stack, and of the world in its view.

use anyhow::Context as _;
use swerve_core::Time;
use swerve_flow::{Dropped, Event, MissEvent, Observer, Publication, StepEnd, StepStart};
use swerve_log::{Log, PublicationRecord, View, Views};
use swerve_msg::ActorId;
use swerve_msg::truth::WorldState;
use swerve_scenario::Scenario;
use swerve_stack::pipeline::{drawn, setup_of_ego};
use swerve_stack::{Assembly, Namespace, Setup};
use swerve_text::did_you_mean;

/// A recorded run as one ego took part in it.
pub struct EgoRun {
    /// Records of its stack, and of the world in its view, under the names of its assembly, until the scenario is over for
    /// this ego.
    pub log: Log,
    /// Configuration of its stack.
    pub setup: Setup,
    /// Scenario, in which the other egos are actors.
    pub scenario: Scenario,
}

/// A recorded run of several egos as one of them took part in it, the first unless one is named; `None` for a run with
/// one ego.
///
/// # Errors
/// If there is no ego of this name.
pub fn of_ego(
    log: &Log,
    setup: &Setup,
    scenario: &Scenario,
    ego: Option<&str>,
) -> anyhow::Result<Option<EgoRun>> {
    let egos = scenario.egos();
    let found = egos.iter().find(|(_, name)| ego.is_none_or(|ego| ego == *name));
    let (id, name) = *found.with_context(|| {
        let names: Vec<&str> = egos.iter().map(|(_, name)| *name).collect();
        let ego = ego.unwrap_or_default();
        format!(
            "--ego {ego}: expected one of {}{}",
            names.join(", "),
            did_you_mean(ego, names.iter().copied())
        )
    })?;
    if egos.len() == 1 {
        return Ok(None);
    }
    let assembly = Assembly::new(setup)?;
    let world = assembly.publisher::<WorldState>().context("the log is of no simulated world")?;
    let names = Namespace::new(name, id == ActorId::EGO, world);
    let log = log.part(|name| names.own(name).map(str::to_owned));
    let is_over =
        |record: &&PublicationRecord| record.decode::<WorldState>().is_ok_and(|w| w.ended.is_some());
    let over = log.publications(world).find(is_over).map(|record| record.header.visible_at);
    let log = match over {
        Some(over) => log.until(over),
        None => log,
    };
    let scenario = drawn(setup, scenario).of_ego(id).context("it is one of the egos")?;
    let scenario = scenario.alone(&setup.sim.vehicle.shape);
    Ok(Some(EgoRun { log, setup: setup_of_ego(setup, id), scenario }))
}

/// Events of one ego's stack in a run with several, until the scenario is over for this ego.
struct Own {
    names: Namespace,
    over: Option<Time>,
}

impl Own {
    fn new(names: &Namespace) -> Self {
        Self { names: names.clone(), over: None }
    }

    /// The event under the names of the ego's assembly; `None` for events of others.
    fn event<'e>(&'e mut self, event: &'e Event<'e>) -> Option<Event<'e>> {
        if self.over.zip(instant(event)).is_some_and(|(over, at)| at > over) {
            return None;
        }
        if let Event::Publication(Publication { stream, visible_at, payload: Some(payload), .. }) = event {
            let world = payload.downcast_ref::<WorldState>();
            if world.is_some_and(|world| world.ended.is_some()) && self.names.own(stream).is_some() {
                self.over.get_or_insert(*visible_at);
            }
        }
        let own = |name| self.names.own(name);
        Some(match event {
            Event::Publication(event) => {
                let (operator, stream) = (own(event.operator)?, own(event.stream)?);
                Event::Publication(Publication { operator, stream, ..event.clone() })
            }
            Event::StepStart(event) => {
                Event::StepStart(StepStart { operator: own(event.operator)?, ..event.clone() })
            }
            Event::StepEnd(event) => {
                Event::StepEnd(StepEnd { operator: own(event.operator)?, ..event.clone() })
            }
            Event::Miss(event) => Event::Miss(MissEvent { operator: own(event.operator)?, ..event.clone() }),
            Event::Drop(event) => Event::Drop(Dropped { operator: own(event.operator)?, ..event.clone() }),
            Event::Decision(_) | Event::End(_) => event.clone(),
        })
    }
}

/// Instant of an event; `None` for those of the run as a whole.
fn instant(event: &Event<'_>) -> Option<Time> {
    match event {
        Event::Publication(Publication { visible_at: at, .. })
        | Event::StepStart(StepStart { at, .. })
        | Event::StepEnd(StepEnd { end: at, .. })
        | Event::Miss(MissEvent { at, .. })
        | Event::Drop(Dropped { at, .. }) => Some(*at),
        Event::Decision(_) | Event::End(_) => None,
    }
}

/// Passes the events of one ego's stack to an observer or a view, under the names of its assembly, until the scenario is
/// over for this ego. Those of a run with one ego are passed on as they are.
pub struct OfEgo<T> {
    own: Option<Own>,
    to: T,
}

impl<T> OfEgo<T> {
    /// Passes on the events of the stack with these names.
    pub fn new(names: &Namespace, to: T) -> Self {
        Self { own: (!names.is_alone()).then(|| Own::new(names)), to }
    }
}

impl Observer for OfEgo<&mut dyn Observer> {
    fn event(&mut self, event: &Event<'_>) {
        match &mut self.own {
            None => self.to.event(event),
            Some(own) => own.event(event).iter().for_each(|event| self.to.event(event)),
        }
    }
}

impl Views for OfEgo<Box<dyn Views>> {
    fn event(&mut self, event: &Event<'_>, out: &mut Vec<View>) {
        match &mut self.own {
            None => self.to.event(event, out),
            Some(own) => own.event(event).iter().for_each(|event| self.to.event(event, out)),
        }
    }
}
