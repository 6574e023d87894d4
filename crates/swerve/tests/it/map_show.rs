//! `swerve map show`: road networks of OpenDRIVE, SUMO, Lanelet2 and CommonRoad files.

use crate::support::Bench;

/// Two roads of 50 m, one after the other, with a lane each way; the second turns left by a quarter circle.
const ROADS: &str = r#"<OpenDRIVE>
<header revMajor="1" revMinor="6" name="two roads"/>
<road id="a" length="50" junction="-1">
<link><successor elementType="road" elementId="b" contactPoint="start"/></link>
<planView><geometry s="0" x="0" y="0" hdg="0" length="50"><line/></geometry></planView>
<lanes><laneSection s="0">
<left><lane id="1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none"><roadMark sOffset="0" type="broken" color="white" width="0.12"/></lane></center>
<right><lane id="-1" type="driving"><link><successor id="-1"/></link><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road>
<road id="b" length="50" junction="-1">
<link><predecessor elementType="road" elementId="a" contactPoint="end"/></link>
<planView><geometry s="0" x="50" y="0" hdg="0" length="50"><arc curvature="0.0314159265358979"/></geometry></planView>
<lanes><laneSection s="0">
<left><lane id="1" type="driving"><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></left>
<center><lane id="0" type="none"/></center>
<right><lane id="-1" type="driving"><link><predecessor id="-1"/></link><width sOffset="0" a="4" b="0" c="0" d="0"/></lane></right>
</laneSection></lanes></road>
</OpenDRIVE>
"#;

#[test]
fn summary_picture_and_route_of_a_network_are_shown() {
    let bench = Bench::new();
    bench.write("m.xodr", ROADS);
    let text = bench.good(&["map", "show", "m.xodr", "--out", "m.svg", "--route", "a:-1:10", "b:-1:25"]);
    for line in [
        "m.xodr: OpenDRIVE 1.6, 2 KiB",
        "roads       2, 0.100 km; 0 in junctions; right-hand traffic",
        "geometry    1 arc, 1 line",
        "lanes       4 in 2 lane sections: 4 driving",
        "links       2, widest gap 0.00 mm; 0 dangling",
        "defects     0",
        // 40 m, and half of a quarter circle with a radius of 31.83 + 2 m.
        "route       66.6 m over 2 lanes, 0 lane changes",
        "  follow        b:0:-1",
    ] {
        assert!(text.lines().any(|found| found.starts_with(line)), "{text}\nexpected {line}");
    }
    let picture = bench.read("m.svg");
    assert!(
        picture.starts_with("<svg") && picture.contains("road b section 0 lane -1: driving"),
        "{picture}"
    );
    let json: serde_json::Value =
        serde_json::from_str(&bench.good(&["map", "show", "m.xodr", "--json"])).unwrap();
    assert_eq!((&json["revision"], &json["lanes"]["driving"]), (&"1.6".into(), &4.into()));
    let links: serde_json::Value =
        serde_json::from_str(&bench.good(&["map", "show", "m.xodr", "--links"])).unwrap();
    assert_eq!((&links["links"], &links["dangling"]), (&2.into(), &0.into()));
}

#[test]
fn lanes_are_sampled_at_the_places_of_a_table() {
    let bench = Bench::new();
    bench.write("m.xodr", ROADS);
    bench.write("p.csv", "lane,s,road,section\n-1,10,a,0\n1,50,b,0\n");
    let table = bench.good(&["map", "show", "m.xodr", "--sample", "p.csv"]);
    let lines: Vec<&str> = table.lines().collect();
    assert_eq!(lines[0], "road,section,lane,type,s,width,x,y,z,hdg_ref,hdg_lane");
    assert_eq!(
        lines[1],
        "a,0,-1,driving,10,4.0000000,10.0000000,-2.0000000,0.0000000,0.000000000,0.000000000"
    );
    // The end of the quarter circle about (50, 31.83), on its inner side.
    assert!(lines[2].starts_with("b,0,1,driving,50,4.0000000,79.8309886,31.8309886,"), "{table}");
    bench.write("p.csv", "road,section,lane,s\na,0,-1,10\na,0,-2,10\n");
    let said = bench.swerve(&["map", "show", "m.xodr", "--sample", "p.csv"]);
    assert_eq!(said.code, Some(1));
    assert!(
        said.stderr.contains("p.csv:3: expected a lane of section 0 of road \"a\", one of 1, -1; found -2"),
        "{said:?}"
    );
}

