//! Notices of a drive, one line each: topics of which nothing is usable, findings of monitors, and whether road users are
//! seen at all.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex};

use serde::Serialize;
use swerve_core::{Span, Time};
use swerve_flow::GraphInfo;
use swerve_msg::{SensorHealth, TrackList};
use swerve_ros2::mapping::{Mapping, Role};
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;

use super::intake::{Intake, TopicSummary};
use super::shared::lock;
use super::wire::Wire;

/// Notices per topic, so that a topic whose faults alternate does not flood the terminal.
const PER_TOPIC: usize = 3;
/// Messages without use from which a topic counts as unusable.
const RECEIVED_MIN: u64 = 3;
/// Time without a message after which a monitored sensor is silent.
const SILENT: Span = Span::from_ms(1000);
/// Share of the most frequent byte from which an image is blank.
const BLANK_SHARE: f32 = 0.99;

/// Findings of monitors, by the monitor's name.
pub type SensorChecks = BTreeMap<String, SensorCheck>;

/// Findings of one monitor.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct SensorCheck {
    /// Images or point clouds checked.
    pub messages: u64,
    /// Those that equal their predecessor, byte for byte.
    pub frozen: u64,
    /// Those with invalid values.
    pub invalid: u64,
    /// Those without content: blank images and empty point clouds.
    pub blank: u64,
    /// Number of times that the sensor fell silent for a second.
    pub silences: u64,
    /// True for a lidar.
    #[serde(skip)]
    is_lidar: bool,
}

/// Empty findings of all monitors of a configuration.
pub(super) fn unchecked(config: &Setup) -> SensorChecks {
    let check = |is_lidar| SensorCheck { is_lidar, ..SensorCheck::default() };
    let monitors = config.monitor.iter();
    monitors.map(|(name, of)| (name.clone(), check(config.lidar.contains_key(&of.sensor)))).collect()
}

impl SensorCheck {
    pub(super) fn take(&mut self, health: &SensorHealth) {
        self.messages += 1;
        self.frozen += u64::from(health.frozen);
        self.invalid += u64::from(health.invalid > 0);
        // The ring numbers of a point cloud may all be equal; its points are not blank.
        self.blank +=
            u64::from(health.numbers == 0 || health.commonest_share > BLANK_SHARE && !self.is_lidar);
    }

    /// The counts that are not zero, as a continuation of a line.
    pub(super) fn words(&self) -> String {
        let counts = [
            (self.frozen, "frozen"),
            (self.invalid, "invalid"),
            (self.blank, "blank"),
            (self.silences, "times silent"),
        ];
        counts.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!(", {n} {what}")).collect()
    }

    /// The finding since `before`, if there is one.
    fn since(&self, before: &Self) -> Option<&'static str> {
        let findings = [
            (self.frozen > before.frozen, "repeats the same data"),
            (self.invalid > before.invalid, "delivers invalid values"),
            (self.blank > before.blank, "delivers data without content"),
        ];
        findings.into_iter().find_map(|(is_found, words)| is_found.then_some(words))
    }
}

/// State of a monitored sensor.
struct Monitored {
    /// Name of the sensor, of its topic in the mapping.
    sensor: String,
    before: SensorCheck,
    finding: Option<&'static str>,
}

/// Notices of a drive; each is given once.
pub struct Notices {
    /// ROS names of the topics, by their names in the mapping.
    topics: BTreeMap<String, String>,
    given: BTreeMap<String, BTreeSet<String>>,
    checks: Arc<Mutex<SensorChecks>>,
    monitors: BTreeMap<String, Monitored>,
    /// True if the road users come from the topic of objects only.
    relies_on_objects: bool,
    has_begun: bool,
    was_driving: bool,
}

impl Notices {
    /// Notices for this pipeline; `checks` are the findings of its monitors.
    pub(super) fn new(
        config: &Setup,
        mapping: &Mapping,
        sees: bool,
        checks: Arc<Mutex<SensorChecks>>,
    ) -> Self {
        let topic = |topic: &swerve_ros2::mapping::TopicMap| (topic.name.clone(), topic.topic.clone());
        let monitor = |(name, monitor): (&String, &swerve_stack::config::monitor::MonitorConfig)| {
            let sensor = monitor.sensor.clone();
            (name.clone(), Monitored { sensor, before: SensorCheck::default(), finding: None })
        };
        Self {
            topics: mapping.topics.iter().map(topic).collect(),
            given: BTreeMap::new(),
            checks,
            monitors: config.monitor.iter().map(monitor).collect(),
            relies_on_objects: !sees,
            has_begun: false,
            was_driving: false,
        }
    }

