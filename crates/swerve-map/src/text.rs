//! Text form of a map.
//!
//! A map of lanes only is the list of its lanes. A map with other elements is a table: `lanes`, and those of `junctions`,
//! `signals`, `stop_lines`, `crossings` and `areas` that are not empty.

use core::fmt;

use serde::de::value::{MapAccessDeserializer, SeqAccessDeserializer};
use serde::de::{Error as _, MapAccess, SeqAccess, Visitor};
use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::{Area, Crossing, Features, Junction, Lane, Map, Signal, StopLine};

/// Fields of a map with other elements than lanes.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Table {
    lanes: Vec<Lane>,
    #[serde(default)]
    junctions: Vec<Junction>,
    #[serde(default)]
    signals: Vec<Signal>,
    #[serde(default)]
    stop_lines: Vec<StopLine>,
    #[serde(default)]
    crossings: Vec<Crossing>,
    #[serde(default)]
    areas: Vec<Area>,
}

#[derive(Serialize)]
struct TableRef<'m> {
    lanes: &'m [Lane],
    #[serde(flatten)]
    features: &'m Features,
}

impl Serialize for Map {
    fn serialize<S: Serializer>(&self, to: S) -> Result<S::Ok, S::Error> {
        if self.features().is_empty() {
            return self.lanes().serialize(to);
        }
        TableRef { lanes: self.lanes(), features: self.features() }.serialize(to)
    }
}

impl<'de> Deserialize<'de> for Map {
    fn deserialize<D: Deserializer<'de>>(from: D) -> Result<Self, D::Error> {
        from.deserialize_any(ListOrTable)
    }
}

struct ListOrTable;

impl<'de> Visitor<'de> for ListOrTable {
    type Value = Map;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a list of lanes, or a table with `lanes`")
    }

    fn visit_seq<A: SeqAccess<'de>>(self, list: A) -> Result<Map, A::Error> {
        let lanes = Vec::deserialize(SeqAccessDeserializer::new(list))?;
        Map::new(lanes).map_err(A::Error::custom)
    }

    fn visit_map<A: MapAccess<'de>>(self, table: A) -> Result<Map, A::Error> {
        let Table { lanes, junctions, signals, stop_lines, crossings, areas } =
            Table::deserialize(MapAccessDeserializer::new(table))?;
        let features = Features { junctions, signals, stop_lines, crossings, areas };
        Map::with_features(lanes, features).map_err(A::Error::custom)
    }
}

#[cfg(test)]
mod tests;
