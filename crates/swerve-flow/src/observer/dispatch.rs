//! Dispatch of payloads by type: handlers are registered once per type, for all publishers.

use core::any::TypeId;
use std::collections::BTreeMap;

use super::{Event, Observer, Publication};
use crate::payload::Payload;
use crate::sent::Sent;

type Handler<S> = Box<dyn FnMut(&mut S, &Publication<'_>, &Sent) + Send>;

/// Observer that passes each payload to the handlers registered for its type, with a state that they all share.
///
/// ```
/// use swerve_core::{Span, Time};
/// use swerve_flow::*;
///
/// struct Wheels;
/// impl Operator for Wheels {
///     type In = Every;
///     type Out = Port<f64>;
///     fn step(&mut self, cx: &mut Context, _: &Every, speed: &mut Port<f64>) {
///         speed.send(cx.stamp().as_secs());
///     }
/// }
/// let mut graph = Graph::new();
/// graph.add("wheels", Wheels, every(Span::from_ms(100))).out();
/// let mut fastest = Dispatcher::new(0.0_f64).on::<f64>(|fastest, _, speed| *fastest = fastest.max(*speed));
/// run_virtual(graph, &RunOptions::until(Time::from_ms(1000)), vec![&mut fastest])?;
/// assert_eq!(fastest.into_state(), 1.0);
/// # Ok::<(), RunError>(())
/// ```
pub struct Dispatcher<S> {
    state: S,
    handlers: BTreeMap<TypeId, Vec<Handler<S>>>,
}

impl<S> Dispatcher<S> {
    /// Creates a dispatcher without handlers.
    pub fn new(state: S) -> Self {
        Self { state, handlers: BTreeMap::new() }
    }

    /// Registers `handler` for every message of type `T`. Several handlers of one type are called in the order of their
    /// registration.
    #[must_use]
    pub fn on<T: Payload>(
        mut self,
        mut handler: impl FnMut(&mut S, &Publication<'_>, &T) + Send + 'static,
    ) -> Self {
        let typed = move |state: &mut S, publication: &Publication<'_>, sent: &Sent| {
            if let Some(payload) = sent.downcast_ref() {
                handler(state, publication, payload);
            }
        };
        self.handlers.entry(TypeId::of::<T>()).or_default().push(Box::new(typed));
        self
    }

    /// Passes a publication to its handlers; ignores bare watermarks.
    pub fn publication(&mut self, publication: &Publication<'_>) {
        let Some(payload) = publication.payload else { return };
        for handler in self.handlers.get_mut(&payload.type_id()).into_iter().flatten() {
            handler(&mut self.state, publication, payload);
        }
    }

    /// State that the handlers share.
    pub fn state(&self) -> &S {
        &self.state
    }

    /// Mutable state that the handlers share.
    pub fn state_mut(&mut self) -> &mut S {
        &mut self.state
    }

    /// Returns the state, after the run.
    pub fn into_state(self) -> S {
        self.state
    }
}

impl<S: Send> Observer for Dispatcher<S> {
    fn event(&mut self, event: &Event<'_>) {
        if let Event::Publication(publication) = event {
            self.publication(publication);
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::{Span, Time};

    use super::*;
    use crate::{Context, Every, Graph, Operator, Port, RunOptions, every, run_virtual};

    /// Publishes its number, and half of it, at every tick.
    struct Both(u64);

    impl Operator for Both {
        type In = Every;
        type Out = (Port<u64>, Port<f64>);

        fn step(&mut self, _: &mut Context<'_>, _: &Every, (whole, half): &mut Self::Out) {
            whole.send(self.0);
            half.send(0.5 * self.0 as f64);
        }
    }

    #[test]
    fn a_payload_reaches_the_handlers_of_its_type_and_no_other() {
        let mut graph = Graph::new();
        let _streams = graph.add("one", Both(1), every(Span::from_ms(10))).out();
        let _streams = graph.add("two", Both(2), every(Span::from_ms(20))).out();
        let mut seen = Dispatcher::new(Vec::new())
            .on::<u64>(|seen: &mut Vec<String>, p, n| seen.push(format!("{} {n}", p.operator)))
            .on::<f64>(|seen, p, half| seen.push(format!("{} half {half}", p.stream)))
            .on::<u64>(|seen, _, n| seen.push(format!("again {n}")))
            .on::<i8>(|seen, _, _| seen.push("nobody says this".into()));
        run_virtual(graph, &RunOptions::until(Time::from_ms(10)), vec![&mut seen]).unwrap();
        let one = ["one 1", "again 1", "one.1 half 0.5"];
        let two = ["two 2", "again 2", "two.1 half 1"];
        let wanted: Vec<&str> = [one, two, one].concat();
        assert_eq!(seen.into_state(), wanted);
    }
}
