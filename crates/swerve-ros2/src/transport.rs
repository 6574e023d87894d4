//! The node in a separate process.
//!
//! An RTPS implementation parses arbitrary network input and allocates as much memory as a datagram requests: a
//! single datagram can make RustDDS 0.15 abort. It therefore runs in a separate process with a memory limit, and
//! driving, braking and recording continue if it fails. [`Transport`] has the functions of a
//! [`Bridge`](crate::bridge::Bridge). If the process ends or hangs, the loss is reported
//! ([`Transport::take_losses`]), a new process is started at once, and later messages go through it. If the program
//! dies, the process continues from the state that was left with it ([`Transport::leave`]), then ends.
//!
//! ```text
//!  program: Transport --- socket, frames of a bounded length --- process: Bridge --- DDS
//! ```

mod frame;
mod process;
mod session;
mod shared;

use std::net::Shutdown;
use std::sync::{Arc, Condvar, Mutex};
use std::thread::{self, JoinHandle};
use std::time::Duration;

pub use self::process::{Orphan, run};
pub use self::shared::TransportProcess;

use self::frame::Order;
use self::session::watch;
use self::shared::{START_WITHIN, Shared, State, WINDOW};
use crate::bridge::{
    BridgeError, Direction, Endpoint, EndpointId, Options, PUBLISH_WAIT, PublishError, Received,
    ServiceError, TopicStatistics,
};
use crate::cdr;
use crate::inbox::Inbox;
use crate::message::AnyMessage;

/// Maximum time for the process to report its statistics.
const COUNT_WITHIN: Duration = Duration::from_millis(500);
/// Maximum number of messages that wait here for a reader.
const DEPTH_MAX: usize = 1000;

/// A node with its topics, in a separate process. Ends the process when dropped.
pub struct Transport {
    endpoints: Vec<Endpoint>,
    shared: Arc<Shared>,
    watch: Option<JoinHandle<()>>,
}

impl Transport {
    /// Starts a process and waits until it has a node.
    ///
    /// # Errors
    /// As [`Bridge::start`](crate::bridge::Bridge::start), or if the process does not start.
    pub fn start(options: &Options, process: TransportProcess) -> Result<Self, BridgeError> {
        if crate::bridge::MISSING.is_some() {
            return Err(BridgeError::NotBuilt);
        }
        let n = options.endpoints.len();
        let depth = |endpoint: &Endpoint| Inbox::new(endpoint.qos.depth.min(DEPTH_MAX), None);
        let state = State {
            inboxes: options.endpoints.iter().map(depth).collect(),
            not_handed_on: vec![0; n],
            ..State::default()
        };
        let shared = Arc::new(Shared { state: Mutex::new(state), news: Condvar::new() });
        let thread = thread::Builder::new().name("swerve-ros2-watch".to_owned()).spawn({
            let (shared, options) = (Arc::clone(&shared), options.clone());
            move || {
                watch(&shared, &options, &process);
                shared.lock().has_ended = true;
                shared.news.notify_all();
            }
        })?;
        let transport = Self { endpoints: options.endpoints.clone(), shared, watch: Some(thread) };
        let (mut state, _) = transport.shared.wait(START_WITHIN, |state| state.began.is_some());
        let refused = |reason: String| BridgeError::Transport {
            at: "process".to_owned(),
            reason: reason + &few_descriptors(),
        };
        match state.began.take() {
            Some(Ok(())) => {}
            Some(Err(why)) => return Err(refused(why)),
            None => return Err(refused(format!("it took more than {} s", START_WITHIN.as_secs()))),
        }
        drop(state);
        Ok(transport)
    }

    /// The endpoint with this name.
    pub fn endpoint(&self, name: &str) -> Option<EndpointId> {
        self.endpoints.iter().position(|endpoint| endpoint.name == name).map(EndpointId)
    }

    /// All endpoints in the order of their indices.
    pub fn endpoints(&self) -> &[Endpoint] {
        &self.endpoints
    }

