//! Steps that are taken by another process, which has built the same graph.
//!
//! Here the operator's body is replaced by one that puts a step into a [`Call`] and hands that to an
//! [`RemoteExecutor`]. There a [`Worker`] holds the operators themselves, and answers calls. What carries both is
//! no business of the engine. Calls and answers are in postcard; payloads keep their digest on the way, so that
//! a run comes out the same wherever its steps are taken.

use std::sync::{Arc, PoisonError};

use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Span, Time};
use thiserror::Error;

use crate::engine::run_step;
use crate::input::Slot;
use crate::message::{Header, Msg};
use crate::operator::{Body, Context, Cut, Meter, Offered, Task};
use crate::payload::{FromWire, Made, Outs, Sent};
use crate::wall::Alarm;

/// Has the steps of one operator taken by somebody else. One for each operator; a step blocks the thread that
/// waits for it.
pub trait RemoteExecutor: Send + 'static {
    /// Has one step taken; what [`Worker::answer`] made of it goes into `answer`, which comes empty.
    ///
    /// # Errors
    /// When the step did not come to its end: who should have taken it is gone. In virtual time this ends the
    /// run; under wall clock the step comes to nothing, and the run goes on.
    fn step(&mut self, call: &Call<'_>, answer: &mut Vec<u8>) -> Result<Answered, Lost>;
}

/// How a remote step was answered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answered {
    /// By an operator that remembers its steps so far.
    InTurn,
    /// By one that was restarted: this was the first step since.
    Restarted,
}

/// Why a remote step did not come to its end.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct Lost(pub String);

/// One step that somebody else is to take.
pub struct Call<'a> {
    operator: &'a str,
    task: &'a Task,
    slots: &'a [Slot],
}

impl Call<'_> {
    /// Whose step.
    pub fn operator(&self) -> &str {
        self.operator
    }

    /// For which stamp.
    pub fn stamp(&self) -> Time {
        self.task.stamp
    }

    /// Appends all that it takes to take the step. May be done more than once, should what was sent get lost.
    pub fn encode(&self, out: &mut Vec<u8>) {
        let cut = self.task.meter.cut.as_ref().map(|cut| CutWire {
            limit: cut.limit,
            offers_max: cut.offers_max,
            offers_wanted: cut.offered.is_some(),
            left: cut.time_is_out.as_ref().map(Alarm::left),
        });
        let head = CallWire {
            operator: self.operator,
            now: self.task.now,
            stamp: self.task.stamp,
            deadline: self.task.deadline,
            seed: self.task.seed,
            cut,
            slots: self.slots.len(),
        };
        put(&head, out);
        let mut payload = Vec::new();
        for slot in self.slots {
            let (kind, msgs): (SlotKind, Vec<&Msg>) = match slot {
                Slot::Empty => (SlotKind::Empty, Vec::new()),
                Slot::Tick => (SlotKind::Tick, Vec::new()),
                Slot::Message(msg) => (SlotKind::Message, vec![msg]),
                Slot::Window(msgs) => (SlotKind::Window, msgs.iter().collect()),
            };
            put(&(kind, msgs.len()), out);
            for msg in msgs {
                put(&msg.header, out);
                put_sent(&msg.sent, &mut payload, out);
            }
        }
    }
}

#[derive(Serialize, Deserialize)]
struct CallWire<'a> {
    operator: &'a str,
    now: Time,
    stamp: Time,
    deadline: Option<Time>,
    seed: u64,
    cut: Option<CutWire>,
    slots: usize,
}

#[derive(Serialize, Deserialize)]
struct CutWire {
    limit: Option<u64>,
    offers_max: Option<u64>,
    offers_wanted: bool,
    /// Until the deadline on the real clock.
    left: Option<Span>,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
enum SlotKind {
    Empty,
    Tick,
    Message,
    Window,
}

#[derive(Serialize, Deserialize)]
struct AnswerWire<'a> {
    panic: Option<&'a str>,
    stop_run: Option<&'a str>,
    units: u64,
    stopped_at: Option<u64>,
    went_on: bool,
    offers: u64,
    /// How many ports published, and how many offered: port and payload of each follow in this order.
    outs: usize,
    offered: usize,
}

