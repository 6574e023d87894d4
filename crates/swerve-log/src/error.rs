//! Errors of reading and writing logs.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// Why a log or trace could not be written or read. Every variant names the file.
#[derive(Debug, Error)]
pub enum LogError {
    /// The file could not be created.
    #[error("{}: cannot create the file: {source}", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// Writing failed; what was written before is readable.
    #[error("{}: cannot write: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The system's error.
        reason: String,
    },
    /// The file could not be opened, or the system failed to read it.
    #[error("{}: cannot read the file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: io::Error,
    },
    /// The file is truncated or corrupted.
    #[error("{}: damaged at byte {offset} of {size}, in {record}: {problem}; {records} records before it are readable", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Where the damaged part of the file begins.
        offset: u64,
        /// Length of the file.
        size: u64,
        /// The content there, as far as it can be told.
        record: String,
        /// The expectation, and what is there instead.
        problem: String,
        /// How many records were read before.
        records: u64,
    },
    /// The run was cut off before it ended.
    #[error("{}: the run was cut off: expected its end record after byte {size}; {records} records before it are readable", path.display())]
    Incomplete {
        /// The file.
        path: PathBuf,
        /// Length of the file.
        size: u64,
        /// How many records were read.
        records: u64,
    },
    /// An MCAP file that does not hold a run of Swerve.
    #[error("{}: not a log of this program: {problem}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// The form that was expected.
        problem: String,
    },
    /// Somebody else's recording is truncated or corrupted.
    #[error("{}: ends or is damaged after {messages} messages, which are readable: {problem}", path.display())]
    CutOff {
        /// The file.
        path: PathBuf,
        /// The expectation, and what is there instead.
        problem: String,
        /// How many messages were read before.
        messages: u64,
    },
    /// A message is not of the type asked for.
    #[error("stream `{stream}`, message {seq}: cannot be read as {type_name}: {reason}")]
    Payload {
        /// The stream.
        stream: String,
        /// Its number on the stream.
        seq: u64,
        /// The type asked for.
        type_name: &'static str,
        /// The mismatch.
        reason: String,
    },
}
