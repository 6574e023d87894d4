//! Clock of a drive: the host's, or simulated time from the topic `clock`.
//!
//! With simulated time, run time is the time of the newest message on that topic, zero at the first one: a simulator
//! may run at any speed, and pause. Run time and stamps have the same clock, so that no offset is estimated.

use core::time::Duration;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex};

use swerve_core::{Span, Time};
use swerve_flow::SimulatedTime;
use swerve_ros2::AnyMessage;
use swerve_ros2::msg::builtin_interfaces as builtin;
use swerve_ros2::msg::rosgraph_msgs::Clock;

use super::shared::lock;
use super::wire::{HostClock, Wire};

/// Earlier times up to this limit are messages out of order; beyond it, the simulator was reset.
const BACK_MAX: Span = Span::from_ms(100);
/// Largest plausible step.
const STEP_MAX: Span = Span::from_ms(10_000);
/// Messages with stamps up to this much ahead of the clock wait until it reaches them: they may overtake its message.
const EARLY_MAX: Span = Span::from_ms(500);
/// Number of messages further ahead, within [`STEP_MAX`] and since the latest advance, after which the clock is silent.
const AHEAD_MAX: u32 = 5;
/// Real time without an advance after which the user is notified.
const STANDS_AFTER: Span = Span::from_ms(1000);
/// Longest sleep while waiting for the first message.
const WAKE: Duration = Duration::from_millis(10);

/// Clock of a drive.
#[derive(Clone)]
pub enum DriveClock {
    /// The host's.
    Host(HostClock),
    /// Simulated time.
    Simulated(Simulated),
}

impl From<HostClock> for DriveClock {
    fn from(clock: HostClock) -> Self {
        Self::Host(clock)
    }
}

impl DriveClock {
    /// Run time.
    pub fn now(&self) -> Time {
        match self {
            Self::Host(clock) => clock.now(),
            Self::Simulated(clock) => clock.time.now(),
        }
    }

    /// Real time since the start of the drive.
    pub fn host_now(&self) -> Time {
        match self {
            Self::Host(clock) => clock.now(),
            Self::Simulated(clock) => clock.host.now(),
        }
    }

    /// Run time of an event with this host time, nanoseconds since the Unix epoch; with simulated time, the present.
    pub fn at_host(&self, host_ns: i64) -> Time {
        match self {
            Self::Host(clock) => clock.at_host(host_ns),
            Self::Simulated(clock) => clock.time.now(),
        }
    }

    /// Run time zero on the clock of stamps, nanoseconds.
    pub fn epoch_ns(&self) -> i64 {
        match self {
            Self::Host(clock) => clock.epoch_ns(),
            Self::Simulated(clock) => clock.epoch_ns,
        }
    }

    /// The simulated time; `None` for the host's clock.
    pub fn simulated(&self) -> Option<&Simulated> {
        match self {
            Self::Host(_) => None,
            Self::Simulated(clock) => Some(clock),
        }
    }

    /// Returns true if simulated time has failed and no longer advances.
    pub fn has_failed(&self) -> bool {
        self.simulated().is_some_and(|clock| lock(&clock.state).failure.is_some())
    }

    /// Returns true if a message with this stamp has overtaken the message of the clock. Several messages that are
    /// further ahead are a failure: the simulator goes on, but its clock is silent.
    pub fn is_early(&self, stamp: Option<builtin::Time>) -> bool {
        let (Some(clock), Some(stamp)) = (self.simulated(), stamp) else { return false };
        clock.judge(Time::from_ns(stamp.ns().saturating_sub(clock.epoch_ns)))
    }
}

/// Simulated time of a drive. Clones share it.
#[derive(Clone)]
pub struct Simulated {
    time: SimulatedTime,
    epoch_ns: i64,
    host: HostClock,
    timeout: Span,
    state: Arc<Mutex<State>>,
}

#[derive(Default)]
struct State {
    /// Real time of the latest advance.
    moved: Time,
    /// True if the user was notified that it stands still.
    stands: bool,
    /// Messages that were too far ahead since the latest advance.
    ahead: u32,
    failure: Option<String>,
}

/// Event of simulated time.
#[derive(Clone, PartialEq, Debug)]
pub enum ClockEvent {
    /// It stands still, or advances again.
    Note(String),
    /// It has failed: the drive ends.
    Failed(String),
}

