//! Slopes of a road worked out by hand, and of published road networks.

use swerve_map::LaneKind;
use swerve_tests::data_or_skip;

use crate::MapFile;
use crate::slope::Slope;
use crate::testing::networks;

/// A straight road of 100 m with two lanes of opposite directions, which rises by 5 % from 50 m on, and is banked from
/// 80 m on: its left side is the upper one.
const ROAD: &str = r#"<OpenDRIVE><header revMajor="1" revMinor="7"/>
<road id="7" length="100" junction="-1"><planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
<elevationProfile><elevation s="0" a="0" b="0" c="0" d="0"/><elevation s="50" a="0" b="0.05" c="0" d="0"/></elevationProfile>
<lateralProfile><superelevation s="0" a="0" b="0" c="0" d="0"/><superelevation s="80" a="0.06" b="0" c="0" d="0"/></lateralProfile>
<lanes><laneSection s="0"><left><lane id="1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none"/></center>
<right><lane id="-1" type="driving"><width sOffset="0" a="3.5" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>
</OpenDRIVE>"#;

#[test]
fn slopes_have_their_sign_in_the_direction_of_travel() {
    let file = MapFile::read("m.xodr", ROAD).unwrap();
    let found = |lane: i32, s_m: f64, part_m: [f64; 2]| {
        let lane = file.on_road("7", lane, s_m).unwrap().lane;
        let slopes = file.slopes([(lane, part_m)]);
        let rounded =
            |slope: Option<Slope>| slope.map(|one| ((1e4 * one.slope).round() * 1e-4, one.s_m.round()));
        (rounded(slopes.grade), rounded(slopes.bank))
    };
    assert_eq!(found(-1, 10.0, [0.0, 50.0]), (None, None));
    assert_eq!(found(-1, 10.0, [0.0, 75.0]), (Some((0.05, 60.0)), None));
    // The tangent of the roll.
    assert_eq!(found(-1, 10.0, [85.0, 95.0]), (Some((0.05, 90.0)), Some((0.0601, 85.0))));
    // Against s, the first 15 m of the lane.
    assert_eq!(found(1, 90.0, [0.0, 15.0]), (Some((-0.05, 95.0)), Some((-0.0601, 100.0))));
}

#[test]
fn maps_without_roads_have_no_slopes() {
    let net = include_str!("../../maps/junction.net.xml");
    let file = MapFile::read("junction.net.xml", net).unwrap();
    let slopes = file.slopes(file.map.lanes().iter().map(|lane| (lane.id, [0.0, lane.line.length()])));
    assert_eq!((slopes.grade, slopes.bank, file.heights_m()), (None, None, Some([0.0, 4.5])));
}

/// Largest grade and bank of the driving lanes of published networks that are not flat, percent.
const PUBLISHED: [(&str, [f64; 2]); 2] =
    [("curves_elevation.xodr", [10.71, 0.0]), ("e6mini.xodr", [2.91, 0.0])];

#[test]
fn slopes_of_published_networks_are_known() {
    let Some(folder) = data_or_skip("external") else { return };
    let mut found = Vec::new();
    for path in networks(&folder) {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let file = MapFile::read(&name, &std::fs::read_to_string(&path).unwrap()).unwrap();
        let driving = file.map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving);
        let slopes = file.slopes(driving.map(|lane| (lane.id, [0.0, lane.line.length()])));
        println!("{name}: {slopes:?}");
        let percent = [slopes.grade, slopes.bank]
            .map(|slope| slope.map_or(0.0, |one| (1e4 * one.slope.abs()).round() / 100.0));
        if percent != [0.0; 2] {
            found.push((name, percent));
        }
    }
    let expected = PUBLISHED.map(|(name, percent)| (name.to_owned(), percent));
    assert_eq!(found, expected);
}
