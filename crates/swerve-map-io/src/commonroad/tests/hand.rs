//! Lanes, rules and lights of scenarios written by hand.

use swerve_map::{
    Aspect, LaneId, LaneKind, Mark, MarkKind, Neighbour, Side, SignalId, SignalProgram, StopSign,
};

use super::SMALL;
use crate::commonroad::{Centers, Commonroad, read};

/// A sign and an intersection for the end of [`SMALL`].
const RULES: &str = r#"
<trafficSign id="6"><trafficSignElement><trafficSignID>206</trafficSignID></trafficSignElement></trafficSign>
<intersection id="20"><incoming id="21"><incomingLanelet ref="1"/><successorsStraight ref="3"/></incoming>
<crossing><crossingLanelet ref="2"/></crossing></intersection>
</commonRoad>"#;

fn good(text: &str) -> Commonroad {
    read("m.xml", text, Centers::Middles).unwrap_or_else(|problems| panic!("{problems}"))
}

fn with_rules() -> Commonroad {
    let text = SMALL.replace("</commonRoad>", RULES);
    good(&text.replace(
        "<point><x>26</x><y>4</y></point>",
        "<point><x>26</x><y>4</y></point><trafficSignRef ref=\"6\"/>",
    ))
}

#[test]
fn lanelets_are_read_as_lanes() {
    for centers in [Centers::Middles, Centers::Rounded] {
        let roads = read("m.xml", SMALL, centers).unwrap();
        let of = |id| roads.lanes.map.lane(LaneId(id)).unwrap();
        assert_eq!(roads.lanes.map.lanes().len(), 3);
        assert_eq!(of(1).successors, [LaneId(3)]);
        assert_eq!(of(1).right, Some(Neighbour { lane: LaneId(2), opposite: false }));
        assert_eq!(of(2).left, Some(Neighbour { lane: LaneId(1), opposite: false }));
        assert_eq!((of(1).speed_limit_mps, of(2).speed_limit_mps), (Some(13.4112), None));
        assert_eq!((of(2).kind, of(3).kind), (LaneKind::Cycling, LaneKind::Driving));
        assert_eq!((of(1).line.length(), of(1).width_m(10.0)), (20.0, 3.5));
        assert_eq!((of(3).width_m(0.0), of(3).width_m(10.0)), (3.5, 4.5), "as the bounds go apart");
        assert_eq!((roads.step_s, roads.lanes.name(LaneId(2))), (Some(0.1), "2"));
    }
}

#[test]
fn markings_of_bounds_are_marks() {
    let marks = |marking: &str| {
        let bound = "<point><x>20</x><y>3.5</y></point>";
        let marking = format!("{bound}<lineMarking>{marking}</lineMarking>");
        let roads = good(&SMALL.replacen(bound, &marking, 1));
        let lane = roads.lanes.map.lane(LaneId(1)).unwrap();
        assert_eq!(lane.marks.of(Side::Right), [], "the other bound has none");
        (lane.marks.of(Side::Left).to_vec(), roads.lanes.defects.count())
    };
    for (name, kind, width_m) in [
        ("solid", MarkKind::Solid, 0.12),
        ("dashed", MarkKind::Broken, 0.12),
        (" broad_solid ", MarkKind::Solid, 0.25),
        ("broad_dashed", MarkKind::Broken, 0.25),
        ("lowered_curb", MarkKind::Kerb, 0.12),
        ("no_marking", MarkKind::None, 0.12),
    ] {
        assert_eq!(marks(name), (vec![Mark { width_m, ..Mark::new(0.0, kind) }], 0), "{name}");
    }
    assert_eq!((marks("unknown"), marks("dotted")), ((vec![], 0), (vec![], 1)));
}

