//! Tests of the CDR encoding, including fuzzing.

use proptest::prelude::*;

use swerve_geom::{Point, Transform};

use super::*;
use crate::check::Why;
use crate::convert::{
    Beside, Epoch, Identities, cloud_from_ros, control_from_ros, ego_from_ros, gnss_from_ros, image_from_ros,
    imu_from_ros, objects_from_ros, objects_to_ros, plan_from_ros,
};
use crate::msg::geometry_msgs::Vector3;
use crate::msg::sensor_msgs::{Image, Imu, NavSatFix, PointCloud2, PointField};
use crate::samples::sample;

fn invalid(message: &impl RosMessage) -> String {
    match decode_any(message.clone().into_any().kind(), &encode(message)) {
        Err(DecodeError::Invalid { invalid, .. }) => invalid.to_string(),
        other => panic!("{other:?}"),
    }
}

/// A hand-written header: byte order, stamp, the frame with its length and terminating zero.
#[test]
fn cdr_bytes_match_the_standard() {
    let mut fix = NavSatFix::default();
    fix.header.stamp.sec = 1;
    fix.header.stamp.nanosec = 2;
    fix.header.frame_id = "gps".to_owned();
    fix.status.status = -1;
    fix.status.service = 0x0102;
    fix.latitude = 1.0;
    let bytes = encode(&fix);
    let front = [
        0, 1, 0, 0, // little-endian
        1, 0, 0, 0, 2, 0, 0, 0, // stamp
        4, 0, 0, 0, b'g', b'p', b's', 0, // frame
        0xff, 0, 0x02, 0x01, // status, padding, service
        0, 0, 0, 0, 0, 0, 0xf0, 0x3f, // latitude: offset 24 without the header is a multiple of 8
    ];
    // The status is at 16 and the service at 18, followed by padding to 24.
    assert_eq!(bytes[..4 + 16], front[..20]);
    assert_eq!(bytes[20..24], front[20..24]);
    assert_eq!(bytes[4 + 24..4 + 32], front[24..32]);
    assert_eq!(bytes.len() % 4, 0);
}

#[test]
fn cdr_round_trips_every_kind() {
    for &kind in Kind::ALL {
        let message = sample(kind);
        assert_eq!(message.kind(), kind);
        let bytes = encode(&message);
        assert_eq!(bytes.len() % 4, 0, "{kind}");
        assert_eq!(decode_any(kind, &bytes).as_ref(), Ok(&message), "{kind}");
        assert_eq!(Kind::parse(&kind.type_name()), Some(kind));
    }
}

#[test]
fn cdr_reads_big_endian() {
    let message = sample(Kind::Imu);
    let mut bytes = vec![0, 0, 0, 0];
    bytes.extend(cdr_encoding::to_vec::<_, BigEndian>(&message).unwrap());
    assert_eq!(decode_any(Kind::Imu, &bytes), Ok(message));
}

#[test]
fn padded_messages_are_a_multiple_of_four_bytes_long() {
    for extra in 0..8 {
        let AnyMessage::PointCloud2(mut cloud) = sample(Kind::PointCloud2) else { unreachable!() };
        cloud.header.frame_id = "l".repeat(extra);
        let bytes = cdr_encoding::to_vec::<_, LittleEndian>(&Padded(AnyMessage::PointCloud2(cloud))).unwrap();
        assert_eq!(bytes.len() % 4, 0, "{extra}");
    }
}

/// Bytes of CARLA's messages, each written by another implementation of CDR from the definitions of the packages.
#[test]
fn carla_messages_match_the_bytes_of_another_implementation() {
    let Some(file) = swerve_tests::data_or_skip("worlds/carla/carla_cdr.json") else { return };
    let cases: Vec<serde_json::Value> =
        serde_json::from_str(&std::fs::read_to_string(file).unwrap()).unwrap();
    let mut compared = Vec::new();
    for case in &cases {
        let Some(kind) = Kind::parse(case["type"].as_str().unwrap()) else { continue };
        let hex = case["cdr"].as_str().unwrap().as_bytes();
        let byte = |pair: &[u8]| u8::from_str_radix(core::str::from_utf8(pair).unwrap(), 16).unwrap();
        let bytes: Vec<u8> = hex.chunks(2).map(byte).collect();
        let value = kind.deserialize(&case["value"]).unwrap();
        let ours = encode(&value);
        // The other implementation does not pad the end.
        assert_eq!(ours[..bytes.len()], bytes, "{kind}");
        assert!(ours.len() - bytes.len() < 4, "{kind}");
        assert_eq!(decode_any(kind, &bytes), Ok(value), "{kind}");
        compared.push(kind);
    }
    let kinds = [Kind::CarlaEgoVehicleControl, Kind::CarlaEgoVehicleStatus, Kind::AckermannDriveStamped];
    assert!(kinds.iter().all(|kind| compared.contains(kind)), "{compared:?}");
}

