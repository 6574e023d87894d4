//! Invalid and hostile files.

use proptest::prelude::*;
use swerve_map::LaneIndex;
use swerve_tests::data_or_skip;

use crate::sumo::read;
use crate::testing::{Changes, Sound, cases, with_value};

const SMALL: &str = include_str!("../../../maps/junction.net.xml");

const SOUND: Sound = Sound { text: SMALL, read: |text| read("n", text).map(|net| net.lanes.defects) };

/// A text of the small network, its replacement, and the fault.
const FAULTS: &Changes = &[
    ("<edge id=\":J_0\"", "<edge name=\":J_0\"", "n:10:5: edge: attribute `id` is missing"),
    (
        "id=\"side_0\"",
        "id=\"in_0\"",
        "edge side/lane in_0: `id`: expected an identity that no other has, found \"in_0\" again",
    ),
    (
        "<edge id=\"side\"",
        "<edge id=\"in\"",
        "edge in: `id`: expected an identity that no other has, found \"in\" again",
    ),
    (
        "function=\"crossing\"",
        "function=\"crosing\"",
        "`function`: expected one of normal, internal, connector, crossing, walkingarea, found \"crosing\"",
    ),
    ("shape=\"100.00,0.00 100.00,35.00\"", "", "edge side/lane side_0: attribute `shape` is missing"),
    ("shape=\"100.00,0.00 100.00,35.00\"", "shape=\"\"", "`shape`: expected at least one vertex"),
    ("100.00,0.00 100.00,35.00", "100.00,NaN 100.00,35.00", "`shape`: expected a finite number, found NaN"),
    (
        "100.00,0.00 100.00,35.00",
        "100.00,1e12 100.00,35.00",
        "`shape`: expected a number of magnitude at most 1e9, found \"1e12\"",
    ),
    (
        "100.00,0.00 100.00,35.00",
        "100.00,0.00 100.00",
        "`shape`: expected vertices of 2 or 3 numbers, found one of 1",
    ),
    (
        "100.00,0.00 100.00,35.00",
        "1,2,3,4,5 100,35",
        "`shape`: expected vertices of 2 or 3 numbers, found one of 4",
    ),
    ("100.00,0.00 100.00,35.00", "a,b 100,35", "`shape`: expected a number, found \"a\""),
    ("width=\"3.50\"", "width=\"0\"", "`width`: expected more than 0 and at most 1000 m, found 0"),
    ("width=\"3.50\"", "width=\"wide\"", "`width`: expected a number, found \"wide\""),
    ("0.00,48.25 90.00,48.25", "0,0 9e8,0", "expected a map of at most 3000000 vertices"),
    (
        "netOffset=\"100.00,50.00\"",
        "netOffset=\"100.00\"",
        "location: `netOffset`: expected 2 numbers, found 1",
    ),
    (
        "netOffset=\"100.00,50.00\"",
        "netOffset=\"inf,0\"",
        "location: `netOffset`: expected a number of magnitude",
    ),
    (
        "from=\"in\" to=\"out\" fromLane=\"1\"",
        "from=\"in\" to=\"out\" fromLane=\"x\"",
        "connection: `fromLane`: expected a whole number, found \"x\"",
    ),
    (
        "from=\"in\" to=\"out\" fromLane=\"1\"",
        "to=\"out\" fromLane=\"1\"",
        "connection: attribute `from` is missing",
    ),
    (
        "linkIndex=\"0\"",
        "linkIndex=\"-2147483648\"",
        "`linkIndex`: expected a whole number, found \"-2147483648\"",
    ),
    (
        "linkIndex=\"0\"",
        "linkIndex=\"first\"",
        "connection: `linkIndex`: expected a whole number, found \"first\"",
    ),
    ("<tlLogic id=\"L\"", "<tlLogic", "tlLogic: attribute `id` is missing"),
    (
        "duration=\"30\"",
        "duration=\"-30\"",
        "tlLogic L/phase: `duration`: expected a number of at least 0, found -30",
    ),
    ("duration=\"30\"", "", "tlLogic L/phase: attribute `duration` is missing"),
    ("duration=\"30\"", "duration=\"NaN\"", "`duration`: expected a finite number, found NaN"),
    ("duration=\"30\"", "duration=\"1e-6\"", "tlLogic L: expected phases of 0 s, or of at least 0.001 s"),
    (
        "<tlLogic",
        "<tlLogic id=\"M\" type=\"static\"/><tlLogic",
        "tlLogic M: expected a cycle of more than 0 s",
    ),
    ("offset=\"5\"", "offset=\"late\"", "tlLogic L: `offset`: expected a number, found \"late\""),
    ("linkIndex=\"0\"", "linkIndex=\"7\"", "n:51:5: tlLogic L: expected a state for link 7, found 3 states"),
    ("state=\"yyr\"", "state=\"yy\"", "`state`: expected 3 letters as in the first phase, found 2"),
    ("state=\"yyr\"", "state=\"yyx\"", "`state`: expected letters of ryYgGsuoO, found \"x\""),
    (
        "<junction id=\"E\"",
        "<junction id=\"J\"",
        "`id`: expected an identity that no other has, found \"J\" again",
    ),
    ("<junction id=\"E\"", "<junction", "junction: attribute `id` is missing"),
    (
        "<request index=\"3\"",
        "<request index=\"three\"",
        "junction J/request: `index`: expected a whole number, found \"three\"",
    ),
    ("<?xml version=\"1.0\" encoding=\"UTF-8\"?>", "<!DOCTYPE net [<!ENTITY a \"b\">]>", "n:1:"),
    ("</net>", "", "it ends too early, expected a whole XML document"),
];

