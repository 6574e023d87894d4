use super::*;
use crate::{AreaId, AreaKind, Borders, CrossingId, JunctionId, Map, MapError, RightOfWay, StopSign};
use swerve_geom::Polyline;

fn lane(id: u32, y_m: f64) -> Lane {
    let ends = [Point2::new(0.0, y_m), Point2::new(50.0, y_m)];
    Lane::new(LaneId(id), Polyline::new(&ends).unwrap(), Borders::constant(1.5, 1.5))
}

fn lanes() -> Vec<Lane> {
    vec![lane(1, 0.0), lane(2, 3.0), lane(5, 6.0)]
}

fn square() -> Vec<Point2> {
    [(0.0, 0.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0)].map(|(x, y)| Point2::new(x, y)).to_vec()
}

/// Elements of each kind, none in order.
fn features() -> Features {
    let ids = |all: &[u32]| all.iter().copied().map(LaneId).collect::<Vec<_>>();
    let junction = |id, lanes: &[u32], incoming: &[u32]| Junction {
        id: JunctionId(id),
        name: format!("j{id}"),
        lanes: ids(lanes),
        incoming: ids(incoming),
        rights_of_way: vec![],
    };
    let signal = |id, lanes: &[u32]| Signal {
        id: SignalId(id),
        name: String::new(),
        position: Point2::new(50.0, -2.0),
        heading_rad: 3.0,
        height_m: Some(4.0),
        lanes: ids(lanes),
        controller: None,
        program: None,
    };
    let right = RightOfWay { lane: LaneId(5), to: LaneId(1) };
    let line = |lane, s_m| StopLine::new(LaneId(lane), s_m);
    let area = |id, kind| Area { id: AreaId(id), name: String::new(), kind, outline: square() };
    Features {
        junctions: vec![
            Junction { rights_of_way: vec![right, right], ..junction(9, &[5, 1, 5], &[2]) },
            junction(4, &[2], &[]),
        ],
        signals: vec![signal(8, &[2, 1]), signal(3, &[1])],
        stop_lines: vec![
            StopLine { signals: vec![SignalId(8), SignalId(3)], ..line(2, 40.0) },
            StopLine { sign: Some(StopSign::Yield), ..line(1, 50.0) },
            line(1, 0.0),
            StopLine { sign: Some(StopSign::Stop), ..line(1, 0.0) },
        ],
        crossings: vec![Crossing {
            id: CrossingId(1),
            name: String::new(),
            outline: square(),
            lanes: ids(&[2, 1]),
        }],
        areas: vec![area(7, AreaKind::Parking), area(6, AreaKind::NoEntry)],
    }
}

#[test]
fn elements_are_ordered_and_found_by_lane() {
    let map = Map::with_features(lanes(), features()).unwrap();
    let junctions = |lane| map.junctions_of(LaneId(lane)).map(|one| one.id.0).collect::<Vec<_>>();
    let signals = |lane| map.signals_of(LaneId(lane)).map(|one| one.id.0).collect::<Vec<_>>();
    let lines = |lane| map.stop_lines_of(LaneId(lane)).iter().map(|one| one.s_m).collect::<Vec<_>>();
    assert_eq!([1, 2, 5, 6].map(junctions), [vec![9], vec![4, 9], vec![9], vec![]]);
    assert_eq!([1, 2, 5, 6].map(signals), [vec![3, 8], vec![8], vec![], vec![]]);
    assert_eq!([1, 2, 5, 6].map(lines), [vec![0.0, 0.0, 50.0], vec![40.0], vec![], vec![]]);
    assert_eq!(map.junction(JunctionId(9)).unwrap().lanes, [LaneId(1), LaneId(5)]);
    assert_eq!(map.junction(JunctionId(9)).unwrap().rights_of_way.len(), 1);
    assert_eq!(map.signal(SignalId(8)).unwrap().lanes, [LaneId(1), LaneId(2)]);
    assert_eq!((map.junction(JunctionId(1)), map.signal(SignalId(1))), (None, None));
    assert_eq!(map.stop_lines_of(LaneId(2))[0].signals, [SignalId(3), SignalId(8)]);
    assert_eq!(map.areas().iter().map(|area| area.id.0).collect::<Vec<_>>(), [6, 7]);
    let reversed = |mut all: Features| {
        all.junctions.reverse();
        all.signals.reverse();
        all.stop_lines.reverse();
        all.areas.reverse();
        all
    };
    assert_eq!(Map::with_features(lanes(), reversed(features())).unwrap(), map);
    let (lanes, features) = map.clone().into_parts();
    assert_eq!(Map::with_features(lanes, features).unwrap(), map);
}

#[test]
fn inconsistent_elements_are_rejected() {
    type Change = fn(&mut Features);
    let cases: [(Change, &str); 14] = [
        (|f| f.junctions[1].id = JunctionId(9), "junction 9 is there twice"),
        (|f| f.signals[0].id = SignalId(3), "signal 3 is there twice"),
        (|f| f.crossings.push(f.crossings[0].clone()), "crossing 1 is there twice"),
        (|f| f.areas[0].id = AreaId(6), "area 6 is there twice"),
        (|f| f.junctions[0].lanes.push(LaneId(3)), "junction 9 names lane 3, which is not there"),
        (|f| f.signals[0].lanes.push(LaneId(3)), "signal 8 names lane 3, which is not there"),
        (|f| f.stop_lines[0].lane = LaneId(3), "stop line of lane 3 names lane 3, which is not there"),
        (
            |f| f.stop_lines[0].signals = vec![SignalId(1)],
            "stop line of lane 2 names signal 1, which is not there",
        ),
        (|f| f.stop_lines[0].s_m = 50.1, "stop line of lane 2 is at 50.1 m, expected 0 to 50 m"),
        (|f| f.stop_lines[0].s_m = f64::NAN, "stop line of lane 2 is at NaN m, expected 0 to 50 m"),
        (
            |f| f.junctions[1].rights_of_way = vec![RightOfWay { lane: LaneId(2), to: LaneId(5) }],
            "junction 4 gives a right of way for lane 5, which is neither inside nor incoming",
        ),
        (|f| f.signals[1].position.x_m = f64::NAN, "signal 3 has coordinates that are not finite"),
        (|f| f.areas[1].outline.truncate(2), "area 6 has 2 corners, expected at least 3"),
        (|f| f.crossings[0].outline[2].y_m = f64::INFINITY, "crossing 1 has coordinates that are not finite"),
    ];
    for (change, expected) in cases {
        let mut changed = features();
        change(&mut changed);
        let error = Map::with_features(lanes(), changed).unwrap_err();
        assert!(matches!(error, MapError::Feature(_)));
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn text_of_a_map_with_features_is_a_table_that_is_checked() {
    let map = Map::with_features(lanes(), features()).unwrap();
    let text = serde_json::to_string(&map).unwrap();
    assert_eq!(serde_json::from_str::<Map>(&text).unwrap(), map);
    for (from, to, expected) in [
        ("\"lane\":5,", "\"lane\":77,", "right of way for lane 77"),
        ("\"stop_lines\"", "\"stop_line\"", "unknown field `stop_line`"),
        ("\"kind\":\"parking\"", "\"kind\":\"park\"", "unknown variant `park`"),
    ] {
        let error = serde_json::from_str::<Map>(&text.replace(from, to)).unwrap_err().to_string();
        assert!(error.contains(expected), "{error}");
    }
}
