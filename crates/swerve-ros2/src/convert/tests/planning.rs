//! Tests of plan and object conversions.

use super::*;

fn plan() -> Plan {
    let point = |i: i32| PlanPoint {
        at: Time::from_ms(1000 + 500 * i64::from(i)),
        pose: Pose2::new(4.0 * f64::from(i), 0.0, 0.0),
        curvature_1pm: 0.0,
        speed_mps: 8.0,
        accel_mps2: 0.25,
    };
    Plan {
        stamp: Time::from_ms(1000),
        status: PlanStatus::Found,
        points: (0..5).map(point).collect(),
        work: 3,
    }
}

#[test]
fn plans_round_trip_through_trajectories() {
    let mut plan = plan();
    plan.points[2].curvature_1pm = 0.1;
    let ros = plan_to_ros(&plan, EPOCH, "map", 2.85);
    passes(&ros);
    assert_eq!(ros.points[2].time_from_start.ns(), 1_000_000_000);
    assert_eq!((ros.points[2].heading_rate_rps, ros.points[2].longitudinal_velocity_mps), (0.8, 8.0));
    assert!((f64::from(ros.points[2].front_wheel_angle_rad) - 0.277_639_1).abs() < 1e-6);
    plan.points[2].curvature_1pm = 0.0;
    let back = plan_from_ros(&ros, EPOCH, "map").unwrap();
    assert_eq!(back, Plan { work: 0, ..plan.clone() });
    let path = path_to_ros(&plan, EPOCH, "map");
    passes(&path);
    assert_eq!(EPOCH.time(path.poses[1].header.stamp), Time::from_ms(1500));
}

#[test]
fn trajectory_times_are_computed_from_speeds_if_missing() {
    let plan = plan();
    let mut ros = plan_to_ros(&plan, EPOCH, "map", 2.85);
    for point in &mut ros.points {
        point.time_from_start = Default::default();
    }
    assert_eq!(plan_from_ros(&ros, EPOCH, "map").unwrap().points, plan.points);
    // It stops at the fourth point: 4 m at a mean speed of 4 m/s; later points are dropped.
    ros.points[3].longitudinal_velocity_mps = 0.0;
    ros.points[4].longitudinal_velocity_mps = 0.0;
    let stopping = plan_from_ros(&ros, EPOCH, "map").unwrap();
    assert_eq!((stopping.points.len(), stopping.end()), (4, Time::from_ms(3000)));
    for point in &mut ros.points {
        point.longitudinal_velocity_mps = 0.0;
    }
    assert_eq!(plan_from_ros(&ros, EPOCH, "map"), Err(ConvertError::NotLater(1)));
}

#[test]
fn trajectory_curvature_is_computed_from_headings() {
    // Left turn on a circle of radius 10 m, in steps of 0.1 rad.
    let mut plan = plan();
    plan.points = (0..16)
        .map(|i| {
            let (sin, cos) = swerve_geom::math::sin_cos(0.1 * f64::from(i));
            let pose = Pose2::new(10.0 * sin, 10.0 * (1.0 - cos), 0.1 * f64::from(i));
            PlanPoint {
                at: Time::from_ms(1000 + 200 * i64::from(i)),
                pose,
                speed_mps: 5.0,
                ..PlanPoint::default()
            }
        })
        .collect();
    let back = plan_from_ros(&plan_to_ros(&plan, EPOCH, "map", 2.85), EPOCH, "map").unwrap();
    assert!(back.points.iter().all(|p| (p.curvature_1pm - 0.1).abs() < 1e-3));
}

fn tracks() -> (TrackList, PredictionList) {
    let stamp = Time::from_ms(400);
    let extent = Extent { length_m: 4.5, width_m: 1.8, height_m: 1.5 };
    let pose = Pose2::new(20.0, 5.0, FRAC_PI_2);
    let history = vec![Sighting { at: stamp, point: pose.point() }];
    let velocity_mps = Vector2::new(-0.5, 3.0);
    let track = Track { id: ActorId(1), kind: ActorKind::Car, pose, extent, velocity_mps, history };
    let path = (0..4).map(|i| PredictedPose {
        at: stamp + Span::from_ms(500) * i,
        pose: Pose2::new(20.0, 5.0 + 1.5 * i as f64, FRAC_PI_2),
    });
    let prediction = Prediction {
        probability: 0.75,
        covariances_m2: (0..4).map(|i| [0.01, 0.0, 0.04 + 0.1 * f64::from(i)]).collect(),
        ..Prediction::single(ActorId(1), ActorKind::Car, extent, path.collect())
    };
    let predictions = PredictionList { stamp, predictions: vec![prediction], ..PredictionList::default() };
    (TrackList { stamp, tracks: vec![track] }, predictions)
}

