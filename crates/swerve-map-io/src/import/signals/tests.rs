//! Junctions, signals, stop lines, crossings and areas of small networks with values worked out by hand.

use swerve_map::{AreaKind, Crossing, LaneId, Map, StopSign};

use crate::import::{Imported, import};
use crate::links::Links;
use crate::opendrive::Network;

/// A road of 100 m to the east with lanes -2 (driving), -1 (driving), 1 (driving), 2 (sidewalk), which leads into the
/// junction `j`; straight on by road `s`, to the left by road `l`.
fn town(on_road: &str, on_left: &str, in_junction: &str, beside: &str) -> String {
    let width = r#"<width sOffset="0" a="3" b="0" c="0" d="0"/>"#;
    let lane = |id: &str, kind: &str| format!(r#"<lane id="{id}" type="{kind}">{width}</lane>"#);
    let link = |id: &str, before: &str| {
        format!(r#"<lane id="{id}" type="driving"><link><predecessor id="{before}"/></link>{width}</lane>"#)
    };
    let connecting = |id: &str, shape: &str, lane: String, content: &str| {
        format!(
            r#"<road id="{id}" length="20" junction="j"><link>
            <predecessor elementType="road" elementId="r" contactPoint="end"/></link><planView>
            <geometry s="0" x="100" y="0" hdg="0" length="20">{shape}</geometry></planView>
            <lanes><laneSection s="0"><right>{lane}</right></laneSection></lanes>{content}</road>"#
        )
    };
    let through = connecting("s", "<line/>", link("-1", "-1") + &link("-2", "-2"), "");
    let left = connecting("l", r#"<arc curvature="0.05"/>"#, link("-1", "-1"), on_left);
    format!(
        r#"<OpenDRIVE><header revMajor="1" revMinor="7"/>
        <road id="r" length="100" junction="-1"><link><successor elementType="junction" elementId="j"/></link>
        <planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView>
        <lanes><laneSection s="0"><left>{}{}</left><right>{}{}</right></laneSection></lanes>{on_road}</road>
        {through}{left}{beside}
        <junction id="j" name="Market">
        <connection id="0" incomingRoad="r" connectingRoad="s" contactPoint="start"><laneLink from="-1" to="-1"/>
        <laneLink from="-2" to="-2"/></connection>
        <connection id="1" incomingRoad="r" connectingRoad="l" contactPoint="start"><laneLink from="-1" to="-1"/></connection>
        {in_junction}</junction></OpenDRIVE>"#,
        lane("2", "sidewalk"),
        lane("1", "driving"),
        lane("-1", "driving"),
        lane("-2", "driving"),
    )
}

fn imported(text: &str) -> (Network, Imported) {
    let network = Network::read("m.xodr", text).unwrap_or_else(|problems| panic!("{problems}"));
    assert_eq!(network.defects.count(), 0, "{}", network.defects);
    let imported = import(&network, &Links::of(&network)).unwrap();
    (network, imported)
}

/// Names of lanes: road and lane.
fn names(network: &Network, imported: &Imported, lanes: &[LaneId]) -> Vec<String> {
    let name = |id: &LaneId| {
        let source = &imported.lanes[id.0 as usize];
        format!("{}{}", network.roads[source.road].id, source.lane)
    };
    lanes.iter().map(name).collect()
}

/// Stop lines: lane, arc length, names of the signals, sign.
fn stops(text: &str) -> Vec<(String, f64, String, Option<StopSign>)> {
    let (network, imported) = imported(text);
    let map = &imported.map;
    let signals = |ids: &[swerve_map::SignalId]| {
        let names: Vec<&str> = ids.iter().map(|id| &*map.signal(*id).unwrap().name).collect();
        names.join(" ")
    };
    let stop = |line: &swerve_map::StopLine| {
        let lane = names(&network, &imported, &[line.lane]).remove(0);
        (lane, (line.s_m * 1e6).round() / 1e6, signals(&line.signals), line.sign)
    };
    map.stop_lines().iter().map(stop).collect()
}

fn signal(id: &str, s: f64, kind: &str, rest: &str) -> String {
    format!(
        r#"<signal id="{id}" s="{s}" t="-7" zOffset="3.5" dynamic="{}" orientation="+" country="OpenDRIVE" type="{kind}" subtype="-1" {rest}"#,
        if kind.starts_with("10000") || kind.starts_with("1.000") { "yes" } else { "no" }
    )
}

fn with_signals(on_road: &str, on_left: &str) -> String {
    let all = |text: &str| format!("<signals>{text}</signals>");
    town(&all(on_road), &all(on_left), "", "")
}

#[test]
fn junctions_have_their_lanes_incoming_lanes_and_rights_of_way() {
    let (network, imported) = imported(&town("", "", r#"<priority high="s" low="l"/>"#, ""));
    let [junction] = imported.map.junctions() else { panic!() };
    assert_eq!(junction.name, "j");
    assert_eq!(names(&network, &imported, &junction.lanes), ["s-1", "s-2", "l-1"]);
    assert_eq!(names(&network, &imported, &junction.incoming), ["r-1", "r-2"]);
    let pairs =
        junction.rights_of_way.iter().map(|right| names(&network, &imported, &[right.lane, right.to]));
    assert_eq!(pairs.collect::<Vec<_>>(), [["l-1", "s-1"], ["l-1", "s-2"]]);
}

#[test]
fn lights_hold_for_lanes_of_their_direction_and_validity() {
    let light =
        signal("a", 98.0, "1000001", r#"hOffset="0.1"><validity fromLane="-2" toLane="-2"/></signal>"#)
            + &signal("b", 97.5, "1.000.011", "/>").replace("orientation=\"+\"", "orientation=\"none\"")
            + &signal("walk", 97.0, "1000002", "/>").replace("orientation=\"+\"", "orientation=\"none\"")
            + &signal("speed", 50.0, "274", "/>");
    let text = with_signals(&light, r#"<signalReference id="a" s="0" t="2" orientation="+"/>"#)
        .replace("<junction ", r#"<controller id="c"><control signalId="a"/></controller><junction "#);
    let (network, imported) = imported(&text);
    let found: Vec<_> = imported.map.signals().iter().collect();
    let of: Vec<(&str, Vec<String>)> =
        found.iter().map(|one| (&*one.name, names(&network, &imported, &one.lanes))).collect();
    let expected: [(&str, &[&str]); 3] =
        [("a", &["r-2", "l-1"]), ("b", &["r1", "r-1", "r-2"]), ("walk", &["r2"])];
    assert_eq!(of, expected.map(|(name, lanes)| (name, lanes.iter().map(|one| (*one).to_owned()).collect())));
    let a = found[0];
    assert_eq!((a.position.x_m, a.position.y_m, a.height_m), (98.0, -7.0, Some(3.5)));
    assert!((a.heading_rad - (0.1 - std::f64::consts::PI)).abs() < 1e-12, "{}", a.heading_rad);
    assert_eq!((a.controller.as_deref(), &found[1].controller), (Some("c"), &None));
    // Lights less than a metre apart share a stop line.
    assert_eq!(
        stops(&text),
        [
            ("r1".into(), 2.5, "b".into(), None),
            ("r2".into(), 3.0, "walk".into(), None),
            ("r-1".into(), 97.5, "b".into(), None),
            ("r-2".into(), 97.5, "a b".into(), None),
            ("l-1".into(), 0.0, "a".into(), None),
        ]
    );
}

#[test]
fn lights_are_at_their_physical_position_and_hold_where_the_road_states_it() {
    let at = |position: &str| {
        let light = signal("a", 98.0, "1000001", &format!(">{position}</signal>"));
        let (_, imported) = imported(&with_signals(&light, ""));
        let light = &imported.map.signals()[0];
        let stops: Vec<f64> =
            imported.map.stop_lines().iter().map(|line| (line.s_m * 1e6).round() / 1e6).collect();
        assert_eq!(stops, [98.0, 98.0]);
        (light.position.x_m, light.position.y_m, light.height_m.unwrap())
    };
    assert_eq!(at(r#"<positionRoad roadId="s" s="15" t="2" zOffset="5"/>"#), (115.0, 2.0, 5.0));
    assert_eq!(at(r#"<positionInertial x="120" y="-9" z="4.5" hdg="0"/>"#), (120.0, -9.0, 4.5));
}

#[test]
fn stop_lines_of_the_file_take_their_lights_and_signs() {
    let at = |s: f64, name: &str, sign| vec![("r-1".into(), s, name.to_owned(), sign)];
    let lane = "<validity fromLane=\"-1\" toLane=\"-1\"/></signal>";
    let line = |s: f64| signal("line", s, "294", &format!(">{lane}"));
    let light = |rest: &str| signal("a", 99.0, "1000001", &format!(">{rest}{lane}"));
    let stop = signal("sign", 96.0, "206", &format!(">{lane}"));
    let give_way = signal("other", 96.5, "205", &format!(">{lane}"));
    // The nearest, up to 20 m.
    assert_eq!(stops(&with_signals(&(line(90.0) + &light("")), "")), at(90.0, "a", None));
    assert_eq!(stops(&with_signals(&(line(90.0) + &stop), "")), at(90.0, "", Some(StopSign::Stop)));
    assert_eq!(stops(&with_signals(&(give_way.clone() + &stop), "")), at(96.0, "", Some(StopSign::Stop)));
    assert_eq!(stops(&with_signals(&give_way, "")), at(96.5, "", Some(StopSign::Yield)));
    assert_eq!(stops(&with_signals(&line(90.0), "")), at(90.0, "", None));
    let yield_line = signal("line", 98.0, "341", &format!(">{lane}"));
    assert_eq!(stops(&with_signals(&(yield_line + &give_way), "")), at(98.0, "", Some(StopSign::Yield)));
    assert_eq!(
        stops(&with_signals(&(line(40.0) + &light("")), "")),
        [at(40.0, "", None), at(99.0, "a", None)].concat()
    );
    // At any distance if the file relates them, in either direction.
    let related = light(r#"<reference elementType="signal" elementId="line"/>"#);
    assert_eq!(stops(&with_signals(&(line(40.0) + &related), "")), at(40.0, "a", None));
    let related = line(40.0).replacen("<validity", r#"<dependency id="a" type="x"/><validity"#, 1);
    assert_eq!(stops(&with_signals(&(related + &light("")), "")), at(40.0, "a", None));
    // A road mark.
    for mark in [
        r#"type="roadMark" subtype="signalLines""#,
        r#"type="roadMark" name="Stop Line 24""#,
        r#"type="stopLine""#,
    ] {
        let object = format!(
            r#"<objects><object id="m" {mark} s="91" t="-1.5" orientation="+" length="0.5" width="3">
            <validity fromLane="-1" toLane="-1"/></object></objects><signals>{}</signals>"#,
            light("")
        );
        assert_eq!(stops(&town(&object, "", "", "")), at(91.0, "a", None), "{mark}");
    }
}

#[test]
fn stop_lines_in_another_lane_section_take_their_lights() {
    let lane = "<validity fromLane=\"-1\" toLane=\"-1\"/></signal>";
    let signals = |line: f64, light: f64| {
        let line = signal("line", line, "294", &format!(">{lane}"));
        line + &signal("a", light, "1000001", &format!(">{lane}"))
    };
    // A second section begins at 95 m.
    let split = |text: String| {
        let link = |name: &str| format!(r#"<link><{name} id="-1"/></link>"#);
        let section = |s: f64, name: &str| {
            format!(
                r#"<laneSection s="{s}"><right><lane id="-1" type="driving">{}
                <width sOffset="0" a="3" b="0" c="0" d="0"/></lane></right></laneSection>"#,
                link(name)
            )
        };
        let begin = text.find("<laneSection").unwrap();
        let end = text.find("</laneSection>").unwrap() + "</laneSection>".len();
        let sections = section(0.0, "successor") + &section(95.0, "predecessor");
        format!("{}{sections}{}", &text[..begin], &text[end..])
            .replace(r#"<laneLink from="-2" to="-2"/>"#, "")
            .replace(r#"<predecessor id="-2"/>"#, "")
    };
    let found = |line: f64, light: f64| stops(&split(with_signals(&signals(line, light), "")));
    let at = |s_m: f64, name: &str| ("r-1".to_owned(), s_m, name.to_owned(), None);
    assert_eq!(found(90.0, 98.0), [at(90.0, "a")]);
    assert_eq!(found(97.0, 94.0), [at(2.0, "a")]);
    assert_eq!(found(70.0, 98.0), [at(70.0, ""), at(3.0, "a")], "too far");
}

#[test]
fn signs_of_other_countries_are_known() {
    for (country, kind, subtype, sign) in [
        ("US", "R1-1", "", Some(StopSign::Stop)),
        ("us", "R1", "2", Some(StopSign::Yield)),
        ("SE", "b", "2", Some(StopSign::Stop)),
        ("DE", "205", "-1", Some(StopSign::Yield)),
        ("SE", "c", "31", None),
    ] {
        let text = with_signals(&signal("x", 95.0, kind, "/>"), "")
            .replace("country=\"OpenDRIVE\"", &format!("country=\"{country}\""))
            .replace("subtype=\"-1\"", &format!("subtype=\"{subtype}\""));
        let found = stops(&text);
        assert_eq!(found.len(), if sign.is_some() { 2 } else { 0 }, "{country} {kind}");
        assert!(found.iter().all(|stop| stop.3 == sign), "{found:?}");
    }
}

#[test]
fn crosswalks_and_parking_spaces_are_crossings_and_areas() {
    let objects = r#"<objects>
        <object id="zebra" type="crosswalk" s="50" t="0" hdg="0" length="4" width="9"/>
        <object id="thin" type="crosswalk" s="60" t="0" hdg="0" length="0" width="9"/>
        <object id="p" type="parkingSpace" s="20" t="-8" hdg="0" length="5" width="2"><outline>
        <cornerRoad s="18" t="-9"/><cornerRoad s="23" t="-9"/><cornerRoad s="20" t="-7"/></outline></object>
        <object id="i" type="trafficIsland" s="20" t="0" hdg="0" length="1" width="1"/></objects>"#;
    let (network, imported) = imported(&town(objects, "", "", ""));
    let map: &Map = &imported.map;
    let [Crossing { name, outline, lanes, .. }] = map.crossings() else { panic!("{:?}", map.crossings()) };
    assert_eq!(
        (&**name, names(&network, &imported, lanes)),
        ("zebra", ["r1", "r-1", "r-2"].map(String::from).to_vec())
    );
    let corners: Vec<(f64, f64)> = outline.iter().map(|corner| (corner.x_m, corner.y_m)).collect();
    assert_eq!(corners, [(52.0, 4.5), (48.0, 4.5), (48.0, -4.5), (52.0, -4.5)]);
    let areas: Vec<_> = map.areas().iter().map(|area| (&*area.name, area.kind, area.outline.len())).collect();
    assert_eq!(areas, [("p", AreaKind::Parking, 3), ("i", AreaKind::NoEntry, 4)]);
}

#[test]
fn lanes_into_direct_junctions_are_incoming() {
    let road = |id: &str, x: f64, link: &str| {
        format!(
            r#"<road id="{id}" length="50" junction="-1"><link>{link}</link>
            <planView><geometry s="0" x="{x}" y="0" hdg="0" length="50"><line/></geometry></planView>
            <lanes><laneSection s="0">
            <left><lane id="1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></left>
            <right><lane id="-1" type="driving"><width sOffset="0" a="3" b="0" c="0" d="0"/></lane></right>
            </laneSection></lanes></road>"#
        )
    };
    let into = |name: &str| format!(r#"<{name} elementType="junction" elementId="d"/>"#);
    let text = format!(
        r#"<OpenDRIVE><header revMajor="1" revMinor="7"/>{}{}<junction id="d" type="direct">
        <connection id="0" incomingRoad="a" linkedRoad="b" contactPoint="start"><laneLink from="-1" to="-1"/>
        <laneLink from="1" to="1"/></connection></junction></OpenDRIVE>"#,
        road("a", 0.0, &into("successor")),
        road("b", 50.0, &into("predecessor"))
    );
    let (network, imported) = imported(&text);
    let junction = &imported.map.junctions()[0];
    assert_eq!(names(&network, &imported, &junction.incoming), ["a-1", "b1"]);
    assert!(junction.lanes.is_empty());
}
