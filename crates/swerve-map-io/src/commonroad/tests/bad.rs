//! Invalid and hostile files.

use proptest::prelude::*;

use super::SMALL;
use crate::commonroad::{Centers, read};
use crate::testing::{Changes, Sound, cases};

const SOUND: Sound = Sound {
    text: SMALL,
    read: |text| read("m.xml", text, Centers::Rounded).map(|roads| roads.lanes.defects),
};

/// A text of the scenario, its replacement, and the problem.
const FAULTS: &Changes = &[
    ("</commonRoad>", "", "m.xml:77:1: it ends too early, expected a whole XML document"),
    ("<commonRoad", "<!DOCTYPE a [<!ENTITY b \"c\">]><commonRoad", "expected no document type (DTD)"),
    ("<commonRoad", "<commonRoads/><commonRoad", "m.xml:2:15: it is not XML: "),
    ("2020a", "2017a", "`commonRoadVersion`: expected one of 2018b, 2020a, found \"2017a\""),
    (
        "id=\"1\"",
        "id=\"-1\"",
        "m.xml:3:12: lanelet -1: `id`: expected a whole number from 0 to 4294967295, found \"-1\"",
    ),
    ("id=\"1\"", "id=\"9e99\"", "`id`: expected a whole number from 0 to 4294967295, found \"9e99\""),
    ("id=\"1\"", "name=\"1\"", "m.xml:3:3: lanelet: attribute `id` is missing"),
    (
        "id=\"2\"",
        "id=\"1\"",
        "m.xml:23:12: lanelet 1: `id`: expected an identity that no other element has, found \"1\" again",
    ),
    (
        "id=\"5\"",
        "id=\"3\"",
        "trafficSign 3: `id`: expected an identity that no other element has, found \"3\" again",
    ),
    (
        "<x>0</x>",
        "<x>NaN</x>",
        "m.xml:5:14: lanelet 1/leftBound/point/x: expected a finite number, found NaN",
    ),
    ("<x>0</x>", "<x>1e300</x>", "expected a number of magnitude at most 1e9, found \"1e300\""),
    ("<x>0</x>", "<x/>", "expected a number, found \"\""),
    ("<x>0</x>", "", "m.xml:5:7: lanelet 1/leftBound/point: element `x` is missing"),
    ("<x>20</x>", "<x>9e8</x>", "expected lanes of at most 2000000 m together, found "),
    (
        "<point><x>0</x><y>3.5</y></point>",
        "",
        "m.xml:4:5: lanelet 1/leftBound: expected at least 2 points, found 1",
    ),
    (
        "<point><x>0</x><y>3.5</y></point>",
        "<point><x>-9</x><y>3.5</y></point><point><x>0</x><y>3.5</y></point>",
        "m.xml:3:3: lanelet 1: expected as many points to the left as to the right, found 3 and 2",
    ),
    (
        "drivingDir=\"same\"",
        "drivingDir=\"up\"",
        "`drivingDir`: expected one of same, opposite, found \"up\"",
    ),
    ("<successor ref=\"3\"/>", "<successor/>", "lanelet 1/successor: attribute `ref` is missing"),
    (
        "yellow",
        "amber",
        "m.xml:63:7: trafficLight 8/cycle/cycleElement: `color`: expected one of red, yellow, redYellow, green, \
         inactive, found \"amber\"",
    ),
    ("170", "-1", "cycle/cycleElement/duration: expected a number of time steps, found \"-1\""),
    ("170", "NaN", "expected a number of time steps, found \"NaN\""),
    ("<duration>170</duration>", "", "cycle/cycleElement: element `duration` is missing"),
    (
        "<timeOffset>43",
        "<timeOffset>later",
        "cycle/timeOffset: expected a number of time steps, found \"later\"",
    ),
    ("timeStepSize=\"0.1\"", "", "m.xml:2:1: commonRoad: attribute `timeStepSize` is missing"),
    (
        "timeStepSize=\"0.1\"",
        "timeStepSize=\"inf\"",
        "`timeStepSize`: expected a number of magnitude at most 1e9",
    ),
    (
        "timeStepSize=\"0.1\"",
        "timeStepSize=\"-0.1\"",
        "trafficLight 8/cycle: expected phases of 0 s, or of at least",
    ),
    ("timeStepSize=\"0.1\"", "timeStepSize=\"0\"", "trafficLight 8/cycle: expected a cycle of more than 0 s"),
    ("timeStepSize=\"0.1\"", "timeStepSize=\"1e9\"", "at most 3e9 s, found 200000000000 s"),
    ("<leftBound>", "<leftBorder>", "it is not XML: expected 'leftBorder' tag, not 'leftBound'"),
];

