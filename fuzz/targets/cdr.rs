#![no_main]
//! Messages of ROS 2 in CDR: the first byte says of which kind.

use swerve_ros2::Kind;
use swerve_ros2::cdr::decode_any;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| {
    let Some((first, payload)) = bytes.split_first() else { return };
    let kind = Kind::ALL[usize::from(*first) % Kind::ALL.len()];
    let _either_way = decode_any(kind, payload).is_ok();
});