    /// New notices, to be asked for once a second.
    pub(super) fn each_second(
        &mut self,
        now: Time,
        is_driving: bool,
        intake: &Intake,
        wire: &dyn Wire,
    ) -> Vec<String> {
        let mut new = self.of_objects(is_driving, intake);
        for (name, fault) in wire.faults() {
            new.extend(self.of_topic(name.trim_end_matches(super::wire::OWN), &fault));
        }
        for TopicSummary { name, tally, .. } in intake.tallies() {
            let unusable = tally.used == 0 && tally.received >= RECEIVED_MIN;
            if let Some(why) = tally.last_refusal.as_ref().filter(|_| unusable) {
                new.extend(self.of_topic(name, &format!("no message is usable: {why}")));
            }
        }
        new.extend(self.of_monitors(now, intake));
        new
    }

    /// Notices that the road counts as empty: at the start of a drive in which nothing detects road users, and when the
    /// stack begins to drive without ever having received objects.
    fn of_objects(&mut self, is_driving: bool, intake: &Intake) -> Vec<String> {
        if !self.relies_on_objects {
            return Vec::new();
        }
        let objects: Vec<TopicSummary<'_>> =
            intake.tallies().filter(|topic| topic.role == Role::Objects).collect();
        let is_heard = objects.iter().any(|topic| topic.tally.used > 0);
        let topic = objects.first().and_then(|topic| self.topics.get(topic.name));
        let until = topic.map_or_else(String::new, |topic| format!(" until objects arrive on {topic}"));
        let begins = !std::mem::replace(&mut self.has_begun, true);
        let sets_off = is_driving && !std::mem::replace(&mut self.was_driving, is_driving);
        let notice = match (is_heard, begins, sets_off) {
            (true, ..) | (false, false, false) => return Vec::new(),
            (false, _, true) => format!("driving without objects: the road counts as empty{until}"),
            (false, true, false) => {
                format!("no operator detects road users: the road counts as empty{until}")
            }
        };
        vec![notice]
    }

    fn of_topic(&mut self, name: &str, fault: &str) -> Option<String> {
        let given = self.given.entry(name.to_owned()).or_default();
        if given.len() >= PER_TOPIC || !given.insert(fault.to_owned()) {
            return None;
        }
        // A mismatch names the topic itself.
        let topic = self.topics.get(name).filter(|topic| !fault.contains(topic.as_str()));
        Some(match topic {
            Some(topic) => format!("{name} ({topic}): {fault}"),
            None => format!("{name}: {fault}"),
        })
    }

    /// Changes in the findings of monitors; sensors that are silent are counted here.
    fn of_monitors(&mut self, now: Time, intake: &Intake) -> Vec<String> {
        let mut new = Vec::new();
        let mut checks = lock(&self.checks);
        for (name, monitored) in &mut self.monitors {
            let heard =
                intake.tallies().find(|topic| topic.name == monitored.sensor).and_then(|t| t.tally.heard);
            let is_silent = heard.is_some_and(|heard| now - heard > SILENT);
            let check = checks.entry(name.clone()).or_default();
            let was_silent = monitored.finding == Some("is silent");
            check.silences += u64::from(is_silent && !was_silent);
            let is_new = check.messages > monitored.before.messages;
            let finding = match is_silent {
                true => Some("is silent"),
                false if is_new => check.since(&monitored.before),
                false => monitored.finding,
            };
            if finding != monitored.finding {
                let words = finding.unwrap_or("delivers sound data again");
                new.push(format!("{name}: {} {words}", monitored.sensor));
            }
            (monitored.finding, monitored.before) = (finding, check.clone());
        }
        new
    }
}

/// Returns true if the tracks of road users derive from a camera, radar or lidar of the vehicle.
pub(super) fn sees(config: &Setup, pipeline: &Pipeline) -> bool {
    let Some(tracks) = pipeline.assembly.publisher::<TrackList>() else { return false };
    let sensors = config.camera.keys().chain(config.radar.keys()).chain(config.lidar.keys());
    let sensors: BTreeSet<&str> = sensors.map(String::as_str).collect();
    pipeline.graph.describe().is_ok_and(|graph| derives_from(&graph, tracks, &sensors))
}

