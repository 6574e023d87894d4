#![no_main]
//! What a worker's process is told at its start.

use swerve_ipc::Setup;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _either_way = Setup::read(bytes).is_ok();
});