#[test]
fn all_faults_of_a_network_are_reported_with_their_place() {
    let bench = Bench::new();
    bench.write(
        "m.xodr",
        &ROADS.replace("length=\"50\"", "length=\"?\"").replace("type=\"driving\"", "type=\"drivng\""),
    );
    let said = bench.swerve(&["map", "show", "m.xodr"]);
    assert_eq!(said.code, Some(1));
    for expected in [
        "m.xodr:3:14: road a: `length`: expected a number, found \"?\"",
        "m.xodr:13:48: road b/planView/geometry: `length`: expected a number, found \"?\"",
        "did you mean `driving`?",
    ] {
        assert!(said.stderr.contains(expected), "{said:?}\nexpected {expected}");
    }
    bench.write("m.xodr", &ROADS.replacen("type=\"driving\"", "type=\"drivng\"", 1));
    assert_eq!(bench.swerve(&["map", "show", "m.xodr"]).code, Some(0));
    let said = bench.swerve(&["map", "show", "m.xodr", "--strict"]);
    assert!(said.code == Some(1) && said.stderr.contains("expected no defects, found 1"), "{said:?}");
}

#[test]
fn sumo_network_is_shown_with_its_lights_and_a_route() {
    let bench = Bench::new();
    bench.write("m.net.xml", include_str!("../../../swerve-map-io/maps/junction.net.xml"));
    let route = ["--route", "in_2:5", "beyond_0:30"];
    let text = bench.good(&[&["map", "show", "m.net.xml", "--out", "m.svg"], &route[..]].concat());
    for line in [
        "m.net.xml: SUMO 1.20, ",
        "lane map    11 lanes: 10 driving 0.383 km, 1 walking 0.090 km; 2 junctions, 2 rights of way, 3 signals, 5 stop lines",
        "defects     0",
        "route       175.0 m over 4 lanes, 0 lane changes",
        "  follow        :J_1_0 ",
    ] {
        assert!(text.lines().any(|found| found.starts_with(line)), "{text}\nexpected {line}");
    }
    let picture = bench.read("m.svg");
    assert!(picture.contains("stop line, signals L:0") && picture.contains("crossing :J_c0"), "{picture}");
    let json: serde_json::Value =
        serde_json::from_str(&bench.good(&["map", "show", "m.net.xml", "--json"])).unwrap();
    assert_eq!((&json["map_features"]["signals"], &json["types"]["internal"]), (&3.into(), &6.into()));
    bench.write("m.net.xml", "<net><edge id=\"a\"><lane id=\"a_0\" shape=\"0,0 NaN,1\"/></edge></net>");
    let said = bench.swerve(&["map", "show", "m.net.xml"]);
    assert_eq!(said.code, Some(1));
    assert!(
        said.stderr.contains("m.net.xml:1:34: edge a/lane a_0: `shape`: expected a finite number, found NaN"),
        "{said:?}"
    );
}

