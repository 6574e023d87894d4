//! Places of signs, masts, rails and pavements at corners.

use swerve_geom::{Point, Pose2};
use swerve_map::{Signal, SignalId, StopSign};

use super::*;
use crate::scene::{Instance, Scene};

fn signal(id: u32, (x, y): (f64, f64), lanes: &[u32]) -> Signal {
    Signal {
        id: SignalId(id),
        name: String::new(),
        position: Point2::new(x, y),
        heading_rad: core::f64::consts::PI,
        height_m: None,
        lanes: lanes.iter().map(|id| LaneId(*id)).collect(),
        controller: None,
        program: None,
    }
}

fn of_class(scene: &Scene, class: SemanticClass) -> Vec<Instance> {
    scene.statics().instances().iter().filter(|instance| instance.class == class).copied().collect()
}

#[test]
fn mast_on_a_road_is_moved_beside_it_and_others_stay() {
    let signals =
        vec![signal(1, (90.0, 4.0), &[1]), signal(2, (100.0, -1.5), &[1]), signal(3, (100.0, -1.5), &[1])];
    let stop = StopLine { signals: vec![SignalId(2)], ..StopLine::new(LaneId(1), 95.0) };
    let features = Features { signals, stop_lines: vec![stop], ..Features::default() };
    let masts = signal_masts(&Map::with_features(road(), features).unwrap());
    let brief = |mast: &SignalMast| {
        let Pose2 { x_m, y_m, .. } = mast.pose;
        [x_m, y_m, mast.height_m].map(|value| (1e3 * value).round() * 1e-3)
    };
    assert_eq!(masts.iter().map(|mast| mast.signal.0).collect::<Vec<_>>(), [1, 2, 3]);
    assert_eq!(brief(&masts[0]), [90.0, 4.0, 0.0]);
    // On the pavement at the stop line; without one, at the end of the lane.
    assert_eq!(brief(&masts[1]), [95.0, -3.6, 0.12]);
    assert_eq!(brief(&masts[2]), [100.0, -3.6, 0.12]);
    assert!(masts.iter().all(|mast| mast.pose.heading_rad == core::f64::consts::PI));
}

#[test]
fn signs_are_at_the_kerb_side_and_face_their_traffic() {
    let line = |lane: u32, s_m: f64, sign| StopLine { sign: Some(sign), ..StopLine::new(LaneId(lane), s_m) };
    let stop_lines = vec![line(1, 95.0, StopSign::Stop), line(2, 95.0, StopSign::Yield)];
    let features = Features { stop_lines, ..Features::default() };
    let mut scene = Scene::default();
    add_map(&mut scene, &Map::with_features(road(), features).unwrap(), 1);
    let signs = of_class(&scene, SemanticClass::TrafficSign);
    assert_eq!(signs.len(), 2);
    for (sign, foot, faces) in
        [(&signs[0], (95.0, -3.6, 0.12), [-1.0, 0.0, 0.0]), (&signs[1], (5.0, 3.6, 0.0), [1.0, 0.0, 0.0])]
    {
        let at = sign.map_from_body.origin();
        let expected = Point::new(foot.0, foot.1, foot.2);
        assert!((at - expected).norm() < 1e-6, "{at:?}");
        let ahead = sign.map_from_body * Point::new(1.0, 0.0, 0.0) - at;
        assert!((0..3).all(|k| (ahead.coords[k] - faces[k]).abs() < 1e-9), "{ahead:?}");
    }
}

#[test]
fn barrier_is_a_row_of_guard_rails_that_face_the_lane() {
    let barrier = [Mark::new(20.0, MarkKind::Barrier), Mark::new(60.0, MarkKind::None)];
    let lane = Lane { marks: marks(&barrier, &[]), ..lane(1, &[(0.0, 0.0), (100.0, 0.0)], 2.0) };
    let mut scene = Scene::default();
    add_map(&mut scene, &Map::new(vec![lane]).unwrap(), 1);
    let rails = of_class(&scene, SemanticClass::GuardRail);
    assert_eq!(rails.len(), 10);
    for (k, rail) in (0..).zip(&rails) {
        let at = rail.map_from_body.origin().coords;
        assert!((at.x - 22.0 - 4.0 * f64::from(k)).abs() < 1e-9 && (at.y - 2.15).abs() < 1e-9, "{at:?}");
        // The face of a rail is towards -y of its frame.
        let face = rail.map_from_body * Point::new(0.0, -1.0, 0.0) - rail.map_from_body.origin();
        assert!(face.coords.y < -0.999);
    }
}

#[test]
fn corner_of_a_junction_between_pavements_is_paved() {
    // From the west and to the south, each with a pavement at the right, and straight on to the east without one.
    let walk = |id, points: &[(f64, f64)], road| Lane {
        kind: LaneKind::Walking,
        left: beside(road, false),
        ..lane(id, points, 1.0)
    };
    let turn: Vec<(f64, f64)> = (0..=10)
        .map(|k| {
            let (sin, cos) = swerve_geom::math::sin_cos(f64::from(k) * 0.1 * core::f64::consts::FRAC_PI_2);
            (-10.0 + 10.0 * sin, -10.0 + 10.0 * cos)
        })
        .collect();
    let next = |ids: &[u32]| ids.iter().map(|id| LaneId(*id)).collect::<Vec<_>>();
    let lanes = vec![
        Lane {
            right: beside(11, false),
            successors: next(&[2, 3]),
            ..lane(1, &[(-60.0, 0.0), (-10.0, 0.0)], 2.0)
        },
        Lane { successors: next(&[4]), ..lane(2, &turn, 2.0) },
        Lane { successors: next(&[5]), ..lane(3, &[(-10.0, 0.0), (10.0, 0.0)], 2.0) },
        Lane { right: beside(14, false), ..lane(4, &[(0.0, -10.0), (0.0, -60.0)], 2.0) },
        Lane { right: beside(15, false), ..lane(5, &[(10.0, 0.0), (60.0, 0.0)], 2.0) },
        walk(11, &[(-60.0, -3.0), (-10.0, -3.0)], 1),
        walk(14, &[(-3.0, -10.0), (-3.0, -60.0)], 4),
        walk(15, &[(10.0, -3.0), (60.0, -3.0)], 5),
    ];
    let inside = Junction {
        id: JunctionId(1),
        name: String::new(),
        lanes: next(&[2, 3]),
        incoming: next(&[1]),
        rights_of_way: Vec::new(),
    };
    let map = Map::with_features(lanes, Features { junctions: vec![inside], ..Features::default() }).unwrap();
    let (pieces, ground) = (map_pieces(&map), MapGround::new(&map));
    // Seven metres from the centre of the turn, the middle of the pavement.
    for angle_rad in [0.3, 0.8, 1.3] {
        let (sin, cos) = swerve_geom::math::sin_cos(angle_rad);
        let at = Point2::new(-10.0 + 7.0 * sin, -10.0 + 7.0 * cos);
        assert!((top(&pieces, at.x_m, at.y_m).0 - 0.12).abs() < 1e-4, "{at:?}");
        assert!((ground.height_m(at) - 0.12).abs() < 1e-6);
    }
    // The way straight on has none, though both its roads do.
    assert!(top(&pieces, 6.0, -3.0).0 < 0.01 && ground.height_m(Point2::new(6.0, -3.0)) == 0.0);
}
