//! Signals and objects (ASAM OpenDRIVE 1.8, chapters 13 and 14).

/// Lanes for which a signal or object holds (`<validity>`).
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Validity {
    /// First lane.
    pub from_lane: i32,
    /// Last lane.
    pub to_lane: i32,
}

/// A traffic sign, traffic light or stop line.
#[derive(Clone, PartialEq, Debug)]
pub struct Signal {
    /// Identity in the network.
    pub id: String,
    /// Name; may be empty.
    pub name: String,
    /// Position along the road, metres.
    pub s_m: f64,
    /// Position to the left of the reference line, metres.
    pub t_m: f64,
    /// Height over the road, metres.
    pub z_offset_m: f64,
    /// True for a signal that changes, such as a traffic light.
    pub dynamic: bool,
    /// Direction of traffic that it is for: `+`, `-` or `none`.
    pub orientation: String,
    /// Country of the catalogue; may be empty.
    pub country: String,
    /// Type in the catalogue of the country.
    pub kind: String,
    /// Subtype in the catalogue of the country.
    pub subtype: String,
    /// Value, such as a speed; `None` if not given.
    pub value: Option<f64>,
    /// Unit of the value; may be empty.
    pub unit: String,
    /// Heading relative to the direction of the orientation, radians.
    pub heading_rad: f64,
    /// Width and height, metres; 0 if not given.
    pub size_m: [f64; 2],
    /// Lanes that it is for; empty for all.
    pub validity: Vec<Validity>,
    /// Position of the signal itself, if it is not where the signal holds (`<positionRoad>`, `<positionInertial>`).
    pub physical: Option<Physical>,
    /// Signals that depend on it or that it depends on (`<dependency>`, `<reference>`), by identity.
    pub related: Vec<String>,
}

/// Position of a signal that is not where it holds.
#[derive(Clone, PartialEq, Debug)]
pub enum Physical {
    /// Beside a road.
    Road {
        /// Identity of the road.
        road: String,
        /// Along the road, metres.
        s_m: f64,
        /// To the left of its reference line, metres.
        t_m: f64,
        /// Height over the road, metres.
        z_offset_m: f64,
    },
    /// In the frame of the file, metres.
    Inertial([f64; 3]),
}

/// A signal of another road that holds for this one, too.
#[derive(Clone, PartialEq, Debug)]
pub struct SignalReference {
    /// Identity of the signal.
    pub id: String,
    /// Position along this road, metres.
    pub s_m: f64,
    /// Position to the left of the reference line, metres.
    pub t_m: f64,
    /// Direction of traffic that it is for: `+`, `-` or `none`.
    pub orientation: String,
    /// Lanes that it is for; empty for all.
    pub validity: Vec<Validity>,
}

/// An object on or beside a road.
#[derive(Clone, PartialEq, Debug)]
pub struct Object {
    /// Identity in the network.
    pub id: String,
    /// Name; may be empty.
    pub name: String,
    /// Kind, such as `crosswalk`, `pole`, `building`.
    pub kind: String,
    /// Variant of the kind, such as `signalLines` of `roadMark`; may be empty.
    pub subtype: String,
    /// Direction of traffic that it is for: `+`, `-` or `none`; may be empty.
    pub orientation: String,
    /// Position along the road, metres.
    pub s_m: f64,
    /// Position to the left of the reference line, metres.
    pub t_m: f64,
    /// Height of the origin over the road, metres.
    pub z_offset_m: f64,
    /// Heading relative to the road, radians.
    pub heading_rad: f64,
    /// Length, width and height, metres; for a round object, its diameter twice; 0 if not given.
    pub size_m: [f64; 3],
    /// Outlines.
    pub outlines: Vec<Outline>,
    /// Lanes that it is for; empty for all.
    pub validity: Vec<Validity>,
    /// Number of `<repeat>` records.
    pub repeats: usize,
}

/// Outline of an object.
#[derive(Clone, PartialEq, Debug)]
pub struct Outline {
    /// True if the last corner is joined with the first.
    pub closed: bool,
    /// Corners in order.
    pub corners: Vec<Corner>,
}

/// Corner of an outline, metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Corner {
    /// Along and to the left of the road (`<cornerRoad>`).
    Road {
        /// Along the road.
        s_m: f64,
        /// To the left of the reference line.
        t_m: f64,
    },
    /// In the frame of the object (`<cornerLocal>`).
    Local {
        /// Forward.
        u_m: f64,
        /// To the left.
        v_m: f64,
    },
}
