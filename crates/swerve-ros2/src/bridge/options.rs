//! Options of a bridge: topics, directions, quality of service.

use super::ServiceSide;
use crate::clock::ClockParams;
use crate::env::Network;
use crate::mapping::{Mapping, Qos, ServiceMap, Side, TopicMap};
use crate::message::Kind;
use serde::{Deserialize, Serialize};

/// Direction of a topic.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub enum Direction {
    /// Subscribed.
    Receive,
    /// Published.
    Send,
}

/// One topic of a bridge.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Endpoint {
    /// Name in the mapping.
    pub name: String,
    /// ROS name.
    pub topic: String,
    /// The type of its messages.
    pub kind: Kind,
    /// Quality of service.
    pub qos: Qos,
    /// Direction.
    pub direction: Direction,
    /// Rate limit, Hz; `None` for no limit.
    pub rate_max_hz: Option<f64>,
}

/// Options of a bridge.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Options {
    /// Name of the node.
    pub node: String,
    /// Namespace of the node, beginning with a slash.
    pub namespace: String,
    /// Domain and interfaces.
    pub network: Network,
    /// Parameters for judging stamps by the host's clock; `None` for simulated time.
    pub judge_stamps: Option<ClockParams>,
    /// Mapping of services in DDS.
    pub service_map: ServiceMap,
    /// Side and name of Autoware's control mode service; `None` without it.
    pub control_mode_service: Option<(ServiceSide, String)>,
    /// The topics.
    pub endpoints: Vec<Endpoint>,
}

impl Options {
    /// Topics of a mapping as seen from one side: it publishes its own and subscribes to those of the other side.
    ///
    /// Small messages are always published reliably, as REP 2003 recommends for sensors: best-effort readers match a
    /// reliable writer, but reliable readers would not match a best-effort one.
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

    /// Returns the options with these endpoints published regardless of side: for a simulator that shows its own
    /// stack's plan.
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
    fn each_side_sends_the_topics_that_the_other_receives() {
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
