//! Two nodes in one process, over the loopback interface. The transport has wall-clock time-outs, so these tests
//! need an idle machine.

#![expect(clippy::unwrap_used, reason = "all of this is a test")]

use std::time::Duration;

use swerve_ros2::bridge::{
    Bridge, Direction, Endpoint, EndpointId, Options, PublishError, ServiceSide, Stopped,
};
use swerve_ros2::clock::ClockParams;
use swerve_ros2::env::Network;
use swerve_ros2::mapping::{Mapping, Qos, ServiceMap, Side, Vehicle};
use swerve_ros2::msg::builtin_interfaces::Time;
use swerve_ros2::samples::{large_cloud, sample};
use swerve_ros2::{AnyMessage, Kind};

const PATIENCE: Duration = Duration::from_secs(10);
const BRIEF: Duration = Duration::from_millis(300);

/// A domain unique to this process and test.
fn network(test: u16) -> Network {
    let domain = 10 + (std::process::id() % 200) as u16 / 10 * 10 + test;
    Network { domain, localhost_only: true }
}

fn endpoint(name: &str, kind: Kind, qos: Qos, direction: Direction) -> Endpoint {
    let topic = format!("/loop/{name}");
    Endpoint { name: name.to_owned(), topic, kind, qos, direction, rate_max_hz: None }
}

fn options(node: &str, network: Network, endpoints: Vec<Endpoint>) -> Options {
    let mapping = Mapping::of(Vehicle::Plain, network);
    Options { node: node.to_owned(), endpoints, ..Options::from_mapping(&mapping, Side::Stack) }
}

/// A publisher and a subscriber of the same topics.
fn pair(test: u16, topics: &[(&str, Kind, Qos)]) -> (Bridge, Bridge) {
    let side = |direction| topics.iter().map(|(n, k, q)| endpoint(n, *k, *q, direction)).collect();
    let writer = Bridge::start(&options("writer", network(test), side(Direction::Send))).unwrap();
    let reader = Bridge::start(&options("reader", network(test), side(Direction::Receive))).unwrap();
    for (i, (name, ..)) in topics.iter().enumerate() {
        assert!(writer.wait_matched(EndpointId(i), 1, PATIENCE), "{name} was not found");
        assert!(reader.wait_matched(EndpointId(i), 1, PATIENCE), "{name} was not found");
    }
    (writer, reader)
}

fn take(bridge: &Bridge, id: usize) -> Option<AnyMessage> {
    for _ in 0..50 {
        if let Some(received) = bridge.take(EndpointId(id)) {
            return Some(received.message);
        }
        bridge.wait(Duration::from_millis(100));
    }
    None
}

#[test]
#[ignore = "real clock"]
fn bridge_delivers_every_kind_unchanged() {
    let names: Vec<String> = (0..Kind::ALL.len()).map(|i| format!("kind{i}")).collect();
    let topics: Vec<_> = Kind::ALL.iter().zip(&names).map(|(k, n)| (n.as_str(), *k, Qos::DEFAULT)).collect();
    let (writer, reader) = pair(0, &topics);
    for (i, kind) in Kind::ALL.iter().enumerate() {
        writer.publish(EndpointId(i), sample(*kind)).unwrap();
        assert_eq!(take(&reader, i), Some(sample(*kind)), "{kind}");
    }
    let wrong = writer.publish(EndpointId(0), sample(Kind::Imu));
    assert_eq!(wrong, Err(PublishError::Kind { topic: Kind::Image, message: Kind::Imu }));
    assert_eq!(reader.publish(EndpointId(0), sample(Kind::Image)), Err(PublishError::NoPublisher));
    let statistics = reader.statistics();
    assert!(
        statistics
            .iter()
            .all(|s| s.received == 1 && s.delivered == 1 && s.refused.total() == 0 && s.lost == 0)
    );
    assert!(statistics[0].latency.unwrap().max.as_ms() < 1000.0);
    assert_eq!(writer.statistics()[0].published, 1);
    assert_eq!((writer.stop(PATIENCE), reader.stop(PATIENCE)), (Stopped::Clean, Stopped::Clean));
}