fn put<T: Serialize>(value: &T, out: &mut Vec<u8>) {
    *out = postcard::to_extend(value, core::mem::take(out))
        .expect("plain values serialize without fail, and memory takes all");
}

fn put_sent(sent: &Sent, scratch: &mut Vec<u8>, out: &mut Vec<u8>) {
    scratch.clear();
    let Made { payload, digest } = sent.clone().into_made();
    payload.to_wire(scratch);
    put(&(digest, scratch.len()), out);
    out.extend_from_slice(scratch);
}

fn take<'de, T: Deserialize<'de>>(bytes: &mut &'de [u8]) -> Result<T, CallError> {
    let (value, rest) = postcard::take_from_bytes(bytes).map_err(|error| CallError(error.to_string()))?;
    *bytes = rest;
    Ok(value)
}

fn take_sent(from_wire: FromWire, bytes: &mut &[u8]) -> Result<Sent, CallError> {
    let (digest, len): (Digest, usize) = take(bytes)?;
    let Some((payload, rest)) = bytes.split_at_checked(len) else {
        return Err(CallError(format!("a payload of {len} bytes is cut off")));
    };
    *bytes = rest;
    Ok(Made { payload: from_wire(payload).map_err(CallError)?, digest }.into())
}

/// Why a call or an answer makes no sense: no step was taken.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct CallError(String);

/// The operators of a graph that another process has stepped here: [`Graph::into_worker`](crate::Graph::into_worker).
pub struct Worker {
    pub(crate) operators: Vec<WorkerOperator>,
}

/// One operator of a worker.
pub(crate) struct WorkerOperator {
    pub(crate) name: Arc<str>,
    pub(crate) body: Box<dyn Body>,
    /// How the messages of each port are made; timers have none.
    pub(crate) ports: Vec<Option<FromWire>>,
}

impl Worker {
    /// Takes the step of a [`Call`]; appends the answer. What the operator panics with is part of that.
    ///
    /// # Errors
    /// When the call is none for an operator of this worker, or a message in it cannot be read. No step was
    /// taken then.
    pub fn answer(&mut self, call: &[u8], answer: &mut Vec<u8>) -> Result<(), CallError> {
        let mut bytes = call;
        let head: CallWire<'_> = take(&mut bytes)?;
        let operator = self.operators.iter_mut().find(|operator| &*operator.name == head.operator);
        let operator = operator.ok_or_else(|| CallError(format!("no operator `{}` here", head.operator)))?;
        if head.slots != operator.ports.len() {
            return Err(CallError(format!("{} ports, expected {}", head.slots, operator.ports.len())));
        }
        let mut slots = Vec::with_capacity(head.slots);
        for port in &operator.ports {
            slots.push(take_slot(*port, &mut bytes)?);
        }
        let mut task = Task { deadline: head.deadline, ..Task::new(head.now, head.stamp, head.seed) };
        let offered = Offered::default();
        task.meter.cut = head.cut.map(|cut| {
            Box::new(Cut {
                limit: cut.limit,
                offers_max: cut.offers_max,
                offered: cut.offers_wanted.then(|| offered.clone()),
                time_is_out: cut.left.map(Alarm::after),
                ..Cut::default()
            })
        });
        let mut outs = Outs::default();
        let panic = run_step(&mut *operator.body, &operator.name, &mut task, &mut slots, &mut outs);
        let (offers, offered) = offered.lock().map(|o| o.clone()).unwrap_or_default();
        let Task { meter: Meter { units, cut }, unusual, .. } = task;
        let stop_run = unusual.and_then(|unusual| unusual.stop_run);
        let head = AnswerWire {
            panic: panic.as_deref(),
            stop_run: stop_run.as_deref(),
            units,
            stopped_at: cut.as_ref().and_then(|cut| cut.stopped_at),
            went_on: cut.as_ref().is_some_and(|cut| cut.went_on),
            offers,
            outs: outs.len(),
            offered: offered.len(),
        };
        put(&head, answer);
        let mut scratch = Vec::new();
        for (port, sent) in outs.iter().chain(offered.iter()) {
            put(&port, answer);
            put_sent(sent, &mut scratch, answer);
        }
        Ok(())
    }
}

