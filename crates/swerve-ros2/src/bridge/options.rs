//! Settings of a bridge: which topics, which way, delivered how.

use super::ServiceSide;
use crate::clock::ClockParams;
use crate::env::Network;
use crate::mapping::{Mapping, Qos, ServiceMap, Side, TopicMap};
use crate::message::Kind;
use serde::{Deserialize, Serialize};

/// Which way a topic goes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Direction {
    /// From the others to us.
    Receive,
    /// From us to the others.
    Send,
}

/// One topic of a bridge.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Endpoint {
    /// Its name here.
    pub name: String,
    /// Its name in ROS.
    pub topic: String,
    /// The type of its messages.
    pub kind: Kind,
    /// How it is delivered.
    pub qos: Qos,
    /// Which way.
    pub direction: Direction,
    /// Faster than this is a flood; `None` for any.
    pub rate_max_hz: Option<f64>,
}

/// Settings of a bridge.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Options {
    /// Name of the node.
    pub node: String,
    /// Namespace of the node, beginning with a slash.
    pub namespace: String,
    /// Where to look for others.
    pub network: Network,
    /// Judge the stamps of what comes by the host's clock; `None` where the stamps are simulated time.
    pub judge_stamps: Option<ClockParams>,
    /// How services are mapped.
    pub service_map: ServiceMap,
    /// Call or offer Autoware's service for the control mode, of this name.
    pub control_mode_service: Option<(ServiceSide, String)>,
    /// The topics.
    pub endpoints: Vec<Endpoint>,
}

impl Options {
    /// The topics of a mapping as seen from one side: it sends its own and receives the other's.
    ///
    /// Small messages are always sent reliably: a reader that does not want that takes them too, but one that does
    /// would not be matched otherwise (REP 2003 has sensors publish so).
    pub fn from_mapping(mapping: &Mapping, side: Side) -> Self {
        let endpoint = |topic: &TopicMap| {
            let direction = if topic.role.side() == side { Direction::Send } else { Direction::Receive };
            let reliable = topic.qos.reliable || (direction == Direction::Send && !topic.kind.is_large());
            Endpoint {
                name: topic.name.clone(),
                topic: topic.topic.clone(),
                kind: topic.kind,
                qos: Qos { reliable, ..topic.qos },
                direction,
                rate_max_hz: topic.rate_max_hz,
            }
        };
        Self {
            node: mapping.node.clone(),
            namespace: mapping.namespace.clone(),
            network: mapping.network,
            judge_stamps: None,
            service_map: mapping.service_map,
            control_mode_service: None,
            endpoints: mapping.topics.iter().map(endpoint).collect(),
        }
    }

    /// The same with these endpoints sent, whoever sends them else: a simulator that shows its own stack's plan.
    #[must_use]
    pub fn sending(mut self, names: &[&str]) -> Self {
        for endpoint in self.endpoints.iter_mut().filter(|endpoint| names.contains(&endpoint.name.as_str())) {
            endpoint.direction = Direction::Send;
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapping::Vehicle;

    #[test]
    fn each_side_sends_what_the_other_receives() {
        let mapping = Mapping::of(Vehicle::Autoware, Network::default());
        let [vehicle, stack] = [Side::Vehicle, Side::Stack].map(|side| Options::from_mapping(&mapping, side));
        assert_eq!(vehicle.endpoints.len(), stack.endpoints.len());
        for (ours, theirs) in vehicle.endpoints.iter().zip(&stack.endpoints) {
            assert_eq!((&ours.topic, ours.kind), (&theirs.topic, theirs.kind));
            assert_ne!(ours.direction, theirs.direction);
            let [writer, reader] =
                if ours.direction == Direction::Send { [ours, theirs] } else { [theirs, ours] };
            assert!(writer.qos.reliable || !reader.qos.reliable, "{} would never match", ours.topic);
        }
        let imu = vehicle.endpoints.iter().find(|endpoint| endpoint.name == "imu").unwrap();
        let lidar = vehicle.endpoints.iter().find(|endpoint| endpoint.name == "lidar").unwrap();
        assert!(imu.qos.reliable && !lidar.qos.reliable);
        let shown = vehicle.sending(&["trajectory"]);
        let direction = |name: &str| shown.endpoints.iter().find(|e| e.name == name).unwrap().direction;
        assert_eq!((direction("trajectory"), direction("command")), (Direction::Send, Direction::Receive));
    }
}
