#![no_main]
//! Calls that a worker's process is sent.

use std::cell::RefCell;

use swerve_flow::Worker;

thread_local! {
    static WORKER: RefCell<Worker> = RefCell::new(swerve_fuzz::worker());
}

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    WORKER.with_borrow_mut(|worker| {
        let _either_way = worker.answer(bytes, &mut Vec::new()).is_ok();
    });
});
