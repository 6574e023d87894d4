//! The program from which worker processes are started: this one, unless a host program with this library sets another.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::sync::OnceLock;

use anyhow::Context as _;
use swerve_core::{Digest, Hasher};
use swerve_report::files::read_whole;

/// A program that contains this library.
#[derive(Clone, Debug)]
pub struct Program {
    /// Executable.
    pub path: PathBuf,
    /// Arguments before the worker's own, such as `worker`.
    pub arguments: Vec<String>,
    /// File that contains this library, on which results depend.
    pub code: PathBuf,
}

/// Arguments with which an interpreter runs the Swerve package.
const MODULE: [&str; 2] = ["-m", "swerve"];

/// Python of the active virtual environment, else the first one on the path.
fn found_python() -> Option<PathBuf> {
    let active = std::env::var_os("VIRTUAL_ENV").map(|folder| Path::new(&folder).join("bin"));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = active.into_iter().chain(std::env::split_paths(&path)).collect();
    let in_folder = |name: &'static str| folders.iter().map(move |folder| folder.join(name));
    in_folder("python3").chain(in_folder("python")).find(|file| file.is_file())
}

static HOST: OnceLock<Program> = OnceLock::new();

impl Program {
    /// Returns the running program.
    ///
    /// # Errors
    /// If the system does not report it.
    pub fn this() -> anyhow::Result<Self> {
        if let Some(host) = HOST.get() {
            return Ok(host.clone());
        }
        let path = std::env::current_exe().context("finding this program")?;
        Ok(Self { code: path.clone(), path, arguments: Vec::new() })
    }

    /// Digest of the file that contains this library: results of other builds differ from it.
    ///
    /// # Errors
    /// If the system does not report the running program, or its file cannot be read.
    pub fn digest() -> anyhow::Result<Digest> {
        let mut hasher = Hasher::new();
        hasher.bytes(&read_whole(&Self::this()?.code)?);
        Ok(hasher.digest())
    }

    /// Registers this as the host program of the library. Only the first call counts.
    pub fn is_part_of(self) {
        let _first = HOST.set(self);
    }

    /// The same program with more arguments.
    #[must_use]
    pub fn with(&self, arguments: &[&str]) -> Self {
        let more = arguments.iter().map(|argument| (*argument).to_owned());
        Self { arguments: self.arguments.iter().cloned().chain(more).collect(), ..self.clone() }
    }

    /// Swerve in Python: run by the given interpreter, else by this program if it is Python, else by that of
    /// `VIRTUAL_ENV`, else by the first `python3` or `python` on the path.
    ///
    /// # Errors
    /// If there is no Python.
    pub fn python(&self, interpreter: Option<&Path>) -> anyhow::Result<Self> {
        if self.arguments == MODULE && interpreter.is_none() {
            return Ok(self.clone());
        }
        let path = match interpreter {
            Some(path) => path.to_owned(),
            None => found_python().context(
                "there is no Python: neither in `VIRTUAL_ENV` nor `python3` or `python` on the path; `interpreter` names one",
            )?,
        };
        Ok(Self { path, arguments: MODULE.map(str::to_owned).to_vec(), code: self.code.clone() })
    }

    /// Checks that a Python interpreter can run the Swerve package.
    ///
    /// # Errors
    /// The reason why it cannot.
    pub(crate) fn check(&self) -> anyhow::Result<()> {
        let python = self.path.display();
        let tried = Command::new(&self.path).args(["-c", "import swerve"]).stdin(Stdio::null()).output();
        let tried = tried.with_context(|| format!("starting {python}"))?;
        let said = String::from_utf8_lossy(&tried.stderr);
        anyhow::ensure!(
            tried.status.success(),
            "{python} has not the package `swerve` ({}); `pip install ./python` there, or name another one by `interpreter`",
            said.lines().last().unwrap_or("it printed nothing")
        );
        Ok(())
    }

    /// Command to which further arguments can be added.
    pub fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        command.args(&self.arguments);
        command
    }
}
