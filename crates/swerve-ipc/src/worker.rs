//! A worker: takes the steps that it is called for until the coordinator is gone.

use core::time::Duration;
use std::io::{self, Read};
use std::rc::Rc;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::sync_channel;
use std::thread::Builder;

use serde::{Deserialize, Serialize};
use swerve_flow::Workshop;
use swerve_msg::block::reading;

use crate::IpcError;
use crate::folder::Address;
use crate::lend::{Shelves, StreamMemory};
use crate::link::{Names, now};
use crate::service::{Hub, Kind, TALK, send};

/// What a worker is told at its start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Setup {
    pub(crate) address: Address,
    /// Its name.
    pub process: String,
    /// Which start of it this is.
    pub(crate) start: u64,
    /// The operators whose steps it takes.
    pub operators: Vec<String>,
    /// What it needs to build the graph of which they are.
    pub payload: Vec<u8>,
    /// For so long it waits for the next call without sleeping, microseconds.
    pub(crate) spin_us: u64,
    /// What it reads where sensors write it.
    pub(crate) memories: Vec<StreamMemory>,
}

impl Setup {
    /// Reads it from standard input, which has to be left open.
    ///
    /// # Errors
    /// When it was not a coordinator that started this process.
    pub fn read(mut from: impl Read) -> io::Result<Self> {
        const BYTES_MAX: u64 = 1 << 30;
        let mut length = [0; 8];
        from.read_exact(&mut length)?;
        let wrong = |what: String| io::Error::new(io::ErrorKind::InvalidData, what);
        let length = Some(u64::from_le_bytes(length)).filter(|length| *length <= BYTES_MAX);
        let length = length.ok_or_else(|| wrong("this is no setup of a worker".into()))?;
        let mut bytes = Vec::new();
        from.take(length).read_to_end(&mut bytes)?;
        postcard::from_bytes(&bytes).map_err(|error| wrong(format!("the setup of a worker: {error}")))
    }

    /// As [`read`](Self::read) expects it.
    pub(crate) fn framed(&self) -> Vec<u8> {
        let bytes = postcard::to_allocvec(self).expect("plain values serialize without fail");
        [&(bytes.len() as u64).to_le_bytes(), &bytes[..]].concat()
    }
}

/// Takes steps until the coordinator is gone.
///
/// # Errors
/// When the run's shared memory is not there, or cannot be used.
pub fn work(setup: &Setup, mut workshop: Workshop) -> Result<(), IpcError> {
    const ANSWER_BYTES: usize = 16 * 1024;
    /// The bell rings for whatever happens; this is for one that did not.
    const LOOK_AROUND: Duration = Duration::from_millis(50);
    let hub = Hub::join(&setup.address)?;
    let names = Names::of(&setup.process);
    let bell = hub.bell(&names.worker_bell)?;
    let calls = hub.receiver(&names.calls, TALK)?;
    let answers = hub.sender(&names.answers, TALK, 2, ANSWER_BYTES)?;
    let shelves = Rc::new(Shelves::new(&hub, &setup.memories)?);
    let coordinator = hub.button(&names.coordinator_bell)?;
    let orphaned = Arc::new(AtomicBool::new(false));
    let (_here, is_left) = sync_channel::<()>(1);
    let (own, alone) = (hub.button(&names.worker_bell)?, orphaned.clone());
    let watch = move || {
        const GRACE: Duration = Duration::from_secs(1);
        // Whatever ends the coordinator closes its end of the pipe.
        let _end = io::stdin().read_to_end(&mut Vec::new());
        alone.store(true, Ordering::SeqCst);
        own.ring();
        // Held up until the loop below is left; a step that takes longer is of no use to anybody.
        if is_left.recv_timeout(GRACE).is_err_and(|error| error == std::sync::mpsc::RecvTimeoutError::Timeout)
        {
            std::process::exit(1);
        }
    };
    Builder::new().name("swerve-orphan".into()).spawn(watch).map_err(IpcError::of("starting a thread"))?;
    send(&answers, setup.start, Kind::Ready, &[])?;
    coordinator.ring();
    let mut answer = Vec::new();
    let spin = Duration::from_micros(setup.spin_us);
    let mut spin_until = now() + spin;
    while !orphaned.load(Ordering::SeqCst) {
        let Some(call) = calls.receive().map_err(IpcError::of("receiving a call"))? else {
            if spin > Duration::ZERO && now() < spin_until {
                core::hint::spin_loop();
            } else {
                bell.wait(LOOK_AROUND);
            }
            continue;
        };
        let seq = call.user_header().seq;
        answer.clear();
        let answered = reading(shelves.clone(), || workshop.answer(call.payload(), &mut answer));
        match answered {
            Ok(()) => send(&answers, seq, Kind::Answer, &answer)?,
            Err(_) if shelves.has_missed() => send(&answers, seq, Kind::Missing, &[])?,
            Err(error) => send(&answers, seq, Kind::Refused, error.to_string().as_bytes())?,
        }
        coordinator.ring();
        drop(call);
        shelves.tidy();
        if spin > Duration::ZERO {
            spin_until = now() + spin;
        }
    }
    Ok(())
}
