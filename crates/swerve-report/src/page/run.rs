//! What the page of a run holds. Numbers are whole, in units that lose nothing an eye could see: instants in
//! microseconds since the run started, lengths in centimetres, angles in milliradians, speeds and accelerations in
//! millimetres per second (squared), errors of localization in millimetres, shares in thousandths. Tables stand column by column.

use serde::Serialize;

/// One run.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct RunPage {
    /// Name of the scenario.
    pub scenario: String,
    /// What drives.
    pub pipeline: String,
    /// The seed.
    pub seed: u64,
    /// One number that two equal runs share; empty where the run was cut off.
    pub digest: String,
    /// The command line that repeats it; empty where none does.
    pub command: String,
    /// Why none does.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub no_command: String,
    /// What is missing in the page, and why.
    pub notes: Vec<String>,
    /// The last instant.
    pub end: i64,
    /// The ground; none where nothing is known of it.
    pub road: Option<Road>,
    /// The ego's outline.
    pub shape: EgoShape,
    /// The ego's motion.
    pub ego: Ego,
    /// How far the poses that the stack drove by were off.
    pub located: Located,
    /// The actors as they truly were.
    pub actors: Vec<Actor>,
    /// What the stack followed, message by message.
    pub tracks: Vec<Tracks>,
    /// Where it expected that to go.
    pub predictions: Vec<Predictions>,
    /// Where it meant to drive.
    pub plans: Vec<Plan>,
    /// What it asked of the car.
    pub commands: Commands,
    /// Everything that runs, in the order of the first sign of it.
    pub operators: Vec<Operator>,
    /// Names of the streams.
    pub streams: Vec<String>,
    /// All steps, in the order of their ends.
    pub steps: Steps,
    /// All messages, in the order of publication.
    pub messages: Messages,
    /// Deadlines missed.
    pub misses: Marks,
    /// Frames and results dropped.
    pub drops: Marks,
    /// Pictures of the cameras.
    pub photos: Vec<Photo>,
    /// Number of older pictures left out.
    #[serde(skip_serializing_if = "is_zero")]
    pub photos_before: usize,
    /// Tables of what belongs to no single step.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<Table>,
    /// The whole configuration, as TOML.
    pub config: String,
    /// Keys of it that are not at their defaults.
    pub changed: Vec<Changed>,
    /// `metrics.json`, as it is; null where there is none.
    pub metrics: serde_json::Value,
}

fn is_zero(n: &usize) -> bool {
    *n == 0
}

/// The ground, as lines of x and y in turn.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Road {
    /// The way of the ego.
    pub line: Vec<i64>,
    /// The left border of the drivable ground.
    pub left: Vec<i64>,
    /// The right border.
    pub right: Vec<i64>,
    /// Distance between lane markings, 0 where unknown.
    pub lane: i64,
    /// Traffic lights.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lights: Vec<Light>,
}

/// A traffic light: green, yellow and red in turn, for ever.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Light {
    /// Its name.
    pub name: String,
    /// Where it stands.
    pub at: [i64; 2],
    /// Its stop line, from one end to the other.
    pub stop: [i64; 4],
    /// How long it is green, yellow and red.
    pub phases: [i64; 3],
    /// How far into its cycle, which begins with green, it is at the start.
    pub offset: i64,
}

/// A table under a heading of its own.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Table {
    /// What it is headed with.
    pub title: String,
    /// Names of its columns.
    pub columns: Vec<String>,
    /// Row by row.
    pub rows: Vec<Vec<String>>,
}

/// The ego's outline.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct EgoShape {
    /// Overall length.
    pub length: i64,
    /// Overall width.
    pub width: i64,
    /// From the origin forward to its middle.
    pub ahead: i64,
}

/// The ego's states.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Ego {
    /// Instants.
    pub t: Vec<i64>,
    /// Places of the origin.
    pub x: Vec<i64>,
    /// The same.
    pub y: Vec<i64>,
    /// Headings.
    pub h: Vec<i64>,
    /// Speeds.
    pub v: Vec<i64>,
    /// Accelerations along the car.
    pub a: Vec<i64>,
    /// Accelerations across it.
    pub lat: Vec<i64>,
    /// Angles of the front wheels.
    pub steer: Vec<i64>,
}

