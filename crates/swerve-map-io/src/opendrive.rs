//! Road networks of ASAM OpenDRIVE, as in the file, and their exact evaluation.

mod evaluate;
mod furniture;
mod junction;
mod lane;
pub(crate) mod read;
mod road;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

pub use crate::curve::PieceKind;
pub use evaluate::{Edge, LaneEdges, Sample, SampleError, SurfacePoint};
pub use furniture::{Corner, Object, Outline, Physical, Signal, SignalReference, Validity};
pub use junction::{Connection, Controller, Junction, JunctionKind, LaneLink, Priority};
pub use lane::{Lane, LaneSection, LaneType, RoadMark, Speed};
pub use road::{Contact, Road, RoadLink, RoadType, Target};

use crate::problem::Problems;

/// Largest length of all roads together, metres.
pub const LENGTH_MAX_M: f64 = 2e6;

/// A road network.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Network {
    /// Header.
    pub header: Header,
    /// Roads, in the order of the file.
    pub roads: Vec<Road>,
    /// Junctions, in the order of the file.
    pub junctions: Vec<Junction>,
    /// Controllers of signals, in the order of the file.
    pub controllers: Vec<Controller>,
    /// Number of unknown elements by name.
    pub unknown: BTreeMap<String, usize>,
    /// Problems that leave the geometry as it is.
    pub defects: Problems,
    /// Index in `roads` by identity.
    pub(crate) road_of: BTreeMap<String, usize>,
}

/// Header of a file (clauses 8.5 and 6.3 of ASAM OpenDRIVE 1.8).
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Header {
    /// Revision, such as `(1, 8)`.
    pub revision: (u32, u32),
    /// Name of the network; may be empty.
    pub name: String,
    /// Program that wrote the file; may be empty.
    pub vendor: String,
    /// Projection as a PROJ text; may be empty. Not interpreted.
    pub geo_reference: String,
    /// Offset of the file's coordinates in the projected ones: x, y, z in metres, heading in radians (clause 8.5).
    pub offset: [f64; 4],
}

impl Network {
    /// Reads a network; `file` is its name in messages.
    ///
    /// # Errors
    /// All faults and defects of the file, if it has at least one fault.
    pub fn read(file: &str, text: &str) -> Result<Self, Problems> {
        read::network(file, text)
    }

    /// Road with this identity.
    pub fn road(&self, id: &str) -> Option<&Road> {
        self.road_of.get(id).map(|index| &self.roads[*index])
    }

    /// Junction with this identity.
    pub fn junction(&self, id: &str) -> Option<&Junction> {
        self.junctions.iter().find(|junction| junction.id == id)
    }
}
