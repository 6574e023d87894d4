//! Tests of recorded drives with damaged messages.

use swerve_core::Rng;
use swerve_ros2::AnyMessage;
use swerve_ros2::samples::sample;
use swerve_stack::Setup;
use swerve_text::Document;

use super::*;

const S: u64 = 1_000_000_000;

fn drive() -> Drive {
    let text = "[live]\nroute = \"lane.toml\"\n[control]\ncontroller = \"stanley\"\n[camera.camera]\n[lidar.lidar]\n";
    let config = Setup::from_document(&Document::parse("c.toml", text).unwrap(), &[]).unwrap();
    let mapping = config.ros2_mapping().unwrap();
    let live = config.live.clone().unwrap();
    let route = PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/lane.toml"));
    let scenario = swerve_drive::read_scenario(&route).unwrap();
    Drive { config, live, mapping, scenario, route }
}

/// Messages of all topics, intact, modified or truncated, at plausible and implausible times: inputs have
/// increasing stamps, all other messages are counted, and the graph runs on them.
#[test]
fn recording_uses_or_counts_every_message() {
    let drive = drive();
    let wanted = wanted(&drive);
    let mut rng = Rng::keyed(7, "bag", &[]);
    let epoch = 1_700_000_000 * S;
    let mut intake = Intake::new(
        &drive.mapping,
        interface(drive.mapping.vehicle, &drive.config),
        &drive.config,
        epoch as i64,
    );
    let mut recording = Recording::default();
    let kinds: Vec<(&String, &(String, Kind))> = wanted.iter().collect();
    for i in 0..4000_u64 {
        let (topic, (_, kind)) = kinds[(rng.bits() % kinds.len() as u64) as usize];
        let mut message = sample(*kind);
        let stamp = swerve_ros2::msg::builtin_interfaces::Time::from_ns((epoch + i * S / 100) as i64);
        match &mut message {
            AnyMessage::Odometry(m) => {
                (m.header.stamp, m.header.frame_id, m.child_frame_id) =
                    (stamp, "map".into(), "base_link".into());
            }
            AnyMessage::VelocityReport(m) => m.header.stamp = stamp,
            AnyMessage::SteeringReport(m) => m.stamp = stamp,
            AnyMessage::ControlModeReport(m) => m.stamp = stamp,
            AnyMessage::PointCloud2(m) => m.header.stamp = stamp,
            _ => {}
        }
        let mut data = cdr::encode(&message);
        for _ in 0..rng.bits() % 3 {
            let at = (rng.bits() % data.len() as u64) as usize;
            data[at] ^= rng.bits() as u8;
        }
        if rng.bits().is_multiple_of(8) {
            data.truncate((rng.bits() % data.len() as u64) as usize);
        }
        let received_ns = if rng.bits().is_multiple_of(50) { rng.bits() } else { epoch + i * S / 100 };
        let (name, type_name) = (topic.clone(), kind.type_name());
        let topic = BagTopic { name, type_name, encoding: "cdr".into(), ..BagTopic::default() };
        recording.take(&topic, &BagMessage { topic: 0, received_ns, data }, &wanted, &mut intake);
    }
    recording.conclude(&intake);
    for topic in recording.topics.values() {
        let refused = topic.refused.total() + topic.wrong_type + topic.malformed + topic.impossible_time;
        assert_eq!(topic.used + refused, topic.messages, "{topic:?}");
    }
    let all: u64 = recording.topics.values().map(|topic| topic.messages).sum();
    let used: u64 = recording.topics.values().map(|topic| topic.used).sum();
    assert!(all == 4000 && used > 500, "{used} of {all}");
    assert!(recording.records["pose"].len() > 50 && recording.records["lidar"].len() > 10);
    let LiveGraph { pipeline: Pipeline { mut graph, .. }, .. } =
        LiveGraph::build(&drive.config, &drive.scenario).unwrap();
    for name in graph.sources().map(str::to_owned).collect::<Vec<_>>() {
        graph.playback(&name, recording.records.remove(&name).unwrap_or_default()).unwrap();
    }
    run_virtual(graph, &RunOptions::until(recording.end), Vec::new()).unwrap();
}