    /// Sends a message to the process.
    ///
    /// # Errors
    /// See [`PublishError`]. Messages that do not reach the process are counted here, those that DDS does not
    /// accept there.
    pub fn publish(&self, EndpointId(endpoint): EndpointId, message: AnyMessage) -> Result<(), PublishError> {
        let Some(known) = self.endpoints.get(endpoint).filter(|known| known.direction == Direction::Send)
        else {
            return Err(PublishError::NoPublisher);
        };
        if known.kind != message.kind() {
            return Err(PublishError::Kind { topic: known.kind, message: message.kind() });
        }
        let order = Order::Publish { endpoint, payload: cdr::encode(&message) };
        let (mut state, has_room) =
            self.shared.wait(PUBLISH_WAIT, |state| state.session.is_none() || state.on_their_way < WINDOW);
        let handed_on = match &state.session {
            None => Err(PublishError::Transport("it is being started again".to_owned())),
            Some(_) if !has_room => Err(PublishError::Full),
            Some(session) => session.orders.try_send(order).map_err(|_| PublishError::Full),
        };
        match handed_on {
            Ok(()) => state.on_their_way += 1,
            Err(_) => state.not_handed_on[endpoint] += 1,
        }
        handed_on
    }

    /// Leaves a state with the process, from which it continues if this program dies; skipped if its queue is full.
    pub fn leave(&self, state: Vec<u8>) {
        let _next_time = self
            .shared
            .lock()
            .session
            .as_ref()
            .map(|session| session.orders.try_send(Order::Leave { state }));
    }

    /// Takes a message of any endpoint, round-robin.
    pub fn take_any(&self) -> Option<(EndpointId, Received)> {
        let mut state = self.shared.lock();
        let n = state.inboxes.len();
        let from = state.search_from;
        let found = (0..n).map(|i| (from + i) % n).find(|i| !state.inboxes[*i].is_empty())?;
        state.search_from = (found + 1) % n;
        state.inboxes[found].pop().map(|received| (EndpointId(found), received))
    }

    /// Waits for a message on any endpoint or the loss of a process; returns false on timeout.
    pub fn wait(&self, timeout: Duration) -> bool {
        let has_news =
            |state: &State| !state.losses.is_empty() || state.inboxes.iter().any(|inbox| !inbox.is_empty());
        self.shared.wait(timeout, has_news).1
    }

    /// Number of matched readers or writers of this topic, by the latest report of the process.
    pub fn matched(&self, EndpointId(endpoint): EndpointId) -> usize {
        self.shared.lock().counts.get(endpoint).map_or(0, |counts| counts.matched)
    }

    /// Reasons for the ends of processes since the last call, one sentence each.
    pub fn take_losses(&self) -> Vec<String> {
        std::mem::take(&mut self.shared.lock().losses)
    }

    /// Number of processes that ended so far.
    pub fn lost(&self) -> u64 {
        self.shared.lock().lost
    }

    /// Requests a control mode of the vehicle (as in `ControlModeReport`) and waits for the answer; returns true if
    /// it was accepted.
    ///
    /// # Errors
    /// If there is no such service, or no answer in time.
    pub fn request_control_mode(&self, mode: u8, timeout: Duration) -> Result<bool, ServiceError> {
        const ON_THE_WAY: Duration = Duration::from_millis(20);
        let mut state = self.shared.lock();
        state.asked += 1;
        let number = state.asked;
        let timeout_ms = u64::try_from(timeout.as_millis()).unwrap_or(u64::MAX);
        let session = state.session.as_ref().ok_or(ServiceError::NoAnswer)?;
        session
            .orders
            .try_send(Order::AskMode { number, mode, timeout_ms })
            .map_err(|_| ServiceError::NoAnswer)?;
        drop(state);
        let (mut state, _) = self.shared.wait(timeout + ON_THE_WAY, |state| {
            state.answers.contains_key(&number) || state.session.is_none()
        });
        let answer = state.answers.remove(&number).ok_or(ServiceError::NoAnswer)?;
        // Discard answers that came too late.
        state.answers.clear();
        answer.map_err(ServiceError::Transport)
    }

    /// Control modes requested by other nodes since the last call. The process has already answered them: it
    /// accepts autonomous and manual only.
    pub fn take_modes(&self) -> Vec<u8> {
        std::mem::take(&mut self.shared.lock().modes)
    }

