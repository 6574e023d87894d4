use std::sync::Arc;

use serde::{Deserialize, Serialize};
use swerve_geom::{FrenetPoint, Obb, Point2, Polyline, Pose2};
use swerve_msg::{ActorId, ActorKind, Extent};
use swerve_text::{Document, Problems};
use swerve_vehicle::Shape;

use crate::{Draws, Expectation, Road, Verdict};

/// One scenario, checked: what [`parse`](Self::parse) returns satisfies every rule that it reports problems for.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Scenario {
    /// Short name, as in file names.
    pub name: String,
    /// One or two sentences for people.
    pub description: String,
    /// The road.
    pub road: Road,
    /// Where the ego starts, how fast it wants to go, where it is done.
    pub ego: EgoStart,
    /// Other ends of the run.
    pub end: End,
    /// Everybody else, in file order; the identity of each is its place, from 1.
    pub actors: Vec<Actor>,
    /// Expectations, per pipeline.
    pub expect: Vec<Expectation>,
    /// Changes that a seed made; `None` for the scenario as written.
    pub draws: Option<Draws>,
    /// The text that it was read from, for processes that read it once more.
    #[serde(skip)]
    pub text: Arc<str>,
}

/// Start and goal of the ego.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct EgoStart {
    /// Where the centre of its outline starts, along the road, metres.
    pub s_m: f64,
    /// The same across the road, metres; positive to the left of the lane's centre.
    pub d_m: f64,
    /// Its heading relative to the road there, radians.
    pub heading_rad: f64,
    /// The speed it is to drive at, m/s.
    pub target_speed_mps: f64,
    /// The speed it starts with, m/s; `None`: the target speed.
    pub start_speed_mps: Option<f64>,
    /// The run is over when the centre of its outline gets here, metres along the road.
    pub end_m: f64,
}

impl EgoStart {
    /// The speed it starts with, m/s.
    pub fn start_speed(&self) -> f64 {
        self.start_speed_mps.unwrap_or(self.target_speed_mps)
    }
}

/// Ends of the run beside the goal.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct End {
    /// After this long the run ends as timed out, seconds.
    pub timeout_s: f64,
    /// How long the run goes on after the first collision, seconds.
    pub after_collision_s: f64,
    /// Standing still for a while, where that is the aim.
    pub standstill: Option<Standstill>,
}

/// The ego has stood still near something for some time.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct Standstill {
    /// Index in [`Scenario::actors`] of the actor it must be near; `None`: anywhere.
    pub near: Option<usize>,
    /// Largest distance between the centres, metres.
    pub within_m: f64,
    /// For at least this long, seconds.
    pub for_s: f64,
}

/// Somebody or something else on or beside the road.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Actor {
    /// Unique name.
    pub name: String,
    /// Kind of road user or thing.
    pub kind: ActorKind,
    /// Its size; pedestrians are upright cylinders, so length and width are equal.
    pub extent: Extent,
    /// Its mass, kg; counts once it is hit.
    pub mass_kg: f64,
    /// Centre of its footprint along the road, metres.
    pub s_m: f64,
    /// The same across the road, metres; positive to the left of the lane's centre.
    pub d_m: f64,
    /// Heading relative to the road there, radians.
    pub heading_rad: f64,
    /// Event that sets it off; it stands still before. `None`: the start of the run.
    pub trigger: Option<Trigger>,
    /// Legs of its motion from then on, one after the other; it stands still afterwards. Empty: it never moves.
    pub motion: Vec<Motion>,
}

/// The ego or an actor.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Subject {
    /// The ego vehicle.
    Ego,
    /// An actor, by index in [`Scenario::actors`].
    Actor(usize),
}

/// Event that sets an actor off; judged at every step of the world, on the state of that step.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Trigger {
    /// The straight distance between its centre and that of `to` is at most `within_m` metres.
    Distance {
        /// Whose distance.
        to: Subject,
        /// Metres, centre to centre.
        within_m: f64,
    },
    /// This many seconds have passed since the start of the run.
    Time {
        /// Seconds.
        at_s: f64,
    },
    /// The centre of `who` has got to `s_m` along the road.
    Reaches {
        /// Whose place.
        who: Subject,
        /// Metres along the road.
        s_m: f64,
    },
}

