#![no_main]
//! Setup message of a worker process.

use swerve_ipc::WorkerSetup;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _either_way = WorkerSetup::read(bytes).is_ok();
});
