//! Lanes that are split: lane sections for one side of a road, and roads that join others between their ends.

use swerve_map::LaneId;

use crate::import::{Imported, import};
use crate::links::Links;
use crate::opendrive::{LaneSection, Network};

fn network(text: &str) -> Network {
    Network::read("m.xodr", text).unwrap_or_else(|problems| panic!("{problems}"))
}

fn lane(id: i32, width: &str, link: &str) -> String {
    format!(r#"<lane id="{id}" type="driving"><link>{link}</link>{width}</lane>"#)
}

fn width(s: f64, a: f64) -> String {
    format!(r#"<width sOffset="{s}" a="{a}" b="0" c="0" d="0"/>"#)
}

fn road(sections: &str) -> String {
    format!(
        r#"<road id="r" length="100" junction="-1"><planView><geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry>
        </planView><lanes>{sections}</lanes></road>"#
    )
}

fn file(content: &str) -> String {
    format!(r#"<OpenDRIVE><header revMajor="1" revMinor="7"/>{content}</OpenDRIVE>"#)
}

/// Begin of each section, its lanes, and the links of each lane.
fn outline(sections: &[LaneSection]) -> Vec<String> {
    let lane =
        |lane: &crate::opendrive::Lane| format!(" {}:{:?}{:?}", lane.id, lane.predecessors, lane.successors);
    sections
        .iter()
        .map(|section| format!("{}{}", section.s_m, section.lanes().map(lane).collect::<String>()))
        .collect()
}

/// Lanes of the map: road, section and lane.
fn name(network: &Network, imported: &Imported, id: LaneId) -> String {
    let source = &imported.lanes[id.0 as usize];
    format!("{}:{}:{}", network.roads[source.road].id, source.section, source.lane)
}

#[test]
fn sections_for_one_side_hold_until_the_next_of_that_side() {
    let single = |s: f64, side: &str, lanes: &str| {
        format!(r#"<laneSection s="{s}" singleSide="true"><{side}>{lanes}</{side}></laneSection>"#)
    };
    // On the left one section, whose width changes at 70 m; on the right two, of which the second has two lanes.
    let left = lane(1, &(width(0.0, 3.0) + &width(70.0, 4.0)), "");
    let first = lane(-1, &width(0.0, 3.5), r#"<successor id="-1"/>"#);
    let second = lane(-1, &width(0.0, 3.5), r#"<predecessor id="-1"/>"#) + &lane(-2, &width(5.0, 2.0), "");
    let text = file(&road(
        &(single(0.0, "left", &left) + &single(0.0, "right", &first) + &single(60.0, "right", &second)),
    ));
    let network = network(&text);
    assert_eq!(network.defects.count(), 0, "{}", network.defects);
    let sections = &network.roads[0].sections;
    assert_eq!(outline(sections), ["0 1:[][1] -1:[][-1]", "60 1:[1][] -1:[-1][] -2:[][]"]);
    let width_m = |section, lane, s_m| network.sample("r", section, lane, s_m).unwrap().width_m;
    assert_eq!([width_m(0, 1, 59.0), width_m(1, 1, 65.0), width_m(1, 1, 75.0)], [3.0, 3.0, 4.0]);
    assert_eq!([width_m(1, -2, 62.0), width_m(1, -2, 66.0), width_m(1, -1, 99.0)], [0.0, 2.0, 3.5]);
    let links = Links::of(&network);
    assert_eq!((links.all.len(), links.dangling.len(), links.widest_m() < 1e-6), (2, 0, true));
    let imported = import(&network, &links).unwrap();
    let next: Vec<Vec<String>> = imported
        .map
        .lanes()
        .iter()
        .map(|lane| lane.successors.iter().map(|next| name(&network, &imported, *next)).collect())
        .collect();
    assert_eq!(next, [vec![], vec!["r:1:-1".to_owned()], vec!["r:0:1".to_owned()], vec![], vec![]]);
}

#[test]
fn whole_sections_end_single_sided_ones_and_missing_lanes_are_defects() {
    let text = file(&road(&format!(
        r#"<laneSection s="0" singleSide="true"><left>{}</left></laneSection>
        <laneSection s="20" singleSide="true"><right>{}</right></laneSection>
        <laneSection s="50"><right>{}</right></laneSection>"#,
        lane(1, &width(0.0, 3.0), r#"<successor id="2"/>"#),
        lane(-1, &width(0.0, 3.0), r#"<successor id="-1"/>"#),
        lane(-1, &width(0.0, 3.0), "")
    )));
    let network = network(&text);
    let sections = &network.roads[0].sections;
    assert_eq!(outline(sections), ["0 1:[][1]", "20 1:[1][2] -1:[][-1]", "50 -1:[][]"]);
    assert_eq!(network.defects.count(), 1, "{}", network.defects);
    assert!(network.defects.to_string().contains("expected a lane of road \"r\", one of -1, found 2"));
}

#[test]
fn splitting_is_bounded() {
    // 190 lanes on the left, split by 1,100 sections on the right.
    let left: String = (1..=190).map(|id| lane(id, &width(0.0, 0.1), "")).collect();
    let right: String = (0..1100)
        .map(|k| {
            let lane = lane(-1, &width(0.0, 3.0), "");
            format!(
                r#"<laneSection s="{}" singleSide="true"><right>{lane}</right></laneSection>"#,
                f64::from(k) * 0.05
            )
        })
        .collect();
    let sections =
        format!(r#"<laneSection s="0" singleSide="true"><left>{left}</left></laneSection>{right}"#);
    let problems = Network::read("m.xodr", &file(&road(&sections))).unwrap_err();
    assert!(problems.to_string().contains("expected at most 200000 pieces of split lanes"), "{problems}");
}

/// A road with a lane each way, and two roads at its side: `out` leaves its lane -1 at 40 m, `back` joins its lane 1 at
/// 40 m.
fn driveway() -> String {
    let main = road(&format!(
        r#"<laneSection s="0"><left>{}</left><right>{}</right></laneSection>"#,
        lane(1, &(width(0.0, 3.0) + &width(30.0, 3.0) + &width(60.0, 3.0)), ""),
        lane(-1, &width(0.0, 3.0), "")
    ));
    let aside = |id: &str, link: &str, [x, y, heading]: [f64; 3], lane: String| {
        format!(
            r#"<road id="{id}" length="20" junction="v"><link>{link}</link><planView>
            <geometry s="0" x="{x}" y="{y}" hdg="{heading}" length="20"><line/></geometry></planView>
            <lanes><laneSection s="0"><right>{lane}</right></laneSection></lanes></road>"#
        )
    };
    let at = |end: &str| format!(r#"<{end} elementType="road" elementId="r" elementS="40" elementDir="+"/>"#);
    let out = aside("out", &at("predecessor"), [40.0, 0.0, 0.0], lane(-1, &width(0.0, 3.0), ""));
    let link = r#"<successor id="1"/>"#;
    let back =
        aside("back", &at("successor"), [60.0, 0.0, core::f64::consts::PI], lane(-1, &width(0.0, 3.0), link));
    let junction = r#"<junction id="v" type="virtual" mainRoad="r" sStart="30" sEnd="50" orientation="+">
        <connection id="0" incomingRoad="r" connectingRoad="out" contactPoint="start"><laneLink from="-1" to="-1"/></connection>
        </junction>"#;
    file(&(main + &out + &back + junction))
}

#[test]
fn roads_join_others_between_their_ends() {
    let network = network(&driveway());
    assert_eq!(network.defects.count(), 0, "{}", network.defects);
    let sections = &network.road("r").unwrap().sections;
    assert_eq!(outline(sections), ["0 1:[][1] -1:[][-1]", "40 1:[1][] -1:[-1][]"]);
    let links = Links::of(&network);
    assert_eq!((links.all.len(), links.dangling.len(), links.within_roads), (4, 0, 0), "{links:?}");
    let imported = import(&network, &links).unwrap();
    let next = |of: &str| {
        let lane = imported.map.lanes().iter().find(|lane| name(&network, &imported, lane.id) == of).unwrap();
        lane.successors.iter().map(|next| name(&network, &imported, *next)).collect::<Vec<_>>()
    };
    assert_eq!(next("r:0:-1"), ["r:1:-1", "out:0:-1"]);
    assert_eq!(next("back:0:-1"), ["r:0:1"]);
    assert_eq!(next("r:1:1"), ["r:0:1"]);
    let [junction] = imported.map.junctions() else { panic!() };
    let names =
        |lanes: &[LaneId]| lanes.iter().map(|lane| name(&network, &imported, *lane)).collect::<Vec<_>>();
    assert_eq!(names(&junction.lanes), ["out:0:-1", "back:0:-1"]);
    assert_eq!(names(&junction.incoming), ["r:0:-1"]);
}
