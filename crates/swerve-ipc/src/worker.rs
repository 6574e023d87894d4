//! Worker: executes the steps that it is called for until the coordinator is gone.

use core::time::Duration;
use std::io::{self, Read};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread::Builder;

use serde::{Deserialize, Serialize};
use swerve_flow::Worker;
use swerve_msg::block::reading;

use crate::IpcError;
use crate::folder::Address;
use crate::lend::{Shelves, StreamMemory};
use crate::link::{LOOK_AROUND, Names, now};
use crate::message::{Head, Kind, TALK};
use crate::service::{Hub, Receiver, Sender};
use crate::waker::{Listener, Signal, Timeout, Waker};

/// WorkerSetup that a worker receives at its start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct WorkerSetup {
    pub(crate) address: Address,
    /// Name of the worker process.
    pub process: String,
    /// Number of this start, counted from 1.
    pub(crate) start: u64,
    /// Operators whose steps the worker executes.
    pub operators: Vec<String>,
    /// Data from which the worker builds the graph of these operators.
    pub payload: Vec<u8>,
    /// Time to spin before sleeping while it waits for the next call, microseconds.
    pub(crate) spin_us: u64,
    /// Memories that it reads in place, where sensors write them.
    pub(crate) memories: Vec<StreamMemory>,
}

impl WorkerSetup {
    /// Reads the setup from standard input, which has to be left open.
    ///
    /// # Errors
    /// If the input is not a worker's setup, as when no coordinator started this process.
    pub fn read(mut from: impl Read) -> io::Result<Self> {
        const BYTES_MAX: u64 = 1 << 30;
        let mut length = [0; 8];
        from.read_exact(&mut length)?;
        let wrong = |what: String| io::Error::new(io::ErrorKind::InvalidData, what);
        let length = Some(u64::from_le_bytes(length)).filter(|length| *length <= BYTES_MAX);
        let length = length.ok_or_else(|| wrong("this is not a worker's setup".into()))?;
        let mut bytes = Vec::new();
        from.take(length).read_to_end(&mut bytes)?;
        postcard::from_bytes(&bytes).map_err(|error| wrong(format!("the setup of a worker: {error}")))
    }

    /// Encodes the setup as [`read`](Self::read) expects it.
    pub(crate) fn framed(&self) -> Vec<u8> {
        let bytes = postcard::to_allocvec(self).expect("plain values serialize without fail");
        [&(bytes.len() as u64).to_le_bytes(), &bytes[..]].concat()
    }
}

/// Executes steps until the coordinator is gone.
///
/// # Errors
/// If the run's shared memory is missing or cannot be used.
pub fn work(setup: &WorkerSetup, worker: Worker) -> Result<(), IpcError> {
    const ANSWER_BYTES: usize = 16 * 1024;
    let hub = Hub::join(&setup.address)?;
    let names = Names::of(&setup.process);
    let waker = Arc::new(Waker::inherited(LOOK_AROUND).map_err(IpcError::of("the wake-up channel"))?);
    let calls = hub.receiver(&names.calls, TALK)?;
    let answers = hub.sender(&names.answers, TALK, ANSWER_BYTES)?;
    let shelves = Rc::new(Shelves::new(&hub, &setup.memories)?);
    let orphaned = Arc::new(AtomicBool::new(false));
    let (_here, is_left) = sync_channel::<()>(1);
    let (end, alone) = (waker.clone(), orphaned.clone());
    let watch = move || {
        const GRACE: Duration = Duration::from_secs(1);
        // The coordinator's end closes however the coordinator ends.
        end.wait_closed();
        alone.store(true, Ordering::SeqCst);
        // Wait until the loop below is left; the result of a longer step is of no use.
        if is_left.recv_timeout(GRACE).is_err_and(|error| error == std::sync::mpsc::RecvTimeoutError::Timeout)
        {
            std::process::exit(1);
        }
    };
    Builder::new().name("swerve-orphan".into()).spawn(watch).map_err(IpcError::of("starting a thread"))?;
    let spin = Duration::from_micros(setup.spin_us);
    waker.ready(setup.start);
    let mut server =
        CallServer { worker, shelves, answers, waker: waker.clone(), answer: Vec::new(), answered: None };
    let mut listener = Listener::at(waker);
    let mut spin_until = now() + spin;
    while !orphaned.load(Ordering::SeqCst) {
        if spin > Duration::ZERO && now() < spin_until {
            if server.take_slice(&calls)? {
                spin_until = now() + spin;
            } else {
                core::hint::spin_loop();
            }
            continue;
        }
        match listener.listen(Timeout::Set) {
            Signal::Wake | Signal::Ready(_) | Signal::TimedOut => {
                if server.take_slice(&calls)? {
                    spin_until = now() + spin;
                }
            }
            Signal::Closed => break,
        }
    }
    Ok(())
}

/// Answers the calls of the coordinator.
struct CallServer {
    worker: Worker,
    shelves: Rc<Shelves>,
    answers: Sender,
    waker: Arc<Waker>,
    /// The last answer.
    answer: Vec<u8>,
    /// Sequence number of the call that it answers, and its kind.
    answered: Option<(u64, Kind)>,
}

impl CallServer {
    /// Executes the next call that arrived, if any; returns true if there was one.
    fn take_slice(&mut self, calls: &Receiver) -> Result<bool, IpcError> {
        let Some(call) = calls.receive().map_err(IpcError::of("receiving a call"))? else { return Ok(false) };
        self.take(*call.user_header(), call.payload())?;
        Ok(true)
    }

    /// Executes the step that a call requests, and answers.
    fn take(&mut self, head: Head, call: &[u8]) -> Result<(), IpcError> {
        // A call is repeated if its answer was lost or the step takes long.
        match self.answered {
            Some((seq, kind)) if seq == head.seq => return self.reply(seq, kind),
            Some((seq, _)) if seq > head.seq => return Ok(()),
            _ => {}
        }
        self.answer.clear();
        let (oldest, body) = self.shelves.split(call).unwrap_or_default();
        let answered = reading(self.shelves.clone(), || self.worker.answer(body, &mut self.answer));
        let kind = match answered {
            Ok(()) => Kind::Answer,
            Err(error) => {
                self.answer.clear();
                if self.shelves.has_missed() {
                    Kind::Missing
                } else {
                    self.answer.extend_from_slice(error.to_string().as_bytes());
                    Kind::Refused
                }
            }
        };
        self.answered = Some((head.seq, kind));
        self.reply(head.seq, kind)?;
        self.shelves.tidy(oldest);
        Ok(())
    }

    fn reply(&self, seq: u64, kind: Kind) -> Result<(), IpcError> {
        self.answers.send(seq, kind, &self.answer)?;
        self.waker.wake();
        Ok(())
    }
}
