//! Drives over maps of other makers: random ways without traffic.

use std::path::Path;

use swerve_core::Rng;
use swerve_drive::drive;
use swerve_eval::Verdict;
use swerve_geom::angle_between;
use swerve_map::{Lane, LaneId, LaneKind, Map};
use swerve_map_io::MapFile;
use swerve_scenario::Scenario;
use swerve_stack::Setup;
use swerve_tests::data_or_skip;

/// Least length of a way, metres.
const WAY_M: f64 = 150.0;

/// Maps, the number of ways that are driven on each, and the largest lateral acceleration, m/s². Bends of SUMO's networks
/// are lines with few points.
const MAPS: [(&str, u64, f64); 8] = [
    ("external/carla/Town01.xodr", 3, 3.0),
    ("external/carla/Town02.xodr", 2, 3.0),
    ("external/esmini/resources/xodr/fabriksgatan.xodr", 2, 3.0),
    ("external/esmini/resources/xodr/two_plus_one.xodr", 1, 3.0),
    ("external/esmini/resources/xodr/e6mini.xodr", 1, 3.0),
    ("external/euro_ncap_2023/OpenDRIVE/NCAP/X-Intersection_NCAP.xodr", 2, 3.0),
    ("worlds/sumo/made/cross.net.xml", 2, 3.5),
    ("worlds/commonroad/interactive/ZAM_Tjunction-1_18_I-1-1/ZAM_Tjunction-1_18_I-1-1.cr.xml.gz", 1, 3.0),
];

/// Radius of the tightest lane that a way leads over, metres. SUMO's networks have lanes for turning around on the spot.
const RADIUS_MIN_M: f64 = 5.0;

/// A random way: the lane that it begins on, and the last one; `None` if it ends inside a junction.
fn way(map: &Map, rng: &mut Rng) -> Option<[LaneId; 2]> {
    let begins = |lane: &&Lane| {
        lane.kind == LaneKind::Driving && lane.line.length() > 20.0 && !map.is_in_junction(lane.id)
    };
    let lanes: Vec<&Lane> = map.lanes().iter().filter(begins).collect();
    let first = *lanes.get(rng.below(lanes.len().max(1)))?;
    let (mut at, mut length_m) = (first, 0.0);
    while length_m < WAY_M || map.is_in_junction(at.id) {
        let nexts: Vec<&Lane> = at.successors.iter().filter_map(|id| map.lane(*id)).collect();
        let can_follow = |lane: &&Lane| lane.kind == LaneKind::Driving && !turns_around(lane);
        let nexts: Vec<&Lane> = nexts.into_iter().filter(can_follow).collect();
        let Some(next) = nexts.get(rng.below(nexts.len().max(1))) else { break };
        (at, length_m) = (next, length_m + next.line.length());
    }
    (!map.is_in_junction(at.id)).then_some([first.id, at.id])
}

fn turns_around(lane: &Lane) -> bool {
    let [begin, end] = [0.0, lane.line.length()].map(|s_m| lane.line.at(s_m).pose.heading_rad);
    angle_between(begin, end).abs() > lane.line.length() / RADIUS_MIN_M
}

/// A place on a lane as in a scenario.
fn place(map: &Map, lane: LaneId, share: f64) -> String {
    let line = &map.lane(lane).unwrap().line;
    let pose = line.at(share * line.length()).pose;
    format!("{{ x_m = {:?}, y_m = {:?}, heading_rad = {:?} }}", pose.x_m, pose.y_m, pose.heading_rad)
}

/// Drives way `seed` of a map; what is wrong with it.
fn driven(file: &Path, map: &Map, seed: u64, lateral_max_mps2: f64) -> Option<String> {
    let [first, last] = way(map, &mut Rng::keyed(seed, "way", &[]))?;
    let name = file.file_name().unwrap().to_str().unwrap();
    let text = format!(
        "name = \"way\"\n[map]\nfile = {name:?}\n[ego]\nstart = {}\ngoal = {}\ntarget_speed_mps = 13.0\n\
         start_speed_mps = 0.0\n[end]\ntimeout_s = 300.0\n",
        place(map, first, 0.3),
        place(map, last, 0.7),
    );
    let scenario = match Scenario::parse(file.with_file_name("way.toml").to_str().unwrap(), &text) {
        Ok(scenario) => scenario,
        Err(problems) => return Some(format!("{name} {seed}: {problems}")),
    };
    let outcome = drive(&Setup::default(), &scenario).unwrap();
    let metrics = &outcome.metrics;
    let lateral_mps2 = metrics.drive.lateral_accel_max_mps2;
    let over_m = metrics.safety.distance_over_line_m.unwrap_or(0.0);
    let is_good = metrics.verdict == Verdict::Completed && lateral_mps2 <= lateral_max_mps2 && over_m == 0.0;
    (!is_good).then(|| {
        let (verdict, margin_m) = (metrics.verdict, outcome.road_margin_m);
        let at_s = metrics.drive.duration_s;
        format!(
            "{name} {seed}: {verdict:?} after {at_s:.0} s, {lateral_mps2:.1} m/s2, {over_m:.1} m over lines, {margin_m:.2} m inside\n{text}"
        )
    })
}

#[test]
fn random_ways_over_published_maps_are_driven_to_their_end_within_the_lane() {
    let mut wrong = Vec::new();
    for (name, ways, lateral_max_mps2) in MAPS {
        let Some(file) = data_or_skip(name) else { continue };
        let text = swerve_text::unpacked(std::fs::read(&file).unwrap()).unwrap();
        let map = MapFile::read(name, &text).unwrap_or_else(|message| panic!("{message}")).map;
        wrong.extend((1..=ways).filter_map(|seed| driven(&file, &map, seed, lateral_max_mps2)));
    }
    assert!(wrong.is_empty(), "{} wrong\n{}", wrong.len(), wrong.join("\n"));
}
