//! Runs on disk: logs for replay, and traces of execution times.
//!
//! [`Recorder`] writes a run into an MCAP file of CBOR messages on a separate thread; [`Log`] and [`Reader`] read
//! it back from that file alone, even if it is damaged. [`TraceWriter`] writes the same run as a trace for
//! <https://ui.perfetto.dev>. [`Bag`] reads third-party recordings such as rosbag2. All times are instants of the
//! run.
//! Contains no clock, no scenario and no configuration format; payloads stay bytes until a caller names a type.

mod arrows;
mod bag;
mod batch;
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
pub use batch::left_out;
pub use error::LogError;
pub use log::Log;
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
