//! A call to a worker and its answer.

use core::time::Duration;
use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::Instant;

use serde::Serialize;
use swerve_flow::{Answered, Call, Elsewhere, Lost};
use swerve_msg::block::writing;

use crate::service::{Bell, Button, Head, Hub, Kind, Received, Receiver, Sender, TALK, send};
use crate::{Happening, IpcError, Told};

/// How long the waiting one sleeps before it looks around by itself. It is woken for whatever happens; this is
/// for a bell that did not ring.
const LOOK_AROUND: Duration = Duration::from_millis(20);

/// The services between the coordinator and one worker.
pub(crate) struct Names {
    pub(crate) calls: String,
    pub(crate) answers: String,
    /// Wakes the worker.
    pub(crate) worker_bell: String,
    /// Wakes the coordinator.
    pub(crate) coordinator_bell: String,
}

impl Names {
    pub(crate) fn of(process: &str) -> Self {
        let name = |what: &str| format!("{what}/{process}");
        Self {
            calls: name("calls"),
            answers: name("answers"),
            worker_bell: name("worker"),
            coordinator_bell: name("coordinator"),
        }
    }
}

/// What went between the processes of a run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Traffic {
    /// Steps that were taken elsewhere.
    pub calls: u64,
    /// Bytes of calls and answers.
    pub bytes: u64,
    /// Bytes among these of numbers that fill images and clouds, of runs longer than [`BIG`](Traffic::BIG).
    pub copied: u64,
    /// How many such runs were read where they lie instead.
    pub in_place: u64,
}

impl Traffic {
    /// From so many bytes on, copying is what costs.
    pub const BIG: usize = 64 * 1024;
}

#[derive(Default)]
pub(crate) struct Counts {
    calls: AtomicU64,
    bytes: AtomicU64,
    copied: AtomicU64,
    in_place: AtomicU64,
}

impl Counts {
    pub(crate) fn traffic(&self) -> Traffic {
        let read = |counter: &AtomicU64| counter.load(Ordering::Relaxed);
        Traffic {
            calls: read(&self.calls),
            bytes: read(&self.bytes),
            copied: read(&self.copied),
            in_place: read(&self.in_place),
        }
    }

    fn add(counter: &AtomicU64, n: usize) {
        counter.fetch_add(n as u64, Ordering::Relaxed);
    }
}

/// What is known of a worker's life; the thread that watches it tells.
#[derive(Default)]
pub(crate) struct Watched(Mutex<Life>);

#[derive(Default)]
pub(crate) struct Life {
    /// How often it was started.
    pub(crate) starts: u64,
    /// The last start that came to be ready.
    pub(crate) ready: u64,
    /// Why it is gone, if it is.
    pub(crate) gone: Option<String>,
    /// How it ended last.
    pub(crate) ended: String,
}

impl Watched {
    pub(crate) fn life(&self) -> MutexGuard<'_, Life> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The coordinator's end of what connects it with one worker.
pub(crate) struct Link {
    process: String,
    calls: Sender,
    answers: Receiver,
    worker: Button,
    bell: Bell,
    /// For so long an answer is waited for without sleeping.
    spin: Duration,
    watched: Arc<Watched>,
    counts: Arc<Counts>,
    told: Told,
    /// The start of the worker that the last call went to.
    start: u64,
    seq: u64,
    call: Vec<u8>,
}

impl Link {
    pub(crate) fn new(
        hub: &Hub,
        process: &str,
        spin: Duration,
        watched: Arc<Watched>,
        (counts, told): (Arc<Counts>, Told),
    ) -> Result<Self, IpcError> {
        const CALL_BYTES: usize = 16 * 1024;
        let names = Names::of(process);
        Ok(Self {
            process: process.to_owned(),
            calls: hub.sender(&names.calls, TALK, 2, CALL_BYTES)?,
            answers: hub.receiver(&names.answers, TALK)?,
            worker: hub.button(&names.worker_bell)?,
            bell: hub.bell(&names.coordinator_bell)?,
            spin,
            watched,
            counts,
            told,
            start: 0,
            seq: 0,
            call: Vec::new(),
        })
    }

    /// Waits until the worker says that it is ready.
    pub(crate) fn wait_ready(&mut self, until: Instant) -> Result<(), IpcError> {
        let error = |process: &str, why: String| IpcError::Worker { process: process.to_owned(), why };
        while self.connect().is_err() {
            if let Some(why) = &self.watched.life().gone {
                return Err(error(&self.process, format!("{why} before it was ready")));
            }
            if now() >= until {
                return Err(error(&self.process, "was not ready in time".into()));
            }
            self.bell.wait(LOOK_AROUND);
        }
        Ok(())
    }

