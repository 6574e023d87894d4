//! The ego of a logged world state.

use core::fmt;

use serde::de::{Deserialize, Deserializer, Error, IgnoredAny, MapAccess, Visitor};
use swerve_msg::truth::EgoTruth;

/// The ego of a logged world state. The other actors, which follow it and are most of the state, are not decoded.
pub(super) struct EgoOnly(pub(super) EgoTruth);

impl<'de> Deserialize<'de> for EgoOnly {
    fn deserialize<D: Deserializer<'de>>(state: D) -> Result<Self, D::Error> {
        struct Keys;
        impl<'de> Visitor<'de> for Keys {
            type Value = EgoOnly;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a state of the world")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<EgoOnly, A::Error> {
                while let Some(key) = map.next_key::<String>()? {
                    if key == "ego" {
                        return map.next_value().map(EgoOnly);
                    }
                    map.next_value::<IgnoredAny>()?;
                }
                Err(Error::missing_field("ego"))
            }
        }
        state.deserialize_map(Keys)
    }
}
