//! Long work on a thread of its own, while Python looks for Ctrl-C and is told how far it came.

use core::time::Duration;
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::Builder;

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

/// How often Python has a look.
const LOOK: Duration = Duration::from_millis(50);

/// Does `work` on a thread. In between `look` is called under the interpreter's lock; where it fails, or a signal came,
/// `stop` is called, and the work is waited for.
pub(crate) fn do_in_background<T: Send + 'static>(
    py: Python<'_>,
    work: impl FnOnce() -> anyhow::Result<T> + Send + 'static,
    mut look: impl FnMut(Python<'_>) -> PyResult<()>,
    mut stop: impl FnMut() + Send,
) -> PyResult<T> {
    let (tell, mut told) = channel();
    let thread = Builder::new().name("swerve".into()).spawn(move || {
        // Nobody is left to be told where this one was given up.
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
