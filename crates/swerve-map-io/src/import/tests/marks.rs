//! Marks of lanes.

use swerve_map::{LaneMarks, Mark, MarkColour, MarkKind, Side};

use super::*;

/// A road of 100 m with two lanes each way, of 3 m at the left and 4 m at the right. Marks of the centre lane and of lane
/// -1 change along it.
fn marked(rule: &str) -> String {
    let mark =
        |s_m: f64, kind: &str, more: &str| format!(r#"<roadMark sOffset="{s_m}" type="{kind}" {more}/>"#);
    let lane = |id: i32, marks: &str| {
        let width_m = if id > 0 { 3 } else { 4 };
        format!(
            r#"<lane id="{id}" type="driving"><width sOffset="0" a="{width_m}" b="0" c="0" d="0"/>{marks}</lane>"#
        )
    };
    let center = [
        mark(0.0, "solid broken", r#"color="yellow" width="0.15""#),
        mark(60.0, "broken", r#"color="standard""#),
    ]
    .concat();
    let changing = [
        mark(0.0, "none", ""),
        mark(25.0, "broken solid", r#"color="red""#),
        mark(25.0, "broken solid", r#"color="white" laneChange="both""#),
        mark(40.0, "broken", r#"laneChange="increase""#),
        mark(200.0, "solid", ""),
    ]
    .concat();
    format!(
        r#"<OpenDRIVE><header revMajor="1" revMinor="6"/><road id="a" length="100" junction="-1" {rule}><planView>
        <geometry s="0" x="0" y="0" hdg="0" length="100"><line/></geometry></planView><lanes><laneSection s="0">
        <left>{}{}</left><center><lane id="0" type="none">{center}</lane></center><right>{}{}</right>
        </laneSection></lanes></road></OpenDRIVE>"#,
        lane(2, &mark(0.0, "curb", r#"width="0.2""#)),
        lane(1, &mark(30.0, "solid broken", "")),
        lane(-1, &changing),
        lane(-2, "")
    )
}

/// Marks of the lane of the road with an identity.
fn of(network: &Network, imported: &Imported, lane: i32) -> LaneMarks {
    imported.map.lane(id(network, imported, ("a", 0, lane))).unwrap().marks.clone()
}

/// Begin, to the micrometre, and kind.
fn brief(marks: &[Mark]) -> Vec<(f64, MarkKind)> {
    marks.iter().map(|mark| ((1e6 * mark.from_m).round() * 1e-6, mark.kind)).collect()
}

#[test]
fn marks_are_those_of_the_borders_in_the_direction_of_travel() {
    use MarkKind as K;
    let (network, imported) = imported(&marked(""));
    let sides = |lane| {
        let marks = of(&network, &imported, lane);
        [brief(marks.of(Side::Left)), brief(marks.of(Side::Right))]
    };
    let outer = vec![(0.0, K::None), (25.0, K::BrokenSolid), (40.0, K::Broken)];
    assert_eq!(sides(-1), [vec![(0.0, K::BrokenSolid), (60.0, K::Broken)], outer]);
    let inner = vec![(0.0, K::None), (25.0, K::SolidBroken), (40.0, K::Broken)];
    assert_eq!(sides(-2), [inner, vec![]]);
    // Against the direction of the road.
    assert_eq!(sides(1), [vec![(0.0, K::Broken), (40.0, K::SolidBroken)], vec![(0.0, K::SolidBroken)]]);
    assert_eq!(sides(2), [vec![(0.0, K::BrokenSolid)], vec![(0.0, K::Kerb)]]);
}

#[test]
fn colours_widths_and_one_way_permissions_are_those_of_the_records() {
    let (network, imported) = imported(&marked(""));
    let middle = of(&network, &imported, -1).of(Side::Left).to_vec();
    assert_eq!((middle[0].colour, middle[0].width_m), (MarkColour::Yellow, 0.15));
    assert_eq!((middle[1].colour, middle[1].width_m), (MarkColour::White, 0.12));
    let permissions = |lane, side| {
        let marks = of(&network, &imported, lane);
        marks.of(side).iter().map(|mark| mark.permission).collect::<Vec<_>>()
    };
    // `increase` permits changes from lane -2 to lane -1 only, `both` nothing that the paint does not.
    assert_eq!(permissions(-1, Side::Right), [None, None, Some(false)]);
    assert_eq!(permissions(-2, Side::Left), [None, None, Some(true)]);
    let lane = imported.map.lane(id(&network, &imported, ("a", 0, -2))).unwrap();
    assert_eq!([10.0, 30.0, 50.0].map(|s_m| lane.may_cross(Side::Left, s_m)), [true, false, true]);
}

#[test]
fn traffic_on_the_left_has_the_same_marks_at_the_same_places() {
    use MarkKind as K;
    let (network, imported) = imported(&marked(r#"rule="LHT""#));
    let marks = of(&network, &imported, -1);
    assert_eq!(brief(marks.of(Side::Right)), [(0.0, K::Broken), (40.0, K::BrokenSolid)]);
    assert_eq!(brief(marks.of(Side::Left)), [(0.0, K::Broken), (60.0, K::BrokenSolid), (75.0, K::None)]);
}

#[test]
fn published_town_has_broken_yellow_middle_lines_and_kerbs() {
    let Some((_, imported)) = published("carla/Town01.xodr") else { return };
    let (mut middle, mut kerbs) = (0, 0);
    for lane in imported.map.lanes() {
        let opposite = lane.left.is_some_and(|left| left.opposite) && lane.kind == LaneKind::Driving;
        if let Some(mark) = lane.marks.at(Side::Left, 0.0).filter(|_| opposite) {
            assert_eq!((mark.kind, mark.colour), (MarkKind::Broken, MarkColour::Yellow));
            assert!((mark.width_m - 0.125).abs() < 1e-12 && lane.may_cross(Side::Left, 1.0));
            middle += 1;
        }
        if lane.kind == LaneKind::Shoulder {
            kerbs += usize::from(lane.marks.at(Side::Right, 0.0).is_some_and(|m| m.kind == MarkKind::Kerb));
        }
    }
    // Counted in the XML: lanes 1 and -1 for driving beside a broken centre line; shoulders with a kerb.
    assert_eq!((middle, kerbs), (52, 52));
}
