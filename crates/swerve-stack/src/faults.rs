//! Fault injection on streams: operators between a stream and its readers.

mod corruptible;

use std::sync::Arc;

use anyhow::{Context as _, anyhow};
use swerve_core::{Rng, Span, Time};
use swerve_flow::{AnyStream, At, Context, Graph, Operator, PayloadType, Policy, Port, RuntimeModel};
use swerve_msg::FaultInjection;

pub use corruptible::Corruptible;

use crate::config::injection::{Carries, FaultConfig, FaultKind};

/// Messages that may be delayed at once: a second of the fastest stream, and as much again.
const UNDER_WAY: usize = 1024;
/// Duration of a unit of work of [`Faulty`].
const UNIT_NS: i64 = 1000;

/// Injects a fault into single messages of a stream.
struct Faulty<T> {
    name: String,
    stream: String,
    kind: FaultKind,
    probability: f64,
    /// First and last stamp affected.
    stamps: (Time, Time),
    seed: u64,
    /// The repeated message, and the stamp up to which it is repeated.
    frozen: Option<(Arc<T>, Time)>,
}

/// A message type that faults can affect, for the registry.
#[derive(Clone)]
pub(crate) struct CorruptibleType {
    pub(crate) payload: PayloadType,
    pub(crate) carries: fn(&str) -> Carries,
    add: fn(&mut Graph, Faulty<()>, AnyStream) -> Option<AnyStream>,
}

impl CorruptibleType {
    pub(crate) fn new<T: Corruptible>() -> Self {
        Self { payload: PayloadType::of::<T>(), carries: T::carries, add: add::<T> }
    }

    /// Injects a fault into a stream and returns the stream for its readers.
    pub(crate) fn put_on(
        &self,
        graph: &mut Graph,
        stream: AnyStream,
        (name, fault): (&str, &FaultConfig),
        seed: u64,
    ) -> anyhow::Result<AnyStream> {
        let operator =
            Faulty::new(name, fault, seed).map_err(|problem| anyhow!("fault.{name}: {problem}"))?;
        (self.add)(graph, operator, stream)
            .with_context(|| format!("fault.{name}: the stream is of another type"))
    }
}

fn add<T: Corruptible>(graph: &mut Graph, operator: Faulty<()>, stream: AnyStream) -> Option<AnyStream> {
    let Faulty { name, stream: on, kind, probability, stamps, seed, .. } = operator;
    let operator =
        Faulty::<T> { name: name.clone(), stream: on, kind, probability, stamps, seed, frozen: None };
    // Delays are counted as work of the step, so that each message has its own.
    let late = RuntimeModel::Work { base: Span::ZERO, per_unit_ns: UNIT_NS as f64 };
    let node = graph.add(name, operator, (stream.typed::<T>()?,)).runtime(late);
    let (stream, _) = node.policy(Policy::pipelined(UNDER_WAY)).outputs(&["message", "injected"]).out();
    Some(stream.into())
}

impl Faulty<()> {
    fn new(name: &str, fault: &FaultConfig, run_seed: u64) -> Result<Self, String> {
        Ok(Self {
            name: name.to_owned(),
            stream: fault.stream.clone(),
            kind: fault.kind().map_err(|(_, message)| message)?,
            probability: fault.probability,
            stamps: fault.stamps().map_err(|(_, message)| message)?,
            seed: fault.seed.unwrap_or(run_seed),
            frozen: None,
        })
    }
}

impl<T: Corruptible> Operator for Faulty<T> {
    type In = (At<T>,);
    type Out = (Port<T>, Port<FaultInjection>);

    fn step(&mut self, cx: &mut Context<'_>, (message,): &Self::In, (out, injected): &mut Self::Out) {
        let Some(message) = message.get() else { return };
        let stamp = cx.stamp();
        let mut rng = Rng::keyed(self.seed, &self.name, &[stamp.ns()]);
        let freezes = self.frozen.take().filter(|(_, until)| stamp < *until);
        let befallen = freezes.is_some()
            || ((self.stamps.0..=self.stamps.1).contains(&stamp) && rng.unit() < self.probability);
        if !befallen {
            return out.pass_on(message);
        }
        let mut later = Span::ZERO;
        match self.kind {
            FaultKind::Drop => {}
            FaultKind::Delay(by) => {
                later = by;
                out.pass_on(message);
            }
            FaultKind::Jitter(most) => {
                later = Span::from_ns((most.ns() as f64 * rng.unit()) as i64);
                out.pass_on(message);
            }
            FaultKind::Freeze(lasts) => {
                let (old, until) = freezes.unwrap_or_else(|| (message.shared(), stamp + lasts));
                let mut repeated = T::clone(&old);
                repeated.restamp(stamp);
                self.frozen = Some((old, until));
                out.send(repeated);
            }
            FaultKind::Corrupt(how) => {
                let mut changed = T::clone(message);
                changed.corrupt(how, &mut rng);
                out.send(changed);
            }
        }
        cx.spend((later.ns() / UNIT_NS).unsigned_abs());
        injected.send(FaultInjection {
            stamp,
            stream: self.stream.clone(),
            harm: self.kind.name().to_owned(),
            later_s: later.as_secs(),
        });
    }
}
