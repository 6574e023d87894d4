//! Lane maps of files that describe lanes by their borders.

use std::collections::BTreeMap;

use swerve_map::{LaneId, Map};

use crate::import::Gap;
use crate::problem::Problems;
use crate::slope::Profile;

/// A lane map read from a file, and what the file has beside it.
#[derive(Clone, PartialEq, Debug)]
pub struct LaneMap {
    /// Format and version for output.
    pub format: String,
    /// True where traffic keeps to the left.
    pub left_hand: bool,
    /// The map, on the flat projection: metres, x east, y north.
    pub map: Map,
    /// Identity of each lane in the file.
    pub names: BTreeMap<LaneId, String>,
    /// Lanes by type of the file.
    pub types: BTreeMap<String, usize>,
    /// Other contents of the file by kind.
    pub contents: BTreeMap<String, usize>,
    /// Lowest and highest z of the file, metres; `None` if it has no heights.
    pub heights_m: Option<[f64; 2]>,
    /// Slopes of the lanes that are not level and whose heights the file has.
    pub profiles: BTreeMap<LaneId, Profile>,
    /// Lane ends that the file links and that are apart.
    pub gaps: Vec<Gap>,
    /// Problems that leave the geometry as it is.
    pub defects: Problems,
    /// Unknown elements by name.
    pub unknown: BTreeMap<String, usize>,
}

impl LaneMap {
    /// The lane of an identity in the file.
    pub fn lane_named(&self, name: &str) -> Option<LaneId> {
        self.names.iter().find(|(_, other)| *other == name).map(|(lane, _)| *lane)
    }

    /// Identity of a lane in the file; empty for lanes that are not in the map.
    pub fn name(&self, lane: LaneId) -> &str {
        self.names.get(&lane).map_or("", String::as_str)
    }
}
