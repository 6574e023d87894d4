//! Invalid and hostile files.

use proptest::prelude::*;
use swerve_tests::data_or_skip;

use crate::links::Links;
use crate::opendrive::Network;
use crate::testing::{Changes, Sound, cases, with_value};

const TWO_ROADS: &str = r#"<OpenDRIVE>
<header revMajor="1" revMinor="6"/>
<road id="first" length="10" junction="-1">
<link><successor elementType="road" elementId="second" contactPoint="start"/></link>
<planView>
<geometry s="0" x="0" y="0" hdg="0" length="4"><line/></geometry>
<geometry s="4" x="4" y="0" hdg="0" length="6"><arc curvature="0.0"/></geometry>
</planView>
<elevationProfile><elevation s="0" a="0" b="0" c="0" d="0"/><elevation s="5" a="0" b="0" c="0" d="0"/></elevationProfile>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><link><successor id="-1"/></link><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>
<lane id="-2" type="shoulder"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane>
</right></laneSection></lanes></road>
<road id="second" length="10" junction="-1">
<planView><geometry s="0" x="10" y="0" hdg="0" length="10"><line/></geometry></planView>
<lanes><laneSection s="0"><center><lane id="0" type="none"/></center><right>
<lane id="-1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></right></laneSection></lanes></road>
<junction id="cross"><connection id="0" incomingRoad="first" connectingRoad="second" contactPoint="start"/></junction>
</OpenDRIVE>
"#;

const SOUND: Sound =
    Sound { text: TWO_ROADS, read: |text| Network::read("m.xodr", text).map(|network| network.defects) };

/// A text of the two roads, its replacement, and the problem.
const FAULTS: &Changes = &[
    (
        "length=\"4\"",
        "length=\"four\"",
        "m.xodr:6:37: road first/planView/geometry: `length`: expected a number, found \"four\"",
    ),
    (
        "x=\"4\"",
        "x=\"NaN\"",
        "m.xodr:7:17: road first/planView/geometry: `x`: expected a finite number, found NaN",
    ),
    ("x=\"4\"", "x=\"inf\"", "`x`: expected a number of magnitude at most 1e9, found \"inf\""),
    ("x=\"4\"", "x=\"1e300\"", "`x`: expected a number of magnitude at most 1e9, found \"1e300\""),
    ("x=\"4\"", "X=\"4\"", "m.xodr:7:1: road first/planView/geometry: attribute `x` is missing"),
    (
        "curvature=",
        "curvatur=",
        "road first/planView/geometry/arc: attribute `curvature` is missing; found \"curvatur\"",
    ),
    ("length=\"10\"", "length=\"0\"", "m.xodr:3:18: road first: `length`: expected more than 0"),
    (
        "length=\"10\"",
        "length=\"-3\"",
        "m.xodr:3:18: road first: `length`: expected a number of at least 0, found -3",
    ),
    ("length=\"10\"", "length=\"1e8\"", "expected more than 0 and at most 2000000"),
    (
        "<arc curvature=\"0.0\"/>",
        "<clothoid a=\"1\"/>",
        "unknown element that carries geometry; expected one of line, arc",
    ),
    (
        "<arc curvature=\"0.0\"/>",
        "<spirl curvStart=\"1\"/>",
        "unknown element that carries geometry; did you mean `spiral`?",
    ),
    ("<arc curvature=\"0.0\"/>", "<arc curvature=\"1e6\"/>", "`curvature`: expected at most 1000 1/m"),
    (
        "<arc curvature=\"0.0\"/>",
        "<spiral curvStart=\"0\" curvEnd=\"900\"/>",
        "expected a spiral that turns by at most 100 rad",
    ),
    (
        "<arc curvature=\"0.0\"/>",
        "<line/><line/>",
        "expected one of line, arc, spiral, poly3, paramPoly3, found 2 of them",
    ),
    (
        "<elevation s=\"5\"",
        "<elevation s=\"-5\"",
        "m.xodr:9:72: road first/elevationProfile/elevation: `s`: expected records in ascending order, found -5 after 0",
    ),
    (
        "id=\"second\"",
        "id=\"first\"",
        "m.xodr:14:7: road first: `id`: expected an identity that no other has, found \"first\" again",
    ),
    ("id=\"-2\"", "id=\"-1\"", "lane -1: `id`: lane -1 is there twice"),
    ("id=\"-2\"", "id=\"-4\"", "`id`: expected identities without holes, found -4 where -2 is missing"),
    ("id=\"-2\"", "id=\"2\"", "`id`: expected a negative identity on this side, found 2"),
    ("id=\"-2\"", "id=\"-2.5\"", "`id`: expected a whole number, found \"-2.5\""),
    (
        "revMinor=\"6\"",
        "revMinor=\"9\"",
        "m.xodr:2:22: header: `revMinor`: expected a revision from 1.4 to 1.8, found 1.9",
    ),
    ("revMajor=\"1\"", "revMajor=\"2\"", "`revMajor`: expected a revision from 1.4 to 1.8, found 2.6"),
    ("<header revMajor=\"1\" revMinor=\"6\"/>", "", "m.xodr:1:1: OpenDRIVE: element `header` is missing"),
    (
        "elementType=\"road\"",
        "elementType=\"raod\"",
        "`elementType`: expected one of road, junction, found \"raod\"; did you mean `road`?",
    ),
    ("contactPoint=\"start\"", "contactPoint=\"middle\"", "expected one of start, end, found \"middle\""),
    (
        "<laneSection s=\"0\">",
        "<laneSectoin s=\"0\"/><laneSection s=\"0\">",
        "carries geometry; did you mean `laneSection`?",
    ),
    ("<width sOffset", "<widht sOffset", "carries geometry; did you mean `width`?"),
    (
        "<OpenDRIVE>",
        "<!DOCTYPE x [<!ENTITY a \"aa\">]><OpenDRIVE>",
        "m.xodr:1:1: expected no document type (DTD)",
    ),
    ("</OpenDRIVE>", "", "m.xodr:20:1: it ends too early, expected a whole XML document"),
    ("</road>", "</raod>", "it is not XML: expected 'road' tag, not 'raod'"),
];

