//! Ctrl-C (`SIGINT`) and `SIGTERM`: the first asks the program to end in good order, the second ends it at once.

use std::sync::atomic::{AtomicBool, Ordering};

use swerve_flow::StopHandle;

/// The exit status of a program that was ended by a second interrupt, as of shells: 128 + `SIGINT`.
const ENDED_AT_ONCE: i32 = 130;

/// Calls `first` at the first interrupt. At the second one, workers are killed and the program exits at once, even
/// where a step, a worker or a file hangs. The handler of an earlier call in this process stays in place.
///
/// # Errors
/// There is a handler already, or the system refuses one.
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

/// Ends a run in good order when it is interrupted.
pub fn stop_on_interrupt(stop: StopHandle) {
    // There is a handler already where a program has run before in this process: that one stays.
    let _first = on_interrupt(move || stop.stop());
}
