//! Traffic lights as a run had them.

use swerve_core::Time;
use swerve_msg::Signal;

/// A traffic light of the ego's lane, and what it showed. Lengths are along the route and to its left.
#[derive(Clone, PartialEq, Debug)]
pub struct LightCourse {
    /// Its name in the scenario.
    pub name: String,
    /// Where it stands along the route, metres.
    pub s_m: f64,
    /// The same across, metres; positive to the left.
    pub d_m: f64,
    /// Its stop line along the route, metres.
    pub stop_s_m: f64,
    /// What it shows from which instant on, in order of time.
    pub shows: Vec<(Time, Signal)>,
}

impl LightCourse {
    /// What it shows at an instant; none before the first of [`shows`](Self::shows). A signal holds its first instant.
    pub fn signal(&self, at: Time) -> Option<Signal> {
        self.since(at).map(|(_, signal)| signal)
    }

    /// The same, and since when.
    pub fn since(&self, at: Time) -> Option<(Time, Signal)> {
        let after = self.shows.partition_point(|(from, _)| *from <= at);
        self.shows.get(after.checked_sub(1)?).copied()
    }
}
