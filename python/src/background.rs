//! Long work on a separate thread, while Python checks for Ctrl-C and reports progress.

use core::time::Duration;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::Builder;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// Interval of the checks.
const LOOK: Duration = Duration::from_millis(50);

/// Number of calls of `stop` after which a step in another process is not waited for: one second.
pub(crate) const LOOKS_OF_GRACE: u32 = 20;

/// Runs `work` on a thread. Meanwhile calls `look` under the interpreter's lock; if that fails, or a signal arrives,
/// calls `stop` at each further check and waits for the work to end.
pub(crate) fn do_in_background<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> anyhow::Result<T> + Send + 'static,
    mut look: impl FnMut(Python<'_>) -> PyResult<()>,
    mut stop: impl FnMut() + Send,
) -> PyResult<T> {
    let (tell, mut told) = channel();
    let thread = Builder::new().name("swerve".into()).spawn(move || {
        // The receiver is gone if this was given up.
        let _given_up = tell.send(work());
    })?;
    let mut ended_by = None;
    let result = loop {
        let received;
        (received, told) = py.detach(move || (told.recv_timeout(LOOK), told));
        match received {
            Ok(result) => break Some(result),
            Err(RecvTimeoutError::Disconnected) => break None,
            Err(RecvTimeoutError::Timeout) => {}
        }
        if ended_by.is_some() {
            stop();
            continue;
        }
        if let Err(error) = look(py).and_then(|()| py.check_signals()) {
            ended_by = Some(error);
            stop();
        }
    };
    let panicked = py.detach(|| thread.join()).is_err();
    if let Some(error) = ended_by {
        return Err(error);
    }
    match result {
        Some(result) => result.map_err(crate::convert::error),
        None => Err(PyRuntimeError::new_err(if panicked { "a bug: the run panicked" } else { "no result" })),
    }
}
