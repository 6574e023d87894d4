use std::collections::BTreeSet;
use std::sync::Arc;

use swerve_geom::{Point2, Polyline, Transform, Vector2};
use swerve_map::{Borders, Lane, LaneId, LaneMarks, Map, Mark, MarkKind, Neighbour, SignalProgram};
use swerve_msg::{EgoState, Extent};
use swerve_vehicle::VehicleParams;

use super::*;

fn line(y_m: f64) -> Polyline {
    Polyline::new(&[Point2::new(0.0, y_m), Point2::new(40.0, y_m)]).unwrap()
}

/// Two lanes beside each other; the left border of the first is broken, then solid.
fn setup() -> Setup {
    let lane = |id, y_m| Lane::new(LaneId(id), line(y_m), Borders::constant(2.0, 2.0));
    let left = vec![Mark::new(0.0, MarkKind::Broken), Mark::new(30.0, MarkKind::Solid)];
    let beside = |id| Some(Neighbour { lane: LaneId(id), opposite: false });
    let marks = LaneMarks::new(left, vec![Mark::new(0.0, MarkKind::Kerb)]).unwrap();
    let lanes = vec![
        Lane { marks, left: beside(2), successors: vec![LaneId(3)], ..lane(1, 0.0) },
        Lane { right: beside(1), ..lane(2, 4.0) },
        Lane::new(
            LaneId(3),
            Polyline::new(&[Point2::new(40.0, 0.0), Point2::new(60.0, 0.0)]).unwrap(),
            Borders::constant(2.0, 2.0),
        ),
    ];
    let light = Light {
        pose: Pose2::new(38.0, -3.0, 0.0),
        height_m: None,
        lanes: vec![LaneId(1)],
        program: SignalProgram::green_yellow_red([10.0, 3.0, 7.0], 0.0),
    };
    Setup { vehicle: VehicleParams::default(), map: Arc::new(Map::new(lanes).unwrap()), lights: vec![light] }
}

fn actor(id: u32, kind: ActorKind, velocity_mps: f64) -> Actor {
    Actor {
        id: ActorId(id),
        kind,
        pose: Pose2::new(20.0, f64::from(id), 0.1 * velocity_mps),
        z_m: 0.25,
        extent: Extent { length_m: 4.0, width_m: 1.0, height_m: 1.5 },
        velocity_mps: Vector2::new(velocity_mps, 0.0),
    }
}

/// A state in which the ego turns left at 0.5 rad/s, and its centre of gravity moves at `speed_mps`.
fn state(ms: i64, speed_mps: f64) -> WorldState {
    let stamp = Time::from_ms(ms);
    WorldState {
        stamp,
        ego: EgoTruth {
            id: ActorId::EGO,
            map_from_ego: Transform::from_roll_pitch_yaw(Point::new(5.0, 1.0, 0.1), 0.01, 0.02, 0.5),
            state: EgoState { stamp, ..EgoState::default() },
            velocity_mps: Vector::new(speed_mps, 0.0, 0.0),
            specific_force_mps2: Vector::new(0.0, 0.0, 9.81),
            angular_velocity_radps: Vector::new(0.0, 0.0, 0.5),
        },
        actors: vec![
            actor(1, ActorKind::Car, speed_mps),
            actor(2, ActorKind::Truck, 1.0),
            actor(3, ActorKind::Motorcycle, 1.0),
            actor(4, ActorKind::Cyclist, 1.0),
            actor(5, ActorKind::Pedestrian, 1.0),
            actor(6, ActorKind::Static, 0.0),
        ],
        collisions: Vec::new(),
        infractions: Vec::new(),
        ended: None,
    }
}

/// First and second message of a run.
pub(crate) fn truths() -> [GroundTruth; 2] {
    let (setup, first, second) = (setup(), state(0, 2.0), state(10, 2.05));
    [ground_truth(&setup, &first, None, true), ground_truth(&setup, &second, Some(&first), false)]
}

fn xyz(vector: Option<Vector3d>) -> [f64; 3] {
    let Vector3d { x, y, z } = vector.unwrap();
    [x, y, z].map(Option::unwrap)
}

fn close(found: [f64; 3], expected: [f64; 3]) {
    assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9), "{found:?} {expected:?}");
}

