//! Drives from recorded vehicle messages, in virtual time.

use super::*;

/// Runs a recorded drive with the named configuration, in virtual time.
fn recorded(name: &str, messages: &[(i64, &str, AnyMessage)], until: Time) -> Recorded {
    recorded_with(name, &[], messages, until)
}

/// As `recorded`, with keys set.
fn recorded_with(
    name: &str,
    sets: &[(String, toml::Value)],
    messages: &[(i64, &str, AnyMessage)],
    until: Time,
) -> Recorded {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live"));
    let drive = Drive::load(&Registry::standard(), &folder.join(name).with_extension("toml"), sets).unwrap();
    let interface = vehicle::interface(drive.mapping.vehicle, &drive.config);
    let mut intake = Intake::new(&drive.mapping, interface, &drive.config, EPOCH_NS);
    let mut arrived = Vec::new();
    for (ms, name, message) in messages {
        intake.take(name, message, Time::from_ms(*ms), &mut arrived);
    }
    for TopicSummary { name, tally, .. } in intake.tallies() {
        assert_eq!(tally.refused.total(), 0, "{name}: {:?}", tally.last_refusal);
    }
    let LiveGraph { pipeline: Pipeline { mut graph, .. }, .. } =
        LiveGraph::build(&drive.config, &drive.scenario).unwrap();
    for source in graph.sources().map(str::to_owned).collect::<Vec<_>>() {
        let own = arrived.iter().filter(|arrived| arrived.source() == source);
        graph.playback(&source, own.cloned().map(intake::Arrived::record).collect()).unwrap();
    }
    let mut seen = Recorded::default();
    swerve_flow::run_virtual(graph, &RunOptions::until(until), vec![&mut seen]).unwrap();
    seen
}

#[derive(Default)]
struct Recorded {
    health: Vec<(String, SensorHealth)>,
    commands: Vec<MotionCommand>,
    plans: Vec<Plan>,
    poses: Vec<EgoState>,
}

impl Observer for Recorded {
    fn event(&mut self, event: &swerve_flow::Event<'_>) {
        let swerve_flow::Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(health) = payload.downcast_ref::<SensorHealth>() {
            self.health.push((publication.operator.to_owned(), *health));
        } else if let Some(plan) = payload.downcast_ref::<Plan>() {
            self.plans.push(plan.clone());
        } else if let Some(ego) = payload.downcast_ref::<EgoState>() {
            self.poses.push(*ego);
        } else if publication.operator == "fresh" {
            self.commands.extend(payload.downcast_ref::<MotionCommand>());
        }
    }
}

const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

/// The ego at 8 m/s along x, from the inertial unit, the satellite receiver and the vehicle's reports, without
/// poses.
fn sensed(until_ms: i64) -> Vec<(i64, &'static str, AnyMessage)> {
    let epoch = Epoch { ns: EPOCH_NS };
    let mut messages = Vec::new();
    for ms in (0..until_ms).step_by(10) {
        let stamp = Time::from_ms(ms);
        let imu = Imu { stamp, accel_mps2: [0.0, 0.0, 9.81], gyro_radps: [0.0; 3] };
        messages.push((ms, "imu", AnyMessage::Imu(imu_to_ros(&imu, epoch, "imu"))));
        if ms % 20 == 0 {
            let velocity = VelocityReport {
                header: epoch.header(stamp, "base_link"),
                longitudinal_velocity: 8.0,
                ..VelocityReport::default()
            };
            messages.push((ms, "velocity", AnyMessage::VelocityReport(velocity)));
            let (stamp, mode) = (epoch.stamp(stamp), ControlModeReport::AUTONOMOUS);
            let steering = SteeringReport { stamp, ..SteeringReport::default() };
            messages.push((ms, "steering", AnyMessage::SteeringReport(steering)));
            let mode = ControlModeReport { stamp, mode };
            messages.push((ms, "control_mode", AnyMessage::ControlModeReport(mode)));
        }
        if ms % 100 == 0 {
            // The map origin is 37.4° north, 122° west; a degree of longitude there is 88,550 m.
            let longitude_deg = -122.0 + 8.0e-3 * ms as f64 / 88_550.1;
            let fix = Gnss { stamp, latitude_deg: 37.4, longitude_deg, altitude_m: 0.0, deviation_m: 0.1 };
            messages.push((ms, "gnss", AnyMessage::NavSatFix(gnss_to_ros(&fix, epoch, "gnss"))));
        }
    }
    messages
}

#[test]
fn vehicle_without_a_pose_topic_is_localized_by_its_sensors() {
    let (until, messages) = (Time::from_ms(3500), sensed(3500));
    let seen = recorded("autoware", &messages, until);
    assert!(seen.poses.is_empty() && seen.plans.is_empty(), "no pose is published");
    let sets = [("localization.localizer".to_owned(), toml::Value::from("eskf"))];
    let seen = recorded_with("autoware", &sets, &messages, until);
    let off = |ego: &EgoState| ego.pose.point().distance(Point2::new(8.0 * ego.stamp.as_secs(), 0.0));
    assert!(seen.poses.len() > 300, "{}", seen.poses.len());
    let worst = seen.poses.iter().map(off).fold(0.0, f64::max);
    assert!(worst < 0.3 && (seen.poses[300].speed_mps - 8.0).abs() < 0.1, "{worst}");
    assert!(seen.commands.len() > 100, "it is driven by them: {}", seen.commands.len());
}

