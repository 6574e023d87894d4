//! Slopes of a road worked out by hand, and of published road networks.

use swerve_map::LaneKind;
use swerve_tests::data_or_skip;

use crate::MapFile;
use crate::slope::{Slope, Slopes};
use crate::testing::{below, networks};

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

const NET: &str = include_str!("../../maps/junction.net.xml");

/// Largest grade and bank of part of a lane, rounded, each with the name of the lane and the place.
fn slopes_of(file: &MapFile, name: &str, part_m: [f64; 2]) -> [Option<(f64, String, f64)>; 2] {
    let rounded = |one: Slope| ((1e6 * one.slope).round() / 1e6, one.road, (1e6 * one.s_m).round() / 1e6);
    let slopes = file.slopes([(file.on_lane(name, 0.0).unwrap().lane, part_m)]);
    [slopes.grade, slopes.bank].map(|slope| slope.map(rounded))
}

fn slope(slope: f64, name: &str, s_m: f64) -> Option<(f64, String, f64)> {
    Some((slope, name.to_owned(), s_m))
}

#[test]
fn networks_of_sumo_have_grades() {
    // 12 % from 45 m on.
    let hill = NET.replace("0.00,48.25 90.00,48.25", "0.00,48.25,7.00 45.00,48.25,7.00 90.00,48.25,12.40");
    let file = MapFile::read("m.net.xml", &hill).unwrap();
    assert_eq!(slopes_of(&file, "in_2", [0.0, 45.0]), [None, None]);
    assert_eq!(slopes_of(&file, "in_2", [20.0, 90.0]), [slope(0.12, "in_2", 47.5), None]);
    // The part of the piece that is driven.
    assert_eq!(slopes_of(&file, "in_2", [66.0, 67.0]), [slope(0.12, "in_2", 66.5), None]);
    assert_eq!(slopes_of(&file, "in_1", [0.0, 90.0]), [slope(0.05, "in_1", 2.5), None]);
    assert_eq!(slopes_of(&file, "out_0", [0.0, 40.0]), [None, None]);
    let without_one = MapFile::read("m.net.xml", &hill.replace("45.00,48.25,7.00", "45.00,48.25")).unwrap();
    assert_eq!(slopes_of(&without_one, "in_2", [0.0, 90.0]), [None, None]);
}

#[test]
fn short_lanes_count_as_longer_ones() {
    let short = |z_m: &str| {
        let to = format!("100.00,35.00,1.00 100.00,36.00,{z_m}");
        let file = MapFile::read("m.net.xml", &NET.replace("100.00,35.00 100.00,40.00", &to)).unwrap();
        slopes_of(&file, ":J_2_0", [0.0, 1.0])
    };
    assert_eq!(short("1.02"), [slope(0.008, ":J_2_0", 0.5), None]);
    assert_eq!(short("0.50"), [slope(-0.2, ":J_2_0", 0.5), None]);
}

/// A lanelet along x of 100 m and 3.5 m, with a node every metre on each border; heights by x and y.
fn lanelet(height_m: impl Fn(f64, f64) -> Option<f64>) -> MapFile {
    let node = |id: usize, [x_m, y_m]: [f64; 2]| {
        let tag = |key: &str, value: f64| format!("<tag k='{key}' v='{value:.4}'/>");
        let ele = height_m(x_m, y_m).map_or_else(String::new, |z_m| tag("ele", z_m));
        format!(
            "<node id='{id}' lat='0' lon='0'>{}{}{ele}</node>\n",
            tag("local_x", x_m),
            tag("local_y", y_m)
        )
    };
    let (mut nodes, mut ways) = (String::new(), String::new());
    for (way, y_m) in [(1, 1.75), (2, -1.75)] {
        let ids = (0..=100).map(|k| (1000 * way + k, k as f64));
        nodes.extend(ids.clone().map(|(id, x_m)| node(id, [x_m, y_m])));
        let of_way: String = ids.map(|(id, _)| format!("<nd ref='{id}'/>")).collect();
        ways += &format!("<way id='{way}'>{of_way}</way>\n");
    }
    let text = format!(
        "<osm>\n{nodes}{ways}<relation id='7'><member type='way' ref='1' role='left'/>\
         <member type='way' ref='2' role='right'/><tag k='type' v='lanelet'/><tag k='subtype' v='road'/>\
         <tag k='one_way' v='no'/></relation>\n</osm>"
    );
    MapFile::read("m.osm", &text).unwrap()
}

