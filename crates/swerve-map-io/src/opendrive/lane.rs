//! Lane sections and lanes (ASAM OpenDRIVE 1.8, chapter 11).

use crate::cubic::{Cubics, holding};

/// A stretch of a road with the same lanes (`<laneSection>`).
#[derive(Clone, PartialEq, Debug)]
pub struct LaneSection {
    /// Begin along the road, metres.
    pub s_m: f64,
    /// Lanes to the left of the centre lane, from inside to outside: 1, 2, ...
    pub left: Vec<Lane>,
    /// Lanes to the right of the centre lane, from inside to outside: -1, -2, ...
    pub right: Vec<Lane>,
    /// Marks of the centre lane.
    pub center_marks: Vec<RoadMark>,
}

impl LaneSection {
    /// Lane with this identity; `None` for the centre lane.
    pub fn lane(&self, id: i32) -> Option<&Lane> {
        let side = if id > 0 { &self.left } else { &self.right };
        side.get((id.unsigned_abs() as usize).checked_sub(1)?)
    }

    /// Lanes from the left to the right.
    pub fn lanes(&self) -> impl Iterator<Item = &Lane> {
        self.left.iter().rev().chain(&self.right)
    }
}

/// A lane of a lane section.
#[derive(Clone, PartialEq, Debug)]
pub struct Lane {
    /// Identity: positive to the left, negative to the right of the centre lane.
    pub id: i32,
    /// Type.
    pub kind: LaneType,
    /// Lanes that it continues from, in the section or road before.
    pub predecessors: Vec<i32>,
    /// Lanes that continue it, in the section or road after.
    pub successors: Vec<i32>,
    /// Marks at the outer border.
    pub marks: Vec<RoadMark>,
    /// Speed limits by position along the road (`<speed>`), metres.
    pub speeds: Vec<(f64, Speed)>,
    /// Heights of the inner and outer border over the road by position along the road (`<height>`), metres.
    pub heights: Vec<(f64, [f64; 2])>,
    pub(crate) geometry: LaneGeometry,
}

/// Lateral extent of a lane.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum LaneGeometry {
    /// Width over arc length (clause 11.6.1), metres.
    Width(Cubics),
    /// Position of the outer border to the left of the reference line (clause 11.6.2), metres.
    Border(Cubics),
}

impl Lane {
    pub(crate) fn records(&self) -> &Cubics {
        match &self.geometry {
            LaneGeometry::Width(records) | LaneGeometry::Border(records) => records,
        }
    }

    /// Lowest speed limit between two positions, m/s; of the lane's own records.
    pub(crate) fn speed_mps(&self, [from, to]: [f64; 2]) -> Option<f64> {
        let held = holding(&self.speeds, |one| one.0, [from, to]);
        held.iter().filter_map(|(_, speed)| speed.limit_mps).reduce(f64::min)
    }
}

/// A speed limit.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Speed {
    /// Limit, m/s; `None` for `no limit` and `undefined`.
    pub limit_mps: Option<f64>,
}

/// A mark at a lane's outer border (`<roadMark>`).
#[derive(Clone, PartialEq, Debug)]
pub struct RoadMark {
    /// Begin along the road, metres.
    pub s_m: f64,
    /// Type, such as `solid` or `broken`; `none` where the mark ends.
    pub kind: String,
    /// Colour, such as `white` or `standard`.
    pub color: String,
    /// Width, metres; `None` if not given.
    pub width_m: Option<f64>,
    /// Lane changes that it permits: `increase`, `decrease`, `both`, `none`; empty if not given.
    pub lane_change: String,
}

macro_rules! lane_types {
    ($($variant:ident = $name:literal),+ $(,)?) => {
        /// Type of a lane (clause 11.7.1). The standard deprecates some of them.
        #[derive(Clone, PartialEq, Eq, PartialOrd, Ord, Debug)]
        pub enum LaneType {
            $(#[doc = concat!("`", $name, "`")] $variant,)+
            /// A type that the standard does not have.
            Other(String),
        }

        impl LaneType {
            /// Names of all types of the standard.
            pub const NAMES: &'static [&'static str] = &[$($name),+];

            /// Type with a name.
            pub fn of(name: &str) -> Self {
                match name {
                    $($name => Self::$variant,)+
                    other => Self::Other(other.to_owned()),
                }
            }

            /// Name in a file.
            pub fn name(&self) -> &str {
                match self {
                    $(Self::$variant => $name,)+
                    Self::Other(name) => name,
                }
            }
        }
    };
}
lane_types! {
    Driving = "driving", Shoulder = "shoulder", Border = "border", Stop = "stop", NoUse = "none",
    Restricted = "restricted", Parking = "parking", Median = "median", Biking = "biking", Sidewalk = "sidewalk",
    Walking = "walking", Curb = "curb", Exit = "exit", Entry = "entry", OnRamp = "onRamp", OffRamp = "offRamp",
    ConnectingRamp = "connectingRamp", SlipLane = "slipLane", Bidirectional = "bidirectional", Bus = "bus",
    Taxi = "taxi", Hov = "HOV", Tram = "tram", Rail = "rail", RoadWorks = "roadWorks", Shared = "shared",
    Special1 = "special1", Special2 = "special2", Special3 = "special3", MotorwayEntry = "mwyEntry",
    MotorwayExit = "mwyExit",
}
