//! Topics of known vehicles, from the rows of [`crate::catalogue`].

use super::{Qos, Role, TopicMap};
use crate::message::Kind;

pub use crate::catalogue::Vehicle;

/// A topic of a vehicle.
#[derive(Clone, Copy)]
pub(crate) struct Row {
    role: Role,
    topic: &'static str,
    frame: &'static str,
    /// Type for drive-by-wire topics; otherwise the default type of the role.
    by_wire: Option<Kind>,
}

/// A topic with the default type of its role; `frame` is empty if its messages have none.
pub(crate) const fn row(role: Role, topic: &'static str, frame: &'static str) -> Row {
    Row { role, topic, frame, by_wire: None }
}

/// A topic of a drive-by-wire interface with a vendor-specific type.
pub(crate) const fn by_wire(role: Role, topic: &'static str, kind: Kind) -> Row {
    Row { role, topic, frame: "", by_wire: Some(kind) }
}

/// Generates `Vehicle` from a table of vehicles and the tables of their topics.
macro_rules! vehicles {
    (@one $vehicle:ident) => { () };
    ($($(#[$attribute:meta])* $vehicle:ident = $name:literal: [$($table:ident),+];)*) => {
        /// A vehicle with known topics.
        #[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
        pub enum Vehicle { $($(#[$attribute])* $vehicle,)* }

        impl Vehicle {
            pub(crate) const NAMES: [(&str, Self); [$(vehicles!(@one $vehicle)),*].len()] =
                [$(($name, Self::$vehicle),)*];

            /// Name in configurations.
            pub fn name(self) -> &'static str {
                match self { $(Self::$vehicle => $name,)* }
            }

            pub(crate) fn tables(self) -> &'static [&'static [Row]] {
                match self { $(Self::$vehicle => &[$(&$table),+],)* }
            }
        }
    };
}
pub(crate) use vehicles;

impl Row {
    fn topic(self) -> TopicMap {
        let Self { role, topic, frame, by_wire } = self;
        let qos = match by_wire {
            None => role.qos(),
            Some(_) if role == Role::Enabled => Qos::LATCHED,
            // Both vendors' interfaces publish and subscribe with a queue of two or more, volatile.
            Some(_) => Qos { depth: 2, ..Qos::DEFAULT },
        };
        TopicMap {
            name: role.name().to_owned(),
            role,
            topic: topic.to_owned(),
            kind: by_wire.unwrap_or(role.kinds()[0]),
            qos,
            frame: frame.to_owned(),
            rate_max_hz: role.rate_max_hz(),
        }
    }
}

/// Topics of a vehicle, ordered by name.
pub(super) fn topics(vehicle: Vehicle) -> Vec<TopicMap> {
    let rows = vehicle.tables().iter().flat_map(|table| table.iter());
    let mut topics: Vec<TopicMap> = rows.map(|row| row.topic()).collect();
    topics.sort_by(|a, b| a.name.cmp(&b.name));
    topics
}
