//! The dataflow engine: operators, typed streams between them, and run time as part of the result.
//!
//! A [`Graph`] is a value: operators are added with the streams that they read and give the streams that
//! they publish. [`run_virtual`] runs it in virtual time, where the result is a function of graph and seed
//! alone; [`run_wall`] runs the same graph against the real clock. What happens when is in
//! `docs/execution.md`; the engine does one sweep over its operators for every instant, in both.
//!
//! ```
//! use swerve_core::{Span, Time};
//! use swerve_flow::*;
//!
//! struct Camera;
//! impl Operator for Camera {
//!     type In = Every;
//!     type Out = Port<u64>;
//!     fn step(&mut self, cx: &mut Context, _: &Every, image: &mut Port<u64>) {
//!         image.loan().send(cx.rng().bits());
//!     }
//! }
//! struct Detector;
//! impl Operator for Detector {
//!     type In = (At<u64>, Latest<f64>); // the image of this very stamp, the newest speed
//!     type Out = Port<String>;
//!     fn step(&mut self, _: &mut Context, (image, speed): &Self::In, out: &mut Port<String>) {
//!         let Some(image) = image.get() else { return };
//!         out.send(format!("{image:?} at {:?} m/s", speed.get().map(|speed| **speed)));
//!     }
//! }
//! struct Wheels;
//! impl Operator for Wheels {
//!     type In = Every;
//!     type Out = Port<f64>;
//!     fn step(&mut self, cx: &mut Context, _: &Every, speed: &mut Port<f64>) {
//!         speed.send(cx.stamp().as_secs());
//!     }
//! }
//! let ms = Span::from_ms;
//! let mut graph = Graph::new();
//! let image = graph.add("camera", Camera, every(ms(50))).runtime(RuntimeModel::Fixed(ms(5))).origin().out();
//! let speed = graph.add("wheels", Wheels, every(ms(10))).out();
//! let boxes = graph.add("detector", Detector, (image, speed)).runtime(RuntimeModel::Fixed(ms(80)));
//! boxes.deadline(Deadline::after(ms(100)).reaction(Reaction::ReuseLast)).out();
//! let report = run_virtual(graph, &RunOptions::until(Time::from_ms(1000)), vec![])?;
//! println!("{} messages, digest {}", report.operator("detector").unwrap().messages, report.digest);
//! # assert_eq!(report.operator("detector").unwrap().messages, 12);
//! # Ok::<(), RunError>(())
//! ```
//!
//! # Writing an operator
//!
//! | input port | connect | holds |
//! |---|---|---|
//! | [`At<T>`] | `stream` | the message stamped as the frame; `None` if the stream has none there |
//! | [`Latest<T>`] | `stream` or `feedback` | the newest message visible when the step starts |
//! | [`Window<T, N>`](Window) | `stream` or `feedback` | the newest `N` |
//! | [`Every`] | [`every(period)`](every)`.phase(p)` | nothing; fires the operator |
//!
//! Tuples of ports (up to twelve, nested if need be) and `Vec`s of ports are inputs too; outputs are `()`, a
//! [`Port<T>`](Port) or a tuple of up to four. `port.get()` gives `Option<&Message<T>>`: a [`Message`]
//! dereferences to its payload and knows its [`Header`].
//!
//! [`Context`] gives `now`, `stamp`, `deadline`, `rng`, counts work by `spend(units)` (which tells an anytime
//! step when to stop), takes best-so-far results by `offer(&mut port, value)`, ends the run by `stop_run`.
//! A missed deadline is answered by its [`Reaction`]; with [`Reaction::OnDeadline`] by
//! [`Operator::on_deadline`], which sees the newest result and the last offer, but not the state.
//!
//! A loop is closed by `let commands = graph.feedback::<Command>("commands")`, given to its reader, and
//! `graph.connect(commands, stream)` later.
//!
//! A [`Session`] runs a graph in virtual time step by step, for a caller who looks and answers in between. Operators
//! whose types are known at run time only are [`AnyOperator`]s.
//!
//! An operator's steps can be taken by another process: [`RemoteExecutor`] carries them there, a [`Worker`] of the
//! same graph takes them, and the run comes out the same.

// What the derives write names this crate from outside.
#[cfg(test)]
extern crate self as swerve_flow;

mod any;
pub mod cbor;
mod cddl;
mod deadline;
mod decision;
mod engine;
mod graph;
mod host;
mod input;
mod message;
mod observer;
mod operator;
mod options;
mod output;
mod payload;
mod playback;
mod policy;
mod port;
mod promise;
mod remote;
mod report;
mod runtime;
mod session;
#[cfg(test)]
mod tests;
mod virtual_time;
mod wall;

pub use any::{AnyInput, AnyMessage, AnyOperator, AnyOutputError, AnyOutputs, AnySource};
pub use deadline::{Anchor, Deadline, Reaction};
pub use decision::{Decision, Replay};
pub use graph::{
    AnyFeedback, AnyStream, Feedback, Graph, GraphError, GraphInfo, InputInfo, InputKind, OperatorInfo,
    OperatorRef, Resource, Stream,
};
pub use input::{At, Connect, Every, Inputs, Latest, Ports, Slots, Source, Timer, Window, every};
pub use message::{Header, Message};
pub use observer::{
    Dispatcher, DropReason, Dropped, Event, Miss as MissEvent, Observer, Publication, Reads, StepEnd,
    StepStart,
};
pub use operator::{Context, Miss, Operator, Progress};
pub use options::RunOptions;
pub use output::{Declaration, Loan, Outputs, Port};
#[doc(hidden)]
pub use payload::Outs;
pub use payload::{ErasedPayload, Payload, PayloadType, Sent};
pub use playback::{PlaybackMessage, PlaybackPayload, PlaybackRecord};
pub use policy::{Full, Late, Policy};
pub use port::{InputPort, NamedInputs, NamedOutputs, OutputInfo, OutputPort, PortInfo, PortMode, Wire};
pub use promise::{Promise, Workers};
pub use remote::{Answered, Call, CallError, Lost, RemoteExecutor, Worker};
pub use report::{Drops, EndReason, OperatorReport, RunError, RunReport, TickReport};
pub use runtime::{RecordedTimes, RuntimeModel};
pub use session::{Reached, Session, Watched};
pub use swerve_flow_derive::{Inputs, Outputs};
pub use virtual_time::{run_replay, run_virtual};
pub use wall::{SendError, SourceHandle, StopHandle, run_wall};