#[test]
fn faults_are_reported_with_their_place() {
    SOUND.assert_faults(FAULTS);
}

/// A text of the small network, its replacement, and the defect; the network is read.
const DEFECTS: &Changes = &[
    ("from=\"side\" to=\"out\"", "from=\"sied\" to=\"out\"", "connection: `from`: no edge is named \"sied\""),
    ("via=\":J_2_0\"", "via=\":J_9_0\"", "connection: `via`: no lane is named \":J_9_0\""),
    (
        "from=\"in\" to=\"out\" fromLane=\"1\"",
        "from=\"in\" to=\"out\" fromLane=\"7\"",
        "`fromLane`: expected one of the 3 lanes of edge \"in\", found 7",
    ),
    (
        "from=\"in\" to=\"out\" fromLane=\"1\"",
        "from=\"in\" to=\"out\" fromLane=\"-1\"",
        "`fromLane`: expected one of the 3 lanes of edge \"in\", found -1",
    ),
    ("incLanes=\"in_1 in_2", "incLanes=\"in_7 in_2", "junction J: `incLanes`: no lane is named \"in_7\""),
    (
        "response=\"10101\"",
        "response=\"101\"",
        "junction J/request: expected an index below 5 and a response of 5 bits",
    ),
    ("request index=\"3\"", "request index=\"-3\"", "read"),
    (
        "crossingEdges=\"out\"",
        "crossingEdges=\"outt\"",
        "edge :J_c0: `crossingEdges`: no edge is named \"outt\"",
    ),
    ("linkIndex=\"0\"", "linkIndex=\"-7\"", "read"),
    (
        "speed=\"13.89\" length=\"35.00\"",
        "speed=\"fast\" length=\"35.00\"",
        "edge side/lane side_0: `speed`: expected a number, found \"fast\"",
    ),
    (
        "id=\"in_1\" index=\"1\"",
        "id=\"in_1\" index=\"4\"",
        "edge in/lane in_1: `index`: expected 1, as lanes are in order",
    ),
    (
        "</net>",
        "<tlLogic id=\"L\" programID=\"p\"><phase duration=\"9\" state=\"GGG\"/></tlLogic></net>",
        "program \"p\" of this traffic light is there twice",
    ),
    ("</net>", "<edge id=\"none\"/></net>", "edge none: it has no lanes"),
    ("</net>", "<vehicle id=\"v\"/></net>", "read"),
];

#[test]
fn defects_are_reported_and_the_network_is_read() {
    SOUND.assert_defects(DEFECTS);
}

