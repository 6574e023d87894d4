//! A crossing of a main road with a side road, with values worked out by hand.

use swerve_geom::Point2;
use swerve_map::{
    AreaKind, Aspect, LaneId, LaneKind, Map, MarkKind, Neighbour, Side, SignalProgram, StopSign,
};

use crate::sumo::{Net, Phase, read};

/// A main road to the east with a sidewalk, a lane for buses and one for cars, a junction with a light, and a side road
/// that gives way, in the form that netconvert writes.
const SMALL: &str = include_str!("../../../maps/junction.net.xml");

fn net(text: &str) -> Net {
    read("junction.net.xml", text).unwrap_or_else(|problems| panic!("{problems}"))
}

fn id(net: &Net, name: &str) -> LaneId {
    net.lanes.lane_named(name).unwrap_or_else(|| panic!("no lane {name}"))
}

fn names(net: &Net, lanes: &[LaneId]) -> Vec<String> {
    lanes.iter().map(|lane| net.lanes.name(*lane).to_owned()).collect()
}

#[test]
fn lanes_have_the_kind_width_speed_and_neighbours_of_the_file() {
    let net = net(SMALL);
    let map: &Map = &net.lanes.map;
    assert_eq!((net.lanes.defects.count(), net.lanes.gaps.len(), &*net.lanes.format), (0, 0, "SUMO 1.20"));
    assert_eq!(
        (net.net_offset_m, &*net.projection, net.lanes.left_hand),
        ([100.0, 50.0], "+proj=utm +zone=32", false)
    );
    let lane = |name| map.lane(id(&net, name)).unwrap();
    let [walk, bus, car] = ["in_0", "in_1", "in_2"].map(lane);
    let kinds =
        [walk, bus, car, lane(":J_0_0")].map(|lane| (lane.kind, lane.width_m(1.0), lane.speed_limit_mps));
    assert_eq!(
        kinds,
        [
            (LaneKind::Walking, 2.0, Some(2.78)),
            (LaneKind::Driving, 3.2, Some(13.89)),
            (LaneKind::Driving, 3.5, Some(13.89)),
            (LaneKind::Driving, 3.2, Some(13.89)),
        ]
    );
    assert!(net.lanes.lane_named("out_1").is_none());
    assert_eq!(net.lanes.contents["lanes left out"], 1);
    // In the frame of the projection; vertices at most 5 m apart.
    let points = car.line.points();
    assert_eq!((points[0].x_m, points[0].y_m, points.len()), (-100.0, -1.75, 19));
    assert_eq!(net.lanes.heights_m, Some([0.0, 4.5]));
    let beside = |name| Some(Neighbour { lane: id(&net, name), opposite: false });
    assert_eq!((walk.left, walk.right), (beside("in_1"), None));
    assert_eq!((bus.left, bus.right), (beside("in_2"), beside("in_0")));
    assert_eq!((car.left, car.right), (None, beside("in_1")));
    let left_hand = self::net(&SMALL.replace("<net ", "<net lefthand=\"true\" "));
    assert_eq!(left_hand.lanes.format, "SUMO 1.20, left-hand traffic");
    let bus = left_hand.lanes.map.lane(id(&left_hand, "in_1")).unwrap();
    assert_eq!((left_hand.lanes.left_hand, bus.left, bus.right), (true, beside("in_0"), beside("in_2")));
    // Both begin at one place: not beside each other.
    assert_eq!((lane(":J_1_0").left, lane(":J_1_1").right), (None, None));
}