/// As [`FAULTS`], of problems that leave the lanes.
const DEFECTS: &Changes = &[
    ("commonRoadVersion", "version", "m.xml:2:1: commonRoad: `commonRoadVersion` is missing: read as 2020a"),
    (
        "<successor ref=\"3\"/>",
        "<successor ref=\"7\"/>",
        "lanelet 1/successor: expected the identity of a lanelet, found 7",
    ),
    (
        "<predecessor ref=\"1\"/>",
        "<predecessor ref=\"7\"/>",
        "lanelet 3/predecessor: expected the identity of a lanelet, found 7",
    ),
    ("ref=\"2\"", "ref=\"7\"", "lanelet 1/adjacentRight: expected the identity of a lanelet, found 7"),
    (
        "ref=\"2\"",
        "ref=\"1\"",
        "lanelet 1: the lane to its right is missing, or has another lane beside it: not neighbours",
    ),
    ("drivingDir=\"same\"", "drivingDir=\"opposite\"", "not neighbours"),
    (
        "<trafficSignRef ref=\"5\"/>",
        "<trafficSignRef ref=\"6\"/>",
        "expected the identity of a traffic sign, found 6",
    ),
    (
        "<trafficLightRef ref=\"8\"/>",
        "<trafficLightRef ref=\"6\"/>",
        "expected the identity of a traffic light, found 6",
    ),
    ("13.4112", "fast", "additionalValue: expected a number, found \"fast\""),
    ("<additionalValue>13.4112</additionalValue>", "", "expected a speed limit in m/s in `additionalValue`"),
    (
        "bicycleLane",
        "bicycle_lane",
        "lanelet 2/laneletType: expected a type of lanelets, found \"bicycle_lane\"",
    ),
    ("<y>-2</y>", "<y>2</y>", "lanelet 2: its left border is not to the left of its right border"),
    ("<x>20</x><y>0</y>", "<x>20</x><y>2.7</y>", "read"),
];

#[test]
fn faults_have_their_place_and_the_expected_value() {
    SOUND.assert_faults(FAULTS);
}

#[test]
fn defects_leave_the_lanes_and_are_listed() {
    SOUND.assert_defects(DEFECTS);
}

#[test]
fn all_problems_are_reported_at_once_in_order() {
    let text = SMALL.replace("<x>20</x>", "<x>far</x>").replacen("ref=\"3\"", "ref=\"7\"", 1);
    let problems = read("m.xml", &text, Centers::Rounded).unwrap_err();
    assert_eq!(problems.count(), 7, "{problems}");
    assert!(problems.windows(2).all(|two| two[0].line <= two[1].line), "{problems}");
}

#[test]
fn lanes_without_length_are_left_out() {
    let point = "<point><x>5</x><y>0</y></point>";
    let text = SMALL
        .replace("<rightBound>\n      <point><x>20</x><y>0</y></point>", &format!("<rightBound>{point}"));
    assert!(read("m.xml", &text, Centers::Rounded).is_ok());
    let bound = |name: &str| format!("<{name}>{point}{point}</{name}>");
    let lanelet =
        format!("<lanelet id=\"4\">{}{}</lanelet></commonRoad>", bound("leftBound"), bound("rightBound"));
    let roads = read("m.xml", &SMALL.replace("</commonRoad>", &lanelet), Centers::Rounded).unwrap();
    assert_eq!(roads.lanes.map.lanes().len(), 3);
    assert!(roads.lanes.defects.to_string().contains("lanelet 4: it has no length: left out"));
}

#[test]
fn deep_nesting_is_refused_and_unknown_elements_are_counted() {
    let deep = format!("{}{}", "<a>".repeat(300), "</a>".repeat(300));
    let text = SMALL.replace("</commonRoad>", &format!("{deep}</commonRoad>"));
    let problems = read("m.xml", &text, Centers::Rounded).unwrap_err();
    assert!(problems.to_string().contains("expected at most 256 nested elements"), "{problems}");
    let text = SMALL.replace("</commonRoad>", "<novel/><novel/></commonRoad>");
    let roads = read("m.xml", &text, Centers::Rounded).unwrap();
    assert_eq!(roads.lanes.unknown.get("novel"), Some(&2));
}

proptest! {
    #![proptest_config(cases())]

    /// Truncated files and files with a few changed characters give lanes, or problems with a valid line.
    #[test]
    fn reader_survives_arbitrary_changes(
        cut in 0..SMALL.len(),
        changes in prop::collection::vec(
            (0..SMALL.len(), prop::sample::select(vec!["9", "<", "-", "e9", "\"", "", "NaN", "0.4", "</point>"])),
            0..4,
        ),
    ) {
        let mut text = SMALL.to_owned();
        for (at, word) in changes {
            if text.is_char_boundary(at) && at < text.len() {
                text.replace_range(at..=at, word);
            }
        }
        for text in [text.as_str(), text.get(..cut).unwrap_or_default()] {
            for centers in [Centers::Middles, Centers::Rounded] {
                if let Err(problems) = read("m.xml", text, centers) {
                    let last = text.lines().count().max(1) + 1;
                    prop_assert!(problems.iter().all(|one| (1..=last).contains(&one.line)), "{problems}");
                }
            }
        }
    }
}