    /// Makes sure that there is a worker that takes calls; says which start of it that is.
    fn connect(&mut self) -> Result<u64, Lost> {
        let (starts, ready) = {
            let life = self.watched.life();
            if let Some(why) = &life.gone {
                return Err(self.lost(why));
            }
            (life.starts, life.ready)
        };
        if ready < starts {
            let is_ready = |head: &Head| Kind::of(head) == Some(Kind::Ready) && head.seq == starts;
            loop {
                match self.receive()? {
                    Some(message) if is_ready(message.user_header()) => break,
                    Some(_) => {}
                    None => {
                        let ended = self.watched.life().ended.clone();
                        return Err(self.lost(&format!("{ended} and is not ready yet")));
                    }
                }
            }
            self.watched.life().ready = starts;
            if starts > 1 {
                (self.told)(Happening::Restarted { process: self.process.clone() });
            }
        }
        self.start = starts;
        Ok(starts)
    }

    fn receive(&self) -> Result<Option<Received>, Lost> {
        self.answers.receive().map_err(|error| self.lost(&format!("cannot be heard: {error:?}")))
    }

    fn lost(&self, why: &str) -> Lost {
        Lost(format!("process `{}` {why}", self.process))
    }

    /// Has one step taken.
    fn step(&mut self, call: &Call<'_>, answer: &mut Vec<u8>) -> Result<u64, Lost> {
        let start = self.connect()?;
        self.seq += 1;
        Counts::add(&self.counts.calls, 1);
        let mut message = self.send_and_wait(call, true)?;
        if Kind::of(message.user_header()) == Some(Kind::Missing) {
            message = self.send_and_wait(call, false)?;
        }
        match Kind::of(message.user_header()) {
            Some(Kind::Answer) => answer.extend_from_slice(message.payload()),
            _ => {
                let why = String::from_utf8_lossy(message.payload());
                return Err(self.lost(&format!("refuses the call: {why}")));
            }
        }
        Ok(start)
    }

    /// Sends a call, with what fills images and clouds as its places or as it is, and waits for the answer.
    fn send_and_wait(&mut self, call: &Call<'_>, places: bool) -> Result<Received, Lost> {
        self.call.clear();
        let ((), written) = writing(places, Traffic::BIG, || call.encode(&mut self.call));
        send(&self.calls, self.seq, Kind::Call, &self.call)
            .map_err(|error| self.lost(&format!("cannot be called: {error}")))?;
        self.worker.ring();
        if self.spin.is_zero() {
            // The answer cannot be there yet.
            self.bell.wait(LOOK_AROUND);
        }
        let message = self.wait()?;
        let answered = message.payload().len();
        Counts::add(&self.counts.bytes, self.call.len() + answered);
        Counts::add(&self.counts.in_place, written.in_place);
        Counts::add(&self.counts.copied, written.copied + if answered > Traffic::BIG { answered } else { 0 });
        Ok(message)
    }

    /// Waits for the answer to the last call.
    fn wait(&self) -> Result<Received, Lost> {
        let spin_until = (self.spin > Duration::ZERO).then(|| now() + self.spin);
        loop {
            while let Some(message) = self.receive()? {
                if message.user_header().seq == self.seq
                    && Kind::of(message.user_header()) != Some(Kind::Ready)
                {
                    return Ok(message);
                }
            }
            if spin_until.is_some_and(|until| now() < until) {
                core::hint::spin_loop();
                continue;
            }
            {
                let life = self.watched.life();
                if let Some(why) = &life.gone {
                    return Err(self.lost(why));
                }
                if life.starts != self.start {
                    return Err(self.lost(&life.ended));
                }
            }
            self.bell.wait(LOOK_AROUND);
        }
    }
}

/// The steps of one operator, taken by a worker.
pub(crate) struct Door {
    pub(crate) link: Arc<Mutex<Link>>,
    /// The start of the worker that took the last step.
    pub(crate) start: u64,
}

impl Elsewhere for Door {
    fn step(&mut self, call: &Call<'_>, answer: &mut Vec<u8>) -> Result<Answered, Lost> {
        let mut link = self.link.lock().unwrap_or_else(PoisonError::into_inner);
        let start = link.step(call, answer)?;
        let before = core::mem::replace(&mut self.start, start);
        Ok(if before == start { Answered::InTurn } else { Answered::Afresh })
    }
}

/// The present moment of the real clock.
#[expect(
    clippy::disallowed_methods,
    reason = "how long to wait for another process; no result depends on it"
)]
pub(crate) fn now() -> Instant {
    Instant::now()
}
