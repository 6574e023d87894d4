use core::f64::consts::FRAC_PI_2;

use swerve_geom::{Point2, Polyline, Pose2, math};

use super::*;
use crate::{Borders, Features, Junction, JunctionId, RightOfWay, StopSign};

/// Arms by the heading in which traffic drives in: from the west, south, east and north.
const ARMS: [usize; 4] = [0, 1, 2, 3];

/// Lane into the junction from an arm, and out of it in the heading of an arm.
fn into(arm: usize) -> LaneId {
    LaneId(10 + arm as u32)
}

fn out(arm: usize) -> LaneId {
    LaneId(20 + arm as u32)
}

/// Lane of a turn by `quarters` to the left: -1, 0 or 1.
fn turn(arm: usize, quarters: i32) -> LaneId {
    LaneId(100 + 10 * arm as u32 + (quarters + 1) as u32)
}

/// A point that is 12 m or more from the centre of the junction, on the right-hand lane.
fn beside(arm: usize, ahead_m: f64) -> Pose2 {
    let heading_rad = arm as f64 * FRAC_PI_2;
    let (sin, cos) = (math::sin(heading_rad), math::cos(heading_rad));
    Pose2::new(ahead_m * cos + 1.75 * sin, ahead_m * sin - 1.75 * cos, heading_rad)
}

/// A curve from one pose to another.
fn curve(from: Pose2, to: Pose2) -> Polyline {
    let reach_m = 0.55 * from.point().distance(to.point());
    let ahead = |pose: Pose2, by_m: f64| {
        let (sin, cos) = (math::sin(pose.heading_rad), math::cos(pose.heading_rad));
        Point2::new(pose.x_m + by_m * cos, pose.y_m + by_m * sin)
    };
    let corners = [from.point(), ahead(from, reach_m * 0.7), ahead(to, -reach_m * 0.7), to.point()];
    let mix = |values: [f64; 4], t: f64| {
        let u = 1.0 - t;
        values[0] * u * u * u
            + 3.0 * values[1] * u * u * t
            + 3.0 * values[2] * u * t * t
            + values[3] * t * t * t
    };
    let at = |k: usize| {
        let t = k as f64 / 20.0;
        Point2::new(mix(corners.map(|p| p.x_m), t), mix(corners.map(|p| p.y_m), t))
    };
    Polyline::new(&(0..=20).map(at).collect::<Vec<_>>()).unwrap()
}

fn lane(id: LaneId, line: Polyline, successors: Vec<LaneId>) -> Lane {
    Lane { successors, ..Lane::new(id, line, Borders::constant(1.75, 1.75)) }
}

/// A junction of four arms with two lanes each, and these elements.
fn crossing(rights_of_way: Vec<RightOfWay>, stop_lines: Vec<StopLine>) -> Map {
    let mut lanes = Vec::new();
    for arm in ARMS {
        let ways = [-1, 0, 1].map(|quarters| turn(arm, quarters));
        lanes.push(lane(into(arm), curve(beside(arm, -60.0), beside(arm, -12.0)), ways.to_vec()));
        lanes.push(lane(out(arm), curve(beside(arm, 12.0), beside(arm, 60.0)), Vec::new()));
        for quarters in [-1, 0, 1] {
            let to = (arm as i32 + quarters).rem_euclid(4) as usize;
            let line = curve(beside(arm, -12.0), beside(to, 12.0));
            lanes.push(lane(turn(arm, quarters), line, vec![out(to)]));
        }
    }
    let inside = ARMS.iter().flat_map(|arm| [-1, 0, 1].map(|quarters| turn(*arm, quarters))).collect();
    let junction = Junction {
        id: JunctionId(1),
        name: String::new(),
        lanes: inside,
        incoming: ARMS.map(into).to_vec(),
        rights_of_way,
    };
    let features = Features { junctions: vec![junction], stop_lines, ..Features::default() };
    Map::with_features(lanes, features).unwrap()
}

/// The only zone of a lane with another one.
fn zone(conflicts: &Conflicts, lane: LaneId, other: LaneId) -> Zone {
    let mut zones = conflicts.zones_of(lane).iter().filter(|zone| zone.other == other);
    let zone = *zones.next().unwrap();
    assert!(zones.next().is_none(), "{lane:?} meets {other:?} twice");
    zone
}

/// True if a lane gives way to another one, and the other way round; the same in all their zones.
fn yields(conflicts: &Conflicts, lane: LaneId, other: LaneId) -> [bool; 2] {
    [(lane, other), (other, lane)].map(|(lane, other)| {
        let zones = conflicts.zones_of(lane).iter().filter(|zone| zone.other == other);
        let yields: Vec<bool> = zones.map(|zone| zone.yields).collect();
        assert!(!yields.is_empty() && yields.iter().all(|one| *one == yields[0]), "{lane:?} and {other:?}");
        yields[0]
    })
}

