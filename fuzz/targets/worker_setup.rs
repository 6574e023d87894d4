#![no_main]
//! Setup message of a worker process.

use swerve_ipc::Setup;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let _either_way = Setup::read(bytes).is_ok();
});
