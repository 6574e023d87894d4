//! Errors of a run with SUMO.

use std::path::PathBuf;

/// Reason why SUMO does not run, or cannot go on.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum SumoError {
    /// The program is missing.
    #[error(
        "SUMO is missing: expected the program `{program}` {place}; install it with `pip install eclipse-sumo`, or set \
         SUMO_HOME to its folder"
    )]
    Missing {
        /// Name of the program.
        program: String,
        /// Places that were searched.
        place: String,
    },
    /// The program cannot be started.
    #[error("{} cannot be started: {why}", program.display())]
    Start {
        /// The program.
        program: PathBuf,
        /// Reason of the operating system.
        why: String,
    },
    /// It ended, or closed the connection.
    #[error("SUMO ended: {0}")]
    Ended(String),
    /// No answer in time.
    #[error("SUMO has not answered for {0} s")]
    Silent(u64),
    /// It refused a command.
    #[error("SUMO refused command 0x{command:02x}: {why}")]
    Refused {
        /// Identity of the command.
        command: u8,
        /// Its reason.
        why: String,
    },
    /// An answer that does not follow the protocol.
    #[error("the answer of SUMO is invalid: {0}")]
    Answer(String),
    /// A vehicle with an invalid value.
    #[error("vehicle \"{name}\" of SUMO: {why}")]
    Vehicle {
        /// Name of the vehicle.
        name: String,
        /// Value that is wrong, and what was expected.
        why: String,
    },
    /// Settings that do not fit each other.
    #[error("{0}")]
    Setting(String),
}