#[test]
fn faults_have_their_place_and_the_expected_value() {
    assert_eq!(SOUND.problems("<", "<"), "read\n");
    SOUND.assert_faults(FAULTS);
    let root = Network::read("m.xodr", "<OpenDrive/>").unwrap_err().to_string();
    assert_eq!(root, "m.xodr:1:1: OpenDrive: expected the element `OpenDRIVE`");
}

#[test]
fn defects_leave_the_geometry_and_are_listed() {
    SOUND.assert_defects(&[
        (
            "<lanes>",
            "<type s=\"0\" type=\"town\"><speed max=\"50\" unit=\"kmh\"/></type><lanes>",
            "road first/type/speed: `unit`: expected one of m/s, km/h, mph, found \"kmh\"; did you mean `km/h`?",
        ),
        (
            "<lanes>",
            "<signals><signal id=\"1\" s=\"0\" t=\"0\" value=\"50 km/h\" width=\"\"/></signals><lanes>",
            "road first/signals/signal 1: `value`: expected a number, found \"50 km/h\"",
        ),
        (
            "<link><successor id=\"-1\"/></link>",
            "<roadMark sOffset=\"5\" type=\"solid\"/><roadMark sOffset=\"2\" type=\"broken\"/>",
            "roadMark: `sOffset`: expected records in ascending order, found 2 after 5",
        ),
        ("revMinor=\"6\"", "revMinor=\"2\"", "m.xodr:2:1: header: revision 1.2 is read as 1.4"),
        (
            "elementId=\"second\"",
            "elementId=\"secnod\"",
            "m.xodr:4:7: road first/link/successor: `elementId`: expected the identity of a road, found \"secnod\"; did you mean `second`?",
        ),
        (
            "<successor id=\"-1\"/>",
            "<successor id=\"-3\"/>",
            "lane -1/link/successor -3: expected a lane of road \"second\", one of -1, found -3",
        ),
        (
            "<successor id=\"-1\"/>",
            "<predecessor id=\"-1\"/>",
            "the road has no predecessor whose lane -1 could be linked",
        ),
        (
            "connectingRoad=\"second\"",
            "connectingRoad=\"third\"",
            "`connectingRoad`: expected the identity of a road, found \"third\"",
        ),
        (
            "junction=\"-1\"",
            "junction=\"cros\"",
            "`junction`: expected the identity of a junction, found \"cros\"; did you mean `cross`?",
        ),
        (
            "type=\"shoulder\"",
            "type=\"sholder\"",
            "`type`: expected a lane type of the standard, found \"sholder\"; did you mean `shoulder`?",
        ),
        (
            "x=\"4\"",
            "x=\"5\"",
            "m.xodr:7:1: road first/planView/geometry: the reference line begins 1.000 m from the end of the geometry before",
        ),
        (
            "<road id=\"first\" length=\"10\"",
            "<road id=\"first\" length=\"12\"",
            "geometry from 0 to 10 m on a road of 12 m",
        ),
    ]);
    let dangling =
        Network::read("m.xodr", &TWO_ROADS.replace("elementId=\"second\"", "elementId=\"x\"")).unwrap();
    assert_eq!(Links::of(&dangling).dangling.len(), 1);
}

