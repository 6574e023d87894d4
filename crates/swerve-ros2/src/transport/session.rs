//! Life cycle of the transport processes, one after the other.

use std::io;
use std::net::Shutdown;
use std::os::fd::OwnedFd;
use std::os::unix::net::UnixStream;
use std::os::unix::process::{CommandExt, ExitStatusExt};
use std::process::{ExitStatus, Stdio};
use std::sync::mpsc::sync_channel;
use std::thread;
use std::time::Duration;

use super::frame::{News, Order, read, write};
use super::process::HANGS;
use super::shared::{START_WITHIN, Session, Shared, State, TransportProcess, WINDOW};
use crate::bridge::{Options, Received};
use crate::cdr;

/// Silence after which a process, which reports ten times a second, is considered hanging.
const SILENCE_MAX: Duration = Duration::from_secs(1);
/// Increment of the pause after each process that did not start, up to [`PAUSE_MAX`].
const PAUSE: Duration = Duration::from_millis(100);
const PAUSE_MAX: Duration = Duration::from_secs(1);
/// Maximum number of losses kept until they are taken.
const LOSSES_MAX: usize = 100;

/// End of a process.
struct End {
    /// True if its node was created.
    started: bool,
    why: String,
}

/// Starts processes, one after the other, until the transport is stopped.
pub(super) fn watch(shared: &Shared, options: &Options, process: &TransportProcess) {
    let mut futile = 0;
    loop {
        let ended = live(shared, options, process);
        let (started, why) = match ended {
            Ok(End { started, why }) => (started, why),
            Err(error) => (false, format!("could not be started: {error}")),
        };
        let mut state = shared.lock();
        state.close();
        if state.is_ending {
            return;
        }
        if !started && state.lost == 0 && state.began.is_none() {
            state.began = Some(Err(why));
            shared.news.notify_all();
            return;
        }
        state.lost += 1;
        if state.losses.len() < LOSSES_MAX {
            state.losses.push(format!("the process of ROS 2's transport {why}: a fresh one is started"));
        }
        drop(state);
        shared.news.notify_all();
        futile = if started { 0 } else { futile + 1 };
        if futile > 0 && shared.wait((PAUSE * futile).min(PAUSE_MAX), |state| state.is_ending).1 {
            return;
        }
    }
}

/// Starts a process and reads from it until it ends or hangs.
fn live(shared: &Shared, options: &Options, process: &TransportProcess) -> io::Result<End> {
    let (ours, theirs) = UnixStream::pair()?;
    let mut command = (process.command)();
    // Limits the address space that each thread reserves, which counts towards the memory limit.
    command.env("MALLOC_ARENA_MAX", "2");
    // A separate process group, so that terminal signals reach only the program.
    command.process_group(0).stdin(OwnedFd::from(theirs)).stdout(Stdio::null());
    let mut child = command.spawn()?;
    // The command holds the other end of the socket.
    drop(command);
    let memory_bytes = u64::from(process.memory_mib) << 20;
    let mut started = false;
    let (orders, queue) = sync_channel::<Order>(WINDOW + 4);
    let mut orders = Some(orders);
    let heard = thread::scope(|scope| {
        let mut listen = || {
            ours.set_write_timeout(Some(SILENCE_MAX))?;
            ours.set_read_timeout(Some(START_WITHIN))?;
            write(
                &ours,
                &Order::Start {
                    options: Box::new(options.clone()),
                    memory_bytes,
                    setup: process.setup.clone(),
                },
            )?;
            loop {
                let news: News = read(&ours)?;
                if let (News::Started, Some(orders)) = (&news, orders.take()) {
                    started = true;
                    ours.set_read_timeout(Some(SILENCE_MAX))?;
                    shared.lock().session = Some(Session { orders, socket: ours.try_clone()? });
                }
                if let News::Refused(why) = news {
                    return Ok(why);
                }
                shared.lock().hear(news, options);
                shared.news.notify_all();
            }
        };
        scope.spawn(|| {
            for order in queue {
                if write(&ours, &order).is_err() {
                    break;
                }
            }
            // A process that cannot be written to is of no use.
            let _gone = ours.shutdown(Shutdown::Both);
        });
        let heard: io::Result<String> = listen();
        // The writing thread ends when the last sender is dropped.
        shared.lock().session = None;
        orders = None;
        let _gone = ours.shutdown(Shutdown::Both);
        heard
    });
    // It has ended or is unusable; the status of a process that ended by itself is kept.
    let _gone = child.kill();
    let status = child.wait()?;
    let why = match heard {
        Ok(refused) => refused,
        Err(error) => {
            let hangs = matches!(error.kind(), io::ErrorKind::WouldBlock | io::ErrorKind::TimedOut);
            ended(hangs, status, process.memory_mib)
        }
    };
    Ok(End { started, why })
}

/// Description of the end of a process.
fn ended(hangs: bool, status: ExitStatus, memory_mib: u32) -> String {
    const ABORT: i32 = 6;
    if status.code() == Some(HANGS) {
        return "hung in DDS for a second and ended itself".to_owned();
    }
    if hangs {
        return format!("was silent for {} s and was killed", SILENCE_MAX.as_secs());
    }
    let hint = match status.signal() {
        Some(ABORT) => {
            format!("; what came asked for more than ros2.transport_memory_mib = {memory_mib}, or it failed")
        }
        _ => String::new(),
    };
    format!("ended ({status}{hint})")
}

impl State {
    /// Processes a message from the process.
    fn hear(&mut self, news: News, options: &Options) {
        match news {
            News::Started => self.began = Some(Ok(())),
            News::Refused(_) => {}
            News::Sent => self.on_their_way = self.on_their_way.saturating_sub(1),
            News::Mode(mode) => {
                if self.modes.len() < LOSSES_MAX {
                    self.modes.push(mode);
                }
            }
            News::Answer { number, taken } => {
                self.answers.insert(number, taken);
            }
            News::Counts { counts, asked } => {
                self.counted += u64::from(asked);
                if counts.len() == options.endpoints.len() {
                    self.counts = counts;
                }
            }
            News::Message { endpoint, writer, received_ns, source_ns, stamp, payload } => {
                let Some(kind) = options.endpoints.get(endpoint).map(|endpoint| endpoint.kind) else {
                    return;
                };
                // The process has validated it; drop the message if it does not decode here.
                if let Ok(message) = cdr::decode_any(kind, &payload) {
                    let received = Received { writer, message, received_ns, source_ns, stamp };
                    self.inboxes[endpoint].push(received, received_ns);
                }
            }
        }
    }

    /// Adds the statistics of a process that ended to those of earlier processes.
    fn close(&mut self) {
        self.session = None;
        self.on_their_way = 0;
        let mut counts = std::mem::take(&mut self.counts);
        if counts.is_empty() {
            return;
        }
        for (counts, earlier) in counts.iter_mut().zip(&self.earlier) {
            counts.add(earlier);
        }
        counts.iter_mut().for_each(|counts| counts.matched = 0);
        self.earlier = counts;
    }
}
