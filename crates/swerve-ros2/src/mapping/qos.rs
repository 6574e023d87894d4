//! Quality of service of topics.

use serde::{Deserialize, Serialize};

/// Quality of service of a topic.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
pub struct Qos {
    /// True to resend lost messages. A reliable reader does not match a best-effort writer.
    pub reliable: bool,
    /// True to send earlier messages to late joiners.
    pub transient_local: bool,
    /// Depth of the history.
    pub depth: usize,
}

impl Qos {
    /// For sensors: the newest five messages, best-effort.
    pub const SENSOR: Self = Self { reliable: false, transient_local: false, depth: 5 };
    /// ROS default: the newest ten messages, reliable.
    pub const DEFAULT: Self = Self { reliable: true, transient_local: false, depth: 10 };
    /// For Autoware's vehicle topics: only the newest message, reliable.
    pub const VEHICLE: Self = Self { reliable: true, transient_local: false, depth: 1 };
    /// For maps and static transforms: the newest message, also for late joiners.
    pub const LATCHED: Self = Self { reliable: true, transient_local: true, depth: 1 };

    pub(crate) const NAMES: [(&str, Self); 4] = [
        ("sensor", Self::SENSOR),
        ("default", Self::DEFAULT),
        ("vehicle", Self::VEHICLE),
        ("latched", Self::LATCHED),
    ];
}