    /// Statistics so far, by endpoint, including those of earlier processes. Includes all earlier publications,
    /// unless the process is too slow.
    pub fn statistics(&self) -> Vec<TopicStatistics> {
        let state = self.shared.lock();
        let counted = state.counted;
        let asked =
            state.session.as_ref().is_some_and(|session| session.orders.try_send(Order::Count).is_ok());
        drop(state);
        let (state, _) = self.shared.wait(COUNT_WITHIN, |state| !asked || state.counted > counted);
        self.newest(&state)
    }

    /// As [`statistics`](Self::statistics), by the latest report of the process, without asking for a new one.
    pub fn latest_statistics(&self) -> Vec<TopicStatistics> {
        self.newest(&self.shared.lock())
    }

    fn newest(&self, state: &State) -> Vec<TopicStatistics> {
        let newest = |i: usize| {
            let earlier = state.earlier.get(i);
            let newest = state.counts.get(i).or(earlier).cloned();
            let mut counts = newest.unwrap_or_else(|| TopicStatistics::none(&self.endpoints[i]));
            if let Some(earlier) = earlier.filter(|_| state.counts.get(i).is_some()) {
                counts.add(earlier);
            }
            counts.overwritten += state.inboxes[i].overwritten;
            counts.not_published += state.not_handed_on[i];
            counts
        };
        (0..self.endpoints.len()).map(newest).collect()
    }

    /// Ends the process; kills it if it hangs.
    pub fn stop(mut self, deadline: Duration) {
        self.end(deadline);
    }

    fn end(&mut self, deadline: Duration) {
        let Some(watch) = self.watch.take() else { return };
        {
            let mut state = self.shared.lock();
            state.is_ending = true;
            // A process that is gone needs no notification.
            let _gone = state.session.as_ref().map(|session| session.orders.try_send(Order::End));
        }
        self.shared.news.notify_all();
        let (state, has_ended) = self.shared.wait(deadline, |state| state.has_ended);
        if let Some(session) = state.session.as_ref().filter(|_| !has_ended) {
            let _gone = session.socket.shutdown(Shutdown::Both);
        }
        drop(state);
        let _done = watch.join();
    }
}

/// Hint for hosts with a low limit of open files: RustDDS does not always report why the system refuses a socket.
fn few_descriptors() -> String {
    const ENOUGH: u64 = 256;
    let most = rustix::process::getrlimit(rustix::process::Resource::Nofile).current;
    let few = most.filter(|most| *most < ENOUGH);
    few.map_or_else(String::new, |most| {
        format!("; at most {most} file descriptors are allowed (`ulimit -n`)")
    })
}

impl Drop for Transport {
    fn drop(&mut self) {
        const DEADLINE: Duration = Duration::from_secs(2);
        self.end(DEADLINE);
    }
}

#[cfg(test)]
mod tests {
    use std::process::Command;

    use super::*;
    use crate::env::Network;
    use crate::mapping::{Mapping, Side, Vehicle};

    /// Error of starting this command instead of the transport process.
    fn started_as(words: &'static [&'static str]) -> String {
        let command = || {
            let mut command = Command::new(words[0]);
            command.args(&words[1..]);
            command
        };
        let options = Options::from_mapping(&Mapping::of(Vehicle::Plain, Network::default()), Side::Stack);
        let process = TransportProcess { command: Box::new(command), memory_mib: 256, setup: Vec::new() };
        Transport::start(&options, process).err().map_or_else(String::new, |error| error.to_string())
    }

    #[test]
    fn transport_reports_a_process_that_does_not_start() {
        for (words, told) in [
            (&["sh", "-c", "exit 3"][..], "ended (exit status: 3)"),
            (
                &["sh", "-c", "kill -ABRT $$"],
                "what came asked for more than ros2.transport_memory_mib = 256, or it failed",
            ),
            (&["/nowhere/at/all"], "could not be started: No such file or directory"),
            // A frame of four gigabytes.
            (&["sh", "-c", "printf '\\377\\377\\377\\377' >&0"], "ended ("),
        ] {
            let error = started_as(words);
            assert!(
                error.contains("the ROS 2 transport does not start") && error.contains(told),
                "{words:?}: {error}"
            );
        }
    }
}
