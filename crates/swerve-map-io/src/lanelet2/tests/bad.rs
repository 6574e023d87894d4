//! Invalid and hostile files.

use proptest::prelude::*;

use crate::lanelet2::read;
use crate::testing::{Changes, Sound, cases, with_value};

/// Two lanes side by side, the left one followed by another.
const SMALL: &str = r#"<osm version="0.6">
<node id="1" lat="0" lon="0"><tag k="local_x" v="0"/><tag k="local_y" v="3"/></node>
<node id="2" lat="0" lon="0"><tag k="local_x" v="20"/><tag k="local_y" v="3"/></node>
<node id="3" lat="0" lon="0"><tag k="local_x" v="0"/><tag k="local_y" v="0"/></node>
<node id="4" lat="0" lon="0"><tag k="local_x" v="20"/><tag k="local_y" v="0"/></node>
<node id="5" lat="0" lon="0"><tag k="local_x" v="0"/><tag k="local_y" v="-3"/></node>
<node id="6" lat="0" lon="0"><tag k="local_x" v="20"/><tag k="local_y" v="-3"/></node>
<node id="7" lat="0" lon="0"><tag k="local_x" v="40"/><tag k="local_y" v="3"/></node>
<node id="8" lat="0" lon="0"><tag k="local_x" v="40"/><tag k="local_y" v="0"/></node>
<way id="11"><nd ref="1"/><nd ref="2"/></way>
<way id="12"><nd ref="3"/><nd ref="4"/></way>
<way id="13"><nd ref="5"/><nd ref="6"/></way>
<way id="14"><nd ref="2"/><nd ref="7"/></way>
<way id="15"><nd ref="4"/><nd ref="8"/></way>
<relation id="21"><member type="way" role="left" ref="11"/><member type="way" role="right" ref="12"/>
<member type="relation" role="regulatory_element" ref="31"/>
<tag k="type" v="lanelet"/><tag k="subtype" v="road"/><tag k="speed_limit" v="50"/></relation>
<relation id="22"><member type="way" role="left" ref="12"/><member type="way" role="right" ref="13"/>
<tag k="type" v="lanelet"/><tag k="subtype" v="bicycle_lane"/></relation>
<relation id="23"><member type="way" role="left" ref="14"/><member type="way" role="right" ref="15"/>
<tag k="type" v="lanelet"/><tag k="subtype" v="road"/></relation>
<relation id="31"><member type="relation" role="yield" ref="21"/><member type="relation" role="right_of_way" ref="22"/>
<tag k="type" v="regulatory_element"/><tag k="subtype" v="right_of_way"/></relation>
</osm>
"#;

const SOUND: Sound = Sound { text: SMALL, read: |text| read("m.osm", text).map(|map| map.lanes.defects) };

