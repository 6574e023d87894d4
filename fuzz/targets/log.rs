#![no_main]
//! Logs: whatever is readable of any bytes is given, with its run times and decisions.

use swerve_fuzz::Scratch;
use swerve_log::Log;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = Scratch::file("log.mcap", bytes);
    if let Ok((log, _damage)) = Log::salvage(file.path()) {
        let _times = log.run_times();
        let _decisions = log.decisions().count();
    }
    let _either_way = Log::read(file.path()).is_ok();
});