#[test]
fn traffic_from_the_right_goes_first_and_left_turns_give_way() {
    let conflicts = Conflicts::new(&crossing(Vec::new(), Vec::new()));
    for arm in ARMS {
        // Who drives in with a heading of a quarter more comes from the right.
        let [right, oncoming] = [(arm + 1) % 4, (arm + 2) % 4];
        assert_eq!(yields(&conflicts, turn(arm, 0), turn(right, 0)), [true, false], "arm {arm}");
        assert_eq!(yields(&conflicts, turn(arm, 1), turn(oncoming, 0)), [true, false], "arm {arm}");
        assert_eq!(yields(&conflicts, turn(arm, 1), turn(oncoming, -1)), [true, false], "arm {arm}");
        let oncoming_straight = conflicts.zones_of(turn(arm, 0)).iter();
        assert_eq!(oncoming_straight.filter(|zone| zone.other == turn(oncoming, 0)).count(), 0);
    }
}

#[test]
fn zone_is_where_the_lines_cross_and_the_same_from_both_sides() {
    let conflicts = Conflicts::new(&crossing(Vec::new(), Vec::new()));
    let own = zone(&conflicts, turn(0, 0), turn(1, 0));
    let other = zone(&conflicts, turn(1, 0), turn(0, 0));
    assert_eq!((own.at_m, own.other_m), (other.other_m, other.at_m));
    assert_eq!([own.meeting, other.meeting], [Meeting::Cross; 2]);
    // The lines cross 12 + 1.75 m after the begin of the first; bodies of 5.6 m by 2.2 m touch up to 3.9 m around it.
    let [from_m, to_m] = own.at_m;
    assert!((from_m - (13.75 - 3.9)).abs() < 1.1 && (to_m - (13.75 + 3.9)).abs() < 1.1, "{own:?}");
    let begins: Vec<f64> = conflicts.zones_of(turn(0, 0)).iter().map(|zone| zone.at_m[0]).collect();
    assert!(begins.is_sorted(), "{begins:?}");
}

#[test]
fn lanes_that_end_in_one_merge_and_those_that_begin_in_one_fork() {
    let conflicts = Conflicts::new(&crossing(Vec::new(), Vec::new()));
    // To the heading of arm 0: straight on from there, and to the left from arm 3.
    let merge = zone(&conflicts, turn(3, 1), turn(0, 0));
    assert_eq!((merge.meeting, merge.shift_m), (Meeting::Merge, None));
    let fork = zone(&conflicts, turn(0, 0), turn(0, 1));
    assert_eq!((fork.meeting, fork.yields, fork.shift_m), (Meeting::Fork, false, Some(0.0)));
    assert_eq!(conflicts.zones_of(into(0)), []);
    assert_eq!(conflicts.zones_of(LaneId(7)), []);
}

#[test]
fn signs_go_before_the_right_and_rights_of_the_map_before_signs() {
    let sign = |arm: usize, sign| StopLine { sign: Some(sign), ..StopLine::new(into(arm), 45.0) };
    // Traffic from arm 1 comes from the right of arm 0.
    let signs = vec![sign(1, StopSign::Yield), sign(3, StopSign::Stop)];
    let conflicts = Conflicts::new(&crossing(Vec::new(), signs.clone()));
    assert_eq!(yields(&conflicts, turn(0, 0), turn(1, 0)), [false, true]);
    assert_eq!(yields(&conflicts, turn(0, 0), turn(3, 0)), [false, true]);
    let right = RightOfWay { lane: turn(0, 0), to: turn(1, 0) };
    let conflicts = Conflicts::new(&crossing(vec![right], signs));
    assert_eq!(yields(&conflicts, turn(0, 0), turn(1, 0)), [true, false]);
}

#[test]
fn exactly_one_of_two_gives_way_except_at_forks() {
    let conflicts = Conflicts::new(&crossing(Vec::new(), Vec::new()));
    for (lane, zones) in &conflicts.lanes {
        for zone in zones {
            let back = conflicts.zones_of(zone.other).iter().find(|back| back.at_m == zone.other_m);
            let back = back.filter(|back| back.other == *lane).unwrap();
            let is_fork = zone.meeting == Meeting::Fork;
            assert_eq!(u8::from(zone.yields) + u8::from(back.yields), u8::from(!is_fork), "{zone:?}");
        }
    }
}