/// The transport matches any type with any: most are rejected by length, the rest by implausible values.
#[test]
fn decoder_rejects_messages_of_another_type() {
    for (written, read) in [
        (Kind::Odometry, Kind::Imu),
        (Kind::Imu, Kind::Odometry),
        (Kind::Image, Kind::PointCloud2),
        (Kind::PointCloud2, Kind::Image),
        (Kind::Control, Kind::VelocityReport),
        (Kind::Trajectory, Kind::Control),
        (Kind::NavSatFix, Kind::Imu),
    ] {
        let refused = decode_any(read, &encode(&sample(written)));
        assert!(refused.is_err(), "a {written} was read as a {read}");
    }
}

#[test]
fn decoder_names_the_inconsistent_field_of_a_cloud() {
    let AnyMessage::PointCloud2(cloud) = sample(Kind::PointCloud2) else { unreachable!() };
    type Lie = fn(&mut PointCloud2);
    let lies: [(Lie, &str); 8] = [
        (|c| c.fields[2].offset = 1000, "`fields[2].offset` has 1004 bytes or elements, where 18 are to be"),
        (
            |c| c.fields[0].offset = u32::MAX,
            "`fields[0].offset` has 4294967299 bytes or elements, where 18 are to be",
        ),
        (|c| c.fields[1].count = 1000, "`fields[1].offset` has 4004 bytes or elements, where 18 are to be"),
        (|c| c.fields[1].datatype = 9, "`fields[1].datatype` has no meaning at 9"),
        (|c| c.fields[1].offset = 2, "`fields[1].offset` overlaps `x`"),
        (|c| c.fields[1].name = "x".to_owned(), "`fields[1].name` is there twice"),
        (|c| c.width = 1 << 20, "`row_step` has 72 bytes or elements, where 18874368 are to be"),
        (|c| c.height = 3, "`data` has 144 bytes or elements, where 216 are to be"),
    ];
    for (lie, wanted) in lies {
        let mut lying = cloud.clone();
        lie(&mut lying);
        assert_eq!(invalid(&lying), wanted);
    }
    let mut endless = cloud;
    (endless.height, endless.width) = (u32::MAX, u32::MAX);
    assert!(invalid(&endless).starts_with("`width`"), "{}", invalid(&endless));
}

#[test]
fn decoder_names_implausible_fields() {
    let mut imu = Imu { angular_velocity: Vector3 { x: 0.0, y: f64::NAN, z: 0.0 }, ..Imu::default() };
    assert_eq!(invalid(&imu), "`angular_velocity.y` is not a finite number");
    imu.angular_velocity.y = 5.0e180;
    assert!(invalid(&imu).starts_with("`angular_velocity.y` is 5"), "{}", invalid(&imu));
    imu.angular_velocity.y = 200.0;
    assert_eq!(invalid(&imu), "`angular_velocity.y` is 200, not from -100 to 100");
    imu.angular_velocity.y = 0.0;
    imu.header.stamp.nanosec = 1_000_000_000;
    assert_eq!(invalid(&imu), "`header.stamp.nanosec` is 1000000000 ns, not less than a second");
    imu.header.stamp.nanosec = 0;
    imu.header.frame_id = "a\u{1}".to_owned();
    assert_eq!(invalid(&imu), "`header.frame_id` is not a name: \"a\\u{1}\"");
    imu.header.frame_id.clear();
    imu.orientation.w = 2.0;
    assert_eq!(invalid(&imu), "`orientation` is a quaternion of length 2");
    imu.orientation_covariance.0[0] = -1.0;
    assert_eq!(decode::<Imu>(&encode(&imu)).as_ref(), Ok(&imu));

    let AnyMessage::Image(mut image) = sample(Kind::Image) else { unreachable!() };
    image.step = 1;
    assert!(invalid(&image).starts_with("`step` has 1 "), "{}", invalid(&image));
    let no_encoding = Image { encoding: "rgb9".to_owned(), ..image };
    assert_eq!(invalid(&no_encoding), "`encoding` is not a name: \"rgb9\"");

    let fix = NavSatFix { latitude: 91.0, ..NavSatFix::default() };
    assert_eq!(invalid(&fix), "`latitude` is 91, not from -90 to 90");
    let no_altitude = NavSatFix { altitude: f64::NAN, ..NavSatFix::default() };
    assert!(decode::<NavSatFix>(&encode(&no_altitude)).unwrap().altitude.is_nan());

    let marker = PointField::default();
    assert_eq!(crate::check::check_numbers(&marker, &[]), Ok(()));
    assert_eq!(Why::Twice.to_string(), "is there twice");
}