/// One leg of scripted motion.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Motion {
    /// Stand still.
    Wait {
        /// Seconds.
        for_s: f64,
    },
    /// Go straight, turned that way.
    Walk {
        /// Constant speed, m/s.
        speed_mps: f64,
        /// How far, metres.
        distance_m: f64,
        /// Which way, relative to the road at the place where the leg starts.
        direction: Direction,
    },
    /// Drive with a speed that changes over time.
    Drive {
        /// Along the road or straight ahead.
        along: Along,
        /// Speed over time since the leg began: linear between the points, held after the last. Never empty.
        speeds: Vec<SpeedPoint>,
        /// The leg ends after this way, metres; `None`: only by coming to a stop for good.
        distance_m: Option<f64>,
    },
    /// Follow straight lines from point to point, turned along them.
    Path {
        /// Constant speed, m/s.
        speed_mps: f64,
        /// Points after the present place. Never empty.
        points: Vec<RoadPlace>,
    },
}

/// A direction relative to the road.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Direction {
    /// Across, to the left (+d).
    Left,
    /// Across, to the right (-d).
    Right,
    /// Along (+s).
    Ahead,
    /// Against (-s).
    Back,
}

/// Course of a drive.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Along {
    /// The road, at constant distance from its line; against it where the actor's heading is.
    Road,
    /// The actor's own heading.
    Heading,
}

/// A speed at a moment of a leg.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct SpeedPoint {
    /// Seconds since the leg began.
    pub at_s: f64,
    /// Speed, m/s.
    pub speed_mps: f64,
}

/// A place relative to the road.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct RoadPlace {
    /// Along the road, metres.
    pub s_m: f64,
    /// Across, metres; positive to the left.
    pub d_m: f64,
}

impl Scenario {
    /// From the text of a scenario file; `file` is only named in problems.
    ///
    /// # Errors
    /// All problems of the text, in the order of their lines.
    pub fn parse(file: &str, text: &str) -> Result<Self, Problems> {
        crate::parse::scenario(&Document::parse(file, text)?)
    }

    /// From a file.
    ///
    /// # Errors
    /// One problem when the file cannot be read, else as [`parse`](Self::parse).
    pub fn read(path: &std::path::Path) -> Result<Self, Problems> {
        crate::parse::scenario(&Document::read(path)?)
    }

    /// The pose of the ego origin (rear axle) at the start, for a car of the given outline.
    pub fn ego_pose(&self, line: &Polyline, shape: &Shape) -> Pose2 {
        let center = on_road(line, self.ego.s_m, self.ego.d_m, self.ego.heading_rad);
        center.ahead(-shape.center_ahead_m())
    }

    /// The expectation of the named pipeline: its own entry, else the one that names none.
    pub fn expectation(&self, pipeline: &str) -> Option<&Expectation> {
        let own = self.expect.iter().find(|e| e.pipeline.as_deref() == Some(pipeline));
        own.or_else(|| self.expect.iter().find(|e| e.pipeline.is_none()))
    }

    /// What is expected by a name of old that runs no longer have, or no longer all have; as far as that shows without one.
    pub fn old_verdicts(&self) -> Vec<String> {
        let told = |expect: &Expectation| match expect.verdict {
            Verdict::Avoided if self.actors.is_empty() => expect.renamed(Verdict::Completed),
            Verdict::Timeout => Some(
                "[expect] verdict `timeout`: a run that ends standing safely is called `stopped` now"
                    .to_owned(),
            ),
            _ => None,
        };
        self.expect.iter().filter_map(told).collect()
    }

    /// The identity of the actor at `index`.
    pub fn id(index: usize) -> ActorId {
        ActorId(u32::try_from(index + 1).unwrap_or(u32::MAX))
    }
}

impl Actor {
    /// Pose of its centre at the start.
    pub fn pose(&self, line: &Polyline) -> Pose2 {
        on_road(line, self.s_m, self.d_m, self.heading_rad)
    }

    /// Whether its body is an upright cylinder (of diameter `extent.width_m`), not a box.
    pub fn is_round(&self) -> bool {
        self.kind == ActorKind::Pedestrian
    }

    /// Distance on the ground between its body at the start and a rectangle, metres; zero when they touch.
    pub fn distance_to(&self, line: &Polyline, rectangle: &Obb) -> f64 {
        let pose = self.pose(line);
        if self.is_round() {
            (rectangle.distance_to_point(pose.point()) - 0.5 * self.extent.width_m).max(0.0)
        } else {
            rectangle.distance(&self.extent.footprint(pose))
        }
    }
}

/// The pose at a place of the road, turned by `heading_rad` from the road's own heading.
pub(crate) fn on_road(line: &Polyline, s_m: f64, d_m: f64, heading_rad: f64) -> Pose2 {
    let Point2 { x_m, y_m, .. } = line.to_map(FrenetPoint { s_m, d_m });
    Pose2::new(x_m, y_m, line.at(s_m).pose.heading_rad + heading_rad)
}
