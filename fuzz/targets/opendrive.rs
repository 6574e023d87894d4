#![no_main]
//! OpenDRIVE files: read, evaluated, made a lane map with its index, drawn.

use swerve_map::LaneIndex;
use swerve_map_io::import::import;
use swerve_map_io::links::Links;
use swerve_map_io::opendrive::Network;
use swerve_map_io::picture;
use swerve_map_io::summary::Summary;

libfuzzer_sys::fuzz_target!(|text: &str| {
    let network = match Network::read("fuzz.xodr", text) {
        Ok(network) => network,
        Err(problems) => {
            assert!(!problems.is_empty() && problems.iter().all(|problem| problem.line > 0));
            return;
        }
    };
    for road in &network.roads {
        for (index, section) in road.sections.iter().enumerate() {
            let Some([from_m, to_m]) = road.section_span_m(index) else { continue };
            for lane in section.lanes().take(8) {
                let Ok(sample) = network.sample(&road.id, index, lane.id, 0.5 * (from_m + to_m)) else { continue };
                assert!(sample.position_m.iter().all(|x| x.is_finite()) && sample.heading_rad.abs() < 3.2);
                assert!(sample.width_m >= 0.0);
            }
        }
    }
    let links = Links::of(&network);
    let Ok(imported) = import(&network, &links) else { return };
    let _index = LaneIndex::new(&imported.map);
    let summary = Summary::of(&network, &imported, text.len());
    let _text = summary.text("fuzz.xodr", &network, &imported, &links);
    if let Some(extent_m) = summary.extent_m {
        let _picture = picture::draw(&network, &imported, extent_m, "fuzz", None);
    }
});
