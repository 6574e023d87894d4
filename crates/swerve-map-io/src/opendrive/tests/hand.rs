//! Small maps with values worked out by hand.

use core::f64::consts::FRAC_PI_2;

use crate::import::import;
use crate::links::Links;
use crate::opendrive::{Contact, LaneType, Network, Sample, Target};
use crate::route;

/// A straight road of 100 m with one lane of 4 m to the right and two to the left, with parts replaced.
const ROAD: &str = r#"<OpenDRIVE><header revMajor="1" revMinor="7"/>
<road id="r" length="100" junction="-1">
<planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
<elevationProfile/><lateralProfile/>
<lanes><laneSection s="0">
<left><lane id="2" type="sidewalk"><width sOffset="0" a="2" b="0" c="0" d="0"/></lane>
<lane id="1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none"/></center>
<right><lane id="-1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road></OpenDRIVE>"#;

fn changed(changes: &[(&str, &str)]) -> Network {
    let text = changes.iter().fold(ROAD.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "{from}");
        text.replace(from, to)
    });
    let network = Network::read("road.xodr", &text).unwrap_or_else(|problems| panic!("{problems}"));
    if network.header.offset == [0.0; 4] {
        let (worst_m, samples) = super::second::worst_m(&network, &text);
        assert!(
            samples >= 10 && worst_m.iter().all(|apart| *apart < 5e-4),
            "{worst_m:?} over {samples}:\n{text}"
        );
    }
    network
}

/// Checks x, y, z, heading of the reference line, heading of the lane, width.
fn check(network: &Network, lane: i32, s_m: f64, expected: [f64; 6]) {
    let Sample { position_m: [x, y, z], reference_heading_rad, heading_rad, width_m } =
        network.sample("r", 0, lane, s_m).unwrap();
    let found = [x, y, z, reference_heading_rad, heading_rad, width_m];
    let apart = found.iter().zip(expected).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    assert!(apart < 1e-9, "lane {lane} at {s_m} m: {found:?}, expected {expected:?}");
}