#[test]
#[ignore = "real clock"]
fn bridge_delivers_a_megabyte() {
    let (writer, reader) = pair(1, &[("cloud", Kind::PointCloud2, Qos::DEFAULT)]);
    let cloud = AnyMessage::PointCloud2(large_cloud((1 << 20) / 18));
    writer.publish(EndpointId(0), cloud.clone()).unwrap();
    assert_eq!(take(&reader, 0).as_ref(), Some(&cloud));
}

#[test]
#[ignore = "real clock"]
fn late_joiners_receive_latched_messages() {
    let network = network(2);
    let topics = |direction| {
        let tf = endpoint("tf_static", Kind::Tf, Qos::LATCHED, direction);
        vec![tf, endpoint("volatile", Kind::Bool, Qos::DEFAULT, direction)]
    };
    let writer = Bridge::start(&options("writer", network, topics(Direction::Send))).unwrap();
    writer.publish(EndpointId(0), sample(Kind::Tf)).unwrap();
    writer.publish(EndpointId(1), sample(Kind::Bool)).unwrap();
    let reader = Bridge::start(&options("reader", network, topics(Direction::Receive))).unwrap();
    assert_eq!(take(&reader, 0), Some(sample(Kind::Tf)));
    assert!(reader.wait_matched(EndpointId(1), 1, PATIENCE));
    assert!(!reader.wait(BRIEF) && reader.take(EndpointId(1)).is_none());
    // The end of the writer is noticed.
    drop(writer);
    assert!(!reader.wait_matched(EndpointId(0), 2, BRIEF));
}

/// The transport matches readers with writers of any type.
#[test]
#[ignore = "real clock"]
fn bridge_rejects_writers_of_another_type() {
    let network = network(3);
    let writer = |kind| vec![endpoint("imu", kind, Qos::DEFAULT, Direction::Send)];
    let reader = vec![endpoint("imu", Kind::SteeringReport, Qos::DEFAULT, Direction::Receive)];
    // Both contain a stamp and a number, so their bytes are nearly the same.
    let odd = Bridge::start(&options("odd", network, writer(Kind::GearReport))).unwrap();
    let reader = Bridge::start(&options("reader", network, reader)).unwrap();
    assert!(odd.wait_matched(EndpointId(0), 1, PATIENCE), "the transport compares types by now");
    reader.wait_matched(EndpointId(0), 1, PATIENCE);
    let mismatch = |bridge: &Bridge| bridge.statistics()[0].mismatch.clone();
    assert_eq!(
        mismatch(&reader).as_deref(),
        Some(
            "/loop/imu is published as autoware_vehicle_msgs/msg/GearReport, expected \
             autoware_vehicle_msgs/msg/SteeringReport"
        )
    );
    for _ in 0..5 {
        odd.publish(EndpointId(0), sample(Kind::GearReport)).unwrap();
    }
    reader.wait(BRIEF);
    let right = Bridge::start(&options("right", network, writer(Kind::SteeringReport))).unwrap();
    assert!(right.wait_matched(EndpointId(0), 1, PATIENCE));
    reader.wait_matched(EndpointId(0), 2, BRIEF);
    right.publish(EndpointId(0), sample(Kind::SteeringReport)).unwrap();
    assert_eq!(take(&reader, 0), Some(sample(Kind::SteeringReport)));
    assert_eq!(reader.take(EndpointId(0)), None);
    let statistics = &reader.statistics()[0];
    assert_eq!(statistics.received - statistics.refused.total(), 1, "{statistics:?}");
    assert!(statistics.refused.total() == 5, "{statistics:?}");
    // A writer that ends is forgotten.
    drop(odd);
    for _ in 0..100 {
        if mismatch(&reader).is_none() {
            break;
        }
        reader.wait(Duration::from_millis(100));
    }
    assert_eq!(mismatch(&reader), None);
}

/// A reliable reader and a best-effort writer never match, and this is reported.
#[test]
#[ignore = "real clock"]
fn bridge_counts_incompatible_qos() {
    let network = network(3);
    let topic = |qos, direction| vec![endpoint("hopeless", Kind::Imu, qos, direction)];
    let writer = Bridge::start(&options("writer", network, topic(Qos::SENSOR, Direction::Send))).unwrap();
    let reader = Bridge::start(&options("reader", network, topic(Qos::DEFAULT, Direction::Receive))).unwrap();
    for _ in 0..50 {
        if reader.statistics()[0].incompatible > 0 {
            break;
        }
        reader.wait_matched(EndpointId(0), 1, Duration::from_millis(100));
    }
    assert!(reader.statistics()[0].incompatible > 0, "{:?}", reader.statistics());
    assert_eq!(
        reader.statistics()[0].fault(),
        Some(
            "a publisher of /loop/hopeless offers best effort, expected reliable: set \
             `ros2.topics.hopeless.qos = \"sensor\"`"
        )
    );
    writer.publish(EndpointId(0), sample(Kind::Imu)).unwrap();
    assert!(!reader.wait(BRIEF) && reader.matched(EndpointId(0)) == 0);
}