impl Simulated {
    /// Starts at the time of a message; `timeout` is the real time for which it may stand still.
    pub fn start(first: &Clock, timeout: Span) -> Self {
        let (time, host, epoch_ns) = (SimulatedTime::new(), HostClock::start(), first.clock.ns());
        Self { time, epoch_ns, host, timeout, state: Arc::default() }
    }

    /// Waits for the first message of the topic `clock`; drops all others.
    ///
    /// # Errors
    /// If there is none within `timeout` of real time, or `interrupted` is set.
    pub fn wait_for(wire: &dyn Wire, timeout: Span, interrupted: &AtomicBool) -> anyhow::Result<Self> {
        let host = HostClock::start();
        while host.now() - Time::ZERO < timeout {
            anyhow::ensure!(
                !interrupted.load(Ordering::Relaxed),
                "interrupted while waiting for simulated time"
            );
            wire.wait(WAKE);
            while let Some(taken) = wire.take() {
                if let AnyMessage::Clock(clock) = &taken.message {
                    return Ok(Self::start(clock, timeout));
                }
            }
        }
        anyhow::bail!(
            "live.clock: no message on the topic `clock` within {:.1} s: start the simulator first, or set \
             `live.clock = \"host\"` for a vehicle",
            timeout.as_secs()
        )
    }

    /// The shared time, which paces the run.
    pub fn time(&self) -> &SimulatedTime {
        &self.time
    }

    /// Advances to a message of the topic. After a jump it has failed, and stands still from then on.
    pub fn hear(&self, clock: &Clock) {
        let mut state = lock(&self.state);
        if state.failure.is_some() {
            return;
        }
        let now = self.time.now();
        let heard = Time::from_ns(clock.clock.ns().saturating_sub(self.epoch_ns));
        let (from_s, to_s) = (self.clock_s(now), self.clock_s(heard));
        if heard.saturating_add(BACK_MAX) < now {
            let what = format!(
                "simulated time jumped back from {from_s:.3} s to {to_s:.3} s: the simulator was reset, or two \
                 programs publish the topic `clock`"
            );
            state.failure = Some(what);
        } else if heard > now.saturating_add(STEP_MAX) {
            let what = format!(
                "simulated time jumped ahead from {from_s:.3} s to {to_s:.3} s: expected steps of at most {:.0} s",
                STEP_MAX.as_secs()
            );
            state.failure = Some(what);
        } else if heard > now {
            (state.moved, state.ahead) = (self.host.now(), 0);
            self.time.advance(heard);
        }
    }

    /// Returns true if a message with this stamp, in run time, has overtaken the message of the clock.
    fn judge(&self, stamp: Time) -> bool {
        let mut state = lock(&self.state);
        let now = self.time.now();
        if state.failure.is_some() || stamp <= now || stamp > now.saturating_add(STEP_MAX) {
            return false;
        }
        if stamp <= now.saturating_add(EARLY_MAX) {
            return true;
        }
        state.ahead += 1;
        if state.ahead >= AHEAD_MAX {
            state.failure = Some(format!(
                "simulated time stood still at {:.3} s while the stamps of messages reached {:.3} s: the topic \
                 `clock` is silent, or its messages are more than {:.1} s apart",
                self.clock_s(now),
                self.clock_s(stamp),
                EARLY_MAX.as_secs()
            ));
        }
        false
    }

    /// Time of the simulator's clock at a run time, seconds.
    fn clock_s(&self, time: Time) -> f64 {
        1e-9 * self.epoch_ns.saturating_add(time.ns()) as f64
    }

    /// Checks that it advances. A failure is final and returned by each call.
    pub fn check(&self) -> Option<ClockEvent> {
        let mut state = lock(&self.state);
        if let Some(what) = &state.failure {
            return Some(ClockEvent::Failed(what.clone()));
        }
        let still = self.host.now() - state.moved;
        let clock_s = self.clock_s(self.time.now());
        if still > self.timeout {
            let what = format!(
                "simulated time stood still at {clock_s:.3} s for {:.1} s (live.clock_timeout_s)",
                self.timeout.as_secs()
            );
            state.failure = Some(what.clone());
            return Some(ClockEvent::Failed(what));
        }
        let stands = still > STANDS_AFTER;
        if stands == std::mem::replace(&mut state.stands, stands) {
            return None;
        }
        Some(ClockEvent::Note(match stands {
            true => format!("simulated time stands still at {clock_s:.3} s"),
            false => "simulated time advances again".to_owned(),
        }))
    }
}

#[cfg(test)]
mod tests;
