//! Transport process: forwards messages between DDS and the program until the program is gone.

use std::io;
use std::net::Shutdown;
use std::os::fd::AsFd;
use std::os::unix::net::UnixStream;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::Duration;

use rustix::process::{Resource, Rlimit, setrlimit};

use super::frame::{News, Order, read, write};
use crate::bridge::{Bridge, EndpointId, Options, Received, ServiceError, ServiceSide};
use crate::cdr;
use crate::convert::is_mode_taken;

/// Polling period for received messages.
const LOOK_EVERY: Duration = Duration::from_millis(20);
/// Period of statistics.
const COUNT_EVERY: Duration = Duration::from_millis(100);
/// An order still in progress after more than this many consecutive statistics hangs.
const LOOKS_MAX: u32 = 9;
/// Exit status of a process that hangs in DDS.
pub(super) const HANGS: i32 = 75;
/// Maximum time for the shutdown of DDS.
const END_WITHIN: Duration = Duration::from_secs(1);

/// Connection to the program.
struct Program {
    socket: UnixStream,
    /// Serialises the writing of frames.
    writing: Mutex<()>,
}

impl Program {
    /// Sends a message to the program. If the program has died, the reader of its orders notices.
    fn tell(&self, news: &News) {
        let _one = self.writing.lock().unwrap_or_else(PoisonError::into_inner);
        match write(&self.socket, news) {
            Err(error) if error.kind() != io::ErrorKind::InvalidData => {
                let _gone = self.socket.shutdown(Shutdown::Both);
            }
            // Messages that are too long to forward are dropped.
            _ => {}
        }
    }
}

/// A process whose program has died without ending it.
pub struct Orphan<'a> {
    /// The node.
    pub bridge: &'a Bridge,
    /// [`TransportProcess::setup`](super::TransportProcess::setup).
    pub setup: Vec<u8>,
    /// Last state left with it by [`Transport::leave`](super::Transport::leave).
    pub state: Vec<u8>,
}

/// Forwards messages for the program that started this process, over standard input. If the program dies after it
/// has left a state, `orphaned` is called before this process ends.
///
/// # Errors
/// If the process was not started by a [`Transport`](super::Transport).
pub fn run(orphaned: impl FnOnce(Orphan<'_>)) -> io::Result<()> {
    let socket = UnixStream::from(io::stdin().as_fd().try_clone_to_owned()?);
    let Order::Start { options, memory_bytes, setup } = read(&socket)? else {
        return Err(io::Error::new(io::ErrorKind::InvalidData, "this is not a transport's start message"));
    };
    limit(memory_bytes)?;
    let program = Program { socket, writing: Mutex::default() };
    let bridge = match Bridge::start(&options) {
        Ok(bridge) => bridge,
        Err(error) => {
            program.tell(&News::Refused(error.to_string()));
            return Ok(());
        }
    };
    program.tell(&News::Started);
    let ended = AtomicBool::new(false);
    // Odd while an order is being executed.
    let order = AtomicU64::new(0);
    let mut state = None;
    thread::scope(|scope| {
        scope.spawn(|| hand_on(&bridge, &options, &program, &ended));
        let counting = scope.spawn(|| {
            let (mut busy_with, mut looks) = (None, 0);
            while !ended.load(Ordering::Relaxed) {
                program.tell(&News::Counts { counts: bridge.statistics(), asked: false });
                thread::park_timeout(COUNT_EVERY);
                let now = Some(order.load(Ordering::Relaxed)).filter(|order| !order.is_multiple_of(2));
                looks = if now.is_some() && now == busy_with { looks + 1 } else { 0 };
                busy_with = now;
                if looks > LOOKS_MAX {
                    // DDS hangs while publishing; a new process starts without that problem.
                    std::process::exit(HANGS);
                }
            }
        });
        while let Ok(next) = read(&program.socket) {
            order.fetch_add(1, Ordering::Relaxed);
            match next {
                Order::Start { .. } | Order::End => {
                    state = None;
                    break;
                }
                Order::Leave { state: newest } => state = Some(newest),
                Order::Count => program.tell(&News::Counts { counts: bridge.statistics(), asked: true }),
                Order::Publish { endpoint, payload } => {
                    publish(&bridge, &options, endpoint, &payload);
                    program.tell(&News::Sent);
                }
                Order::AskMode { number, mode, timeout_ms } => {
                    let (bridge, program) = (&bridge, &program);
                    scope.spawn(move || {
                        let asked = bridge.request_control_mode(mode, Duration::from_millis(timeout_ms));
                        let taken = asked.map_err(|error: ServiceError| error.to_string());
                        program.tell(&News::Answer { number, taken });
                    });
                }
            }
            order.fetch_add(1, Ordering::Relaxed);
        }
        ended.store(true, Ordering::Relaxed);
        counting.thread().unpark();
    });
    if let Some(state) = state {
        orphaned(Orphan { bridge: &bridge, setup, state });
    }
    // This process ends in any case, even if DDS hangs.
    let _either_way = bridge.stop(END_WITHIN);
    std::process::exit(0)
}

/// Limits the memory of this process: an excessive allocation ends this process and nothing else.
fn limit(memory_bytes: u64) -> io::Result<()> {
    let at_most = |bytes| Rlimit { current: Some(bytes), maximum: Some(bytes) };
    setrlimit(Resource::As, at_most(memory_bytes))?;
    // No core file, which would delay its end.
    Ok(setrlimit(Resource::Core, at_most(0))?)
}

fn publish(bridge: &Bridge, options: &Options, endpoint: usize, payload: &[u8]) {
    let Some(kind) = options.endpoints.get(endpoint).map(|endpoint| endpoint.kind) else { return };
    if let Ok(message) = cdr::decode_unchecked(kind, payload) {
        // The bridge counts messages that are not sent.
        let _counted = bridge.publish(EndpointId(endpoint), message);
    }
}

/// Forwards received messages and requests.
fn hand_on(bridge: &Bridge, options: &Options, program: &Program, ended: &AtomicBool) {
    let serves = matches!(options.control_mode_service, Some((ServiceSide::Server, _)));
    while !ended.load(Ordering::Relaxed) {
        bridge.wait(LOOK_EVERY);
        while let Some((EndpointId(endpoint), received)) = bridge.take_any() {
            let Received { writer, message, received_ns, source_ns, stamp } = received;
            let payload = cdr::encode(&message);
            program.tell(&News::Message { endpoint, writer, received_ns, source_ns, stamp, payload });
        }
        if serves {
            let serve = |mode| {
                program.tell(&News::Mode(mode));
                is_mode_taken(mode)
            };
            // The service exists: its request was just received.
            let _served = bridge.serve_control_mode(serve);
        }
    }
}
