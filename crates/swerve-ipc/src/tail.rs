//! Standard error of a worker: passed on, and its last lines kept for the error message.

use std::io::{self, Read as _, Write as _};
use std::process::ChildStderr;
use std::sync::mpsc::{Receiver, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;
use std::time::Duration;

/// Bytes kept.
const BYTES_MAX: usize = 4096;
/// Lines of an error message.
const LINES_MAX: usize = 8;
/// Time to wait for the rest after the end of a process; its children may keep the pipe open.
const REST_WITHIN: Duration = Duration::from_millis(200);

/// The last bytes that a worker wrote to standard error.
pub(crate) struct Tail {
    bytes: Arc<Mutex<Vec<u8>>>,
    closed: Receiver<()>,
}

impl Tail {
    /// Passes on everything from now to the end of the pipe.
    pub(crate) fn of(mut pipe: ChildStderr) -> io::Result<Self> {
        let bytes = Arc::new(Mutex::new(Vec::new()));
        let (close, closed) = sync_channel(1);
        let kept = bytes.clone();
        Builder::new().name("swerve-stderr".into()).spawn(move || {
            let mut chunk = [0; 1024];
            while let Ok(n @ 1..) = pipe.read(&mut chunk) {
                // Standard error may be closed: the lines are still kept.
                let _unheard = io::stderr().write_all(&chunk[..n]);
                let mut kept = kept.lock().unwrap_or_else(PoisonError::into_inner);
                kept.extend_from_slice(&chunk[..n]);
                let over = kept.len().saturating_sub(BYTES_MAX);
                kept.drain(..over);
            }
            // The receiver is gone if the worker was started again.
            let _told = close.send(());
        })?;
        Ok(Self { bytes, closed })
    }

    /// The last lines of a process that has ended, indented, after a heading; empty if it wrote none.
    pub(crate) fn finish(self) -> String {
        let _late = self.closed.recv_timeout(REST_WITHIN);
        let bytes = self.bytes.lock().unwrap_or_else(PoisonError::into_inner);
        last_lines(&String::from_utf8_lossy(&bytes))
    }
}

fn last_lines(text: &str) -> String {
    let lines: Vec<&str> = text.lines().map(str::trim_end).filter(|line| !line.is_empty()).collect();
    let last = &lines[lines.len().saturating_sub(LINES_MAX)..];
    if last.is_empty() {
        return String::new();
    }
    format!("; the end of its standard error:\n  {}", last.join("\n  "))
}

#[cfg(test)]
mod tests {
    use std::process::{Command, Stdio};

    use super::*;

    #[test]
    fn last_lines_of_a_process_are_kept() {
        let mut command = Command::new("sh");
        command.args(["-c", "seq 1 3000 >&2; echo 'no such class' >&2; exit 1"]);
        let mut child = command.stderr(Stdio::piped()).spawn().unwrap();
        let tail = Tail::of(child.stderr.take().unwrap()).unwrap();
        child.wait().unwrap();
        let said = tail.finish();
        assert!(said.ends_with("\n  2999\n  3000\n  no such class") && said.lines().count() == 9, "{said}");
        assert_eq!(last_lines("\n \n"), "");
    }
}