#[test]
fn all_problems_are_reported_at_once_in_order() {
    let text = TWO_ROADS.replace("hdg=\"0\"", "hdg=\"?\"").replace("a=\"3\"", "a=\"\"");
    let problems = Network::read("m.xodr", &text).unwrap_err();
    let lines: Vec<usize> = problems.iter().map(|problem| problem.line).collect();
    assert_eq!(lines, [6, 7, 11, 12, 15, 17]);
    // Repeated past the limit, they are counted.
    let lanes: String =
        (1..=150).map(|k| format!("<lane id=\"-{k}\" type=\"driving\"><width/></lane>")).collect();
    let sections = format!("<laneSection s=\"0\"><right>{lanes}</right></laneSection>").repeat(4);
    let many = TWO_ROADS.replacen("<lanes>", &format!("<lanes>{sections}"), 1);
    let problems = Network::read("m.xodr", &many).unwrap_err();
    assert_eq!((problems.len(), problems.count()), (1000, 4 * 150 * 5));
    assert!(problems.first(2).ends_with("m.xodr: and 2998 more"), "{}", problems.first(2));
}

#[test]
fn long_and_unprintable_values_are_cut_and_escaped() {
    let found = SOUND.problems("length=\"4\"", &format!("length=\"a\tb{}\"", "c".repeat(10_000)));
    let expected = format!("`length`: expected a number, found \"a b{}…\"", "c".repeat(37));
    assert!(found.ends_with(&expected), "{found}");
    let found = SOUND.problems("id=\"first\"", "id=\"&#x202e;x&#27;\" nothing=\"\"").replace("read\n", "");
    assert!(!found.contains(['\u{202e}', '\u{1b}']), "{found}");
}

#[test]
fn unknown_elements_are_counted() {
    let found =
        TWO_ROADS.replace("<planView>", "<userData code=\"x\"/><trees><tree/></trees><trees/><planView>");
    let network = Network::read("m.xodr", &found).unwrap();
    let unknown: Vec<(&str, usize)> = network.unknown.iter().map(|(name, count)| (&**name, *count)).collect();
    assert_eq!(unknown, [("trees", 4), ("userData", 2)]);
}

