//! Ctrl-C (`SIGINT`) and `SIGTERM`: the first requests an orderly end, the second ends the program at once.

use std::sync::atomic::{AtomicBool, Ordering};

use swerve_flow::StopHandle;

/// Exit status after a second interrupt, as in shells: 128 + `SIGINT`.
const ENDED_AT_ONCE: i32 = 130;

/// Calls `first` at the first interrupt. At the second one, workers are killed and the program exits at once, even if a
/// step, a worker or a file hangs. A handler set earlier in this process stays in place.
///
/// # Errors
/// If there is a handler already, or the system refuses one.
pub fn on_interrupt(first: impl Fn() + Send + 'static) -> Result<(), ctrlc::Error> {
    let interrupted = AtomicBool::new(false);
    ctrlc::set_handler(move || {
        if interrupted.swap(true, Ordering::SeqCst) {
            swerve_ipc::kill_workers();
            std::process::exit(ENDED_AT_ONCE);
        }
        first();
    })
}

/// Ends a run in order when interrupted.
pub fn stop_on_interrupt(stop: StopHandle) {
    // An earlier run in this process may have set a handler: it stays.
    let _first = on_interrupt(move || stop.stop());
}
