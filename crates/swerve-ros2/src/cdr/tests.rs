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

/// A header by hand: byte order, stamp, the frame with its length and final zero.
#[test]
fn bytes_are_those_of_the_standard() {
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
    // The status is at 16 and the service at 18: padding to 24 follows.
    assert_eq!(bytes[..4 + 16], front[..20]);
    assert_eq!(bytes[20..24], front[20..24]);
    assert_eq!(bytes[4 + 24..4 + 32], front[24..32]);
    assert_eq!(bytes.len() % 4, 0);
}

#[test]
fn every_kind_survives_its_bytes() {
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
fn the_other_byte_order_is_read_too() {
    let message = sample(Kind::Imu);
    let mut bytes = vec![0, 0, 0, 0];
    bytes.extend(cdr_encoding::to_vec::<_, BigEndian>(&message).unwrap());
    assert_eq!(decode_any(Kind::Imu, &bytes), Ok(message));
}

#[test]
fn a_filled_up_message_is_a_multiple_of_four_long_whatever_its_length() {
    for extra in 0..8 {
        let AnyMessage::PointCloud2(mut cloud) = sample(Kind::PointCloud2) else { unreachable!() };
        cloud.header.frame_id = "l".repeat(extra);
        let bytes = cdr_encoding::to_vec::<_, LittleEndian>(&Padded(AnyMessage::PointCloud2(cloud))).unwrap();
        assert_eq!(bytes.len() % 4, 0, "{extra}");
    }
}

/// The transport matches any type with any: most are refused by their length, the rest by their numbers.
#[test]
fn another_type_is_not_taken_for_the_one_asked_for() {
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
fn lying_clouds_are_refused_with_the_field_that_lies() {
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
fn what_cannot_be_is_refused_by_name() {
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
    assert_eq!(invalid(&imu), "`header.frame_id` is no name: \"a\\u{1}\"");
    imu.header.frame_id.clear();
    imu.orientation.w = 2.0;
    assert_eq!(invalid(&imu), "`orientation` is a quaternion of length 2");
    imu.orientation_covariance.0[0] = -1.0;
    assert_eq!(decode::<Imu>(&encode(&imu)).as_ref(), Ok(&imu));

    let AnyMessage::Image(mut image) = sample(Kind::Image) else { unreachable!() };
    image.step = 1;
    assert!(invalid(&image).starts_with("`step` has 1 "), "{}", invalid(&image));
    let no_encoding = Image { encoding: "rgb9".to_owned(), ..image };
    assert_eq!(invalid(&no_encoding), "`encoding` is no name: \"rgb9\"");

    let fix = NavSatFix { latitude: 91.0, ..NavSatFix::default() };
    assert_eq!(invalid(&fix), "`latitude` is 91, not from -90 to 90");
    let no_altitude = NavSatFix { altitude: f64::NAN, ..NavSatFix::default() };
    assert!(decode::<NavSatFix>(&encode(&no_altitude)).unwrap().altitude.is_nan());

    let marker = PointField::default();
    assert_eq!(crate::check::check_numbers(&marker, &[]), Ok(()));
    assert_eq!(Why::Twice.to_string(), "is there twice");
}

#[test]
fn bytes_that_are_left_or_missing_are_told() {
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

/// The use that is made of a message that passed its check: nothing of it may panic either.
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

/// How many mutated payloads are tried: more with `SWERVE_FUZZ=1`.
fn mutations() -> u32 {
    if std::env::var_os("SWERVE_FUZZ").is_some() { 100_000 } else { 2_000 }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: mutations(), failure_persistence: None, rng_seed: proptest::test_runner::RngSeed::Fixed(7), ..ProptestConfig::default() })]

    /// Whatever is done to a payload: a message that passes its own check, or an error.
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

    /// Noise is not a message, and its lengths are not believed.
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
