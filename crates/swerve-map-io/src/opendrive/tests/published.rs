//! Maps of CARLA, esmini, Euro NCAP and UN R157, with samples in `oracles/opendrive`.

use std::path::Path;

use crate::links::Links;
use crate::opendrive::{Network, Sample};
use crate::testing::{networks, scenario_maps};
use swerve_geom::wrap_angle;
use swerve_tests::data_or_skip;

/// Maps with samples: name, path, tolerance in the ground plane (paramPoly3: 2 mm), number of samples.
const MAPS: [(&str, &str, f64, usize); 6] = [
    ("Town01", "carla/Town01.xodr", 2e-4, 2894),
    ("fabriksgatan", "esmini/resources/xodr/fabriksgatan.xodr", 2e-4, 966),
    ("e6mini", "esmini/resources/xodr/e6mini.xodr", 2e-3, 2604),
    ("curves_elevation", "esmini/resources/xodr/curves_elevation.xodr", 2e-4, 1746),
    (
        "alks_road_different_curvatures",
        "un_r157_alks/concrete_scenarios/road_networks/alks_road_different_curvatures.xodr",
        2e-4,
        10_240,
    ),
    ("X-Intersection_NCAP", "euro_ncap_2023/OpenDRIVE/NCAP/X-Intersection_NCAP.xodr", 2e-4, 1156),
];

fn network(path: &Path) -> Network {
    let text = std::fs::read_to_string(path).unwrap();
    Network::read(&path.display().to_string(), &text).unwrap_or_else(|problems| panic!("{problems}"))
}

/// Largest differences: in the plane, heights, widths (metres), headings (radians).
fn worst(network: &Network, table: &str) -> ([f64; 5], usize) {
    let (mut worst, mut count) = ([0.0_f64; 5], 0);
    for line in table.lines().skip(1) {
        let cells: Vec<&str> = line.split(',').collect();
        let [s, width, x, y, z, reference, heading] =
            [4, 5, 6, 7, 8, 9, 10].map(|k| cells[k].parse::<f64>().unwrap());
        let (section, lane) = (cells[1].parse().unwrap(), cells[2].parse().unwrap());
        let Sample { position_m, reference_heading_rad, heading_rad, width_m } =
            network.sample(cells[0], section, lane, s).unwrap_or_else(|error| panic!("{line}: {error}"));
        let in_plane = (position_m[0] - x).abs().max((position_m[1] - y).abs());
        let apart = [
            in_plane,
            position_m[2] - z,
            width_m - width,
            wrap_angle(reference_heading_rad - reference),
            wrap_angle(heading_rad - heading),
        ];
        for (worst, apart) in worst.iter_mut().zip(apart) {
            *worst = worst.max(apart.abs());
        }
        let found = network.road(cells[0]).unwrap().sections[section].lane(lane).unwrap();
        assert_eq!(found.kind.name(), cells[3], "{line}");
        count += 1;
    }
    (worst, count)
}

#[test]
fn samples_match_the_oracle() {
    for (name, path, within_m, samples) in MAPS {
        let Some(path) = data_or_skip(&format!("external/{path}")) else { return };
        let Some(table) = data_or_skip(&format!("oracles/opendrive/{name}.csv")) else { return };
        let (worst, count) = worst(&network(&path), &std::fs::read_to_string(table).unwrap());
        let [plane_m, height_m, width_m, reference_rad, heading_rad] = worst;
        println!("{name}: {count} samples, worst {worst:?}");
        assert_eq!(count, samples, "{name}");
        assert!(plane_m <= within_m && height_m <= 1e-4 && width_m <= 1e-4, "{name}: {worst:?}");
        assert!(reference_rad <= 1e-4 && heading_rad <= 1e-4, "{name}: {worst:?}");
    }
}

#[test]
fn links_and_gaps_match_the_oracle() {
    for (name, path, _, _) in MAPS {
        let Some(path) = data_or_skip(&format!("external/{path}")) else { return };
        let Some(expected) = data_or_skip(&format!("oracles/opendrive/{name}.links.json")) else { return };
        let expected: serde_json::Value =
            serde_json::from_str(&std::fs::read_to_string(expected).unwrap()).unwrap();
        let network = network(&path);
        let found = Links::of(&network).json(&network);
        for key in ["links", "dangling", "dangling_first", "over_0_01_m", "over_0_05_m"] {
            assert_eq!(found[key], expected[key], "{name}: {key}");
        }
        for key in ["p50", "p99", "max"] {
            let [a, b] = [&found, &expected].map(|json| json["gap_m"][key].as_f64().unwrap());
            assert!((a - b).abs() < 1e-6, "{name}: {key}: {a} {b}");
        }
    }
}

#[test]
fn all_shared_maps_load_and_their_ends_meet() {
    let mut found = Vec::new();
    for folder in ["external", "worlds"] {
        let Some(folder) = data_or_skip(folder) else { return };
        found.extend(networks(&folder));
    }
    assert!(found.len() >= 25, "{}", found.len());
    for path in found {
        let network = network(&path);
        let links = Links::of(&network);
        println!(
            "{}: {} roads, {} links, {} dangling, widest gap {:.2} mm; {} defects\n{}",
            path.file_name().unwrap().display(),
            network.roads.len(),
            links.all.len(),
            links.dangling.len(),
            1e3 * links.widest_m(),
            network.defects.count(),
            network.defects.first(3),
        );
        assert!(links.widest_m() < 1e-3, "{}: {}", path.display(), links.json(&network));
    }
}

fn assert_second_reader_agrees(folder: &Path) {
    for path in networks(folder) {
        let text = std::fs::read_to_string(&path).unwrap();
        let (worst_m, samples) = super::second::worst_m(&network(&path), &text);
        println!(
            "{}: {:.2} mm over {samples} samples",
            path.file_name().unwrap().display(),
            1e3 * worst_m[0]
        );
        assert!(samples > 0 && worst_m[0] < 1e-3, "{}: {worst_m:?}", path.display());
    }
}

#[test]
fn second_reader_agrees_on_all_shared_maps() {
    let Some(folder) = data_or_skip("external") else { return };
    assert_second_reader_agrees(&folder);
}

#[test]
fn second_reader_agrees_on_the_maps_of_scenarios() {
    assert_second_reader_agrees(&scenario_maps());
}