#[test]
fn lanelet2_map_is_shown_with_its_rules_and_a_route() {
    let bench = Bench::new();
    bench.write("m.osm", include_str!("../../../swerve-map-io/maps/junction.osm"));
    // From the west to the east, through the junction.
    let text = bench.good(&["map", "show", "m.osm", "--out", "m.svg", "--route", "88:5", "90:10"]);
    for line in [
        "m.osm: Lanelet2, local coordinates, 47 KiB",
        "lane map    16 lanes: 1 cycling 0.065 km, 12 driving 0.544 km, 1 shoulder 0.065 km, 2 walking 0.017 km; 1 junction",
        "extent      x -80.0 to 80.0 m, y -80.0 to 5.5 m, z 0.0 to 5.2 m",
        "defects     0",
        "route       100.0 m over 3 lanes, 0 lane changes",
    ] {
        assert!(text.lines().any(|found| found.starts_with(line)), "{text}\nexpected {line}");
    }
    assert!(bench.read("m.svg").contains("crossing "));
    bench.write("m.osm", include_str!("../../../swerve-map-io/maps/alley.osm"));
    let links: serde_json::Value =
        serde_json::from_str(&bench.good(&["map", "show", "m.osm", "--links"])).unwrap();
    assert_eq!((&links["links"], &links["gaps"][0]["joined"]), (&3.into(), &true.into()));
    let said = bench.swerve(&["map", "show", "m.osm", "--strict"]);
    assert!(said.code == Some(1) && said.stderr.contains("are 0.3000 m apart"), "{said:?}");
}

/// A file packed by gzip: one stored block.
fn packed(text: &str) -> Vec<u8> {
    let size = u16::try_from(text.len()).unwrap();
    let head = [0x1f, 0x8b, 8, 0, 0, 0, 0, 0, 0, 0, 1];
    [&head[..], &size.to_le_bytes(), &(!size).to_le_bytes(), text.as_bytes(), &[0; 8]].concat()
}

#[test]
fn suite_drives_a_folder_of_commonroad_scenarios_also_packed() {
    let bench = Bench::new();
    let text = include_str!("../../../swerve-commonroad/src/read/tests/small.xml");
    std::fs::create_dir(bench.path("scenes")).unwrap();
    bench.write("scenes/plain.xml", text);
    std::fs::write(bench.path("scenes/packed.xml.gz"), packed(text)).unwrap();
    let text = bench.good(&["suite", "scenes", "--seeds", "1", "--out", "all"]);
    for scene in ["plain", "packed"] {
        assert!(text.lines().any(|line| line.starts_with(scene)), "{text}");
    }
    assert!(text.contains("2 of 2 cells in all"), "{text}");
}

#[test]
fn commonroad_scenario_is_shown_also_packed() {
    let bench = Bench::new();
    bench.write("m.xml", include_str!("../../../swerve-map-io/src/commonroad/tests/small.xml"));
    let text = bench.good(&["map", "show", "m.xml", "--route", "1:5", "3:2"]);
    for line in [
        "m.xml: CommonRoad 2020a, 3 KiB",
        "lane map    3 lanes: 1 cycling 0.020 km, 2 driving 0.030 km; 2 signals, 2 stop lines",
        "route       17.0 m over 2 lanes, 0 lane changes",
    ] {
        assert!(text.lines().any(|found| found.starts_with(line)), "{text}\nexpected {line}");
    }
    std::fs::write(bench.path("m.xml.gz"), packed(&bench.read("m.xml"))).unwrap();
    let json: serde_json::Value =
        serde_json::from_str(&bench.good(&["map", "show", "m.xml.gz", "--json"])).unwrap();
    assert_eq!((&json["map_lanes"], &json["successors"]), (&3.into(), &1.into()));
    for (name, text, expected) in [
        ("m.xml", "<commonRoad/>", "m.xml:1:1: commonRoad: expected lanelets, found none"),
        ("m.xml", "<kml/>", "m.xml:1:1: kml: expected the element `commonRoad`"),
        ("m.kml", "<kml/>", "m.kml: expected a road network with the root element `OpenDRIVE` (.xodr)"),
        ("m.xml", "\u{1f}", "m.xml:1:1: it is not XML"),
    ] {
        bench.write(name, text);
        let said = bench.swerve(&["map", "show", name]);
        assert!(said.code == Some(1) && said.stderr.contains(expected), "{said:?}\nexpected {expected}");
    }
}