#[test]
fn decoder_reports_trailing_and_missing_bytes() {
    let bytes = encode(&sample(Kind::Control));
    assert_eq!(decode_any(Kind::Control, &bytes[..3]), Err(DecodeError::TooShort(3)));
    let cut = decode_any(Kind::Control, &bytes[..bytes.len() - 8]).unwrap_err();
    assert!(cut.to_string().contains("unexpected end of input"), "{cut}");
    let mut long = bytes.clone();
    long.extend([0; 8]);
    assert!(matches!(decode_any(Kind::Control, &long), Err(DecodeError::Trailing { .. })));
    let mut other = bytes;
    other[1] = 3;
    assert_eq!(decode_any(Kind::Control, &other), Err(DecodeError::Representation([0, 3])));
}

/// Uses a validated message in every conversion: none may panic.
fn use_it(message: &AnyMessage) {
    let (epoch, mut names) = (Epoch { ns: 1_000 }, Identities::default());
    let place = Transform::from_roll_pitch_yaw(Point::new(0.0, 0.0, 0.0), 0.0, 0.0, 0.0);
    message.stamp().map(|stamp| epoch.time(stamp));
    match message {
        AnyMessage::Image(m) => drop(image_from_ros(m, epoch, swerve_msg::CameraInfo::default())),
        AnyMessage::PointCloud2(m) => {
            if let Ok(cloud) = cloud_from_ros(m, epoch) {
                assert_eq!(cloud.check(), Ok(()));
                assert!(cloud.len() <= (m.width * m.height) as usize);
            }
        }
        AnyMessage::Imu(m) => drop(imu_from_ros(m, epoch, &place)),
        AnyMessage::NavSatFix(m) => drop(gnss_from_ros(m, epoch)),
        AnyMessage::Odometry(m) => {
            drop(ego_from_ros(m, epoch, &m.header.frame_id, &m.child_frame_id, Beside::default()));
        }
        AnyMessage::Trajectory(m) => drop(plan_from_ros(m, epoch, &m.header.frame_id)),
        AnyMessage::PredictedObjects(m) => {
            if let Ok((tracks, futures)) = objects_from_ros(m, epoch, &m.header.frame_id, &mut names) {
                drop(objects_to_ros(&tracks, &futures, epoch, "map"));
            }
        }
        AnyMessage::Control(m) => {
            let command = control_from_ros(m, epoch);
            assert!(command.steering_rad.is_finite() && command.speed_mps.is_finite());
        }
        _ => {}
    }
}

/// Number of mutated payloads to try; more with `SWERVE_FUZZ=1`.
fn mutations() -> u32 {
    if std::env::var_os("SWERVE_FUZZ").is_some() { 100_000 } else { 2_000 }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: mutations(), failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(7), ..ProptestConfig::default() })]

    /// A mutated payload yields a message that passes its check, or an error.
    #[test]
    fn mutated_payloads_never_panic(
        kind in prop::sample::select(Kind::ALL),
        changes in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>()), 0..12),
        keep in any::<prop::sample::Index>(),
        cut in any::<bool>(),
    ) {
        let mut bytes = encode(&sample(kind));
        for (at, value) in changes {
            let at = at.index(bytes.len());
            bytes[at] = value;
        }
        if cut {
            bytes.truncate(keep.index(bytes.len() + 1));
        }
        if let Ok(message) = decode_any(kind, &bytes) {
            prop_assert_eq!(message.check(), Ok(()));
            use_it(&message);
            prop_assert!(encoded_bytes(&message) <= bytes.len() + 8);
        }
    }

    /// Noise is not a message, and its length fields are not trusted.
    #[test]
    fn random_payloads_never_panic(
        kind in prop::sample::select(Kind::ALL),
        big in any::<bool>(),
        body in prop::collection::vec(any::<u8>(), 0..600),
    ) {
        let mut bytes = vec![0, u8::from(!big), 0, 0];
        bytes.extend(body);
        if let Ok(message) = decode_any(kind, &bytes) {
            prop_assert!(encoded_bytes(&message) <= bytes.len() + 8);
        }
    }
}
