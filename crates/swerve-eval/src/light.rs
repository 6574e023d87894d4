//! Traffic light signals during a run.

use swerve_core::Time;
use swerve_msg::Signal;

/// A traffic light of the ego lane and its signals. Positions are in route coordinates.
#[derive(Clone, PartialEq, Debug)]
pub struct LightCourse {
    /// Name in the scenario.
    pub name: String,
    /// Position along the route, metres.
    pub s_m: f64,
    /// Lateral position, metres; positive to the left.
    pub d_m: f64,
    /// Position of its stop line along the route, metres.
    pub stop_s_m: f64,
    /// Signals with their start, in order of time.
    pub shows: Vec<(Time, Signal)>,
}

impl LightCourse {
    /// Signal at an instant; `None` before the first of [`shows`](Self::shows). A signal includes its first instant.
    pub fn signal(&self, at: Time) -> Option<Signal> {
        self.since(at).map(|(_, signal)| signal)
    }

    /// Signal at an instant, and its start.
    pub fn since(&self, at: Time) -> Option<(Time, Signal)> {
        let after = self.shows.partition_point(|(from, _)| *from <= at);
        self.shows.get(after.checked_sub(1)?).copied()
    }
}