fn take_slot(port: Option<FromWire>, bytes: &mut &[u8]) -> Result<Slot, CallError> {
    let (kind, n): (SlotKind, usize) = take(bytes)?;
    let mut msg = || {
        let header: Header = take(bytes)?;
        let from_wire = port.ok_or_else(|| CallError("a message on a timer's port".into()))?;
        Ok(Msg { header, sent: take_sent(from_wire, bytes)? })
    };
    Ok(match kind {
        SlotKind::Empty => Slot::Empty,
        SlotKind::Tick => Slot::Tick,
        SlotKind::Message => Slot::Message(msg()?),
        SlotKind::Window => Slot::Window((0..n).map(|_| msg()).collect::<Result<_, _>>()?),
    })
}

/// The body of an operator whose steps another process takes.
pub(crate) struct Remote {
    executor: Box<dyn RemoteExecutor>,
    /// How the messages of each output are made.
    ports: Vec<FromWire>,
    answer: Vec<u8>,
}

impl Remote {
    pub(crate) fn new(executor: Box<dyn RemoteExecutor>, ports: Vec<FromWire>) -> Self {
        Self { executor, ports, answer: Vec::new() }
    }

    fn take_in(&self, task: &mut Task, outs: &mut Outs) -> Result<Option<String>, CallError> {
        let mut bytes = &self.answer[..];
        let head: AnswerWire<'_> = take(&mut bytes)?;
        let mut offered = Outs::default();
        for (n, into) in [(head.outs, outs), (head.offered, &mut offered)] {
            for _ in 0..n {
                let port: usize = take(&mut bytes)?;
                let from_wire = self.ports.get(port);
                let from_wire = from_wire.ok_or_else(|| CallError(format!("there is no output {port}")))?;
                into.set(port, take_sent(*from_wire, &mut bytes)?);
            }
        }
        task.meter.units = head.units;
        if let Some(reason) = head.stop_run {
            task.unusual.get_or_insert_default().stop_run = Some(reason.into());
        }
        if let Some(cut) = &mut task.meter.cut {
            (cut.stopped_at, cut.went_on, cut.offers) = (head.stopped_at, head.went_on, head.offers);
            if let Some(shared) = &cut.offered {
                *shared.lock().unwrap_or_else(PoisonError::into_inner) = (head.offers, offered);
            }
        }
        Ok(head.panic.map(str::to_owned))
    }
}

impl Body for Remote {
    fn step(&mut self, cx: &mut Context<'_>, slots: &mut [Slot], outs: &mut Outs) {
        self.answer.clear();
        let call = Call { operator: cx.name, task: &*cx.task, slots };
        let answered = self.executor.step(&call, &mut self.answer);
        slots.fill_with(Slot::default);
        let lost = match answered {
            Err(Lost(why)) => Some(why),
            Ok(answered) => {
                if answered == Answered::Restarted {
                    cx.task.unusual.get_or_insert_default().restarted = true;
                }
                match self.take_in(cx.task, outs) {
                    // It goes on here as what it was there: the engine ends the run with it.
                    Ok(Some(panic)) => std::panic::resume_unwind(Box::new(panic)),
                    Ok(None) => None,
                    Err(error) => Some(format!("its answer makes no sense: {error}")),
                }
            }
        };
        if let Some(why) = lost {
            *outs = Outs::default();
            cx.task.unusual.get_or_insert_default().lost = Some(why);
        }
    }
}
