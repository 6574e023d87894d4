#![no_main]
//! Road networks of SUMO: read as lane maps, indexed, summed up, drawn.

use swerve_map::LaneIndex;
use swerve_map_io::overview::Overview;
use swerve_map_io::{picture, sumo};

libfuzzer_sys::fuzz_target!(|text: &str| {
    let net = match sumo::read("fuzz.net.xml", text) {
        Ok(net) => net,
        Err(problems) => {
            assert!(!problems.is_empty() && problems.iter().all(|problem| problem.line > 0));
            return;
        }
    };
    let map = &net.lanes.map;
    let _index = LaneIndex::new(map);
    for program in &net.programs {
        assert!(program.signals.iter().flatten().all(|id| map.signal(*id).is_some()));
    }
    let overview = Overview::of(map, text.len());
    let _text = overview.text("fuzz.net.xml", &net.lanes);
    if let Some(extent_m) = overview.extent_m {
        let _picture = picture::lanes::draw(map, extent_m, "fuzz", None);
    }
});