#[test]
fn objects_have_the_centre_of_their_box_and_its_motion() {
    let [first, second] = truths();
    let (vehicle, ego) = (VehicleParams::default(), &first.moving_object[0]);
    let base = ego.base.unwrap();
    assert_eq!((first.host_vehicle_id, ego.id), (Identifier::new(0), Identifier::new(0)));
    // The centre of the box is behind that of gravity or before it: seen from there it moves sideways.
    let ahead_m = vehicle.shape.center_ahead_m();
    let pose = state(0, 2.0).ego.map_from_ego;
    let at = pose * Point::new(ahead_m, 0.0, 0.5 * vehicle.shape.height_m);
    close(xyz(base.position), at.coords.into());
    let beside = pose * Vector::new(0.0, 0.5 * (ahead_m - vehicle.cg_to_rear_m()), 0.0);
    close(xyz(base.velocity), [2.0 + beside.coords.x, beside.coords.y, beside.coords.z]);
    let axles = ego.vehicle_attributes.unwrap();
    let rear = xyz(axles.bbcenter_to_rear);
    close(rear, [-ahead_m, 0.0, vehicle.wheel.radius_m - 0.5 * vehicle.shape.height_m]);
    close(xyz(axles.bbcenter_to_front), [rear[0] + vehicle.shape.wheelbase_m, 0.0, rear[2]]);
    // Rates need a state before.
    assert_eq!((base.acceleration, base.orientation_rate), (None, None));
    close(xyz(second.moving_object[0].base.unwrap().acceleration), [5.0, 0.0, 0.0]);
    let car = second.moving_object[1].base.unwrap();
    close(xyz(car.position), [20.0, 1.0, 0.25 + 0.75]);
    close(xyz(car.acceleration), [5.0, 0.0, 0.0]);
    assert!((car.orientation_rate.unwrap().yaw.unwrap() - 0.5).abs() < 1e-9);
}

#[test]
fn kinds_are_those_of_osi_and_identities_are_unique() {
    let [first, second] = truths();
    let kinds = |object: &MovingObject| {
        (object.r#type.unwrap(), object.vehicle_classification.map(|of| of.r#type.unwrap()))
    };
    let kinds: Vec<_> = first.moving_object.iter().map(kinds).collect();
    let vehicle = |of| (TYPE_VEHICLE, Some(of));
    let expected = [CAR, CAR, HEAVY_TRUCK, MOTORCYCLE, BICYCLE].map(vehicle);
    assert_eq!(kinds, [&expected[..], &[(TYPE_PEDESTRIAN, None)]].concat());
    assert_eq!(first.stationary_object.len(), 1);
    let ids = first.moving_object.iter().map(|of| of.id);
    let ids = ids.chain(first.stationary_object.iter().map(|of| of.id));
    let ids = ids.chain(first.traffic_light.iter().map(|of| of.id));
    let ids = ids.chain(first.lane.iter().map(|of| of.id)).chain(first.lane_boundary.iter().map(|of| of.id));
    let ids: Vec<u64> = ids.map(|id| id.unwrap().value.unwrap()).collect();
    assert_eq!(ids.iter().collect::<BTreeSet<_>>().len(), ids.len(), "{ids:?}");
    // Lanes are in the first message only.
    assert_eq!([first.lane.len(), first.lane_boundary.len()], [3, 7]);
    assert_eq!([second.lane.len(), second.lane_boundary.len()], [0, 0]);
}

#[test]
fn border_has_a_boundary_for_each_of_its_marks() {
    let [first, _] = truths();
    let lane = first.lane[0].classification.clone().unwrap();
    let of = |ids: &[Identifier]| {
        let boundary = |id: &Identifier| {
            let boundary = first.lane_boundary.iter().find(|boundary| boundary.id == Some(*id)).unwrap();
            let x_m = boundary.boundary_line.iter().map(|point| xyz(point.position)).collect::<Vec<_>>();
            (boundary.classification.unwrap().r#type.unwrap(), x_m)
        };
        ids.iter().map(boundary).collect::<Vec<_>>()
    };
    let left = of(&lane.left_lane_boundary_id);
    let dashed = vec![[0.0, 2.0, 0.0], [30.0, 2.0, 0.0]];
    assert_eq!(left, [(4, dashed), (3, vec![[30.0, 2.0, 0.0], [40.0, 2.0, 0.0]])]);
    assert_eq!(of(&lane.right_lane_boundary_id), [(12, vec![[0.0, -2.0, 0.0], [40.0, -2.0, 0.0]])]);
    assert_eq!(lane.left_adjacent_lane_id, [lane::identity(LaneId(2)).unwrap()]);
    let [pair] = lane.lane_pairing[..] else { panic!("{:?}", lane.lane_pairing) };
    assert_eq!((pair.antecessor_lane_id, pair.successor_lane_id), (None, lane::identity(LaneId(3))));
}

#[test]
fn lamps_show_the_phase_of_the_instant() {
    let setup = setup();
    let lit = |ms: i64| {
        let lamps = ground_truth(&setup, &state(ms, 0.0), None, false).traffic_light;
        let of = lamps.iter().map(|lamp| lamp.classification.clone().unwrap());
        let on = of.filter(|of| of.mode == Some(MODE_CONSTANT)).map(|of| of.color.unwrap());
        on.collect::<Vec<_>>()
    };
    assert_eq!([0, 9_999, 10_000, 13_000].map(lit), [vec![4], vec![4], vec![3], vec![2]]);
    let [red, _, green] = &ground_truth(&setup, &state(0, 0.0), None, false).traffic_light[..] else {
        panic!()
    };
    let z_m = |lamp: &TrafficLight| xyz(lamp.base.unwrap().position)[2];
    assert!(z_m(red) > z_m(green) && z_m(red) < LIGHT_HEIGHT_M);
    // It faces the traffic that it is for.
    assert_eq!(red.base.unwrap().orientation.unwrap().yaw, Some(core::f64::consts::PI));
}