#[test]
fn deep_nesting_and_entities_are_refused() {
    let deep = format!("<OpenDRIVE>{}{}</OpenDRIVE>", "<a>".repeat(300), "</a>".repeat(300));
    let refused = Network::read("m.xodr", &deep).unwrap_err().to_string();
    assert_eq!(refused, "m.xodr:1:777: expected at most 256 nested elements");
    // A million levels, with and without their ends.
    for text in
        [format!("<OpenDRIVE>{}", "<a>".repeat(1 << 20)), "<a>".repeat(1 << 20) + &"</a>".repeat(1 << 20)]
    {
        assert!(Network::read("m.xodr", &text).is_err());
    }
    let entities: String =
        (1..10).map(|k| format!("<!ENTITY e{k} \"{}\">", format!("&e{};", k - 1).repeat(10))).collect();
    let bomb = format!("<!DOCTYPE m [<!ENTITY e0 \"x\">{entities}]><OpenDRIVE>&e9;</OpenDRIVE>");
    assert!(Network::read("m.xodr", &bomb).unwrap_err().to_string().contains("no document type"));
}

#[test]
fn texts_cut_anywhere_are_refused() {
    for end in (0..TWO_ROADS.len() - 2).filter(|end| TWO_ROADS.is_char_boundary(*end)) {
        let problems = Network::read("m.xodr", &TWO_ROADS[..end]).unwrap_err();
        assert_eq!(problems.len(), 1, "{end}: {problems}");
    }
}

/// Evaluates all that a file has: positions finite, headings wrapped, borders in order.
fn evaluate(network: &Network) {
    let links = Links::of(network);
    assert!(links.all.iter().all(|link| link.gap_m.is_finite()));
    for road in &network.roads {
        for (index, section) in road.sections.iter().enumerate() {
            let Some([from_m, to_m]) = road.section_span_m(index) else { continue };
            for share in [0.0, 0.37, 1.0] {
                let s_m = from_m + share * (to_m - from_m);
                for is_left in [true, false] {
                    for (lane, edges) in road.edges(section, is_left, s_m) {
                        let sample = network.sample_at(road, s_m, edges);
                        assert!(
                            sample.position_m.iter().all(|x| x.is_finite()),
                            "{} {}: {sample:?}",
                            road.id,
                            lane.id
                        );
                        assert!(sample.heading_rad.abs() <= 3.2 && sample.width_m >= 0.0, "{sample:?}");
                    }
                }
            }
        }
    }
}

/// Texts put in place of an attribute's value.
const VALUES: [&str; 16] = [
    "", "0", "-1", "1e9", "-1e9", "1e-300", "NaN", "inf", "1e400", "x", "-0", "0.5", "100", "3", "start",
    "road",
];

proptest! {
    #![proptest_config(cases())]
    #[test]
    fn attributes_of_any_value_never_cause_a_panic(changes in proptest::collection::vec((0..10_000_usize, 0..VALUES.len()), 1..4)) {
        let mut text = TWO_ROADS.to_owned();
        for (at, value) in changes {
            text = with_value(&text, at, VALUES[value]).unwrap_or(text);
        }
        if let Ok(network) = Network::read("m.xodr", &text) {
            evaluate(&network);
        }
    }
}

#[test]
fn published_maps_with_any_attribute_changed_never_cause_a_panic() {
    for (path, step) in [
        ("esmini/resources/xodr/fabriksgatan.xodr", 23),
        ("esmini/resources/xodr/e6mini.xodr", 17),
        ("esmini/resources/xodr/curves_elevation.xodr", 11),
        ("esmini/resources/xodr/direct_junction_simple.xodr", 13),
    ] {
        let Some(path) = data_or_skip(&format!("external/{path}")) else { return };
        let text = std::fs::read_to_string(path).unwrap();
        let attributes = text.matches('"').count() / 2;
        for (k, at) in (0..attributes).step_by(step).enumerate() {
            let Some(text) = with_value(&text, at, VALUES[k % VALUES.len()]) else { continue };
            if let Ok(network) = Network::read("m.xodr", &text) {
                evaluate(&network);
            }
        }
    }
}