#[test]
fn lanelets_have_grades_and_banks_in_their_direction() {
    // 12 % from 50 m on; from 80 m on, the left border is 0.21 m over the right one.
    let bank = |x_m: f64| if x_m > 79.5 { 0.06 } else { 0.0 };
    let hill = lanelet(|x_m, y_m| Some(40.0 + 0.12 * (x_m - 50.0).max(0.0) + bank(x_m) * y_m));
    assert_eq!(slopes_of(&hill, "7", [0.0, 50.0]), [None, None]);
    assert_eq!(slopes_of(&hill, "7", [0.0, 75.0]), [slope(0.12, "7", 52.5), None]);
    assert_eq!(slopes_of(&hill, "7", [80.0, 100.0]), [slope(0.12, "7", 82.5), slope(0.06, "7", 82.5)]);
    let back = "7:backward";
    assert_eq!(slopes_of(&hill, back, [0.0, 20.0]), [slope(-0.12, back, 2.5), slope(-0.06, back, 2.5)]);
    assert_eq!(slopes_of(&hill, back, [50.0, 100.0]), [None, None]);
    let flat = lanelet(|_, _| Some(812.0));
    assert_eq!(slopes_of(&flat, "7", [0.0, 100.0]), [None, None]);
    let without_one = lanelet(|x_m, y_m| (x_m != 30.0 || y_m > 0.0).then_some(0.12 * x_m));
    assert_eq!(slopes_of(&without_one, "7", [0.0, 100.0]), [None, None]);
}

#[test]
fn errors_of_survey_points_are_no_hills() {
    // Each height is off by 3 cm in the worst way: up at one end of a piece and down at the other one, then up at one
    // border and down at the other one.
    let worst = |x_m: f64, y_m: f64| match x_m < 50.0 {
        true if (x_m / 5.0).floor() % 2.0 == 0.0 => Some(0.03),
        true => Some(-0.03),
        false => Some(0.03 * y_m.signum()),
    };
    let [grade, bank] = slopes_of(&lanelet(worst), "7", [0.0, 100.0]);
    assert!((0.011..0.0121).contains(&grade.unwrap().0.abs()), "below the 2 % of a warning");
    assert!(bank.unwrap().0.abs() < 0.0172, "below the 4 % of a warning");
}

#[test]
fn scenarios_of_commonroad_have_grades_and_banks() {
    let bound = |name: &str, y_m: f64, [a, b]: [f64; 2]| {
        let point = |x_m: f64, z_m: f64| format!("<point><x>{x_m}</x><y>{y_m}</y><z>{z_m}</z></point>");
        format!("<{name}>{}{}</{name}>", point(0.0, a), point(50.0, b))
    };
    let text = format!(
        "<commonRoad commonRoadVersion='2020a' timeStepSize='0.1'><lanelet id='4'>{}{}\
         <laneletType>urban</laneletType></lanelet></commonRoad>",
        bound("leftBound", 4.0, [1.0, 7.0]),
        bound("rightBound", 0.0, [1.2, 7.2]),
    );
    let file = MapFile::read("m.xml", &text).unwrap();
    assert_eq!(slopes_of(&file, "4", [0.0, 50.0]), [slope(0.12, "4", 2.5), slope(-0.05, "4", 2.5)]);
    let file = MapFile::read("m.xml", &text.replace("<z>7</z>", "")).unwrap();
    assert_eq!(slopes_of(&file, "4", [0.0, 50.0]), [None, None]);
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

#[test]
fn published_networks_of_lanelets_and_sumo_are_flat() {
    // Points of tests of readers. In lanelet 101 the left border rises from 1 to 5 m and the right one from 0 to 2 m over
    // 2 m, which count as 2.5 m: a grade of 3 m over 2.5 m, and a bank of 2 m in the mean over 2 m.
    const RISING: &str = "test_3d_points.xml.gz";
    let Some(folder) = data_or_skip("worlds") else { return };
    let paths = below(&folder, &[".net.xml", ".osm", ".xml.gz", ".xml"]);
    let mut count = 0;
    for path in paths {
        let name = path.file_name().unwrap().to_string_lossy().into_owned();
        let text = swerve_text::unpacked(std::fs::read(&path).unwrap()).unwrap();
        let Ok(file) = MapFile::read(&name, &text) else { continue };
        let all = file.map.lanes().iter().map(|lane| (lane.id, [0.0, lane.line.length()]));
        let slopes = file.slopes(all);
        count += 1;
        if name == RISING {
            let [grade, bank] = [slopes.grade, slopes.bank].map(|one| one.map(|one| (one.slope, one.road)));
            assert_eq!((grade, bank), (Some((1.2, "101".to_owned())), Some((1.0, "101".to_owned()))));
        } else {
            assert_eq!(slopes, Slopes::default(), "{name}");
        }
    }
    assert!(count > 50, "{count}");
}
