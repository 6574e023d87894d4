//! Roles of topics.

use super::Qos;
use crate::message::Kind;

pub use crate::catalogue::Role;

/// Publishing side of a topic.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Side {
    /// The vehicle, or its simulator: measurements and reports.
    Vehicle,
    /// The stack: commands and visualisation.
    Stack,
}

/// Purpose of a topic.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Purpose {
    /// A measurement of a sensor.
    Sensor,
    /// Pose and motion of the ego from localization.
    Localization,
    /// A report of the vehicle.
    Report,
    /// A switch by which a person enables or stops the stack.
    Switch,
    /// Time and frames.
    Frames,
    /// Other road users from external perception.
    Perception,
    /// A command that moves the vehicle.
    Motion,
    /// A command that goes with motion: gear and lights.
    Auxiliary,
    /// Visualisation of the stack.
    Display,
}

/// Properties of a role.
pub(crate) struct Description {
    pub(crate) name: &'static str,
    pub(crate) side: Side,
    pub(crate) purpose: Purpose,
    /// Possible types; the first is the default.
    pub(crate) kinds: &'static [Kind],
    pub(crate) qos: Qos,
    /// Rate limit: five times the usual rate.
    pub(crate) rate_max_hz: f64,
}

/// Generates `Role` from a table of roles.
macro_rules! roles {
    ($($role:ident = $name:literal: $side:ident, $purpose:ident, [$($kind:ident),+], $qos:expr, $rate:literal;)*) => {
        /// Role of a topic.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
        pub enum Role { $(#[doc = concat!("`", $name, "`.")] $role,)* }

        impl Role {
            /// All roles, in table order.
            pub const ALL: &[Self] = &[$(Self::$role,)*];

            pub(crate) fn description(self) -> &'static Description {
                match self { $(Self::$role => const { &Description {
                    name: $name,
                    side: Side::$side,
                    purpose: Purpose::$purpose,
                    kinds: &[$(Kind::$kind),+],
                    qos: $qos,
                    rate_max_hz: $rate,
                } },)* }
            }
        }
    };
}
pub(crate) use roles;

impl Role {
    /// Name in configurations.
    pub fn name(self) -> &'static str {
        self.description().name
    }

    /// Publishing side.
    pub fn side(self) -> Side {
        self.description().side
    }

    /// Purpose.
    pub fn purpose(self) -> Purpose {
        self.description().purpose
    }

    /// Possible types.
    pub fn kinds(self) -> &'static [Kind] {
        self.description().kinds
    }

    pub(super) fn qos(self) -> Qos {
        self.description().qos
    }

    pub(super) fn rate_max_hz(self) -> Option<f64> {
        Some(self.description().rate_max_hz)
    }
}

pub(super) fn names() -> Vec<(&'static str, Role)> {
    Role::ALL.iter().map(|role| (role.name(), *role)).collect()
}
