//! The program that processes of a run are started from: this one, unless who has this library in it says otherwise.

use std::path::PathBuf;
use std::process::Command;
use std::sync::OnceLock;

use anyhow::Context as _;

/// A program that has this library in it.
#[derive(Clone, Debug)]
pub struct Program {
    /// What is started.
    pub path: PathBuf,
    /// What comes before its own arguments, such as `worker`.
    pub arguments: Vec<String>,
    /// The file with this library in it: what a result depends on.
    pub code: PathBuf,
}

static HOST: OnceLock<Program> = OnceLock::new();

impl Program {
    /// The program that runs.
    ///
    /// # Errors
    /// When the system does not tell.
    pub fn this() -> anyhow::Result<Self> {
        if let Some(host) = HOST.get() {
            return Ok(host.clone());
        }
        let path = std::env::current_exe().context("finding this program")?;
        Ok(Self { code: path.clone(), path, arguments: Vec::new() })
    }

    /// Says that this library is a part of another program. Only the first time counts.
    pub fn is_part_of(self) {
        let _first = HOST.set(self);
    }

    /// It, to be started with arguments of its own.
    pub fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        command.args(&self.arguments);
        command
    }
}
