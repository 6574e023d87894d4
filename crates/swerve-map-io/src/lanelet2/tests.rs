//! Maps made by `tests/reference/lanelet2/make.py`, Lanelet2 itself as the oracle, and invalid files.

mod bad;
mod converted;
mod junction;
mod marks;
mod oracle;

use swerve_map::{Lane, LaneId, LaneKind, Neighbour};

use super::{Lanelet2, read};

const JUNCTION: &str = include_str!("../../maps/junction.osm");
const ALLEY: &str = include_str!("../../maps/alley.osm");

fn good(text: &str) -> Lanelet2 {
    read("m.osm", text).unwrap_or_else(|problems| panic!("{problems}"))
}
