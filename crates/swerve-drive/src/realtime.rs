//! A run's processors and priority under wall clock, as far as the machine permits.
//!
//! The engine's thread advances the run: it takes the ticks and the light steps. It gets the first processor of
//! `clock.pin` and the priority `clock.priority`. All others of the run (threads of heavy steps, the log writer, worker
//! processes) get the other processors, and no priority.

use std::sync::{Arc, Mutex, PoisonError};

use rustix::thread::{CpuSet, sched_setaffinity};
use serde::Serialize;
use swerve_flow::{Event, Observer};
use swerve_stack::config::clock::{Clock, ClockConfig};
use thread_priority::{
    RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy, set_thread_priority_and_policy,
    thread_native_id,
};

/// Processors and priority obtained of those requested by `clock.pin` and `clock.priority`.
#[derive(Serialize, Clone, PartialEq, Eq, Debug, Default)]
pub struct Obtained {
    /// Processor of the engine's thread.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub pinned_to: Option<usize>,
    /// Real-time priority of the engine's thread (`SCHED_FIFO`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub priority: Option<u8>,
    /// Refused settings, with reasons.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub refused: Vec<String>,
}

impl Obtained {
    /// One line for the terminal.
    pub fn text(&self) -> String {
        let pinned = self.pinned_to.map(|cpu| format!("the engine's thread on processor {cpu}"));
        let priority = self.priority.map(|priority| format!("real-time priority {priority}"));
        let refused = self.refused.iter().map(|why| format!("not obtained: {why}"));
        let parts: Vec<String> = pinned.into_iter().chain(priority).chain(refused).collect();
        parts.join("; ") + "\n"
    }
}

/// Sets up the threads of a run. It is an observer because observers are called on the engine's thread.
pub struct Realtime {
    wanted: ClockConfig,
    begun: bool,
    obtained: Arc<Mutex<Obtained>>,
}

impl Realtime {
    /// Restricts all threads that this thread starts from now on to the processors other than the engine's. `None` if
    /// nothing is requested or the run is in virtual time.
    pub fn begin(wanted: &ClockConfig) -> Option<Self> {
        if wanted.source == Clock::Virtual || (wanted.pin.is_empty() && wanted.priority.is_none()) {
            return None;
        }
        let obtained = Arc::<Mutex<Obtained>>::default();
        if let [_, others @ ..] = &wanted.pin[..] {
            let others = if others.is_empty() { &wanted.pin } else { others };
            if let Err(why) = pin(others) {
                refuse(&obtained, why);
            }
        }
        Some(Self { wanted: wanted.clone(), begun: false, obtained })
    }

    /// Settings obtained; complete once the run is over.
    pub fn obtained(&self) -> Obtained {
        self.obtained.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    fn set_up_this_thread(&self) {
        if let Some(first) = self.wanted.pin.first() {
            match pin(&[*first]) {
                Ok(()) => {
                    self.obtained.lock().unwrap_or_else(PoisonError::into_inner).pinned_to = Some(*first)
                }
                Err(why) => refuse(&self.obtained, why),
            }
        }
        if let Some(priority) = self.wanted.priority {
            match prioritise(priority) {
                Ok(()) => {
                    self.obtained.lock().unwrap_or_else(PoisonError::into_inner).priority = Some(priority);
                }
                Err(why) => refuse(&self.obtained, why),
            }
        }
    }
}

impl Observer for Realtime {
    fn event(&mut self, _: &Event<'_>) {
        if !self.begun {
            self.begun = true;
            self.set_up_this_thread();
        }
    }
}

/// Records a refusal; the run continues without.
fn refuse(obtained: &Mutex<Obtained>, why: String) {
    #[expect(clippy::print_stderr, reason = "said once, before the drive")]
    {
        eprintln!("warning: {why}; the run goes on without");
    }
    obtained.lock().unwrap_or_else(PoisonError::into_inner).refused.push(why);
}

/// Restricts this thread, and those that it starts, to these processors.
fn pin(cpus: &[usize]) -> Result<(), String> {
    let mut set = CpuSet::new();
    for cpu in cpus {
        if *cpu >= CpuSet::MAX_CPU {
            return Err(format!("clock.pin: there is no processor {cpu}"));
        }
        set.set(*cpu);
    }
    sched_setaffinity(None, &set).map_err(|error| {
        let named: Vec<String> = cpus.iter().map(ToString::to_string).collect();
        format!("clock.pin: the machine gives no processor {} ({error})", named.join(", "))
    })
}

/// Gives this thread real-time priority.
fn prioritise(priority: u8) -> Result<(), String> {
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let error = |error: &dyn core::fmt::Display| {
        format!(
            "clock.priority: the machine gives no real-time priority {priority} ({error}): it takes root, \
             CAP_SYS_NICE or a limit `rtprio`"
        )
    };
    let value = ThreadPriority::try_from(priority).map_err(|why| error(&why))?;
    set_thread_priority_and_policy(thread_native_id(), value, policy).map_err(|why| error(&why))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn wanted(pin: &[usize], priority: Option<u8>) -> ClockConfig {
        ClockConfig { source: Clock::Wall, pin: pin.to_vec(), priority }
    }

    /// Field of this thread's status.
    fn status(field: &str) -> String {
        let status = std::fs::read_to_string("/proc/thread-self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix(field)).unwrap();
        line.trim_start_matches(':').trim().to_owned()
    }

    #[test]
    fn nothing_is_set_unless_requested() {
        assert!(Realtime::begin(&wanted(&[], None)).is_none());
        assert!(Realtime::begin(&ClockConfig { pin: vec![0], ..ClockConfig::default() }).is_none());
    }

    #[test]
    fn thread_is_pinned_and_threads_started_before_are_not() {
        // On a separate thread, which takes the settings with it when it ends.
        let run = || {
            let realtime = Realtime::begin(&wanted(&[0], None)).unwrap();
            realtime.set_up_this_thread();
            assert_eq!(status("Cpus_allowed_list"), "0");
            assert_eq!(realtime.obtained(), Obtained { pinned_to: Some(0), ..Obtained::default() });
            assert_eq!(realtime.obtained().text(), "the engine's thread on processor 0\n");
        };
        std::thread::spawn(run).join().unwrap();
    }

    #[test]
    fn refused_settings_are_reported_and_the_run_continues() {
        let run = || {
            let realtime = Realtime::begin(&wanted(&[100_000], None)).unwrap();
            realtime.set_up_this_thread();
            let refused = realtime.obtained().refused;
            assert!(refused[0].contains("clock.pin: there is no processor 100000"), "{refused:?}");
        };
        std::thread::spawn(run).join().unwrap();
        let run = || {
            let realtime = Realtime::begin(&wanted(&[], Some(5))).unwrap();
            realtime.set_up_this_thread();
            let obtained = realtime.obtained();
            let stat = std::fs::read_to_string("/proc/thread-self/stat").unwrap();
            let behind_name: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_whitespace().collect();
            // Fields 40 and 41 of `proc(5)`: priority and policy.
            let (priority, policy) = (behind_name[37], behind_name[38]);
            match obtained.priority {
                Some(5) => assert_eq!((priority, policy), ("5", "1")),
                _ => assert!(obtained.refused[0].contains("rtprio"), "{obtained:?}"),
            }
        };
        std::thread::spawn(run).join().unwrap();
    }
}