#[test]
#[ignore = "real clock"]
fn bridge_rejects_and_counts_implausible_and_untimely_messages() {
    let network = network(4);
    let topic = |direction| vec![endpoint("steering", Kind::SteeringReport, Qos::DEFAULT, direction)];
    let writer = Bridge::start(&options("writer", network, topic(Direction::Send))).unwrap();
    let judge = Options {
        judge_stamps: Some(ClockParams::default()),
        ..options("reader", network, topic(Direction::Receive))
    };
    let reader = Bridge::start(&judge).unwrap();
    assert!(
        writer.wait_matched(EndpointId(0), 1, PATIENCE) && reader.wait_matched(EndpointId(0), 1, PATIENCE)
    );
    let AnyMessage::SteeringReport(mut report) = sample(Kind::SteeringReport) else { unreachable!() };
    let send = |report| writer.publish(EndpointId(0), AnyMessage::SteeringReport(report)).unwrap();
    for i in 0..8 {
        report.stamp = Time { sec: 1000, nanosec: i * 1000 };
        send(report);
        assert!(take(&reader, 0).is_some());
    }
    report.stamp.sec = 900;
    send(report);
    report.stamp.sec = 5000;
    send(report);
    report.stamp = Time::default();
    send(report);
    report.stamp = Time { sec: 1000, nanosec: 999_999 };
    report.steering_tire_angle = f32::NAN;
    send(report);
    report.steering_tire_angle = 0.25;
    send(report);
    assert_eq!(take(&reader, 0), Some(AnyMessage::SteeringReport(report)));
    let statistics = &reader.statistics()[0];
    let refused = statistics.refused;
    assert_eq!(
        (refused.behind, refused.ahead, refused.unset, refused.implausible),
        (1, 1, 1, 1),
        "{refused:?}"
    );
    assert!(statistics.clock.unwrap().stamps == 9);
}

#[test]
#[ignore = "real clock"]
fn bridge_keeps_the_newest_in_a_flood() {
    let network = network(5);
    let topic = |direction, qos| Endpoint {
        rate_max_hz: Some(20.0),
        ..endpoint("flood", Kind::TurnIndicatorsReport, qos, direction)
    };
    let deep = Qos { depth: 2000, ..Qos::DEFAULT };
    let writer = Bridge::start(&options("writer", network, vec![topic(Direction::Send, deep)])).unwrap();
    let reader = Bridge::start(&options("reader", network, vec![topic(Direction::Receive, deep)])).unwrap();
    assert!(
        writer.wait_matched(EndpointId(0), 1, PATIENCE) && reader.wait_matched(EndpointId(0), 1, PATIENCE)
    );
    let AnyMessage::TurnIndicatorsReport(mut report) = sample(Kind::TurnIndicatorsReport) else {
        unreachable!()
    };
    for i in 0..1000 {
        report.stamp.nanosec = i;
        writer.publish(EndpointId(0), AnyMessage::TurnIndicatorsReport(report)).unwrap();
    }
    for _ in 0..100 {
        if reader.statistics()[0].received == 1000 {
            break;
        }
        reader.wait_matched(EndpointId(0), 9, Duration::from_millis(50));
    }
    let statistics = reader.statistics().remove(0);
    assert_eq!(statistics.received, 1000);
    assert!(statistics.over_rate > 900, "{statistics:?}");
    let mut newest = None;
    while let Some(received) = reader.take(EndpointId(0)) {
        newest = Some(received.message);
    }
    assert_eq!(newest, Some(AnyMessage::TurnIndicatorsReport(report)));
}

