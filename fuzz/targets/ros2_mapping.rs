#![no_main]
//! Tables of what ROS 2 calls our streams.

use swerve_ros2::env::Network;
use swerve_ros2::mapping::Mapping;

libfuzzer_sys::fuzz_target!(|text: &str| {
    if let Ok(table) = text.parse::<toml::Table>() {
        let _either_way = Mapping::from_table(&table, Network { domain: 0, localhost_only: true }).is_ok();
    }
});
