//! Runs on disk: the log that everything can be replayed from, and the trace that shows where time goes.
//!
//! [`Recorder`] writes a run into an MCAP file of CBOR messages on a thread of its own; [`Log`] and [`Reader`]
//! read it back and need nothing but that file, damaged or not. [`TraceWriter`] writes the same run as a trace
//! for <https://ui.perfetto.dev>. [`Bag`] reads what others recorded, as rosbag2 does. All times are instants of the run.
//! Absences: no clock, no scenario, no configuration format; payloads stay bytes until a caller names a type.

mod arrows;
mod bag;
mod error;
mod format;
mod log;
mod mcap_record;
mod observe;
mod reader;
mod record;
mod recorder;
mod seals;
mod trace;
mod view;
mod writer;

pub use bag::{Bag, BagMessage, BagTopic};
pub use error::LogError;
pub use log::Log;
pub use observe::left_out;
pub use reader::Reader;
pub use record::{
    DecisionRecord, DropRecord, MessageHeader, MissRecord, PublicationRecord, Record, RunEnd, RunStart,
    StepRecord, StreamInfo, UnfinishedRecord, WatermarkRecord,
};
pub use recorder::{LeavesOut, Recorder};
pub use trace::TraceWriter;
pub use view::{Encode, View, ViewSchema, ViewTopic, Views};

#[cfg(test)]
mod tests;