#[test]
#[ignore = "real clock"]
fn control_mode_service_works_in_both_mappings() {
    for (i, map) in [ServiceMap::Enhanced, ServiceMap::Cyclone].into_iter().enumerate() {
        let network = network(6 + i as u16);
        let service = |side| Options {
            service_map: map,
            control_mode_service: Some((side, "/control/control_mode_request".to_owned())),
            ..options("mode", network, Vec::new())
        };
        let server = Bridge::start(&service(ServiceSide::Server)).unwrap();
        let client = Bridge::start(&service(ServiceSide::Client)).unwrap();
        let asked = std::sync::atomic::AtomicBool::new(false);
        std::thread::scope(|scope| {
            scope.spawn(|| {
                // Requests sent before both sides have discovered each other are lost; the first one after that is
                // answered.
                let answered = (0..20).find_map(|_| client.request_control_mode(1, BRIEF).ok());
                assert_eq!(answered, Some(true), "{map:?}");
                assert_eq!(client.request_control_mode(4, PATIENCE), Ok(false));
                asked.store(true, std::sync::atomic::Ordering::Release);
            });
            for _ in 0..1000 {
                server.serve_control_mode(|mode| mode == 1).unwrap();
                if asked.load(std::sync::atomic::Ordering::Acquire) {
                    break;
                }
                server.wait(Duration::from_millis(10));
            }
        });
        assert!(asked.into_inner(), "{map:?}");
        assert!(server.request_control_mode(1, BRIEF).is_err());
    }
}

/// Any host on the network can send arbitrary datagrams to the transport's sockets. It may lose messages or hang at
/// its end; the program continues, and `stop` returns in time.
#[test]
#[ignore = "real clock"]
fn bridge_survives_noise_on_its_sockets() {
    let (writer, reader) = pair(9, &[("noisy", Kind::Control, Qos::DEFAULT)]);
    let socket = std::net::UdpSocket::bind("127.0.0.1:0").unwrap();
    let base = 7400 + 250 * network(9).domain;
    let mut state = 0x9e37_79b9_7f4a_7c15_u64;
    let mut random = move || {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        (state >> 32) as u8
    };
    for i in 0..3000_usize {
        // Noise behind an RTPS 2.3 header, with valid kinds of submessages.
        let mut datagram = b"RTPS\x02\x03\x01\x12".to_vec();
        datagram.extend((0..12).map(|_| random()));
        const KINDS: [u8; 8] = [0x06, 0x07, 0x08, 0x09, 0x0e, 0x12, 0x15, 0x16];
        datagram.push(KINDS[i % KINDS.len()]);
        datagram.extend([1, random() % 64, 0]);
        let length = usize::from(random());
        datagram.extend((0..length).map(|_| random()));
        let port = base + 10 + 2 * ((i / 2) % 2) as u16 + (i % 2) as u16;
        socket.send_to(&datagram, ("127.0.0.1", port)).unwrap();
    }
    for _ in 0..20 {
        let _ = writer.publish(EndpointId(0), sample(Kind::Control));
        reader.wait(Duration::from_millis(10));
    }
    assert!(reader.statistics()[0].received <= 20);
    for bridge in [writer, reader] {
        let ended = bridge.stop(Duration::from_secs(3));
        assert!(matches!(ended, Stopped::Clean | Stopped::Hanging));
    }
}

/// The clock is compatible with ROS's `/clock`.
#[test]
#[ignore = "real clock"]
fn simulated_time_is_an_ordinary_topic() {
    let network = network(8);
    let side = |side, node: &str| {
        let mapping = Mapping::of(Vehicle::Autoware, network);
        Options { node: node.to_owned(), ..Options::from_mapping(&mapping, side) }
    };
    let vehicle = Bridge::start(&side(Side::Vehicle, "vehicle")).unwrap();
    let stack = Bridge::start(&side(Side::Stack, "stack")).unwrap();
    let (clock, command) = (vehicle.endpoint("clock").unwrap(), stack.endpoint("command").unwrap());
    assert!(vehicle.wait_matched(clock, 1, PATIENCE) && stack.wait_matched(clock, 1, PATIENCE));
    assert!(vehicle.wait_matched(command, 1, PATIENCE) && stack.wait_matched(command, 1, PATIENCE));
    vehicle.publish(clock, sample(Kind::Clock)).unwrap();
    assert_eq!(take(&stack, clock.0), Some(sample(Kind::Clock)));
    stack.publish(command, sample(Kind::Control)).unwrap();
    assert_eq!(take(&vehicle, command.0), Some(sample(Kind::Control)));
}