#[test]
fn tracks_and_predictions_convert_to_predicted_objects() {
    let (tracks, predictions) = tracks();
    let ros = objects_to_ros(&tracks, &predictions, EPOCH, "map");
    passes(&ros);
    let object = &ros.objects[0];
    // Heading north: 3 m/s along, and 0.5 m/s to the left, which is west.
    let linear = object.kinematics.initial_twist_with_covariance.twist.linear;
    assert!((linear.x - 3.0).abs() < 1e-12 && (linear.y - 0.5).abs() < 1e-12);
    let present = &object.kinematics.initial_pose_with_covariance;
    assert_eq!((present.pose.position.z, present.covariance.0[..2].to_vec()), (0.75, vec![0.01, 0.0]));
    assert_eq!((present.covariance.0[6], present.covariance.0[7]), (0.0, 0.04));
    assert_eq!(object.classification[0].label, ObjectClassification::CAR);
    assert_eq!((object.shape.type_, object.shape.dimensions.x), (Shape::BOUNDING_BOX, 4.5));
    let path = &object.kinematics.predicted_paths[0];
    assert_eq!((path.path.len(), path.time_step.ns(), path.confidence), (4, 500_000_000, 0.75));

    let mut names = Identities::default();
    let (back, futures) = objects_from_ros(&ros, EPOCH, "map", &mut names).unwrap();
    assert_eq!(
        (back.stamp, back.tracks[0].id, back.tracks[0].extent),
        (tracks.stamp, ActorId(1), tracks.tracks[0].extent)
    );
    let v = back.tracks[0].velocity_mps;
    assert!((v.x + 0.5).abs() < 1e-12 && (v.y - 3.0).abs() < 1e-12);
    assert_eq!(futures.predictions[0].path[3].at, predictions.predictions[0].path[3].at);
    assert!((futures.predictions[0].path[3].pose.y_m - 9.5).abs() < 1e-12);
    assert!(objects_from_ros(&ros, EPOCH, "odom", &mut names).is_err());
}

#[test]
fn identities_keep_their_number_and_evict_the_oldest() {
    let name = |i: u32| {
        let mut uuid = [9; 16];
        uuid[12..].copy_from_slice(&i.to_le_bytes());
        UUID { uuid }
    };
    let mut names = Identities::default();
    assert_eq!(
        (names.id(name(7)), names.id(name(8)), names.id(name(7))),
        (ActorId(1), ActorId(2), ActorId(1))
    );
    for i in 0..Identities::MAX as u32 - 1 {
        names.id(name(1000 + i));
    }
    assert_eq!(names.id(name(7)), ActorId(1), "used later than the other");
    assert_ne!(names.id(name(8)), ActorId(2), "forgotten, and its number is not used again");
}

#[test]
fn markers_match_the_poses_of_obstacles_and_plan() {
    let (tracks, _) = tracks();
    let track = &tracks.tracks[0];
    let obstacle = swerve_msg::Obstacle {
        id: track.id,
        kind: ActorKind::Pedestrian,
        pose: track.pose,
        extent: track.extent,
        velocity_mps: track.velocity_mps,
        visible_share: 1.0,
    };
    let list = ObstacleList { stamp: tracks.stamp, obstacles: vec![obstacle] };
    let mut markers = obstacles_to_markers(&list, EPOCH, "map");
    markers.markers.push(plan_to_marker(&plan(), EPOCH, "map"));
    passes(&markers);
    let first = &markers.markers[0];
    assert_eq!((first.pose.position.x, first.pose.position.z, first.scale.x), (20.0, 0.75, 4.5));
    assert_eq!(markers.markers[1].points.len(), 5);
}

#[test]
fn markers_of_a_map_are_the_borders_of_its_lanes_and_stay() {
    use crate::msg::builtin_interfaces::Duration;
    use crate::msg::visualization_msgs::Marker;
    use swerve_geom::{Point2, Polyline};
    use swerve_map::{Borders, Lane, LaneId, LaneMarks, Map, Mark, MarkKind};
    let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(20.0, 0.0)]).unwrap();
    let broken = LaneMarks::new(vec![Mark::new(0.0, MarkKind::Broken)], vec![]).unwrap();
    let lane = Lane { marks: broken, ..Lane::new(LaneId(1), line, Borders::constant(2.0, 1.5)) };
    let markers = map_to_markers(&Map::new(vec![lane]).unwrap(), Time::ZERO, EPOCH, "map");
    passes(&markers);
    let points = |k: usize| markers.markers[k].points.iter().map(|p| (p.x, p.y)).collect::<Vec<_>>();
    assert_eq!(points(0), [0.0, 3.0, 9.0, 12.0, 18.0, 20.0].map(|x| (x, 2.0)), "strokes");
    assert_eq!(points(1), [(0.0, -1.5), (20.0, -1.5)]);
    assert_eq!(markers.markers.len(), 2, "there is no junction");
    let stays = |marker: &Marker| marker.lifetime == Duration::default() && marker.action == Marker::ADD;
    assert!(markers.markers.iter().all(stays));
    assert_ne!(markers.markers[0].id, markers.markers[1].id);
}
