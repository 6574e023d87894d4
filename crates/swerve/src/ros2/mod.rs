//! `swerve run --ros2`: the simulated car as a vehicle on ROS 2's topics.
//!
//! | module | what |
//! |---|---|
//! | [`show`] | sensors, reports and plans go out: an observer of the run, which changes nothing in it |
//! | [`mounts`] | which sensor is on which topics, and where it sits |
//!
//! Messages are made and sent on two threads of their own, one for images and point clouds, one for all else. Each
//! has a queue with a bound; what does not fit is dropped and counted.

mod mounts;
mod show;

use std::sync::Arc;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::thread::{self, JoinHandle};
use std::time::Duration;

use anyhow::Context as _;
use serde::Serialize;
use swerve_flow::Observer;
use swerve_ros2::AnyMessage;
use swerve_ros2::bridge::{Bridge, Direction, EndpointId, Options, Stopped};
use swerve_ros2::mapping::Side;

use crate::config::Config;
use crate::output::align;
use crate::pipeline::Pipeline;
use mounts::Mounts;
use show::Show;

/// Small messages that may wait: a second of all of them.
const SMALL_MAX: usize = 1000;
/// Images and point clouds that may wait.
const LARGE_MAX: usize = 4;
/// How long the transport may take for its end.
const STOP_WITHIN: Duration = Duration::from_secs(2);

/// Makes a message; nothing where it cannot be said in ROS.
type Make = Box<dyn FnOnce() -> Option<AnyMessage> + Send>;

/// What the stack shows of itself: sent where it is our own that drives.
const STACK: [&str; 3] = ["trajectory", "path", "markers"];

/// Messages on their way out.
struct Outbox {
    bridge: Arc<Bridge>,
    queues: [SyncSender<(EndpointId, Make)>; 2],
    /// Messages that found their queue full, by endpoint.
    dropped: Vec<u64>,
}

impl Outbox {
    /// Has a small message made and sent.
    fn small(&mut self, id: EndpointId, make: impl FnOnce() -> Option<AnyMessage> + Send + 'static) {
        self.post(0, id, Box::new(make));
    }

    /// Has a large message made and sent.
    fn large(&mut self, id: EndpointId, make: impl FnOnce() -> Option<AnyMessage> + Send + 'static) {
        self.post(1, id, Box::new(make));
    }

    fn post(&mut self, queue: usize, id: EndpointId, make: Make) {
        if let Err(TrySendError::Full(_) | TrySendError::Disconnected(_)) =
            self.queues[queue].try_send((id, make))
        {
            self.dropped[id.0] += 1;
        }
    }
}

/// Makes and sends what is in a queue until it is closed.
fn send(bridge: &Bridge, queue: &Receiver<(EndpointId, Make)>) {
    for (id, make) in queue {
        if let Some(message) = make() {
            // What is not sent is counted by the bridge.
            let _counted = bridge.publish(id, message);
        }
    }
}

/// The car on ROS 2's topics, as long as it lives.
pub struct Ros2Car {
    bridge: Arc<Bridge>,
    show: Show,
    threads: Vec<JoinHandle<()>>,
}

impl Ros2Car {
    /// Opens the topics of a configuration of which there is something to say in this run.
    ///
    /// # Errors
    /// When the transport does not start.
    pub fn start(config: &Config, pipeline: &Pipeline) -> anyhow::Result<Self> {
        let mapping = config.ros2_mapping()?;
        let mounts = Mounts::of(config, &mapping);
        for sensor in mounts.without_topic() {
            eprintln!("{sensor} is on no topic: name one in [ros2.topics.{sensor}]");
        }
        let mut options = Options::from_mapping(&mapping, Side::Vehicle).sending(&STACK);
        options.endpoints.retain(|endpoint| {
            endpoint.direction == Direction::Send && show::is_fed(config, &mapping, &mounts, &endpoint.name)
        });
        let bridge = Arc::new(Bridge::start(&options)?);
        let mut queues = Vec::new();
        let mut threads = Vec::new();
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
        let show = Show::new(config, pipeline, &mapping, &mounts, outbox);
        Ok(Self { bridge, show, threads })
    }

    /// Who has to be told what happens in the run.
    pub fn observer(&mut self) -> &mut dyn Observer {
        &mut self.show
    }

    /// Sends what still waits, and leaves.
    pub fn finish(self) -> Vec<Ros2Topic> {
        let Self { bridge, show, threads } = self;
        let dropped = show.finish();
        for thread in threads {
            // A panic there has been told by then; what was counted is still true.
            let _told = thread.join();
        }
        let topics = bridge
            .statistics()
            .into_iter()
            .zip(dropped)
            .map(|(topic, dropped)| Ros2Topic {
                topic: topic.topic,
                kind: topic.kind.type_name(),
                readers: topic.matched,
                sent: topic.published,
                not_sent: topic.not_published,
                dropped,
            })
            .collect();
        if let Some(bridge) = Arc::into_inner(bridge)
            && bridge.stop(STOP_WITHIN) == Stopped::Hanging
        {
            eprintln!("ROS 2's transport does not end in order; it goes with the program");
        }
        topics
    }
}

/// What became of a topic.
#[derive(Serialize, Clone, Debug)]
pub struct Ros2Topic {
    /// Its name in ROS.
    pub topic: String,
    /// Its type in ROS.
    #[serde(rename = "type")]
    pub kind: String,
    /// Who reads it at the end.
    pub readers: usize,
    /// Messages that were sent.
    pub sent: u64,
    /// Messages that the transport did not take.
    pub not_sent: u64,
    /// Messages that were dropped because too many waited.
    pub dropped: u64,
}

/// The topics as a table.
pub fn text(topics: &[Ros2Topic]) -> String {
    let head = ["topic", "readers", "sent", "not sent", "dropped"].map(str::to_owned).to_vec();
    let row = |t: &Ros2Topic| {
        let counts = [t.readers as u64, t.sent, t.not_sent, t.dropped].map(|n| n.to_string());
        std::iter::once(t.topic.clone()).chain(counts).collect()
    };
    align(&std::iter::once(head).chain(topics.iter().map(row)).collect::<Vec<_>>())
}
