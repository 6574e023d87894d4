//! Commands of a stack for the vehicle of a foreign world.

use std::collections::VecDeque;

use anyhow::Context as _;
use swerve_core::{Span, Time};
use swerve_flow::{Event, GraphInfo, Observer, Publication};
use swerve_msg::Command;
use swerve_stack::pipeline::Pipeline;

/// A command for the vehicle.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Commanded {
    /// Instant from which it is visible to the vehicle.
    pub at: Time,
    /// Stamp of the newest sensor frame that it derives from, if there is one.
    pub origin: Option<Time>,
    /// Steering angle of the road wheels, throttle and brake.
    pub command: Command,
}

/// Commands up to an instant.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Commands {
    /// Newest visible command; `None` before the first.
    pub newest: Option<Commanded>,
    /// Commands that became visible since the last advance, in order.
    pub new: Vec<Commanded>,
}

/// Records the commands for the vehicle.
pub(super) struct Tape {
    /// Operator whose commands the vehicle gets.
    operator: String,
    /// Time from the publication of a command to its readers.
    delay: Span,
    coming: VecDeque<Commanded>,
    newest: Option<Commanded>,
}

impl Tape {
    pub(super) fn new(pipeline: &Pipeline, graph: &GraphInfo) -> anyhow::Result<Self> {
        let operator = pipeline.stack().publisher_after_faults::<Command>().map(str::to_owned);
        let operator = operator.context("no operator of the pipeline publishes a command")?;
        let described = graph.operators.iter().find(|described| described.name == operator);
        let delay = Span::from_ns(described.map_or(0, |described| described.delay_ns));
        Ok(Self { operator, delay, coming: VecDeque::new(), newest: None })
    }

    /// Commands that are visible at an instant, which is not before that of the last call.
    pub(super) fn up_to(&mut self, instant: Time) -> Commands {
        let count = self.coming.partition_point(|commanded| commanded.at <= instant);
        let new: Vec<Commanded> = self.coming.drain(..count).collect();
        self.newest = new.last().copied().or(self.newest);
        Commands { newest: self.newest, new }
    }
}

impl Observer for Tape {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(Publication { operator, visible_at, origin, payload: Some(payload), .. }) =
            event
        else {
            return;
        };
        if *operator != self.operator {
            return;
        }
        if let Some(command) = payload.downcast_ref::<Command>() {
            let at = visible_at.saturating_add(self.delay);
            self.coming.push_back(Commanded { at, origin: *origin, command: *command });
        }
    }
}