#[test]
fn all_problems_of_a_file_are_reported_at_once() {
    let text = SMALL
        .replace("100.00,0.00 100.00,35.00", "100.00,NaN 100.00,35.00")
        .replace("width=\"3.50\"", "width=\"-2\"")
        .replace("state=\"yyr\"", "state=\"yy\"")
        .replace("via=\":J_2_0\"", "via=\":J_9_0\"");
    let found = read("n", &text).unwrap_err();
    let lines: Vec<usize> = found.iter().map(|problem| problem.line).collect();
    assert!(found.len() >= 4 && lines.is_sorted(), "{found}");
}

#[test]
fn hostile_files_are_refused() {
    let deep = format!("<net>{}{}</net>", "<edge id=\"a\">".repeat(300), "</edge>".repeat(300));
    let message = |text: &str| read("n", text).unwrap_err().to_string();
    assert!(message(&deep).contains("expected at most 256 nested elements"), "{}", message(&deep));
    assert!(message("").contains("it ends too early"));
    assert!(message("<net/>").contains("net: expected lanes, found none"));
    assert!(message("<osm/>").contains("expected the element `net`"));
    assert!(message("<!DOCTYPE net><net/>").contains("expected no document type (DTD)"));
    // The second use of an identity is the last lane, and is referred to.
    let lane = r#"<edge id="a"><lane id="a_0" shape="0,0 9,0"/></edge>"#;
    for twice in [lane.replace("a_0", "b_0"), lane.replace("\"a\"", "\"b\"")] {
        let to_it = r#"<connection from="a" to="a" fromLane="0" toLane="0" via="a_0"/><junction id="j" incLanes="a_0"/>"#;
        let found = message(&format!("<net>{lane}{twice}{to_it}</net>"));
        assert!(found.contains("expected an identity that no other has"), "{found}");
    }
    // Requests that all give way to each other are bounded.
    let links = 3000;
    let lanes: String = (0..links)
        .map(|k| {
            format!(
                r#"<edge id=":J_{k}" function="internal"><lane id=":J_{k}_0" shape="0,{k} 9,{k}"/></edge>"#
            )
        })
        .collect();
    let names: Vec<String> = (0..links).map(|k| format!(":J_{k}_0")).collect();
    let ones = "1".repeat(links);
    let requests: String =
        (0..links).map(|k| format!(r#"<request index="{k}" response="{ones}"/>"#)).collect();
    let text =
        format!(r#"<net>{lanes}<junction id="J" intLanes="{}">{requests}</junction></net>"#, names.join(" "));
    assert!(message(&text).contains("expected at most 2000000 rights of way"));
}

/// Texts in place of attribute values.
const VALUES: [&str; 16] = [
    "",
    "NaN",
    "-1",
    "0",
    "1e308",
    "1e-300",
    "999999999",
    "in",
    "in_1",
    ":J_0",
    "x",
    "0,0",
    "0,0 0,0",
    "0,0 1e9,1e9",
    "0,0 1,1 0,0",
    "J",
];

proptest! {
    #![proptest_config(cases())]

    /// Networks with changed attributes are read as maps, or refused with a place; nothing panics.
    #[test]
    fn changed_attributes_are_read_or_refused(changes in prop::collection::vec((0_usize..400, 0_usize..16), 1..5)) {
        let mut text = SMALL.to_owned();
        for (number, value) in changes {
            text = with_value(&text, number, VALUES[value]).unwrap();
        }
        match read("n", &text) {
            Ok(net) => {
                let index = LaneIndex::new(&net.lanes.map);
                prop_assert!(index.nearest(swerve_geom::Point2::new(0.0, 0.0)).is_some());
                prop_assert_eq!(net.sources.len(), net.lanes.map.lanes().len());
            }
            Err(problems) => prop_assert!(!problems.is_empty() && problems.iter().all(|problem| problem.line > 0)),
        }
    }
}

#[test]
fn truncated_published_networks_are_refused() {
    let Some(path) = data_or_skip("worlds/sumo/made/cross.net.xml") else { return };
    let text = std::fs::read_to_string(path).unwrap();
    for share in 1..40 {
        let end = text.len() * share / 40;
        assert!(read("n", &text[..end]).is_err());
    }
}