/// Returns true if the stream of an operator derives from one of the `sources`, over any number of operators.
fn derives_from(graph: &GraphInfo, stream: &str, sources: &BTreeSet<&str>) -> bool {
    let (mut open, mut seen) = (vec![stream], BTreeSet::new());
    while let Some(name) = open.pop() {
        if sources.contains(name) {
            return true;
        }
        let publishes = |name: &str| {
            graph.operators.iter().find(|operator| {
                operator.name == name || operator.outputs.iter().any(|(stream, _)| stream == name)
            })
        };
        let Some(operator) = publishes(name).filter(|operator| seen.insert(operator.name.as_str())) else {
            continue;
        };
        open.extend(operator.inputs.iter().filter_map(|input| input.from.as_deref()));
    }
    false
}

#[cfg(test)]
mod tests {
    use core::time::Duration;
    use std::path::Path;

    use swerve_core::Digest;
    use swerve_ros2::AnyMessage;
    use swerve_ros2::bridge::TopicStatistics;
    use swerve_ros2::convert::{Epoch, ego_to_ros};
    use swerve_stack::Registry;

    use super::*;
    use crate::drive::Drive;
    use crate::graph::LiveGraph;
    use crate::vehicle;
    use crate::wire::{Sent, Taken};

    /// A wire on which nothing arrives, for these reasons.
    struct Faulty(Vec<(String, String)>);

    impl Wire for Faulty {
        fn wait(&self, _: Duration) -> bool {
            false
        }

        fn take(&self) -> Option<Taken<'_>> {
            None
        }

        fn send(&self, _: Role, _: AnyMessage) -> Sent {
            Sent::Done
        }

        fn ask_mode(&self, _: u8, _: Duration) -> Result<bool, String> {
            Ok(true)
        }

        fn statistics(&self) -> Vec<TopicStatistics> {
            Vec::new()
        }

