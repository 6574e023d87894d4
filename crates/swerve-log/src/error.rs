//! Errors of reading and writing logs.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

/// Error of writing or reading a log or trace. Every variant names the file.
#[derive(Debug, Error)]
pub enum LogError {
    /// The file could not be created.
    #[error("{}: cannot create the file: {source}", path.display())]
    Create {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// Writing failed; everything before it is readable.
    #[error("{}: cannot write: {reason}", path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        reason: String,
    },
    /// The file could not be opened, or the system failed to read it.
    #[error("{}: cannot read the file: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Error of the operating system.
        source: io::Error,
    },
    /// The file is truncated or corrupted.
    #[error("{}: damaged at byte {offset} of {size}, in {record}: {problem}; {records} records before it are readable", path.display())]
    Damaged {
        /// The file.
        path: PathBuf,
        /// Offset of the damage, bytes.
        offset: u64,
        /// Length of the file, bytes.
        size: u64,
        /// Kind of the damaged record, as far as it can be determined.
        record: String,
        /// Expected and actual content.
        problem: String,
        /// Number of records read before.
        records: u64,
    },
    /// The log was cut off before the run ended.
    #[error("{}: the run was cut off: expected its end record after byte {size}; {records} records before it are readable", path.display())]
    Incomplete {
        /// The file.
        path: PathBuf,
        /// Length of the file, bytes.
        size: u64,
        /// Number of records read.
        records: u64,
    },
    /// An MCAP file that does not contain a Swerve run.
    #[error("{}: not a log of this program: {problem}", path.display())]
    Foreign {
        /// The file.
        path: PathBuf,
        /// Mismatch with the expected format.
        problem: String,
    },
    /// A third-party recording is truncated or corrupted.
    #[error("{}: ends or is damaged after {messages} messages, which are readable: {problem}", path.display())]
    CutOff {
        /// The file.
        path: PathBuf,
        /// Expected and actual content.
        problem: String,
        /// Number of messages read before.
        messages: u64,
    },
    /// A message does not have the requested type.
    #[error("stream `{stream}`, message {seq}: cannot be read as {type_name}: {reason}")]
    Payload {
        /// The stream.
        stream: String,
        /// Sequence number on the stream.
        seq: u64,
        /// Requested type.
        type_name: &'static str,
        /// Mismatch with that type.
        reason: String,
    },
}
