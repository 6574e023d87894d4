//! Roads (ASAM OpenDRIVE 1.8, chapter 10).

use super::{LaneSection, Object, PieceKind, Signal, SignalReference, Speed};
use crate::cubic::{Cubics, holding};
use crate::curve::ReferenceLine;

/// End of a road.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum Contact {
    /// At s = 0.
    Start,
    /// At the road's length.
    End,
}

/// Continuation of a road.
#[derive(Clone, PartialEq, Debug)]
pub struct RoadLink {
    /// The other element.
    pub target: Target,
    /// Identity of the other element.
    pub id: String,
}

/// Kind of a road's continuation.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Target {
    /// An end of another road.
    Road(Contact),
    /// A place within another road, in a virtual junction: its lane sections are split there.
    Within {
        /// Along the other road, metres.
        s_m: f64,
    },
    /// A junction.
    Junction,
}

/// Type of a road from a position on (`<type>` of a road).
#[derive(Clone, PartialEq, Debug)]
pub struct RoadType {
    /// Begin along the road, metres.
    pub s_m: f64,
    /// Type, such as `town` or `motorway`.
    pub name: String,
    /// Speed limit of the type.
    pub speed: Option<Speed>,
}

/// A road.
#[derive(Clone, PartialEq, Debug)]
pub struct Road {
    /// Identity in the network.
    pub id: String,
    /// Name; may be empty.
    pub name: String,
    /// Length of the reference line, metres.
    pub length_m: f64,
    /// Junction that the road is in; `None` for a road between junctions.
    pub junction: Option<String>,
    /// True where traffic keeps to the left (`rule="LHT"`).
    pub left_hand: bool,
    /// Continuation at s = 0.
    pub predecessor: Option<RoadLink>,
    /// Continuation at the end.
    pub successor: Option<RoadLink>,
    /// Types, in ascending order.
    pub types: Vec<RoadType>,
    /// Lane sections, in ascending order; at least one.
    pub sections: Vec<LaneSection>,
    /// Signals.
    pub signals: Vec<Signal>,
    /// Signals of other roads that hold here, too.
    pub signal_references: Vec<SignalReference>,
    /// Objects.
    pub objects: Vec<Object>,
    pub(crate) line: ReferenceLine,
    /// Elevation of the reference line, metres.
    pub(crate) elevation: Cubics,
    /// Roll of the cross-section about the reference line, radians.
    pub(crate) superelevation: Cubics,
    pub(crate) lateral: LateralShape,
    /// Position of the centre lane, metres to the left of the reference line.
    pub(crate) lane_offset: Cubics,
}

/// Height of the surface over the plane of the superelevation (`<shape>`, and `<crossfall>` of 1.4 and 1.5).
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct LateralShape {
    /// Profiles over t at positions along the road, linear between them.
    pub(crate) shapes: Vec<(f64, Cubics)>,
    /// Slope down from the reference line to the left and to the right, radians.
    pub(crate) crossfall: [Cubics; 2],
}

impl Road {
    /// Kinds of the pieces of the reference line, in order.
    pub fn pieces(&self) -> impl Iterator<Item = PieceKind> + '_ {
        self.line.0.iter().map(crate::curve::Piece::kind)
    }

    /// Continuation at an end.
    pub fn link_at(&self, end: Contact) -> Option<&RoadLink> {
        match end {
            Contact::Start => self.predecessor.as_ref(),
            Contact::End => self.successor.as_ref(),
        }
    }

    /// Ends of a lane section along the road, metres.
    pub fn section_span_m(&self, section: usize) -> Option<[f64; 2]> {
        let begin = self.sections.get(section)?.s_m;
        Some([begin, self.sections.get(section + 1).map_or(self.length_m, |next| next.s_m)])
    }

    /// Lane section at `s_m`, the first or last beyond the ends.
    pub fn section_at(&self, s_m: f64) -> usize {
        self.sections.partition_point(|section| section.s_m <= s_m).max(1) - 1
    }

    /// True if traffic of a lane with this identity runs along the road, false if against it.
    pub fn runs_forward(&self, lane: i32) -> bool {
        (lane < 0) != self.left_hand
    }

    /// Lowest speed limit between two positions, m/s; of the road's types.
    pub(crate) fn type_speed_mps(&self, [from, to]: [f64; 2]) -> Option<f64> {
        let held = holding(&self.types, |one| one.s_m, [from, to]);
        held.iter().filter_map(|one| one.speed?.limit_mps).reduce(f64::min)
    }
}