        fn faults(&self) -> Vec<(String, String)> {
            self.0.clone()
        }
    }

    struct Bench {
        notices: Notices,
        intake: Intake,
        wire: Faulty,
        checks: Arc<Mutex<SensorChecks>>,
    }

    impl Bench {
        /// Notices of a shipped configuration.
        fn new(name: &str) -> Self {
            let drive = Drive::load(&Registry::standard(), Path::new(name), &[]).unwrap();
            let graph = LiveGraph::build(&drive.config, &drive.scenario).unwrap();
            let checks = Arc::new(Mutex::new(unchecked(&drive.config)));
            let sees = sees(&drive.config, &graph.pipeline);
            let notices = Notices::new(&drive.config, &drive.mapping, sees, checks.clone());
            let interface = vehicle::interface(drive.mapping.vehicle, &drive.config);
            let intake = Intake::new(&drive.mapping, interface, &drive.config, 0);
            Self { notices, intake, wire: Faulty(Vec::new()), checks }
        }

        fn at(&mut self, s: f64, is_driving: bool) -> Vec<String> {
            let now = Time::ZERO + Span::from_secs(s);
            self.notices.each_second(now, is_driving, &self.intake, &self.wire)
        }
    }

    #[test]
    fn drive_without_a_source_of_road_users_is_announced() {
        let mut bench = Bench::new("autoware");
        let until = "until objects arrive on /perception/object_recognition/objects";
        assert_eq!(
            bench.at(1.0, false),
            [format!("no operator detects road users: the road counts as empty {until}")]
        );
        assert_eq!(bench.at(2.0, false), Vec::<String>::new());
        assert_eq!(
            bench.at(3.0, true),
            [format!("driving without objects: the road counts as empty {until}")]
        );
        assert_eq!(bench.at(4.0, true), Vec::<String>::new());
        // Tracks from the lidar.
        let mut bench = Bench::new("autoware_lidar");
        assert_eq!([bench.at(1.0, false), bench.at(2.0, true)].concat(), Vec::<String>::new());
    }

    #[test]
    fn unusable_topics_are_named_once() {
        let mut bench = Bench::new("autoware_lidar");
        let mismatch = "/localization/kinematic_state is published as geometry_msgs/msg/PoseStamped, expected \
                        nav_msgs/msg/Odometry";
        bench.wire.0 = vec![("odometry".into(), mismatch.into()), ("enable (own)".into(), "no stamp".into())];
        let expected = [format!("odometry: {mismatch}"), "enable (/autoware/engage): no stamp".into()];
        assert_eq!(bench.at(1.0, false), expected);
        assert_eq!(bench.at(2.0, false), Vec::<String>::new());
        for k in 0..20 {
            bench.wire.0 = vec![("imu".into(), format!("fault {k}"))];
            let count = bench.at(3.0, false).len();
            assert_eq!(count, usize::from(k < PER_TOPIC), "{k}");
        }
        // Odometry in a frame other than that of the map.
        bench.wire.0.clear();
        for k in 1..=3 {
            let now = Time::from_ms(4000 + 20 * k);
            let ego = swerve_msg::EgoState { stamp: now, ..swerve_msg::EgoState::default() };
            let odometry = AnyMessage::Odometry(ego_to_ros(&ego, Epoch::default(), "odom", "base_link"));
            bench.intake.take("odometry", &odometry, now, &mut Vec::new());
        }
        let found = bench.at(5.0, false);
        assert_eq!(
            found,
            [
                "odometry (/localization/kinematic_state): no message is usable: it is in frame `odom`, not in `map`"
            ]
        );
    }

    /// A driver that publishes millimetres.
    #[test]
    fn point_cloud_in_another_unit_is_refused() {
        let mut bench = Bench::new("autoware_lidar");
        for k in 1..=3 {
            let now = Time::from_ms(100 * k);
            let mut cloud = swerve_msg::PointCloud { stamp: now, ..swerve_msg::PointCloud::default() };
            for place_m in [[9000.0, 10.0, 0.0], [-100.0, 8000.0, -2400.0], [400.0, 300.0, 0.0]] {
                cloud.push(swerve_msg::LidarPoint { place_m, ..swerve_msg::LidarPoint::default() });
            }
            let cloud = swerve_ros2::convert::cloud_to_ros(&cloud, Epoch::default(), "lidar_top");
            bench.intake.take("lidar", &AnyMessage::PointCloud2(cloud), now, &mut Vec::new());
        }
        let expected = "lidar (/sensing/lidar/top/pointcloud_raw): no message is usable: 2 of 3 points are farther than \
                        500 m: expected coordinates in metres";
        assert_eq!(bench.at(1.0, false), [expected]);
    }

    #[test]
    fn findings_of_monitors_are_reported_when_they_change() {
        let mut bench = Bench::new("autoware_lidar");
        let health = |frozen| SensorHealth {
            stamp: Time::ZERO,
            numbers: 100,
            invalid: 0,
            commonest_share: 1.0,
            frozen,
            checksum: Digest::default(),
        };
        let check = |bench: &Bench, frozen| {
            lock(&bench.checks).get_mut("lidar_watch").unwrap().take(&health(frozen));
        };
        check(&bench, false);
        assert_eq!(bench.at(1.0, false), Vec::<String>::new());
        check(&bench, true);
        assert_eq!(bench.at(2.0, false), ["lidar_watch: lidar repeats the same data"]);
        check(&bench, true);
        assert_eq!(bench.at(3.0, false), Vec::<String>::new());
        assert_eq!(bench.at(3.5, false), Vec::<String>::new(), "there is no new data");
        check(&bench, false);
        assert_eq!(bench.at(4.0, false), ["lidar_watch: lidar delivers sound data again"]);
        let found = lock(&bench.checks)["lidar_watch"].clone();
        assert_eq!(
            (found.messages, found.frozen, found.blank, found.words().as_str()),
            (4, 2, 0, ", 2 frozen")
        );
        // The lidar falls silent.
        let (now, mut out) = (Time::from_ms(4000), Vec::new());
        let cloud = swerve_msg::PointCloud { stamp: now, ..swerve_msg::PointCloud::default() };
        let cloud = AnyMessage::PointCloud2(swerve_ros2::convert::cloud_to_ros(
            &cloud,
            Epoch::default(),
            "lidar_top",
        ));
        bench.intake.take("lidar", &cloud, now, &mut out);
        assert_eq!(out.len(), 1);
        assert_eq!(bench.at(4.5, false), Vec::<String>::new());
        assert_eq!(bench.at(6.0, false), ["lidar_watch: lidar is silent"]);
        assert_eq!(bench.at(7.0, false), Vec::<String>::new());
        assert_eq!(lock(&bench.checks)["lidar_watch"].silences, 1);
    }
}
