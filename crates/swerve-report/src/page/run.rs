//! Data of a run's page. Numbers are integers, in units finer than the page can show: instants in microseconds since
//! the run started, lengths in centimetres, angles in milliradians, speeds and accelerations in millimetres per second
//! (squared), localization errors in millimetres, shares in thousandths. Tables are stored column by column.

use serde::Serialize;

/// Data of one run.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct RunPage {
    /// Scenario name.
    pub scenario: String,
    /// Name of the driving stack's pipeline.
    pub pipeline: String,
    /// Random seed.
    pub seed: u64,
    /// Digest shared by equal runs; empty if the run was interrupted.
    pub digest: String,
    /// Command line that repeats the run; empty if there is none.
    pub command: String,
    /// Reason why no command line repeats the run.
    #[serde(skip_serializing_if = "String::is_empty")]
    pub no_command: String,
    /// Notes on data missing from the page, with reasons.
    pub notes: Vec<String>,
    /// Last instant.
    pub end: i64,
    /// Road; `None` if unknown.
    pub road: Option<Road>,
    /// The ego's outline.
    pub shape: EgoShape,
    /// States of the ego.
    pub ego: Ego,
    /// Errors of the poses that the stack used.
    pub located: Located,
    /// True poses of the actors.
    pub actors: Vec<Actor>,
    /// Tracks, message by message.
    pub tracks: Vec<Tracks>,
    /// Predictions, message by message.
    pub predictions: Vec<Predictions>,
    /// Plans.
    pub plans: Vec<Plan>,
    /// Commands to the vehicle.
    pub commands: Commands,
    /// All operators, in order of first appearance.
    pub operators: Vec<Operator>,
    /// Names of the streams.
    pub streams: Vec<String>,
    /// All steps, ordered by end time.
    pub steps: Steps,
    /// All messages, ordered by publication time.
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
    /// States of the behaviour planner; absent if it has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub behaviour: Option<Behaviour>,
    /// Tables of data that belongs to no single step.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub tables: Vec<Table>,
    /// The whole configuration, as TOML.
    pub config: String,
    /// Configuration keys that differ from their defaults.
    pub changed: Vec<Changed>,
    /// Content of `metrics.json`; null if there is none.
    pub metrics: serde_json::Value,
}

fn is_zero(n: &usize) -> bool {
    *n == 0
}

/// Road as polylines of alternating x and y.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Road {
    /// Route of the ego.
    pub line: Vec<i64>,
    /// Left border of the drivable area.
    pub left: Vec<i64>,
    /// Right border of the drivable area.
    pub right: Vec<i64>,
    /// Distance between lane markings; 0 if unknown.
    pub lane: i64,
    /// Traffic lights.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub lights: Vec<Light>,
}

/// Traffic light with an endless cycle of phases.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Light {
    /// Name.
    pub name: String,
    /// Position, x and y.
    pub at: [i64; 2],
    /// Stop line, x and y of both ends.
    pub stop: [i64; 4],
    /// Names of the burning lamps, `off` without one, and durations.
    pub phases: Vec<(&'static str, i64)>,
    /// Elapsed time of the cycle at the start of the run.
    pub offset: i64,
}

/// States of the behaviour planner in a run.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Behaviour {
    /// The first changes, in order of time.
    pub changes: Vec<StateChange>,
    /// Number of later changes, which are left out.
    pub more: usize,
    /// States in words with their times, milliseconds, the longest first.
    pub times: Vec<(&'static str, i64)>,
}

/// Change of the state.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct StateChange {
    /// Instant.
    pub t: i64,
    /// State in words.
    pub state: &'static str,
    /// Name of the road user that is the reason; empty without one.
    pub because: String,
}

/// Table with a heading.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Table {
    /// Heading.
    pub title: String,
    /// Column names.
    pub columns: Vec<String>,
    /// Rows.
    pub rows: Vec<Vec<String>>,
}

/// Outline of the ego.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize)]
pub struct EgoShape {
    /// Overall length.
    pub length: i64,
    /// Overall width.
    pub width: i64,
    /// Distance from the vehicle origin forward to the centre.
    pub ahead: i64,
}

/// States of the ego.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Ego {
    /// Instants.
    pub t: Vec<i64>,
    /// x of the vehicle origin.
    pub x: Vec<i64>,
    /// y of the vehicle origin.
    pub y: Vec<i64>,
    /// Headings.
    pub h: Vec<i64>,
    /// Speeds.
    pub v: Vec<i64>,
    /// Longitudinal accelerations.
    pub a: Vec<i64>,
    /// Lateral accelerations.
    pub lat: Vec<i64>,
    /// Steering angles of the front wheels.
    pub steer: Vec<i64>,
}

