//! Steps executed by another process, which has built the same graph.
//!
//! In the coordinator, the operator's body is replaced by one that encodes a step as a [`Call`] and passes it to a
//! [`RemoteExecutor`]. In the other process, a [`Worker`] holds the operators themselves and answers calls. The engine
//! does not depend on the transport. Calls and answers are in postcard; payloads keep their digest, so that the result
//! of a run does not depend on where its steps are executed.

use std::sync::{Arc, PoisonError};

use serde::{Deserialize, Serialize};
use swerve_core::{Digest, Span, Time};
use thiserror::Error;

use crate::alarm::Alarm;
use crate::input::Slot;
use crate::message::{Header, Msg};
use crate::operator::{Body, Context, Cut, Meter, Offered, Task, run_step};
use crate::payload::{FromWire, Made};
use crate::sent::{Outs, Sent};

/// Executor of the steps of one operator outside the engine. A step blocks the thread that waits for it.
pub trait RemoteExecutor: Send + 'static {
    /// Executes one step and writes the result of [`Worker::answer`] to `answer`, which is empty at first.
    ///
    /// # Errors
    /// If the step did not complete because its executor is gone. In virtual time this ends the run; under wall clock
    /// the step has no result, and the run goes on.
    fn step(&mut self, call: &Call<'_>, answer: &mut Vec<u8>) -> Result<Answered, Lost>;
}

/// State of the operator that executed a remote step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Answered {
    /// The operator has the state of its steps so far.
    InTurn,
    /// The operator was restarted: this was its first step since.
    Restarted,
}

/// Reason why a remote step did not complete.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct Lost(pub String);

/// One step to be executed elsewhere.
pub struct Call<'a> {
    operator: &'a str,
    task: &'a Task,
    slots: &'a [Slot],
}

impl Call<'_> {
    /// Name of the operator.
    pub fn operator(&self) -> &str {
        self.operator
    }

    /// Stamp that the step is for.
    pub fn stamp(&self) -> Time {
        self.task.stamp
    }

    /// Appends everything needed to execute the step. Can be repeated if a message gets lost.
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
    /// Time until the deadline on the real clock.
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
    /// Number of ports that published, and number that offered: port and payload of each follow in this order.
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

/// Reason why a call or an answer is invalid; the step was not executed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct CallError(String);

/// Operators of a graph that are stepped on behalf of another process:
/// [`Graph::into_worker`](crate::Graph::into_worker).
pub struct Worker {
    pub(crate) operators: Vec<WorkerOperator>,
}

/// One operator of a worker.
pub(crate) struct WorkerOperator {
    pub(crate) name: Arc<str>,
    pub(crate) body: Box<dyn Body>,
    /// Decoder of each port's messages; `None` for timers.
    pub(crate) ports: Vec<Option<FromWire>>,
}

impl Worker {
    /// Executes the step of a [`Call`] and appends the answer. A panic of the operator is part of the answer.
    ///
    /// # Errors
    /// If the call is not for an operator of this worker, or a message in it cannot be read. The step was not executed
    /// then.
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

/// Body of an operator whose steps another process executes.
pub(crate) struct Remote {
    executor: Box<dyn RemoteExecutor>,
    /// Decoder of each output's messages.
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
                    // The panic is resumed here: the engine ends the run with it.
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
