#![no_main]
//! Recordings of ROS 2 in MCAP.

use swerve_fuzz::Scratch;
use swerve_log::Bag;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let file = Scratch::file("bag.mcap", bytes);
    let Ok(mut bag) = Bag::open(file.path()) else { return };
    while let Ok(Some(_)) = bag.next_message() {}
});