#[test]
fn stop_lines_have_their_lights_and_signs() {
    let roads = with_rules();
    let [first, second] = &roads.lanes.map.features().stop_lines[..] else { panic!("two stop lines") };
    assert_eq!(
        (first.lane, first.s_m, &first.signals[..]),
        (LaneId(1), 20.0, &[SignalId(8), SignalId(9)][..])
    );
    assert_eq!((second.lane, second.s_m, second.signals.len()), (LaneId(3), 6.0, 0));
    assert_eq!((first.sign, second.sign), (None, Some(StopSign::Stop)));
}

#[test]
fn lights_have_places_and_cycles() {
    let roads = with_rules();
    let [first, second] = &roads.lanes.map.features().signals[..] else { panic!("two lights") };
    assert_eq!((first.position.x_m, first.position.y_m, first.height_m), (21.0, 5.0, Some(4.5)));
    // Without a position, at the end of its lane, against the traffic.
    assert_eq!((second.position.x_m, second.position.y_m, second.height_m), (20.0, 1.75, None));
    assert_eq!((&first.lanes[..], second.heading_rad), (&[LaneId(1)][..], core::f64::consts::PI));
    let light = &roads.lights[0];
    let cycle = light.cycle.as_ref().unwrap();
    let phases: Vec<_> = cycle.phases.iter().map(|phase| (phase.aspect, phase.steps)).collect();
    assert_eq!((phases, cycle.offset_steps), (vec![(Aspect::Green, 170), (Aspect::Yellow, 30)], 43));
    assert_eq!((&*light.direction, light.active, roads.lights[1].active), ("straightRight", false, true));
}

#[test]
fn signals_have_the_cycles_of_lights_that_are_active() {
    let program = |text: &str| good(text).lanes.map.features().signals[0].program.clone();
    assert_eq!(program(SMALL), None);
    let active = SMALL.replace("<active>false</active>", "");
    let mut expected = SignalProgram { offset_s: -4.3, ..SignalProgram::default() };
    expected.push(Aspect::Green, 17.0);
    expected.push(Aspect::Yellow, 3.0);
    assert_eq!(program(&active), Some(expected.clone()));
    let flashing = active.replace("yellow", "inactive");
    expected.phases[1].aspect = Aspect::Off;
    assert_eq!(program(&flashing), Some(expected));
    assert_eq!(good(&active).lanes.map.features().signals[1].program, None);
}

#[test]
fn intersections_are_junctions_with_their_crossings() {
    let roads = with_rules();
    let features = roads.lanes.map.features();
    let [junction] = &features.junctions[..] else { panic!("one junction") };
    assert_eq!((&junction.lanes[..], &junction.incoming[..]), (&[LaneId(3)][..], &[LaneId(1)][..]));
    let [crossing] = &features.crossings[..] else { panic!("one crossing") };
    assert_eq!((&*crossing.name, crossing.outline.len()), ("2", 4));
}

#[test]
fn links_count_if_one_lanelet_names_them() {
    let text = SMALL.replacen("<successor ref=\"3\"/>", "", 1).replacen(
        "<adjacentLeft drivingDir=\"same\" ref=\"1\"/>",
        "",
        1,
    );
    let map = good(&text).lanes.map;
    assert_eq!(map.lane(LaneId(1)).unwrap().successors, [LaneId(3)]);
    assert_eq!(map.lane(LaneId(2)).unwrap().left, Some(Neighbour { lane: LaneId(1), opposite: false }));
}

#[test]
fn speed_limits_of_2018b_are_in_the_lanelet() {
    let text = SMALL.replacen("2020a", "2018b", 1).replacen(
        "<adjacentLeft drivingDir=\"same\" ref=\"1\"/>",
        "<adjacentLeft drivingDir=\"same\" ref=\"1\"/><speedLimit>8.5</speedLimit>",
        1,
    );
    let roads = good(&text);
    assert_eq!(roads.lanes.map.lane(LaneId(2)).unwrap().speed_limit_mps, Some(8.5));
    assert_eq!(roads.lanes.format, "CommonRoad 2018b");
}
