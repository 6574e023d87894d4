//! `swerve run --ros2`: the simulated car as a vehicle on ROS 2 topics.
//!
//! | module | content |
//! |---|---|
//! | `show` | sends sensor data, reports and plans: a passive observer of the run |
//! | `drive` | receives commands of another stack, if it drives: a source of the run |
//! | `streams` | which streams the readers in the graph receive |
//! | `mounts` | topics and mounting poses of the sensors |
//!
//! Messages are built and sent on two separate threads, one for images and point clouds, one for everything else.
//! Each has a bounded queue; messages that do not fit are dropped and counted.

mod drive;
mod mounts;
mod outbox;
mod show;
mod streams;
mod writers;

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::Context as _;
use serde::Serialize;
use swerve_flow::Observer;
use swerve_report::output::align;
use swerve_ros2::bridge::{Direction, EndpointId, Options, ServiceSide};
use swerve_ros2::convert::SteeringGear;
use swerve_ros2::mapping::{Mapping, Purpose, Role, Side, Vehicle};
use swerve_ros2::transport::Transport;
use swerve_stack::Setup;
use swerve_stack::config::LiveConfig;
use swerve_stack::pipeline::Pipeline;

use drive::{DriverInputs, Listener, ListenerReport};
use mounts::Mounts;
use outbox::{Make, Outbox};
use show::Show;
use streams::Streams;

/// Queue length for small messages: one second of all topics.
const SMALL_MAX: usize = 1000;
/// Queue length for images and point clouds.
const LARGE_MAX: usize = 4;
/// Maximum time for the transport to end.
const STOP_WITHIN: Duration = Duration::from_secs(2);

/// Autoware's service that requests a control mode of the vehicle.
const CONTROL_MODE_SERVICE: &str = "/control/control_mode_request";

/// Builds and sends the messages of a queue until it is closed.
fn send(bridge: &Transport, queue: &Receiver<(EndpointId, Make)>) {
    for (id, make) in queue {
        if let Some(message) = make() {
            // The bridge counts messages that are not sent.
            let _counted = bridge.publish(id, message);
        }
    }
}

/// Steering gear of the simulated car: that of the vehicle in `[live]`, if there is one.
fn gear(config: &Setup) -> SteeringGear {
    config.live.as_ref().map_or_else(SteeringGear::default, LiveConfig::gear)
}

/// The car on ROS 2 topics, until it is dropped.
pub struct Ros2Car {
    bridge: Arc<Transport>,
    show: Show,
    threads: Vec<JoinHandle<()>>,
    listener: Option<(JoinHandle<ListenerReport>, Arc<AtomicBool>)>,
}

impl Ros2Car {
    /// Opens the topics of a configuration for which this run has data and, if another stack drives, the topics of
    /// its commands.
    ///
    /// # Errors
    /// If the transport does not start.
    pub fn start(config: &Setup, pipeline: &mut Pipeline) -> anyhow::Result<Self> {
        let mapping = config.ros2_mapping()?;
        let mounts = Mounts::new(config, &pipeline.assembly, &mapping);
        for sensor in mounts.without_topic() {
            eprintln!("{sensor} is on no topic: name one in [ros2.topics.{sensor}]");
        }
        let driver = DriverInputs::take(pipeline);
        let streams = Streams::new(&pipeline.graph.describe()?);
        let options = options(config, &streams, &mapping, &mounts, driver.is_some());
        let bridge = Arc::new(crate::wire::transport(&mapping, &options, Vec::new())?);
        let (mut queues, mut threads) = (Vec::new(), Vec::new());
        for (name, places) in [("swerve-ros2-small", SMALL_MAX), ("swerve-ros2-large", LARGE_MAX)] {
            let (sender, queue) = sync_channel(places);
            let bridge = Arc::clone(&bridge);
            let thread = thread::Builder::new().name(name.into()).spawn(move || send(&bridge, &queue));
            threads.push(thread.context("no thread for ROS 2's messages")?);
            queues.push(sender);
        }
        let queues = queues.try_into().expect("two were made");
        let outbox =
            Outbox { bridge: Arc::clone(&bridge), queues, dropped: vec![0; options.endpoints.len()] };
        let mut show = Show::new(config, pipeline, &mapping, &mounts, streams, outbox);
        let mut listener = None;
        if let Some(inputs) = driver {
            let one = Listener::new(inputs, &pipeline.vehicle, gear(config), show.is_driven());
            let (bridge, stop) = (Arc::clone(&bridge), Arc::new(AtomicBool::new(false)));
            let until = Arc::clone(&stop);
            let thread = thread::Builder::new().name("swerve-ros2-commands".into());
            let thread = thread.spawn(move || one.run(&bridge, &mapping, &until));
            listener = Some((thread.context("no thread for ROS 2's commands")?, stop));
        }
        Ok(Self { bridge, show, threads, listener })
    }

    /// Observer for the run.
    pub fn observer(&mut self) -> &mut dyn Observer {
        &mut self.show
    }

