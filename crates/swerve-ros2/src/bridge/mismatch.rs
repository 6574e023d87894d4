//! Descriptions of discovered writers and readers that cannot exchange messages with an endpoint.

use super::{Direction, Endpoint};

/// Maximum length of a type name that is repeated, characters: type names come from the network.
const NAME_MAX: usize = 200;

/// Quality of service that another node offers (a writer) or requests (a reader).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct OtherQos {
    /// True if it is reliable.
    pub(super) reliable: bool,
    /// True if it is transient local.
    pub(super) transient_local: bool,
}

/// ROS name of a type, `package/msg/Name`, from its name in DDS; other names are returned as they are.
fn ros_type(dds_name: &str) -> String {
    let printable: String =
        dds_name.chars().take(NAME_MAX).map(|c| if c.is_control() { '?' } else { c }).collect();
    let parts: Vec<&str> = printable.split("::").collect();
    match parts[..] {
        [package, kind, "dds_", name] => format!("{package}/{kind}/{}", name.trim_end_matches('_')),
        _ => printable,
    }
}

/// Difference between the type of a discovered writer or reader and that of the endpoint.
pub(super) fn of_type(endpoint: &Endpoint, other: &str) -> Option<String> {
    let Endpoint { topic, kind, direction, .. } = endpoint;
    let verb = match direction {
        Direction::Receive => "published",
        Direction::Send => "subscribed to",
    };
    (other != kind.dds_type_name())
        .then(|| format!("{topic} is {verb} as {}, expected {}", ros_type(other), kind.type_name()))
}

/// Difference between the quality of service of a discovered writer or reader and that of the endpoint, and the
/// setting that removes it.
pub(super) fn of_qos(endpoint: &Endpoint, other: OtherQos) -> String {
    let Endpoint { name, topic, qos, direction, .. } = endpoint;
    let words = |reliable: bool, transient_local: bool, by: [bool; 2]| {
        let reliability = if reliable { "reliable" } else { "best effort" };
        let durability = if transient_local { "transient local" } else { "volatile" };
        let both = [reliability, durability].into_iter().zip(by);
        both.filter(|(_, differs)| *differs).map(|(word, _)| word).collect::<Vec<_>>().join(" and ")
    };
    let (offered, requested) = match direction {
        Direction::Receive => {
            (other, OtherQos { reliable: qos.reliable, transient_local: qos.transient_local })
        }
        Direction::Send => (OtherQos { reliable: qos.reliable, transient_local: qos.transient_local }, other),
    };
    let by = [requested.reliable && !offered.reliable, requested.transient_local && !offered.transient_local];
    let (offers, requests) = (
        words(offered.reliable, offered.transient_local, by),
        words(requested.reliable, requested.transient_local, by),
    );
    let profile = match (direction, other.reliable, other.transient_local) {
        (Direction::Receive, false, _) => "sensor",
        (_, _, true) => "latched",
        _ => "default",
    };
    match direction {
        _ if by == [false; 2] => format!(
            "another node's quality of service on {topic} is incompatible in a policy that cannot be set here, \
             such as a deadline"
        ),
        Direction::Receive => format!(
            "a publisher of {topic} offers {offers}, expected {requests}: set `ros2.topics.{name}.qos = \"{profile}\"`"
        ),
        Direction::Send => format!(
            "a subscriber of {topic} expects {requests}, offered {offers}: set `ros2.topics.{name}.qos = \"{profile}\"`"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mapping::Qos;
    use crate::message::Kind;

    fn endpoint(direction: Direction, qos: Qos) -> Endpoint {
        let (name, topic) = ("odometry".to_owned(), "/odom".to_owned());
        Endpoint { name, topic, kind: Kind::Odometry, qos, direction, rate_max_hz: None }
    }

    #[test]
    fn mismatch_names_both_types() {
        let reader = endpoint(Direction::Receive, Qos::DEFAULT);
        let found = |other: &str| of_type(&reader, other);
        assert_eq!(found("nav_msgs::msg::dds_::Odometry_"), None);
        assert_eq!(
            found("geometry_msgs::msg::dds_::PoseStamped_").unwrap(),
            "/odom is published as geometry_msgs/msg/PoseStamped, expected nav_msgs/msg/Odometry"
        );
        let long = found(&format!("my type\n{}", "x".repeat(9000))).unwrap();
        assert!(long.starts_with("/odom is published as my type?xxx") && long.len() < 300, "{long}");
        assert_eq!(
            of_type(&endpoint(Direction::Send, Qos::DEFAULT), "HelloWorld").unwrap(),
            "/odom is subscribed to as HelloWorld, expected nav_msgs/msg/Odometry"
        );
    }

    #[test]
    fn mismatch_names_the_setting_that_removes_it() {
        let other = |reliable, transient_local| OtherQos { reliable, transient_local };
        let reader = |qos, offered| of_qos(&endpoint(Direction::Receive, qos), offered);
        assert_eq!(
            reader(Qos::DEFAULT, other(false, false)),
            "a publisher of /odom offers best effort, expected reliable: set `ros2.topics.odometry.qos = \"sensor\"`"
        );
        assert_eq!(
            reader(Qos::LATCHED, other(true, false)),
            "a publisher of /odom offers volatile, expected transient local: set `ros2.topics.odometry.qos = \"default\"`"
        );
        assert_eq!(
            reader(Qos::LATCHED, other(false, false)),
            "a publisher of /odom offers best effort and volatile, expected reliable and transient local: set \
             `ros2.topics.odometry.qos = \"sensor\"`"
        );
        assert_eq!(
            of_qos(&endpoint(Direction::Send, Qos::VEHICLE), other(true, true)),
            "a subscriber of /odom expects transient local, offered volatile: set `ros2.topics.odometry.qos = \"latched\"`"
        );
        assert!(reader(Qos::DEFAULT, other(true, false)).contains("such as a deadline"));
        // The settings that are proposed are compatible.
        for qos in [Qos::DEFAULT, Qos::LATCHED, Qos::VEHICLE, Qos::SENSOR] {
            for offered in [other(false, false), other(true, false), other(false, true)] {
                let message = reader(qos, offered);
                let proposed = Qos::NAMES.iter().find(|(name, _)| message.contains(&format!("\"{name}\"")));
                let Some((_, proposed)) = proposed else { continue };
                assert!(offered.reliable || !proposed.reliable, "{message}");
                assert!(offered.transient_local || !proposed.transient_local, "{message}");
            }
        }
    }
}