#[test]
fn poly3_is_evaluated_at_the_true_arc_length() {
    // v = u²/100: at u = 10 the slope is 0.2 and the arc length 10 sqrt(1.04) / 2 + asinh(0.2) / 0.04.
    let network = changed(&[("<line/>", r#"<poly3 a="0" b="0" c="0.01" d="0"/>"#)]);
    let (sin, cos) = (0.2 / 1.04_f64.sqrt(), 1.0 / 1.04_f64.sqrt());
    let s_m = 5.0 * 1.04_f64.sqrt() + 0.198_690_110_349_241_4 / 0.04;
    let heading = 0.197_395_559_849_880_75;
    check(&network, -1, s_m, [10.0 + 2.0 * sin, 1.0 - 2.0 * cos, 0.0, heading, heading, 4.0]);
}

#[test]
fn borders_are_positions_and_widths_are_stacked() {
    let network = changed(&[
        ("<lanes>", r#"<lanes><laneOffset s="0" a="0.5" b="0" c="0" d="0"/>"#),
        (
            r#"<width sOffset="0" a="2" b="0" c="0" d="0"/>"#,
            r#"<border sOffset="0" a="5" b="0.1" c="0" d="0"/>"#,
        ),
        (
            r#"<lane id="1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/>"#,
            r#"<lane id="1" type="driving"><border sOffset="0" a="3" b="0" c="0" d="0"/>"#,
        ),
    ]);
    check(&network, 1, 10.0, [10.0, 1.75, 0.0, 0.0, 0.0, 2.5]);
    // Borders at 3 and 6 m; the outer one moves outwards by 0.1 m per metre, the middle by half of that.
    check(&network, 2, 10.0, [10.0, 4.5, 0.0, 0.0, 0.049_958_395_721_942_76, 3.0]);
    check(&network, -1, 10.0, [10.0, -1.5, 0.0, 0.0, 0.0, 4.0]);
}

#[test]
fn widths_win_over_borders_and_negative_widths_are_none() {
    let network = changed(&[
        (
            r#"<lane id="1" type="driving"><width"#,
            r#"<lane id="1" type="driving"><border sOffset="0" a="9" b="0" c="0" d="0"/><width"#,
        ),
        (
            r#"<width sOffset="0" a="2" b="0" c="0" d="0"/>"#,
            r#"<width sOffset="0" a="2" b="-0.1" c="0" d="0"/>"#,
        ),
    ]);
    check(&network, 1, 10.0, [10.0, 2.0, 0.0, 0.0, 0.0, 4.0]);
    check(&network, 2, 30.0, [30.0, 4.0, 0.0, 0.0, 0.0, 0.0]);
}

#[test]
fn shapes_are_linear_between_their_positions() {
    let shape = |s: f64, a: f64| {
        format!(
            r#"<shape s="{s}" t="-4" a="{a}" b="{}" c="0" d="0"/><shape s="{s}" t="0" a="0" b="0" c="0" d="0"/>"#,
            -a / 4.0
        )
    };
    let profile = format!("<lateralProfile>{}{}</lateralProfile>", shape(0.0, 0.4), shape(100.0, 0.8));
    let network = changed(&[("<lateralProfile/>", &profile)]);
    // In the middle of the lane, 2 m to the right: 0.2 m at the begin, 0.4 m at the end.
    check(&network, -1, 0.0, [0.0, -2.0, 0.2, 0.0, 0.0, 4.0]);
    check(&network, -1, 50.0, [50.0, -2.0, 0.3, 0.0, 0.0, 4.0]);
    check(&network, 1, 50.0, [50.0, 2.0, 0.0, 0.0, 0.0, 4.0]);
}

#[test]
fn superelevation_turns_the_cross_section_about_the_reference_line() {
    let network = changed(&[
        (
            "<elevationProfile/>",
            r#"<elevationProfile><elevation s="0" a="5" b="0.02" c="0" d="0"/></elevationProfile>"#,
        ),
        (
            "<lateralProfile/>",
            r#"<lateralProfile><superelevation s="0" a="0" b="0.01" c="0" d="0"/></lateralProfile>"#,
        ),
    ]);
    // At 10 m: 0.1 rad; sin 0.1 and cos 0.1.
    let (sin, cos) = (0.099_833_416_646_828_15, 0.995_004_165_278_025_7);
    let turned = small_atan(0.02 * sin);
    check(&network, -1, 10.0, [10.0, -2.0 * cos, 5.2 - 2.0 * sin, 0.0, turned, 4.0]);
    check(&network, 1, 10.0, [10.0, 2.0 * cos, 5.2 + 2.0 * sin, 0.0, -turned, 4.0]);
}

/// Arc tangent of a small number by its series.
fn small_atan(x: f64) -> f64 {
    x - x.powi(3) / 3.0 + x.powi(5) / 5.0
}

#[test]
fn crossfall_falls_to_its_side_only() {
    let network = changed(&[(
        "<lateralProfile/>",
        r#"<lateralProfile><crossfall side="right" s="0" a="0.02" b="0" c="0" d="0"/></lateralProfile>"#,
    )]);
    check(&network, -1, 10.0, [10.0, -2.0, -0.040_005_334_613_699_25, 0.0, 0.0, 4.0]);
    check(&network, 1, 10.0, [10.0, 2.0, 0.0, 0.0, 0.0, 4.0]);
}

#[test]
fn offset_of_the_header_turns_and_moves_the_network() {
    let offset = format!(
        r#"<header revMajor="1" revMinor="7"><offset x="1000" y="2000" z="7" hdg="{FRAC_PI_2}"/></header>"#
    );
    let network = changed(&[(r#"<header revMajor="1" revMinor="7"/>"#, &offset)]);
    check(&network, -1, 10.0, [1002.0, 2010.0, 7.0, FRAC_PI_2, FRAC_PI_2, 4.0]);
}

#[test]
fn arcs_move_lanes_on_their_inner_and_outer_side() {
    let network = changed(&[("<line/>", r#"<arc curvature="0.1"/>"#)]);
    // A quarter circle of 10 m about (0, 10): the left lane has a radius of 8 m, the right one of 12 m.
    let s_m = 10.0 * FRAC_PI_2;
    check(&network, 1, s_m, [8.0, 10.0, 0.0, FRAC_PI_2, FRAC_PI_2, 4.0]);
    check(&network, -1, s_m, [12.0, 10.0, 0.0, FRAC_PI_2, FRAC_PI_2, 4.0]);
}

#[test]
fn speed_limits_are_read_in_all_units() {
    let lane = |speed: &str| format!(r#"<lane id="1" type="driving">{speed}<width"#);
    let typed = |speed: &str| format!(r#"<type s="0" type="town">{speed}</type><planView>"#);
    for (speed, mps) in [
        (r#"<speed sOffset="0" max="30" unit="mph"/>"#, Some(13.4112)),
        (r#"<speed sOffset="0" max="90" unit="km/h"/>"#, Some(25.0)),
        (r#"<speed sOffset="0" max="20" unit="m/s"/>"#, Some(20.0)),
        (r#"<speed sOffset="0" max="20"/>"#, Some(20.0)),
        (r#"<speed sOffset="0" max="no limit"/>"#, None),
    ] {
        let network = changed(&[
            (r#"<lane id="1" type="driving"><width"#, &lane(speed)),
            ("<planView>", &typed(speed)),
        ]);
        let road = network.road("r").unwrap();
        let close = |found: Option<f64>| match (found, mps) {
            (Some(a), Some(b)) => (a - b).abs() < 1e-12,
            (a, b) => a == b,
        };
        assert!(close(road.type_speed_mps([0.0, 100.0])), "{speed}");
        assert!(close(road.sections[0].lane(1).unwrap().speed_mps([0.0, 100.0])), "{speed}");
    }
}

#[test]
fn left_hand_traffic_turns_the_direction_of_lanes() {
    let right = changed(&[]);
    let left = changed(&[(r#"junction="-1""#, r#"junction="-1" rule="LHT""#)]);
    let [right, left] = [&right, &left].map(|network| network.road("r").unwrap());
    assert!(right.runs_forward(-1) && !right.runs_forward(1));
    assert!(left.runs_forward(1) && !left.runs_forward(-1));
}

#[test]
fn marks_signals_objects_and_links_are_kept() {
    let network = changed(&[
        (
            "</laneSection></lanes>",
            r#"</laneSection></lanes>
<objects><object id="o" type="crosswalk" s="20" t="0" hdg="1.5" length="8" width="3"><outline>
<cornerRoad s="19" t="-4"/><cornerRoad s="22" t="-4"/><cornerLocal u="1" v="2"/></outline></object></objects>
<signals><signal id="s" s="30" t="-5" zOffset="2" dynamic="yes" orientation="+" country="DE" type="1000001" subtype="-1" value="-1">
<validity fromLane="-1" toLane="-1"/></signal><signalReference id="s" s="40" t="5" orientation="-"/></signals>"#,
        ),
        ("</OpenDRIVE>", r#"<controller id="c" name="all"><control signalId="s"/></controller></OpenDRIVE>"#),
        (
            r#"<lane id="0" type="none"/>"#,
            r#"<lane id="0" type="none"><roadMark sOffset="5" type="broken" color="yellow" width="0.15" laneChange="both"/></lane>"#,
        ),
    ]);
    let road = network.road("r").unwrap();
    let object = &road.objects[0];
    assert_eq!(
        (&*object.kind, object.size_m, object.outlines[0].corners.len()),
        ("crosswalk", [8.0, 3.0, 0.0], 3)
    );
    let signal = &road.signals[0];
    assert_eq!((&*signal.kind, signal.dynamic, signal.value), ("1000001", true, Some(-1.0)));
    assert_eq!((signal.validity.len(), road.signal_references.len()), (1, 1));
    assert_eq!(network.controllers[0].signals, ["s"]);
    let mark = &road.sections[0].center_marks[0];
    assert_eq!((mark.s_m, &*mark.kind, &*mark.color, mark.width_m), (5.0, "broken", "yellow", Some(0.15)));
    assert_eq!(network.defects.count(), 0, "{}", network.defects);
    assert_eq!(LaneType::of("driving"), LaneType::Driving);
    assert_eq!(LaneType::of("x").name(), "x");
}

#[test]
fn road_links_and_direct_junctions_are_read() {
    let link = r#"<link><predecessor elementType="junction" elementId="j"/><successor elementType="road" elementId="r" contactPoint="end"/></link><planView>"#;
    let junction = r#"<junction id="j" type="direct"><connection id="0" incomingRoad="r" linkedRoad="r" contactPoint="end">
<laneLink from="1" to="-1"/></connection></junction></OpenDRIVE>"#;
    let network = changed(&[("<planView>", link), ("</OpenDRIVE>", junction)]);
    let road = network.road("r").unwrap();
    assert_eq!(road.link_at(Contact::Start).unwrap().target, Target::Junction);
    assert_eq!(road.link_at(Contact::End).unwrap().target, Target::Road(Contact::End));
    let junction = network.junction("j").unwrap();
    assert_eq!((junction.kind.name(), &*junction.connections[0].continuing), ("direct", "r"));
    assert_eq!(
        (junction.connections[0].lane_links[0].from, junction.connections[0].lane_links[0].to),
        (1, -1)
    );
}

#[test]
fn connections_within_a_road_are_counted_apart() {
    let junction = r#"<junction id="j" type="virtual" mainRoad="r" sStart="20" sEnd="40">
<connection id="0" type="virtual" incomingRoad="r" connectingRoad="r" contactPoint="start"><laneLink from="-1" to="1"/></connection>
<connection id="1" type="virtual"><predecessor elementType="road" elementId="r" elementS="30" elementDir="+"/></connection>
</junction></OpenDRIVE>"#;
    let text = ROAD.replace("</OpenDRIVE>", junction);
    let network = Network::read("m.xodr", &text).unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!(network.junctions[0].kind.name(), "virtual");
    let links = Links::of(&network);
    assert_eq!((links.within_roads, links.dangling.len(), network.defects.count()), (1, 0, 0), "{links:?}");
}

#[test]
fn example_map_has_no_defects_and_its_lanes_meet() {
    let text = include_str!("../../../maps/crossing.xodr");
    let network = Network::read("crossing.xodr", text).unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!(network.defects.count(), 0, "{}", network.defects);
    assert!(network.unknown.is_empty(), "{:?}", network.unknown);
    let links = Links::of(&network);
    assert!(links.widest_m() < 1e-6 && links.dangling.is_empty(), "{}", links.json(&network));
    assert!(links.all.iter().all(|link| link.height_gap_m < 1e-6), "{}", links.json(&network));
    let imported = import(&network, &links).unwrap();
    let stop = |text: &str| route::stop(&network, &imported, text).unwrap();
    let way = swerve_map::router::find(&imported.map, stop("west:-1:10"), stop("east:-1:30"), &[]).unwrap();
    assert_eq!((way.lanes.len(), way.changes()), (4, 0));
    // The lane for turning begins in the second lane section; the nearest one to a point on it.
    let turn = swerve_map::router::find(&imported.map, stop("west:-1:10"), stop("497.5,180"), &[]).unwrap();
    assert_eq!((turn.lanes.len(), turn.changes()), (4, 1));
    let without_offset = text.replace(r#"<offset x="500" y="200" z="10" hdg="0"/>"#, "");
    let network = Network::read("crossing.xodr", &without_offset).unwrap();
    let (worst_m, samples) = super::second::worst_m(&network, &without_offset);
    assert!(samples > 50 && worst_m.iter().all(|apart| *apart < 1e-3), "{worst_m:?}");
}