    /// Sends the remaining messages and shuts down.
    pub fn finish(self) -> Ros2Report {
        let Self { bridge, show, threads, listener } = self;
        let dropped = show.finish();
        for thread in threads {
            // A panic in the thread has been reported by then; its counts are valid.
            let _told = thread.join();
        }
        let report = listener.and_then(|(thread, stop)| {
            stop.store(true, Ordering::Relaxed);
            thread.join().ok()
        });
        let of_others =
            |id| report.as_ref().and_then(|report| report.of_others.get(&EndpointId(id))).copied();
        let topics = bridge.statistics().into_iter().zip(dropped).enumerate();
        let topics = topics.map(|(id, (topic, dropped))| Ros2Topic {
            topic: topic.topic,
            kind: topic.kind.type_name(),
            others: topic.matched,
            sent: topic.published,
            not_sent: topic.not_published,
            dropped,
            received: topic.received,
            refused: topic.refused.total() + of_others(id).unwrap_or_default(),
        });
        let topics = topics.collect();
        let transports_lost = bridge.lost();
        if let Some(bridge) = Arc::into_inner(bridge) {
            bridge.stop(STOP_WITHIN);
        }
        Ros2Report { topics, transports_lost, driver: report.map(Ros2Driver::new) }
    }
}

/// Options of the bridge: the vehicle's side of the mapping, and the visualisation of our stack. If another stack
/// drives, only the objects on the road and its lanes.
fn options(
    config: &Setup,
    streams: &Streams,
    mapping: &Mapping,
    mounts: &Mounts,
    is_driven: bool,
) -> Options {
    let shown = mapping.topics.iter().filter(|topic| {
        topic.role.purpose() == Purpose::Display && (show::is_of_the_world(topic.role) || !is_driven)
    });
    let shown: Vec<&str> = shown.map(|topic| topic.name.as_str()).collect();
    let mut options = Options::from_mapping(mapping, Side::Vehicle).sending(&shown);
    let role = |name: &str| mapping.topic(name).map(|topic| topic.role);
    options.endpoints.retain(|endpoint| match endpoint.direction {
        Direction::Send => show::is_fed(config, streams, mapping, mounts, &endpoint.name),
        Direction::Receive => is_driven && role(&endpoint.name).is_some_and(is_command),
    });
    if is_driven && mapping.vehicle == Vehicle::Autoware {
        options.control_mode_service = Some((ServiceSide::Server, CONTROL_MODE_SERVICE.to_owned()));
    }
    options
}

/// Returns true if another stack may send this role to the car.
fn is_command(role: Role) -> bool {
    role.side() == Side::Stack && matches!(role.purpose(), Purpose::Motion | Purpose::Switch)
}

/// Counts of the ROS 2 topics and of the external stack's commands.
#[derive(Serialize, Clone, Debug)]
pub struct Ros2Report {
    /// Counts by topic.
    pub topics: Vec<Ros2Topic>,
    /// Number of times that the transport process ended or hung and was restarted.
    pub transports_lost: u64,
    /// Counts for the external stack, if it drove.
    pub driver: Option<Ros2Driver>,
}

/// Command counts of an external stack.
#[derive(Serialize, Clone, Debug)]
pub struct Ros2Driver {
    /// Commands passed to the safety gate.
    pub commands: u64,
    /// Commands rejected for implausible stamps.
    pub implausible: u64,
    /// Commands of another writer than the one that drove: rejected, and the car was stopped.
    pub of_others: u64,
    /// Run time minus the stack's clock, ms, for the command with the least delay.
    pub clock_offset_ms: Option<f64>,
    /// Uncertainty of the offset, ms.
    pub clock_spread_ms: Option<f64>,
    /// Number of times that the stack's clock was set.
    pub clock_jumps: u32,
}

impl Ros2Driver {
    fn new(report: ListenerReport) -> Self {
        let ListenerReport { commands, implausible, of_others, clock } = report;
        Self {
            commands,
            implausible,
            of_others: of_others.into_values().sum(),
            clock_offset_ms: clock.map(|clock| clock.offset.as_ms()),
            clock_spread_ms: clock.map(|clock| clock.spread.as_ms()),
            clock_jumps: clock.map_or(0, |clock| clock.jumps),
        }
    }
}

/// Counts of a topic.
#[derive(Serialize, Clone, Debug)]
pub struct Ros2Topic {
    /// ROS name.
    pub topic: String,
    /// ROS type.
    #[serde(rename = "type")]
    pub kind: String,
    /// Number of other readers or writers at the end.
    pub others: usize,
    /// Messages sent.
    pub sent: u64,
    /// Messages that the transport did not accept.
    pub not_sent: u64,
    /// Messages dropped because of a full queue.
    pub dropped: u64,
    /// Messages received.
    pub received: u64,
    /// Received messages that were rejected: invalid, or of another writer than the one that drove.
    pub refused: u64,
}

impl Ros2Report {
    /// Formats a table for the terminal.
    pub fn text(&self) -> String {
        let head = ["topic", "peers", "sent", "send errors", "dropped", "received", "refused"];
        let row = |t: &Ros2Topic| {
            let counts = [t.others as u64, t.sent, t.not_sent, t.dropped, t.received, t.refused];
            std::iter::once(t.topic.clone()).chain(counts.map(|n| n.to_string())).collect()
        };
        let rows = std::iter::once(head.map(str::to_owned).to_vec()).chain(self.topics.iter().map(row));
        let mut text = align(&rows.collect::<Vec<_>>());
        if self.transports_lost > 0 {
            text += &format!("the process of the transport was lost {} times\n", self.transports_lost);
        }
        if let Some(driver) = &self.driver {
            let Ros2Driver { commands, implausible, of_others, .. } = driver;
            text +=
                &format!("{commands} commands of the other stack, {implausible} refused for their stamps");
            if let (Some(offset), Some(spread)) = (driver.clock_offset_ms, driver.clock_spread_ms) {
                text +=
                    &format!("; its clock: {offset:+.1} ms to the run's time, uncertain by {spread:.1} ms");
            }
            text += "\n";
            if *of_others > 0 {
                text += &format!("{of_others} commands of a second writer refused: the car was stopped\n");
            }
        }
        text
    }
}