#[test]
fn real_road_requires_a_map() {
    let config = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../configs/live/autoware.toml"));
    let set = |key: &str, value: &str| (key.to_owned(), toml::Value::from(value));
    let sets = [set("localization.localizer", "ndt"), set("lidar.roof.preset", "vlp_32")];
    let said = Drive::load(&Registry::standard(), config, &sets).map(|_| ()).unwrap_err().to_string();
    assert!(said.contains("localization.map: is missing: expected a map of the road"), "{said}");
}

/// Poses of the ego at 8 m/s along x, every 20 ms.
fn poses(until_ms: i64) -> Vec<(i64, &'static str, AnyMessage)> {
    let pose = |ms: i64| {
        let mut ego = EgoState { stamp: Time::from_ms(ms), speed_mps: 8.0, ..EgoState::default() };
        ego.pose.x_m = 8.0e-3 * ms as f64;
        let odometry = ego_to_ros(&ego, Epoch { ns: EPOCH_NS }, "map", "base_link");
        (ms, "odometry", AnyMessage::Odometry(odometry))
    };
    (0..until_ms / 20).map(|i| pose(20 * i)).collect()
}

#[test]
fn images_and_clouds_are_monitored() {
    let stamp = |ms: i64| Epoch { ns: EPOCH_NS }.stamp(Time::from_ms(ms));
    let mut messages = poses(1000);
    for ms in [100, 200, 300] {
        let AnyMessage::Image(mut image) = sample(Kind::Image) else { panic!("an image") };
        image.header.stamp = stamp(ms);
        // The third image repeats the second.
        image.data[0] = (ms / 200) as u8;
        messages.push((ms, "camera", AnyMessage::Image(image)));
        let mut cloud = swerve_ros2::samples::large_cloud(500);
        cloud.header.stamp = stamp(ms);
        messages.push((ms, "lidar", AnyMessage::PointCloud2(cloud)));
    }
    messages.sort_by_key(|(ms, ..)| *ms);
    let seen = recorded("plain", &messages, Time::from_ms(1000));
    let of = |name: &str| -> Vec<SensorHealth> {
        seen.health.iter().filter(|(monitor, _)| monitor == name).map(|(_, health)| *health).collect()
    };
    let (camera, lidar) = (of("camera_watch"), of("lidar_watch"));
    assert_eq!(camera.iter().map(|health| health.frozen).collect::<Vec<_>>(), [false, false, true]);
    assert_eq!(lidar.iter().map(|health| health.frozen).collect::<Vec<_>>(), [false, true, true]);
    assert!(camera.iter().all(|health| health.invalid == 0 && health.numbers == 18), "{camera:?}");
    assert!(lidar.iter().all(|health| health.invalid == 0 && health.numbers == 500), "{lidar:?}");
}

#[test]
fn silent_objects_topic_is_not_an_empty_road() {
    // An obstacle at rest in the lane 30 m ahead, from 200 ms to 1,500 ms.
    let pose = swerve_geom::Pose2::new(30.0, 0.0, 0.0);
    let track = Track {
        id: ActorId(7),
        kind: ActorKind::Static,
        pose,
        extent: Extent { length_m: 2.0, width_m: 3.5, height_m: 2.0 },
        velocity_mps: Vector2::new(0.0, 0.0),
        history: Vec::new(),
    };
    let objects = |ms: i64| {
        let tracks = TrackList { stamp: Time::from_ms(ms), tracks: vec![track.clone()] };
        let none = PredictionList::default();
        (
            ms,
            "objects",
            AnyMessage::PredictedObjects(objects_to_ros(&tracks, &none, Epoch { ns: EPOCH_NS }, "map")),
        )
    };
    let until = Time::from_ms(3500);
    let free = recorded("autoware", &poses(3500), until);
    let mut messages = poses(3500);
    messages.extend((2..15).map(|i| objects(100 * i)));
    messages.sort_by_key(|(ms, ..)| *ms);
    let blocked = recorded("autoware", &messages, until);
    let slowest = |seen: &Recorded| {
        let before = |command: &&MotionCommand| command.stamp < Time::from_ms(1500);
        seen.commands.iter().filter(before).map(|command| command.accel_mps2).fold(f64::INFINITY, f64::min)
    };
    assert!(slowest(&free) > -0.5 && slowest(&blocked) < -1.0, "{} {}", slowest(&free), slowest(&blocked));
    // Plans end 500 ms after the last objects, and commands 500 ms after the last plan.
    let last_plan = |seen: &Recorded| seen.plans.last().unwrap().stamp;
    assert!((1900..=2000).contains(&(last_plan(&blocked).ns() / 1_000_000)), "{:?}", last_plan(&blocked));
    assert!(last_plan(&free) > Time::from_ms(3400));
    let last_command = |seen: &Recorded| seen.commands.last().unwrap().stamp;
    assert!(last_command(&blocked) < Time::from_ms(2550) && last_command(&free) > Time::from_ms(3400));
}

#[test]
fn shipped_vehicle_configurations_name_existing_routes() {
    let names: Vec<_> = swerve_drive::shipped::Kind::Live.all().map(|(name, _)| name).collect();
    assert!(names.len() >= 4);
    for name in names {
        let drive = Drive::load(&Registry::standard(), Path::new(name), &[]).unwrap();
        assert!(drive.scenario.road.length_m() > drive.scenario.ego.end_m);
        let stem = Path::new(name).file_stem().unwrap().to_str().unwrap();
        assert!(stem.starts_with(drive.mapping.vehicle.name()), "{name}");
    }
}
