//! SUMO as a child process: found, started, watched, ended.

use std::ffi::OsString;
use std::io::{BufRead as _, BufReader, Read};
use std::net::{Ipv4Addr, TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::time::Duration;

use swerve_text::open_file;

use crate::SumoError;

/// Name of the program.
#[cfg(not(windows))]
const PROGRAM: &str = "sumo";
#[cfg(windows)]
const PROGRAM: &str = "sumo.exe";

/// Time between two attempts to connect.
const PAUSE: Duration = Duration::from_millis(20);

/// Most lines of messages that are kept, and the longest line, bytes.
const LINES_MAX: usize = 64;
const LINE_MAX: u64 = 4_096;

/// Environment in which the program is searched.
#[derive(Clone, Debug, Default)]
pub struct Environment {
    /// `SUMO_HOME`: the folder that contains `bin/sumo`.
    pub sumo_home: Option<PathBuf>,
    /// `PATH`.
    pub path: Option<OsString>,
}

impl Environment {
    /// That of this process.
    pub fn of_process() -> Self {
        let sumo_home = std::env::var_os("SUMO_HOME").filter(|home| !home.is_empty()).map(PathBuf::from);
        Self { sumo_home, path: std::env::var_os("PATH") }
    }

    /// The program: in `SUMO_HOME` if that is set, else on `PATH`. A wrapper of the Python package is resolved to the
    /// program that it starts, which can then be watched and ended.
    ///
    /// # Errors
    /// If it is missing.
    pub fn program(&self) -> Result<PathBuf, SumoError> {
        let missing = |place: String| SumoError::Missing { program: PROGRAM.to_owned(), place };
        if let Some(home) = &self.sumo_home {
            let program = home.join("bin").join(PROGRAM);
            return match program.is_file() {
                true => Ok(program),
                false => Err(missing(format!("in the folder `bin` of SUMO_HOME, {}", home.display()))),
            };
        }
        let folders = self.path.iter().flat_map(std::env::split_paths);
        let found = folders.map(|folder| folder.join(PROGRAM)).find(|program| program.is_file());
        let found = found.ok_or_else(|| missing("on PATH".to_owned()))?;
        Ok(wrapped(&found).unwrap_or(found))
    }
}

/// The program behind a script of the Python package `eclipse-sumo`.
fn wrapped(script: &Path) -> Option<PathBuf> {
    let mut start = [0; 2];
    open_file(script).ok()?.read_exact(&mut start).ok()?;
    if start != *b"#!" {
        return None;
    }
    let libraries = std::fs::read_dir(script.parent()?.parent()?.join("lib")).ok()?;
    let mut found: Vec<PathBuf> = libraries
        .filter_map(|entry| Some(entry.ok()?.path().join("site-packages/sumo/bin").join(PROGRAM)))
        .filter(|program| program.is_file())
        .collect();
    found.sort();
    found.pop()
}

/// A started program. It is killed when this is dropped.
#[derive(Debug)]
pub struct Process {
    child: Child,
    port: u16,
    /// Lines of its output, until it ends.
    lines: Receiver<String>,
    /// The last lines.
    kept: Vec<String>,
}

impl Process {
    /// Starts a program with arguments, and with the port on which it waits for a client.
    ///
    /// # Errors
    /// If it cannot be started.
    pub fn start(program: &Path, arguments: &[OsString]) -> Result<Self, SumoError> {
        let wrong = |why: String| SumoError::Start { program: program.to_owned(), why };
        // The system's choice; another program may take it before SUMO does, which then ends with an error.
        let port = TcpListener::bind((Ipv4Addr::LOCALHOST, 0)).and_then(|free| free.local_addr());
        let port = port.map_err(|error| wrong(error.to_string()))?.port();
        let mut command = Command::new(program);
        if let Some(home) = program.parent().and_then(Path::parent) {
            command.env("SUMO_HOME", home);
        }
        command.args(arguments).arg("--remote-port").arg(port.to_string());
        command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().map_err(|error| wrong(error.to_string()))?;
        let (sender, lines) = sync_channel(LINES_MAX);
        let pipes: [Option<Box<dyn Read + Send>>; 2] = [
            child.stdout.take().map(|pipe| Box::new(pipe) as Box<dyn Read + Send>),
            child.stderr.take().map(|pipe| Box::new(pipe) as Box<dyn Read + Send>),
        ];
        let started = Self { child, port, lines, kept: Vec::new() };
        for pipe in pipes.into_iter().flatten() {
            let sender = sender.clone();
            let reader = std::thread::Builder::new().name("sumo output".to_owned());
            reader.spawn(move || forward(pipe, &sender)).map_err(|error| wrong(error.to_string()))?;
        }
        Ok(started)
    }

    /// Connects as soon as it waits for a client, within `timeout`.
    ///
    /// # Errors
    /// If it ends, or does not wait for a client in time.
    pub fn connect(&mut self, timeout: Duration) -> Result<TcpStream, SumoError> {
        let attempts = timeout.as_millis() / PAUSE.as_millis();
        for _ in 0..attempts.max(1) {
            if let Ok(stream) = TcpStream::connect((Ipv4Addr::LOCALHOST, self.port)) {
                return Ok(stream);
            }
            match self.lines.recv_timeout(PAUSE) {
                Ok(line) => self.keep(line),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return Err(self.ended()),
            }
        }
        Err(SumoError::Silent(timeout.as_secs()))
    }

    fn keep(&mut self, line: String) {
        if self.kept.len() == LINES_MAX {
            self.kept.remove(0);
        }
        self.kept.push(line);
    }

    /// Ends the program if it still runs; its exit and last messages.
    pub fn ended(&mut self) -> SumoError {
        // Its output has ended, or the connection has: it has ended, or is about to.
        for _ in 0..50 {
            if !matches!(self.child.try_wait(), Ok(None)) {
                break;
            }
            match self.lines.recv_timeout(PAUSE) {
                Ok(line) => self.keep(line),
                Err(RecvTimeoutError::Timeout) => {}
                // The output has ended shortly before the program.
                Err(RecvTimeoutError::Disconnected) => std::thread::park_timeout(PAUSE),
            }
        }
        let status = match self.child.try_wait() {
            Ok(Some(status)) => status.to_string(),
            _ => {
                self.kill();
                "it was still running and has been killed".to_owned()
            }
        };
        while let Ok(line) = self.lines.try_recv() {
            self.keep(line);
        }
        let is_error = |line: &&String| line.contains("Error") || line.contains("rror:");
        let said: Vec<&str> = self.kept.iter().filter(is_error).map(|line| line.trim()).collect();
        SumoError::Ended(if said.is_empty() { status } else { format!("{status}: {}", said.join(" ")) })
    }

    fn kill(&mut self) {
        // It may have ended already.
        let _ended = self.child.kill();
        let _status = self.child.wait();
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        self.kill();
    }
}

/// Forwards lines until the end of the output. Lines that are not taken are lost: SUMO must not wait for a reader.
fn forward(pipe: impl Read, sender: &SyncSender<String>) {
    let mut pipe = BufReader::new(pipe);
    let mut line = Vec::new();
    while let Ok(1..) = pipe.by_ref().take(LINE_MAX).read_until(b'\n', &mut line) {
        let _lost = sender.try_send(String::from_utf8_lossy(&line).into_owned());
        line.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn missing_program_is_reported_with_the_places_searched() {
        let folder = tempfile::tempdir().unwrap();
        let home = Environment { sumo_home: Some(folder.path().into()), path: None };
        let error = home.program().unwrap_err().to_string();
        assert!(
            error.contains("in the folder `bin` of SUMO_HOME") && error.contains("pip install"),
            "{error}"
        );
        let path = Environment { sumo_home: None, path: Some(folder.path().into()) };
        let error = path.program().unwrap_err().to_string();
        assert!(error.contains("on PATH"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn wrapper_of_the_python_package_is_resolved() {
        let folder = tempfile::tempdir().unwrap();
        let [script, real] =
            ["bin/sumo", "lib/python3.11/site-packages/sumo/bin/sumo"].map(|path| folder.path().join(path));
        for path in [&script, &real] {
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        }
        std::fs::write(&script, "#!/usr/bin/python3\n").unwrap();
        std::fs::write(&real, "\x7fELF").unwrap();
        let path = Some(script.parent().unwrap().into());
        assert_eq!(Environment { sumo_home: None, path }.program(), Ok(real));
    }

    #[cfg(unix)]
    #[test]
    fn program_that_ends_is_reported_with_its_message() {
        let arguments = ["-c", "echo Error: no net >&2; exit 3"].map(OsString::from);
        let mut process = Process::start(Path::new("/bin/sh"), &arguments).unwrap();
        let error = process.connect(Duration::from_secs(20)).unwrap_err().to_string();
        assert!(error.contains("exit status: 3") && error.contains("Error: no net"), "{error}");
    }

    #[cfg(unix)]
    #[test]
    fn program_is_killed_with_its_owner() {
        let arguments = ["-c", "exec sleep 600"].map(OsString::from);
        let mut process = Process::start(Path::new("/bin/sh"), &arguments).unwrap();
        let timeout = process.connect(Duration::from_millis(100)).unwrap_err();
        assert_eq!(timeout, SumoError::Silent(0));
        let stat = PathBuf::from(format!("/proc/{}", process.child.id()));
        assert!(stat.exists() || !Path::new("/proc/self").exists());
        drop(process);
        assert!(!stat.exists());
    }
}
