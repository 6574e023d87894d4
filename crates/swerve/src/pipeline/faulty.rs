//! Faults on streams: operators between a stream and its readers.

mod victim;

use std::sync::Arc;

use swerve_core::{Rng, Span, Time};
use swerve_flow::{At, Context, Graph, Operator, Policy, Port, RuntimeModel, Stream};
use swerve_msg::FaultInjection;

use victim::Victim;

use crate::config::Config;
use crate::config::injection::{FaultConfig, Harm};

/// Messages that may be under way at once: a second of the fastest stream, and as much again.
const UNDER_WAY: usize = 1024;
/// What a unit of work of [`Faulty`] lasts.
const UNIT_NS: i64 = 1000;

/// Does to single messages of a stream what a fault does.
struct Faulty<T> {
    name: String,
    stream: String,
    harm: Harm,
    probability: f64,
    /// First and last stamp that it befalls.
    stamps: (Time, Time),
    seed: u64,
    /// What is repeated, and up to which stamp.
    frozen: Option<(Arc<T>, Time)>,
}

/// The readers' side of `stream`: itself, or what the faults of the configuration make of it.
pub(super) fn faulty<T: Victim>(
    graph: &mut Graph,
    config: &Config,
    name: &str,
    mut stream: Stream<T>,
) -> anyhow::Result<Stream<T>> {
    for (fault, what) in config.faults_of(name) {
        let operator = Faulty::new(fault, what, config.seed)
            .map_err(|message| anyhow::anyhow!("fault.{fault}: {message}"))?;
        // Lateness is work that the step counts, so that each message has its own.
        let late = RuntimeModel::Work { base: Span::ZERO, per_unit_ns: UNIT_NS as f64 };
        let node = graph.add(fault, operator, (stream,)).runtime(late);
        let node = node.policy(Policy::pipelined(UNDER_WAY)).outputs(&["message", "injected"]);
        (stream, _) = node.out();
    }
    Ok(stream)
}

impl<T> Faulty<T> {
    fn new(name: &str, fault: &FaultConfig, run_seed: u64) -> Result<Self, String> {
        Ok(Self {
            name: name.to_owned(),
            stream: fault.stream.clone(),
            harm: fault.harm()?,
            probability: fault.probability,
            stamps: fault.stamps().map_err(|(_, message)| message)?,
            seed: fault.seed.unwrap_or(run_seed),
            frozen: None,
        })
    }
}

impl<T: Victim> Operator for Faulty<T> {
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
        match self.harm {
            Harm::Drop => {}
            Harm::Delay(by) => {
                later = by;
                out.pass_on(message);
            }
            Harm::Jitter(most) => {
                later = Span::from_ns((most.ns() as f64 * rng.unit()) as i64);
                out.pass_on(message);
            }
            Harm::Freeze(lasts) => {
                let (old, until) = freezes.unwrap_or_else(|| (message.shared(), stamp + lasts));
                let mut repeated = T::clone(&old);
                repeated.restamp(stamp);
                self.frozen = Some((old, until));
                out.send(repeated);
            }
            Harm::Corrupt(how) => {
                let mut changed = T::clone(message);
                changed.corrupt(how, &mut rng);
                out.send(changed);
            }
        }
        cx.spend((later.ns() / UNIT_NS).unsigned_abs());
        injected.send(FaultInjection {
            stamp,
            stream: self.stream.clone(),
            harm: self.harm.name().to_owned(),
            later_s: later.as_secs(),
        });
    }
}

#[cfg(test)]
mod tests;
