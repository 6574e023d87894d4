//! The program that processes of a run are started from: this one, unless who has this library in it says otherwise.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
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

/// How an interpreter runs Swerve's package.
const MODULE: [&str; 2] = ["-m", "swerve"];

/// The Python of the environment that is active, else the first one on the path.
fn found_python() -> Option<PathBuf> {
    let active = std::env::var_os("VIRTUAL_ENV").map(|folder| Path::new(&folder).join("bin"));
    let path = std::env::var_os("PATH").unwrap_or_default();
    let folders: Vec<PathBuf> = active.into_iter().chain(std::env::split_paths(&path)).collect();
    let in_folder = |name: &'static str| folders.iter().map(move |folder| folder.join(name));
    in_folder("python3").chain(in_folder("python")).find(|file| file.is_file())
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

    /// The same with more arguments.
    #[must_use]
    pub fn with(&self, arguments: &[&str]) -> Self {
        let more = arguments.iter().map(|argument| (*argument).to_owned());
        Self { arguments: self.arguments.iter().cloned().chain(more).collect(), ..self.clone() }
    }

    /// Swerve in Python: by the interpreter that is named, else this program where it is one, else by the one of
    /// `VIRTUAL_ENV`, else by the first `python3` or `python` on the path.
    ///
    /// # Errors
    /// When there is no Python.
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

    /// Says why a Python does not run Swerve's package, if it does not.
    ///
    /// # Errors
    /// That.
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

    /// It, to be started with arguments of its own.
    pub fn command(&self) -> Command {
        let mut command = Command::new(&self.path);
        command.args(&self.arguments);
        command
    }
}
