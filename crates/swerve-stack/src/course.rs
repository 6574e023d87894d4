//! Recorded course of a simulated world, so that another run can repeat it up to an instant and be driven by its own
//! stack from there.

use std::sync::{Arc, Mutex, PoisonError};

use swerve_core::{Span, Time};
use swerve_msg::Command;

/// Commands of a simulated world: those given to it, one a step from the first on, and those that it took. Clones share
/// the record of commands taken.
#[derive(Clone, Debug, Default)]
pub struct Course {
    given: Arc<[Command]>,
    taken: Arc<Mutex<Vec<Command>>>,
}

/// Compares given commands only: those taken are not part of a configuration.
impl PartialEq for Course {
    fn eq(&self, other: &Self) -> bool {
        self.given == other.given
    }
}

impl Course {
    /// The same course up to `until`, then driven by the run's own stack; `dt` is the world's step.
    #[must_use]
    pub fn up_to(&self, until: Time, dt: Span) -> Self {
        let taken = self.taken.lock().unwrap_or_else(PoisonError::into_inner);
        // The command latched at a step moves the world until the next one.
        let steps = (until - Time::ZERO).ns().max(0) / dt.ns().max(1);
        let given = taken.iter().take(usize::try_from(steps).unwrap_or(usize::MAX)).copied().collect();
        Self { given, taken: Arc::default() }
    }

    /// Command of a step for which the stack requests `asked`; recorded as taken.
    pub(crate) fn command(&self, step: usize, asked: Command) -> Command {
        let command = self.given.get(step).copied().unwrap_or(asked);
        self.taken.lock().unwrap_or_else(PoisonError::into_inner).push(command);
        command
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn course_repeats_the_commands_before_an_instant() {
        let command = |throttle: f64| Command { throttle, ..Command::default() };
        let first = Course::default();
        for step in 0..4 {
            assert_eq!(first.command(step, command(step as f64)), command(step as f64));
        }
        let dt = Span::from_ms(5);
        for (until_ms, own_from) in [(0, 0), (9, 1), (10, 2), (1000, 4), (-5, 0)] {
            let again = first.up_to(Time::ZERO + Span::from_ms(until_ms), dt);
            let throttles: Vec<f64> = (0..5).map(|step| again.command(step, command(9.0)).throttle).collect();
            let expected: Vec<f64> =
                (0..5).map(|step| if step < own_from { f64::from(step) } else { 9.0 }).collect();
            assert_eq!(throttles, expected, "{until_ms} ms");
        }
    }
}
