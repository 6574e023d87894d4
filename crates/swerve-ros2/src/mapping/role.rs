use super::Qos;
use crate::message::Kind;

pub use crate::catalogue::Role;

/// Who publishes a topic.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Side {
    /// The vehicle, or the simulator in its place: what is measured and reported.
    Vehicle,
    /// The stack: what is commanded and shown.
    Stack,
}

/// The part that a topic plays in a drive.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Purpose {
    /// A measurement of a sensor.
    Sensor,
    /// The ego's place and motion, by localization.
    Localization,
    /// The vehicle's report of itself.
    Report,
    /// A person's say in who drives.
    Switch,
    /// Time and frames.
    Frames,
    /// The other road users, by somebody else's perception.
    Perception,
    /// A command that moves the vehicle.
    Motion,
    /// A command that goes with motion: gear and lights.
    Auxiliary,
    /// The stack's intention, for the eye.
    Display,
}

/// All that is known of a role.
pub(crate) struct Description {
    pub(crate) name: &'static str,
    pub(crate) side: Side,
    pub(crate) purpose: Purpose,
    /// Types that it can have; the first where none is given.
    pub(crate) kinds: &'static [Kind],
    pub(crate) qos: Qos,
    /// Five times the usual rate.
    pub(crate) rate_max_hz: f64,
}

/// Makes `Role` of a table of roles.
macro_rules! roles {
    ($($role:ident = $name:literal: $side:ident, $purpose:ident, [$($kind:ident),+], $qos:expr, $rate:literal;)*) => {
        /// The use that a topic is of.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
        pub enum Role { $(#[doc = concat!("`", $name, "`.")] $role,)* }

        impl Role {
            /// All of them, in the order of the table.
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
    /// As it is written in a table.
    pub fn name(self) -> &'static str {
        self.description().name
    }

    /// Who publishes it.
    pub fn side(self) -> Side {
        self.description().side
    }

    /// The part that it plays.
    pub fn purpose(self) -> Purpose {
        self.description().purpose
    }

    /// Types that it can have.
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