#[test]
fn lines_between_lanes_of_an_edge_follow_the_permissions_to_change() {
    use MarkKind as K;
    let marks = |text: &str| {
        let net = net(text);
        let of = |name, side| {
            let lane = net.lanes.map.lane(id(&net, name)).unwrap();
            lane.marks.at(side, 1.0).map(|mark| mark.kind)
        };
        // Of the lane for buses at the outside and of that for cars.
        let sides = if net.lanes.left_hand { [Side::Right, Side::Left] } else { [Side::Left, Side::Right] };
        [of("in_1", sides[0]), of("in_2", sides[1]), of("in_1", sides[1]), of("in_2", sides[0])]
    };
    let change = |text: &str, bus: &str, car: &str| {
        let text = text.replace(r#"id="in_1""#, &format!(r#"id="in_1" {bus}"#));
        text.replace(r#"id="in_2""#, &format!(r#"id="in_2" {car}"#))
    };
    let [stay, all] = [r#"changeLeft="emergency bus""#, r#"changeRight="all""#];
    let left_hand = SMALL.replace("<net ", "<net lefthand=\"true\" ");
    for text in [SMALL, &left_hand] {
        // A sidewalk has no line, nor has the side of the other direction.
        assert_eq!(marks(text), [Some(K::Broken), Some(K::Broken), None, None]);
        assert_eq!(marks(&change(text, stay, all))[..2], [Some(K::SolidBroken), Some(K::BrokenSolid)]);
        let only = r#"changeRight="bus""#;
        assert_eq!(marks(&change(text, "", only))[..2], [Some(K::BrokenSolid), Some(K::SolidBroken)]);
        assert_eq!(marks(&change(text, stay, only))[..2], [Some(K::Solid), Some(K::Solid)]);
    }
}

#[test]
fn connections_are_successors_and_lanes_without_length_are_skipped() {
    let net = net(SMALL);
    let after = |name| names(&net, &net.lanes.map.lane(id(&net, name)).unwrap().successors);
    assert_eq!(after("in_1"), [":J_0_0"]);
    assert_eq!(after("in_2"), [":J_1_0", ":J_1_1"]);
    assert_eq!(after(":J_0_0"), ["out_0"]);
    assert_eq!(after("side_0"), [":J_2_0"]);
    assert_eq!(after(":J_2_0"), [":J_3_0"]);
    assert_eq!(after("out_0"), ["beyond_0"], "through a lane without length");
    // 6 cm are joined, 20 cm are not; both are listed.
    for (x, joined) in [("110.06", true), ("110.20", false)] {
        let moved =
            self::net(&SMALL.replace("110.00,47.00 150.00,47.00", &format!("{x},47.00 150.00,47.00")));
        let gap = moved
            .lanes
            .gaps
            .iter()
            .find(|gap| gap.ends == "lane :J_0_0 at its end and lane out_0 at its start")
            .unwrap();
        assert_eq!(gap.joined, joined);
        let successors = &moved.lanes.map.lane(id(&moved, ":J_0_0")).unwrap().successors;
        assert_eq!(!successors.is_empty(), joined);
    }
}

#[test]
fn junctions_have_their_lanes_and_rights_of_way() {
    let net = net(SMALL);
    let of: Vec<_> = net.lanes.map.junctions().iter().map(|junction| &*junction.name).collect();
    assert_eq!(of, ["J", "K"], "neither dead ends nor parts of junctions");
    let junction = &net.lanes.map.junctions()[0];
    assert_eq!(names(&net, &junction.lanes), [":J_0_0", ":J_1_0", ":J_1_1", ":J_2_0", ":J_3_0"]);
    assert_eq!(names(&net, &junction.incoming), ["in_1", "in_2", "side_0"]);
    let rights = junction.rights_of_way.iter().map(|right| names(&net, &[right.lane, right.to]));
    assert_eq!(rights.collect::<Vec<_>>(), [[":J_3_0", ":J_0_0"], [":J_3_0", ":J_1_1"]]);
}

#[test]
fn lights_and_rules_are_signals_stop_lines_and_programs() {
    let net = net(SMALL);
    let map = &net.lanes.map;
    let signals: Vec<_> = map
        .signals()
        .iter()
        .map(|one| (&*one.name, names(&net, &one.lanes), one.controller.as_deref()))
        .collect();
    let lanes = |all: &[&str]| all.iter().map(|one| (*one).to_owned()).collect::<Vec<_>>();
    let expected = [
        ("L:0", lanes(&[":J_0_0"]), Some("L")),
        ("L:1", lanes(&[":J_1_0", ":J_1_1"]), Some("L")),
        ("L:2", lanes(&[]), Some("L")),
    ];
    assert_eq!(signals, expected);
    let first = &map.signals()[0];
    assert!(first.position.distance(Point2::new(-10.0, -5.1)) < 1e-9, "{:?}", first.position);
    assert_eq!(first.height_m, None);
    assert!((first.heading_rad.abs() - core::f64::consts::PI).abs() < 1e-12, "{}", first.heading_rad);
    let stops: Vec<_> = map
        .stop_lines()
        .iter()
        .map(|line| {
            let signals: Vec<&str> =
                line.signals.iter().map(|one| &*map.signal(*one).unwrap().name).collect();
            (names(&net, &[line.lane]).remove(0), line.s_m, signals.join(" "), line.sign)
        })
        .collect();
    let expected = [
        (":J_0_0", "L:0", None),
        (":J_1_0", "L:1", None),
        (":J_1_1", "L:1", None),
        (":J_2_0", "", Some(StopSign::Stop)),
        (":J_3_0", "", Some(StopSign::Yield)),
    ];
    assert_eq!(stops, expected.map(|(lane, signals, sign)| (lane.to_owned(), 0.0, signals.to_owned(), sign)));
    let [program] = &*net.programs else { panic!("{:?}", net.programs) };
    assert_eq!(
        (&*program.light, &*program.program, &*program.kind, program.offset_s),
        ("L", "p", "static", 5.0)
    );
    assert_eq!(program.phases[1], Phase { duration_s: 3.0, states: "yyr".to_owned() });
    let numbers: Vec<_> = program.signals.iter().map(|signal| signal.map(|id| id.0)).collect();
    assert_eq!(numbers, [Some(0), Some(1), Some(2)]);
}

#[test]
fn signals_have_the_phases_of_their_link_in_the_last_static_program() {
    use Aspect::{Green, Off, Red, RedYellow, Yellow};
    let of = |text: &str, link: usize| {
        let program = net(text).lanes.map.signals()[link].program.clone()?;
        let SignalProgram { phases, offset_s } = program;
        Some((phases.iter().map(|phase| (phase.aspect, phase.duration_s)).collect::<Vec<_>>(), offset_s))
    };
    // Equal states in a row are one phase.
    assert_eq!(of(SMALL, 0), Some((vec![(Green, 30.0), (Yellow, 3.0), (Red, 20.0)], -5.0)));
    assert_eq!(of(SMALL, 2), Some((vec![(Red, 33.0), (Green, 20.0)], -5.0)));
    let letters = SMALL.replace("GGr", "ous").replace("rrG", "OYr");
    assert_eq!(of(&letters, 0), Some((vec![(Off, 30.0), (Yellow, 3.0), (Off, 20.0)], -5.0)));
    assert_eq!(of(&letters, 1), Some((vec![(RedYellow, 30.0), (Yellow, 23.0)], -5.0)));
    assert_eq!(of(&letters, 2), Some((vec![(Red, 53.0)], -5.0)));
    let two = SMALL.replace(
        "</tlLogic>",
        r#"</tlLogic><tlLogic id="L" programID="q" offset="begin"><phase duration="9" state="rGr"/></tlLogic>"#,
    );
    assert_eq!(of(&two, 1), Some((vec![(Green, 9.0)], 0.0)));
    // Phases that depend on traffic are not a program.
    for (from, to) in [("static", "actuated"), ("state=\"yyr\"", "state=\"yyr\" next=\"0\"")] {
        assert_eq!(of(&SMALL.replace(from, to), 0), None, "{to}");
    }
}

#[test]
fn crossings_and_walking_areas_are_polygons() {
    let net = net(SMALL);
    let [crossing] = net.lanes.map.crossings() else { panic!("{:?}", net.lanes.map.crossings()) };
    assert_eq!(
        (&*crossing.name, names(&net, &crossing.lanes)),
        (":J_c0", ["out_0"].map(String::from).to_vec())
    );
    let corners: Vec<_> = crossing.outline.iter().map(|corner| (corner.x_m, corner.y_m)).collect();
    assert_eq!(corners, [(10.0, -8.0), (10.0, 2.0), (14.0, 2.0), (14.0, -8.0)]);
    let [area] = net.lanes.map.areas() else { panic!("{:?}", net.lanes.map.areas()) };
    assert_eq!((&*area.name, area.kind, area.outline.len()), (":J_w0", AreaKind::Walking, 4));
}

#[test]
fn permissions_decide_the_kind_of_a_lane() {
    let kind = |attributes: &str| {
        let text = SMALL.replace("allow=\"bus\"", attributes);
        let net = net(&text);
        net.lanes.lane_named("in_1").map(|lane| net.lanes.map.lane(lane).unwrap().kind)
    };
    for (attributes, expected) in [
        ("", Some(LaneKind::Driving)),
        ("allow=\"all\"", Some(LaneKind::Driving)),
        ("disallow=\"pedestrian tram\"", Some(LaneKind::Driving)),
        ("allow=\"bicycle\"", Some(LaneKind::Cycling)),
        ("allow=\"bicycle pedestrian\"", Some(LaneKind::Walking)),
        ("allow=\"emergency authority\"", Some(LaneKind::Shoulder)),
        ("allow=\"moped bicycle\"", Some(LaneKind::Driving)),
        ("allow=\"tram\"", None),
        ("disallow=\"all\"", None),
        ("allow=\"\"", None),
    ] {
        assert_eq!(kind(attributes), expected, "{attributes}");
    }
}

#[test]
fn networks_far_from_the_origin_are_moved_near_it() {
    let offset_m = |location: &str| {
        let location = format!("<location {location} origBoundary=\"0,0,1,1\" projParameter=\"!\"/>");
        let start = SMALL.find("<location").unwrap();
        let end = start + SMALL[start..].find("/>").unwrap() + 2;
        let text = format!("{}{location}{}", &SMALL[..start], &SMALL[end..]);
        crate::sumo::read_near("n.net.xml", &text).unwrap().net_offset_m
    };
    for (location, expected_m) in [
        ("netOffset=\"100.5,-20\" convBoundary=\"0,0,400,300\"", [100.5, -20.0]),
        ("netOffset=\"-683542.41,-4928877.56\" convBoundary=\"0,0,1817.58,1350.19\"", [0.0, 0.0]),
        (
            "netOffset=\"-342498.65,-5630866.92\" convBoundary=\"11543.90,13228.14,12159.14,13425.53\"",
            [11_500.0, 13_200.0],
        ),
        ("netOffset=\"-342498.65,-5630866.92\"", [-342_498.65, -5_630_866.92]),
    ] {
        assert_eq!(offset_m(location), expected_m, "{location}");
    }
}