/// Localization errors; empty if the stack uses the simulator's own poses.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Located {
    /// Instants.
    pub t: Vec<i64>,
    /// Distances from the true position.
    pub off: Vec<i64>,
    /// Standard deviations reported by localization, along the worst direction; `None` where it reports none.
    pub sigma: Vec<Option<i64>>,
}

/// Actor and its poses; each pose holds until the next instant.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Actor {
    /// Identity.
    pub id: u32,
    /// Name in the scenario.
    pub name: String,
    /// Type: `car`, `pedestrian` and so on.
    pub kind: String,
    /// Length.
    pub length: i64,
    /// Width.
    pub width: i64,
    /// Instants.
    pub t: Vec<i64>,
    /// x of its centre.
    pub x: Vec<i64>,
    /// y of its centre.
    pub y: Vec<i64>,
    /// Headings.
    pub h: Vec<i64>,
}

/// One message of tracks.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Tracks {
    /// Time of publication.
    pub t: i64,
    /// Instant that it describes.
    pub stamp: i64,
    /// Identity, x, y, heading, length, width, velocity along x and y of each track.
    pub of: Vec<[i64; 8]>,
}

/// One message of predictions.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Predictions {
    /// Time of publication.
    pub t: i64,
    /// Probability of each prediction, then alternating x and y.
    pub of: Vec<Vec<i64>>,
}

/// One plan.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Plan {
    /// Time of publication.
    pub t: i64,
    /// Instant that it describes.
    pub stamp: i64,
    /// Plan status.
    pub status: String,
    /// Alternating x and y.
    pub line: Vec<i64>,
}

/// Commands: steering, throttle and brake.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Commands {
    /// Times of publication.
    pub t: Vec<i64>,
    /// Steering angles of the front wheels.
    pub steer: Vec<i64>,
    /// Throttle.
    pub throttle: Vec<i64>,
    /// Brake.
    pub brake: Vec<i64>,
}

/// Operator with its input streams.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Operator {
    /// Its name.
    pub name: String,
    /// Inputs; empty if unknown.
    pub inputs: Vec<Input>,
}

/// Input stream of an operator.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Input {
    /// Its name.
    pub stream: String,
    /// True for an edge that closes a loop: the step sees only messages published before its instant.
    pub feedback: bool,
}

/// Steps.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Steps {
    /// Index of the operator.
    pub operator: Vec<usize>,
    /// Stamp that the step handles.
    pub stamp: Vec<i64>,
    /// Start time.
    pub start: Vec<i64>,
    /// Run time.
    pub took: Vec<i64>,
    /// Indices of the steps whose results came too late to be used.
    pub late: Vec<usize>,
}

/// Messages.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Messages {
    /// Index of the stream.
    pub stream: Vec<usize>,
    /// Index of the publishing operator.
    pub operator: Vec<usize>,
    /// Instant that the message describes.
    pub stamp: Vec<i64>,
    /// Time of publication.
    pub at: Vec<i64>,
    /// Stamp of the newest sensor frame that the message derives from; -1 if none.
    pub origin: Vec<i64>,
}

/// Events at stamps: missed deadlines or drops.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Marks {
    /// Index of the operator.
    pub operator: Vec<usize>,
    /// Stamp concerned.
    pub stamp: Vec<i64>,
    /// Time of the event.
    pub at: Vec<i64>,
    /// Reaction to a missed deadline, or reason for a drop.
    pub why: Vec<String>,
}

/// Camera picture.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct Photo {
    /// Middle of the exposure.
    pub t: i64,
    /// Stream name.
    pub stream: String,
    /// Data URI of the picture.
    pub data: String,
}

/// Configuration key that differs from its default.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Changed {
    /// Dotted key.
    pub key: String,
    /// Value; empty if not set.
    pub value: String,
    /// Default value; empty if there is none.
    pub default: String,
}

/// First difference between two runs on one stream.
#[derive(Clone, PartialEq, Eq, Debug, Default, Serialize)]
pub struct Parting {
    /// Stream name.
    pub stream: String,
    /// Number of messages in the first run, in the second run, and before the first difference.
    pub counts: [usize; 3],
    /// Time of publication of the first message that differs, in the run that published it first; `None` if the runs
    /// agree.
    pub at: Option<i64>,
    /// Stamp of that message.
    pub stamp: Option<i64>,
    /// Kind of difference: `content`, `instant` or `missing`.
    pub by: &'static str,
}