/// Errors of localization; empty where its poses are the simulator's own.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Located {
    /// Instants.
    pub t: Vec<i64>,
    /// Distances from the true place.
    pub off: Vec<i64>,
    /// Standard deviations that localization gives, along the worst direction; none where it gives none.
    pub sigma: Vec<Option<i64>>,
}

/// An actor and its way; it stands where it was last until the next instant.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Actor {
    /// Identity.
    pub id: u32,
    /// As the scenario calls it.
    pub name: String,
    /// `car`, `pedestrian` and so on.
    pub kind: String,
    /// Size.
    pub length: i64,
    /// The same.
    pub width: i64,
    /// Instants.
    pub t: Vec<i64>,
    /// Places of its centre.
    pub x: Vec<i64>,
    /// The same.
    pub y: Vec<i64>,
    /// Headings.
    pub h: Vec<i64>,
}

/// One message of tracks.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Tracks {
    /// When it was published.
    pub t: i64,
    /// What it describes.
    pub stamp: i64,
    /// Identity, x, y, heading, length, width, speed along x and y of each.
    pub of: Vec<[i64; 8]>,
}

/// One message of predictions.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Predictions {
    /// When it was published.
    pub t: i64,
    /// Of each its probability, then x and y in turn.
    pub of: Vec<Vec<i64>>,
}

/// One plan.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Plan {
    /// When it was published.
    pub t: i64,
    /// What it describes.
    pub stamp: i64,
    /// How it came about.
    pub status: String,
    /// x and y in turn.
    pub line: Vec<i64>,
}

/// Commands to the pedals and the wheel.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Commands {
    /// When each was published.
    pub t: Vec<i64>,
    /// Angle of the front wheels.
    pub steer: Vec<i64>,
    /// Throttle.
    pub throttle: Vec<i64>,
    /// Brake.
    pub brake: Vec<i64>,
}

/// An operator and the streams that it reads.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Operator {
    /// Its name.
    pub name: String,
    /// What it reads; empty where that is not known.
    pub inputs: Vec<Input>,
}

/// A stream that is read.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Input {
    /// Its name.
    pub stream: String,
    /// Over an edge that closes a loop: only what was published before the instant of the step.
    pub feedback: bool,
}

/// Steps.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Steps {
    /// Whose, as an index of the operators.
    pub operator: Vec<usize>,
    /// For which stamp.
    pub stamp: Vec<i64>,
    /// When each started.
    pub start: Vec<i64>,
    /// How long it took.
    pub took: Vec<i64>,
    /// The results that were of no use, as indices of the steps.
    pub late: Vec<usize>,
}

/// Messages.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Messages {
    /// On which stream, as an index of the streams.
    pub stream: Vec<usize>,
    /// Whose, as an index of the operators.
    pub operator: Vec<usize>,
    /// What instant each describes.
    pub stamp: Vec<i64>,
    /// When it was published.
    pub at: Vec<i64>,
    /// The stamp of the newest sensor frame that it derives from, -1 without.
    pub origin: Vec<i64>,
}

/// Things that befell a stamp.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Marks {
    /// Whose, as an index of the operators.
    pub operator: Vec<usize>,
    /// Which stamp.
    pub stamp: Vec<i64>,
    /// When.
    pub at: Vec<i64>,
    /// Why: the reaction to a miss, the reason of a drop.
    pub why: Vec<String>,
}

/// A picture of a camera.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Photo {
    /// Middle of its exposure.
    pub t: i64,
    /// Its stream.
    pub stream: String,
    /// The picture as an address that holds it.
    pub data: String,
}

/// A key that is not at its default.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Changed {
    /// Dotted.
    pub key: String,
    /// What it is; empty where it is not set.
    pub value: String,
    /// What it would be; empty where there is no default.
    pub default: String,
}

/// Where a stream of two runs first differs.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Parting {
    /// The stream.
    pub stream: String,
    /// Its messages in the first run, in the second, and how many are the same before the first that is not.
    pub counts: [usize; 3],
    /// When the first message that differs was published, by the run that did so first; none where all are the same.
    pub at: Option<i64>,
    /// Its stamp.
    pub stamp: Option<i64>,
    /// In what it differs: `content`, `instant`, `missing`.
    pub by: &'static str,
}
