//! Every message that the bridge knows, behind one type; which there are is in [`crate::catalogue`].

use core::fmt;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub use crate::catalogue::{AnyMessage, Kind};
use crate::check::Check;

/// A message with a ROS type name.
pub trait RosMessage:
    Check + Serialize + for<'de> Deserialize<'de> + Clone + PartialEq + fmt::Debug + Default
{
    /// Which it is.
    const KIND: Kind;

    /// The message in the type of all.
    fn into_any(self) -> AnyMessage;

    /// The message, if it is of this type.
    fn from_any(any: AnyMessage) -> Option<Self>;
}

/// Makes `Kind` and `AnyMessage` of a table of messages. A row says all that is known of a message beside its fields:
/// none of it can be left out.
macro_rules! messages {
    (@stamp $message:ident header) => { Some($message.header.stamp) };
    (@stamp $message:ident own) => { Some($message.stamp) };
    (@stamp $message:ident none) => {{ let _none = $message; None }};
    (@large small) => { false };
    (@large large) => { true };
    ($($variant:ident = $package:ident :: $name:ident : $stamp:ident, $size:ident;)*) => {
        /// Which message: its ROS package and name.
        #[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
        pub enum Kind { $(#[doc = concat!("`", stringify!($package), "/", stringify!($name), "`.")] $variant,)* }

        /// A message of any kind.
        #[derive(Clone, PartialEq, Debug)]
        #[expect(clippy::large_enum_variant, reason = "messages are moved through one queue, not kept in arrays")]
        pub enum AnyMessage { $(#[doc = concat!("`", stringify!($package), "/", stringify!($name), "`.")] $variant($package::$name),)* }

        impl Kind {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$variant,)*];

            /// The ROS package.
            pub fn package(self) -> &'static str {
                match self { $(Self::$variant => stringify!($package),)* }
            }

            /// The name within the package.
            pub fn name(self) -> &'static str {
                match self { $(Self::$variant => stringify!($name),)* }
            }

            /// Whether its messages are so large that many datagrams make one.
            pub fn is_large(self) -> bool {
                match self { $(Self::$variant => messages!(@large $size),)* }
            }

            /// A message of this kind with nothing in it.
            pub fn empty(self) -> AnyMessage {
                match self { $(Self::$variant => AnyMessage::$variant(Default::default()),)* }
            }
        }

        impl AnyMessage {
            /// Which it is.
            pub fn kind(&self) -> Kind {
                match self { $(Self::$variant(_) => Kind::$variant,)* }
            }

            /// The instant that it describes, by its writer's clock; `None` where it says none or several.
            pub fn stamp(&self) -> Option<builtin_interfaces::Time> {
                match self { $(Self::$variant(message) => messages!(@stamp message $stamp),)* }
            }

            /// Whether a reader may rely on its numbers, sizes and names.
            ///
            /// # Errors
            /// The first field that is not as it has to be.
            pub fn check(&self) -> Result<(), Invalid> {
                match self { $(Self::$variant(message) => {
                    check_numbers(message, <$package::$name as Check>::MAY_BE_NAN)?;
                    message.check()
                })* }
            }

            /// Sets the fields that have to fit one another, in an example of arbitrary values.
            pub(crate) fn fit(&mut self) {
                match self { $(Self::$variant(message) => message.fit(),)* }
            }
        }

        impl Serialize for AnyMessage {
            fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
                match self { $(Self::$variant(message) => message.serialize(serializer),)* }
            }
        }

        impl<'de> DeserializeSeed<'de> for Kind {
            type Value = AnyMessage;
            fn deserialize<D: Deserializer<'de>>(self, deserializer: D) -> Result<AnyMessage, D::Error> {
                match self { $(Self::$variant =>
                    Deserialize::deserialize(deserializer).map(AnyMessage::$variant),)* }
            }
        }

        $(impl RosMessage for $package::$name {
            const KIND: Kind = Kind::$variant;
            fn into_any(self) -> AnyMessage { AnyMessage::$variant(self) }
            fn from_any(any: AnyMessage) -> Option<Self> {
                match any { AnyMessage::$variant(message) => Some(message), _ => None }
            }
        })*
    };
}
pub(crate) use messages;

impl Kind {
    /// `package/msg/Name`, as ROS tools write it.
    pub fn type_name(self) -> String {
        format!("{}/msg/{}", self.package(), self.name())
    }

    /// `package::msg::dds_::Name_`, as it is on the wire.
    pub fn dds_type_name(self) -> String {
        format!("{}::msg::dds_::{}_", self.package(), self.name())
    }

    /// The kind of `package/msg/Name` or `package/Name`.
    pub fn parse(type_name: &str) -> Option<Self> {
        let (package, name) = type_name.split_once('/')?;
        let name = name.strip_prefix("msg/").unwrap_or(name);
        Self::ALL.iter().copied().find(|kind| kind.package() == package && kind.name() == name)
    }
}

impl Serialize for Kind {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.type_name())
    }
}

impl<'de> Deserialize<'de> for Kind {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        let name = String::deserialize(deserializer)?;
        Self::parse(&name).ok_or_else(|| serde::de::Error::custom(format!("no message is called {name}")))
    }
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/msg/{}", self.package(), self.name())
    }
}