/// A text of the map, its replacement, and the problem.
const FAULTS: &Changes = &[
    ("</osm>\n", "", "m.osm:24:1: it ends too early, expected a whole XML document"),
    ("<osm", "<!DOCTYPE osm><osm", "expected no document type (DTD)"),
    ("v=\"20\"", "v=\"NaN\"", "m.osm:3:47: node 2/tag: `v`: expected a finite number, found NaN"),
    ("v=\"20\"", "v=\"1e300\"", "`v`: expected a number of magnitude at most 1e9, found \"1e300\""),
    ("v=\"20\"", "v=\"far\"", "`v`: expected a number, found \"far\""),
    (
        "k=\"local_x\" v=\"20\"",
        "k=\"x\" v=\"20\"",
        "node 2: expected the tags `local_x` and `local_y`, as other nodes have",
    ),
    ("v=\"20\"", "v=\"9e8\"", "expected lanes of at most 2000000 m together, found "),
    (
        "<node id=\"2\"",
        "<node id=\"1\"",
        "m.osm:3:7: node 1: `id`: expected an identity that no other node has, found 1 again",
    ),
    (
        "<way id=\"12\"",
        "<way id=\"11\"",
        "way 11: `id`: expected an identity that no other way has, found 11 again",
    ),
    ("<node id=\"2\"", "<node id=\"two\"", "`id`: expected a whole number, found \"two\""),
    ("<node id=\"2\"", "<node", "node: attribute `id` is missing"),
    (
        "<node id=\"2\"",
        "<node action=\"delete\" id=\"2\"",
        "m.osm:10:27: way 11/nd: expected the identity of a node, found 2",
    ),
    (
        "<nd ref=\"1\"/>",
        "<nd ref=\"99\"/>",
        "m.osm:10:14: way 11/nd: expected the identity of a node, found 99",
    ),
    ("<nd ref=\"1\"/>", "", "relation 21/member: expected a way of at least 2 nodes, found 1"),
    ("ref=\"11\"", "ref=\"99\"", "m.osm:15:19: relation 21/member: expected the identity of a way, found 99"),
    (
        "type=\"way\" role=\"left\" ref=\"11\"",
        "type=\"relation\" role=\"left\" ref=\"21\"",
        "expected a way with the role `left`, found a relation",
    ),
    (
        "role=\"left\" ref=\"11\"",
        "role=\"links\" ref=\"11\"",
        "relation 21: expected one way with the role `left`, found 0",
    ),
    (
        "role=\"right\" ref=\"12\"",
        "role=\"left\" ref=\"12\"",
        "relation 21: expected one way with the role `left`, found 2",
    ),
    ("type=\"way\"", "type=\"road\"", "`type`: expected one of node, way, relation, found \"road\""),
];

/// As [`FAULTS`], of problems that leave the lanes.
const DEFECTS: &Changes = &[
    ("v=\"50\"", "v=\"fast\"", "relation 21/tag: expected a speed with km/h, mph or m/s, found \"fast\""),
    (
        "v=\"bicycle_lane\"",
        "v=\"bike\"",
        "relation 22: `subtype`: expected one of Lanelet2, found \"bike\": read as Driving",
    ),
    ("ref=\"31\"", "ref=\"21\"", "expected the identity of a regulatory element, found 21"),
    ("ref=\"31\"", "ref=\"99\"", "expected the identity of a regulatory element, found 99"),
    // The right border where the left one is, and a lane from a node to itself.
    (
        "role=\"right\" ref=\"12\"",
        "role=\"right\" ref=\"11\"",
        "relation 21: its left border is not to the left of its right border",
    ),
    ("<nd ref=\"4\"/><nd ref=\"8\"/>", "<nd ref=\"7\"/><nd ref=\"2\"/>", "relation 23: "),
];

#[test]
fn faults_have_their_place_and_the_expected_value() {
    SOUND.assert_faults(FAULTS);
}

#[test]
fn defects_leave_the_lanes_and_are_listed() {
    assert_eq!(SOUND.problems("</osm>", "</osm>"), "read\n");
    SOUND.assert_defects(DEFECTS);
}

#[test]
fn latitudes_are_degrees() {
    let text = SMALL.replace("local_", "other_");
    let wrong = |from: &str, to: &str| read("m.osm", &text.replacen(from, to, 1)).unwrap_err().to_string();
    assert!(wrong("lat=\"0\"", "lat=\"91\"").contains("`lat`: expected degrees from -90 to 90, found 91"));
    assert!(wrong("lon=\"0\"", "lon=\"inf\"").contains("`lon`: expected a number of magnitude at most 1e9"));
    assert!(wrong("lat=\"0\" ", "").contains("attribute `lat` is missing"));
    // All nodes in one place: lanes without length.
    let problems = read("m.osm", &text).unwrap();
    assert!(problems.lanes.map.lanes().is_empty() && problems.lanes.defects.count() >= 3);
}

