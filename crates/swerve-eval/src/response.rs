//! End-to-end response times.

use std::collections::VecDeque;

use swerve_core::{Span, Time};

use crate::{Distribution, Summary};

/// Response times from sensor frames to their effects on the world.
///
/// The response time of a command is its first effect on the world minus the stamp of the newest sensor frame that it
/// derives from. A world step at `t` latches the newest command visible strictly before `t`, and the vehicle acts on it
/// after its dead time. Commands replaced by a newer one before they are latched have no effect and do not count, nor
/// do commands that derive from no sensor frame.
#[derive(Clone, Debug)]
pub struct ResponseTimes {
    dead_time: Span,
    waiting: VecDeque<Waiting>,
    times: Distribution,
}

#[derive(Clone, Copy, Debug)]
struct Waiting {
    visible_at: Time,
    origin: Option<Time>,
}

impl ResponseTimes {
    /// Creates an accumulator for a vehicle that acts `dead_time` after latching a command.
    pub fn new(dead_time: Span) -> Self {
        Self { dead_time, waiting: VecDeque::new(), times: Distribution::default() }
    }

    /// Adds a command that became visible; `origin` is the stamp of the newest sensor frame that it derives from.
    /// Commands are added in the order of their visibility.
    pub fn command(&mut self, visible_at: Time, origin: Option<Time>) {
        // Only the newest one visible before an instant can be latched at it: one per instant is enough.
        if self.waiting.back().is_some_and(|w| w.visible_at == visible_at) {
            self.waiting.pop_back();
        }
        self.waiting.push_back(Waiting { visible_at, origin });
    }

    /// Adds a world step at `at`: the newest command visible before takes effect.
    pub fn world_step(&mut self, at: Time) {
        let before = self.waiting.partition_point(|w| w.visible_at < at);
        if let Some(Waiting { origin: Some(origin), .. }) = self.waiting.drain(..before).next_back() {
            self.times.take(at + self.dead_time - origin);
        }
    }

    /// Distribution so far; `None` before the first response.
    pub fn summary(&self) -> Option<Summary> {
        self.times.summary()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn command_acts_from_the_first_step_after_it_became_visible() {
        let mut response = ResponseTimes::new(Span::from_ms(20));
        response.world_step(Time::from_ms(100));
        response.command(Time::from_ms(100), Some(Time::from_ms(60)));
        response.world_step(Time::from_ms(100));
        assert_eq!(response.summary(), None);
        response.world_step(Time::from_ms(105));
        response.world_step(Time::from_ms(110));
        let summary = response.summary().unwrap();
        assert_eq!((summary.count, summary.max_ms), (1, 65.0));
    }

    #[test]
    fn command_replaced_before_a_step_does_not_count() {
        let mut response = ResponseTimes::new(Span::ZERO);
        response.command(Time::from_ms(1), Some(Time::ZERO));
        response.command(Time::from_ms(2), Some(Time::from_ms(1)));
        response.command(Time::from_ms(2), Some(Time::from_ms(2)));
        response.command(Time::from_ms(7), None);
        response.world_step(Time::from_ms(5));
        response.world_step(Time::from_ms(10));
        let summary = response.summary().unwrap();
        assert_eq!((summary.count, summary.max_ms), (1, 3.0));
    }
}