#[test]
fn files_without_lanelets_and_cyclic_relations() {
    let problems = read("m.osm", "<osm/>").unwrap_err().to_string();
    assert!(problems.contains("expected relations of type `lanelet`, found none"), "{problems}");
    assert!(read("m.osm", "<net/>").unwrap_err().to_string().contains("expected the element `osm`"));
    // Rules that name themselves and each other.
    let cycle = "<relation id=\"41\"><member type=\"relation\" role=\"refers\" ref=\"41\"/>\
                 <member type=\"relation\" role=\"refers\" ref=\"42\"/><tag k=\"type\" v=\"regulatory_element\"/>\
                 <tag k=\"subtype\" v=\"crosswalk\"/></relation>\
                 <relation id=\"42\"><member type=\"relation\" role=\"refers\" ref=\"41\"/>\
                 <tag k=\"type\" v=\"regulatory_element\"/><tag k=\"subtype\" v=\"traffic_light\"/></relation></osm>";
    let map = read("m.osm", &SMALL.replace("</osm>", cycle)).unwrap();
    assert_eq!(map.lanes.map.lanes().len(), 3);
    assert!(map.lanes.defects.to_string().contains("expected the identity of a lanelet, found 41"));
    let deep = format!("{}{}", "<a>".repeat(300), "</a>".repeat(300));
    let problems = read("m.osm", &SMALL.replace("</osm>", &format!("{deep}</osm>"))).unwrap_err();
    assert!(problems.to_string().contains("expected at most 256 nested elements"), "{problems}");
}

#[test]
fn crowds_at_one_border_are_bounded() {
    let lanelet = |id: usize, left: u8, right: u8| {
        format!(
            "<relation id=\"{id}\"><member type=\"way\" role=\"left\" ref=\"{left}\"/><member type=\"way\" \
             role=\"right\" ref=\"{right}\"/><tag k=\"type\" v=\"lanelet\"/><tag k=\"subtype\" v=\"road\"/></relation>"
        )
    };
    let before: String = (100..200).map(|id| lanelet(id, 11, 12)).collect();
    let after: String = (200..300).map(|id| lanelet(id, 14, 15)).collect();
    let text = SMALL.replace("</osm>", &format!("{before}{after}</osm>"));
    let map = read("m.osm", &text).unwrap_or_else(|problems| panic!("{}", problems.first(3)));
    let widest = map.lanes.map.lanes().iter().map(|lane| lane.successors.len()).max();
    assert_eq!(widest, Some(64));
    assert!(map.lanes.defects.to_string().contains("expected at most 64 lanes at its end"));
    assert!(map.lanes.defects.to_string().contains("expected a border of at most 64 lanes"));
}

/// Texts put in place of an attribute's value.
const VALUES: [&str; 18] = [
    "",
    "0",
    "-1",
    "1e9",
    "-1e9",
    "1e-300",
    "NaN",
    "inf",
    "x",
    "0.5",
    "100",
    "3",
    "way",
    "relation",
    "left",
    "yes",
    "multipolygon",
    "traffic_light",
];

/// Reads a text; its lanes have finite widths, its problems a place.
fn survives(text: &str) {
    match read("m.osm", text) {
        Ok(map) => {
            for lane in map.lanes.map.lanes() {
                let width_m = lane.width_m(0.5 * lane.line.length());
                assert!(width_m.is_finite() && width_m >= 0.0, "{text}");
            }
        }
        Err(problems) => assert!(!problems.is_empty() && problems.iter().all(|one| one.line > 0)),
    }
}

#[test]
fn any_attribute_of_the_junction_may_have_any_value() {
    let text = super::JUNCTION;
    let attributes = text.matches('"').count() / 2;
    for (k, at) in (0..attributes).step_by(3).enumerate() {
        survives(&with_value(text, at, VALUES[k % VALUES.len()]).unwrap());
    }
}

proptest! {
    #![proptest_config(cases())]
    #[test]
    fn attributes_of_any_value_never_cause_a_panic(
        cut in 0..SMALL.len(),
        changes in proptest::collection::vec((0..10_000_usize, 0..VALUES.len()), 1..4),
    ) {
        let mut text = SMALL.to_owned();
        for (at, value) in changes {
            text = with_value(&text, at, VALUES[value]).unwrap_or(text);
        }
        survives(&text);
        survives(text.get(..cut).unwrap_or_default());
    }
}
