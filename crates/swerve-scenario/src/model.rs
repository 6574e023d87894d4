use std::sync::Arc;

use swerve_geom::{FrenetPoint, Obb, Point2, Polyline, Pose2};
use swerve_msg::{ActorId, ActorKind, ActorNames, Extent};
use swerve_vehicle::Shape;

use crate::parse::usual_mass_kg;
use crate::{Course, Expectation, Road, Slippery, SumoWorld, Vary, Verdict};

/// A checked scenario: one returned by [`parse`](Self::parse) satisfies every rule that it reports problems for.
#[derive(Clone, PartialEq, Debug)]
pub struct Scenario {
    /// Short name, as used in file names.
    pub name: String,
    /// Description in one or two sentences.
    pub description: String,
    /// The road.
    pub road: Road,
    /// Patches of the ground with a friction of their own, in file order.
    pub slippery: Vec<Slippery>,
    /// Start, target speed and goal of the ego.
    pub ego: EgoStart,
    /// Identity of the ego in the run: [`ActorId::EGO`], but in the [view](Self::of_ego) of another ego.
    pub ego_id: ActorId,
    /// Name of the ego: "ego" if there is one.
    pub ego_name: String,
    /// Other egos, ordered by identity.
    pub other_egos: Vec<OtherEgo>,
    /// End conditions beside the goal.
    pub end: End,
    /// Other actors, ordered by identity: in file order, then those of the traffic once it is placed.
    pub actors: Vec<Actor>,
    /// Traffic on the map; `None` without traffic.
    pub traffic: Option<Traffic>,
    /// Simulation of SUMO that moves the other road users; `None` without one.
    pub sumo: Option<SumoWorld>,
    /// Expected results, per pipeline.
    pub expect: Vec<Expectation>,
    /// Variations applied by a seed; `None` for the scenario as written.
    pub draws: Option<Draws>,
    /// Text that it was read from, for processes that parse it again.
    pub text: Arc<str>,
}

/// Numbers of road users that drive and walk over the map by themselves.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Traffic {
    /// Number of cars.
    pub vehicles: usize,
    /// Number of pedestrians.
    pub pedestrians: usize,
    /// Number of cyclists.
    pub cyclists: usize,
    /// Identity of the first one: they follow the actors of the file.
    pub first_id: ActorId,
    /// Seed with which they were placed among the actors; `None` before that.
    pub seed: Option<u64>,
}

impl Traffic {
    /// Words of the names of its road users, such as `vehicle_1`: of vehicles, pedestrians and cyclists.
    pub const WORDS: [&str; 3] = ["vehicle", "pedestrian", "cyclist"];

    /// Returns true if one of its road users has this name.
    pub fn has_named(&self, name: &str) -> bool {
        let counts = [self.vehicles, self.pedestrians, self.cyclists];
        Self::WORDS.iter().zip(counts).any(|(word, count)| {
            let number = name.strip_prefix(word).and_then(|rest| rest.strip_prefix('_'));
            number.is_some_and(|text| {
                text.parse().is_ok_and(|n: usize| (1..=count).contains(&n) && n.to_string() == text)
            })
        })
    }

    /// Number of road users, if there is a place for each.
    pub fn count(&self) -> usize {
        self.vehicles + self.pedestrians + self.cyclists
    }
}

/// Start and goal of the ego.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct EgoStart {
    /// Start position of the centre of its outline along the road, metres.
    pub s_m: f64,
    /// Start position across the road, metres; positive to the left of the lane's centre.
    pub d_m: f64,
    /// Start heading relative to the road, radians.
    pub heading_rad: f64,
    /// Target speed, m/s.
    pub target_speed_mps: f64,
    /// Start speed, m/s; `None`: the target speed.
    pub start_speed_mps: Option<f64>,
    /// Goal: the run ends when the centre of its outline reaches this position along the road, metres.
    pub end_m: f64,
}

impl EgoStart {
    /// Start speed, m/s.
    pub fn start_speed(&self) -> f64 {
        self.start_speed_mps.unwrap_or(self.target_speed_mps)
    }

    /// Pose of the origin (rear axle) at the start along a line, for a vehicle of the given outline.
    pub fn pose(&self, line: &Polyline, shape: &Shape) -> Pose2 {
        on_road(line, self.s_m, self.d_m, self.heading_rad).ahead(-shape.center_ahead_m())
    }
}

/// Another ego, which a stack of its own drives on the same ground.
#[derive(Clone, PartialEq, Debug)]
pub struct OtherEgo {
    /// Identity in the run.
    pub id: ActorId,
    /// Unique name.
    pub name: String,
    /// Start, target speed and goal.
    pub start: EgoStart,
    /// The road with the way of this ego.
    pub road: Road,
}

impl OtherEgo {
    /// Pose of its origin (rear axle) at the start, for a vehicle of the given outline.
    pub fn pose(&self, shape: &Shape) -> Pose2 {
        self.start.pose(self.road.route().line(), shape)
    }
}

/// End conditions of the run beside the goal.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct End {
    /// Time after which the run ends with a timeout, seconds.
    pub timeout_s: f64,
    /// Time that the run continues after the first collision, seconds.
    pub after_collision_s: f64,
    /// End at standstill, for scenarios in which that is the goal.
    pub standstill: Option<Standstill>,
}

/// End condition: the ego has been at standstill near an actor for some time.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Standstill {
    /// Actor that the ego must be near; `None`: anywhere.
    pub near: Option<ActorId>,
    /// Largest distance between the centres, metres.
    pub within_m: f64,
    /// Minimum duration of the standstill, seconds.
    pub for_s: f64,
}

/// Another road user, or an object on or beside the road.
#[derive(Clone, PartialEq, Debug)]
pub struct Actor {
    /// Identity in the run.
    pub id: ActorId,
    /// Unique name.
    pub name: String,
    /// Kind of road user or object.
    pub kind: ActorKind,
    /// Size; pedestrians are upright cylinders, so length and width are equal.
    pub extent: Extent,
    /// Mass, kg; used in collisions.
    pub mass_kg: f64,
    /// Line that it is placed by and drives along, on a map; `None`: the line of the ego's lanes.
    pub line: Option<Arc<Polyline>>,
    /// Start position of the centre of its footprint along the line, metres.
    pub s_m: f64,
    /// Start position across the line, metres; positive to the left.
    pub d_m: f64,
    /// Start heading relative to the line, radians.
    pub heading_rad: f64,
    /// Event that starts its motion; it is at rest before. `None`: the start of the run.
    pub trigger: Option<Trigger>,
    /// Legs of its motion in sequence; it is at rest afterwards. Empty: it never moves.
    pub motion: Vec<Motion>,
    /// Half ranges of the seed's changes.
    pub vary: Vary,
}

/// The ego or an actor.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Subject {
    /// The ego vehicle.
    Ego,
    /// An actor.
    Actor(ActorId),
}

/// Event that starts an actor's motion; evaluated at every step of the world, on the state of that step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Trigger {
    /// The distance between its centre and that of `to` is at most `within_m` metres.
    Distance {
        /// The other end of the distance.
        to: Subject,
        /// Metres, centre to centre.
        within_m: f64,
    },
    /// A time since the start of the run has elapsed.
    Time {
        /// Time since the start of the run, seconds.
        at_s: f64,
    },
    /// The centre of `who` has reached `s_m` along the road.
    Reaches {
        /// The vehicle or actor that is observed.
        who: Subject,
        /// Position along the road, metres.
        s_m: f64,
    },
}

/// One leg of scripted motion.
#[derive(Clone, PartialEq, Debug)]
pub enum Motion {
    /// Remain at rest.
    Wait {
        /// Duration, seconds.
        for_s: f64,
    },
    /// Walk straight, facing the direction of motion.
    Walk {
        /// Constant speed, m/s.
        speed_mps: f64,
        /// Length of the leg, metres.
        distance_m: f64,
        /// Direction relative to the road at the start of the leg.
        direction: Direction,
        /// Turn from that direction by the seed, radians; positive to the left.
        turn_rad: f64,
    },
    /// Drive with a speed profile over time.
    Drive {
        /// Along the road or straight ahead.
        along: Along,
        /// Speed over time since the leg began: linear between the points, constant after the last. Never empty.
        speeds: Vec<SpeedPoint>,
        /// Length of the leg, metres; `None`: the leg ends only with a final standstill.
        distance_m: Option<f64>,
    },
    /// Follow straight lines between points, facing along them.
    Path {
        /// Constant speed, m/s.
        speed_mps: f64,
        /// Points after the present position. Never empty.
        points: Vec<RoadPlace>,
    },
    /// Recorded motion, the only leg of its actor.
    Track(Track),
}

/// Recorded motion: poses of the centre at a constant period. The actor is absent before the first and after the last.
#[derive(Clone, PartialEq, Debug)]
pub struct Track {
    /// Time of the first pose since the start of the run, seconds.
    pub from_s: f64,
    /// Period, seconds.
    pub step_s: f64,
    /// Poses in the map. Never empty.
    pub poses: Arc<[Pose2]>,
    /// True if a vehicle brakes for the ego, and for all that is not where it was recorded, by the intelligent driver
    /// model along the recorded path; false for exact replay.
    pub reacts: bool,
}

impl Motion {
    /// Largest speed, m/s.
    pub fn fastest_mps(&self) -> f64 {
        match self {
            Self::Wait { .. } => 0.0,
            Self::Walk { speed_mps, .. } | Self::Path { speed_mps, .. } => *speed_mps,
            Self::Drive { speeds, .. } => speeds.iter().map(|point| point.speed_mps).fold(0.0, f64::max),
            Self::Track(track) => {
                let ways_m = track.poses.windows(2).map(|two| two[0].point().distance(two[1].point()));
                ways_m.fold(0.0, f64::max) / track.step_s
            }
        }
    }
}

/// A direction relative to the road.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Direction {
    /// Across the road, to the left (+d).
    Left,
    /// Across the road, to the right (-d).
    Right,
    /// Along the road (+s).
    Ahead,
    /// Against the road (-s).
    Back,
}

/// Course of a [`Motion::Drive`] leg.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Along {
    /// The road, at constant distance from its line; in the opposite direction if the actor's heading is.
    Road,
    /// The actor's heading.
    Heading,
}

/// A point of a speed profile.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct SpeedPoint {
    /// Seconds since the leg began.
    pub at_s: f64,
    /// Speed, m/s.
    pub speed_mps: f64,
}

/// A position relative to the road.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct RoadPlace {
    /// Position along the road, metres.
    pub s_m: f64,
    /// Position across the road, metres; positive to the left.
    pub d_m: f64,
}

/// Random changes to a scenario.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Draws {
    /// Seed of the draws.
    pub seed: u64,
    /// Added to the ego's start along the road, metres.
    pub ego_start_m: f64,
    /// Added to the ego's start and target speed, m/s.
    pub ego_speed_mps: f64,
    /// Added to the distance of each actor's trigger, metres; zero for actors without a distance trigger.
    pub trigger_m: Vec<f64>,
}

/// Half of the range from which [`Draws::ego_start_m`] is drawn, metres.
pub(crate) const EGO_START_M: f64 = 0.5;

impl Scenario {
    /// Pose of the ego origin (rear axle) at the start, for a vehicle of the given outline.
    pub fn ego_pose(&self, line: &Polyline, shape: &Shape) -> Pose2 {
        self.ego.pose(line, shape)
    }

    /// Identities and names of all egos, ordered by identity.
    pub fn egos(&self) -> Vec<(ActorId, &str)> {
        let others = self.other_egos.iter().map(|other| (other.id, other.name.as_str()));
        let mut egos: Vec<_> =
            core::iter::once((self.ego_id, self.ego_name.as_str())).chain(others).collect();
        egos.sort_unstable();
        egos
    }

    /// The same scenario in the view of the ego with this identity: [`ego`](Self::ego) and [`road`](Self::road) are its
    /// own, and the others are [`other_egos`](Self::other_egos). `None` if there is no such ego.
    #[must_use]
    pub fn of_ego(&self, id: ActorId) -> Option<Self> {
        if id == self.ego_id {
            return Some(self.clone());
        }
        let mut view = self.clone();
        let index = view.other_egos.iter().position(|other| other.id == id)?;
        let OtherEgo { id, name, start, road } = view.other_egos.remove(index);
        let line = Arc::new(self.road.line());
        for actor in &mut view.actors {
            actor.line.get_or_insert_with(|| Arc::clone(&line));
            let who = match &mut actor.trigger {
                Some(Trigger::Distance { to: who, .. } | Trigger::Reaches { who, .. }) => who,
                Some(Trigger::Time { .. }) | None => continue,
            };
            *who = match *who {
                Subject::Ego => Subject::Actor(self.ego_id),
                Subject::Actor(actor) if actor == id => Subject::Ego,
                other => other,
            };
        }
        view.other_egos.push(OtherEgo {
            id: view.ego_id,
            name: view.ego_name,
            start: view.ego,
            road: view.road,
        });
        view.other_egos.sort_by_key(|other| other.id);
        (view.ego_id, view.ego_name, view.ego, view.road) = (id, name, start, road);
        Some(view)
    }

    /// The scenario for its ego alone, with vehicles of the given outline: the other egos are actors, which stand where
    /// they start. For logs, in which all of them have moved already.
    #[must_use]
    pub fn alone(mut self, shape: &Shape) -> Self {
        for other in core::mem::take(&mut self.other_egos) {
            let place = self.actors.partition_point(|actor| actor.id < other.id);
            let actor = Actor {
                id: other.id,
                name: other.name,
                kind: ActorKind::Car,
                extent: Extent { length_m: shape.length_m, width_m: shape.width_m, height_m: shape.height_m },
                mass_kg: 1_500.0,
                line: Some(Arc::new(other.road.line())),
                s_m: other.start.s_m,
                d_m: other.start.d_m,
                heading_rad: other.start.heading_rad,
                trigger: None,
                motion: Vec::new(),
                vary: Vary::default(),
            };
            self.actors.insert(place, actor);
            if let Some(draws) = &mut self.draws {
                draws.trigger_m.insert(place.min(draws.trigger_m.len()), 0.0);
            }
        }
        self
    }

    /// The expectation for the named pipeline: its own entry, else the one without a pipeline.
    pub fn expectation(&self, pipeline: &str) -> Option<&Expectation> {
        let own = self.expect.iter().find(|e| e.pipeline.as_deref() == Some(pipeline));
        own.or_else(|| self.expect.iter().find(|e| e.pipeline.is_none()))
    }

    /// Notes on expected verdicts that have been renamed or split since, as far as that is known without a run.
    pub fn old_verdicts(&self) -> Vec<String> {
        let is_alone = self.actors.is_empty() && self.other_egos.is_empty() && self.traffic.is_none();
        let told = |expect: &Expectation| match expect.verdict {
            Verdict::Avoided if is_alone => expect.renamed(Verdict::Completed),
            Verdict::Timeout => Some(
                "[expect] verdict `timeout`: a run that ends standing safely is called `stopped` now"
                    .to_owned(),
            ),
            _ => None,
        };
        self.expect.iter().filter_map(told).collect()
    }

    /// Number of road users of the traffic for which there was no place, once it is placed; 0 before that.
    pub fn left_out(&self) -> usize {
        let Some(traffic) = self.traffic.filter(|traffic| traffic.seed.is_some()) else { return 0 };
        let ids = traffic.first_id.0..traffic.first_id.0 + traffic.count() as u32;
        let placed = self.actors.iter().filter(|actor| ids.contains(&actor.id.0)).count();
        traffic.count() - placed
    }

    /// Facts in which a drive differs from the world that the scenario describes.
    pub fn warnings(&self) -> Vec<String> {
        let warnings = match &self.road.course {
            Course::Strip(_) => &[][..],
            Course::Map(course) => &course.warnings,
        };
        warnings.iter().map(|message| format!("map.file: {message}")).collect()
    }

    /// The actor with this identity.
    pub fn actor(&self, id: ActorId) -> Option<&Actor> {
        self.actors.binary_search_by_key(&id, |actor| actor.id).ok().map(|index| &self.actors[index])
    }

    /// Names of the actors, and of the other egos.
    pub fn names(&self) -> ActorNames {
        let actors = self.actors.iter().map(|actor| (actor.id, actor.name.clone()));
        actors.chain(self.other_egos.iter().map(|other| (other.id, other.name.clone()))).collect()
    }
}

impl Actor {
    /// An actor of the usual mass that stands at a pose of its centre until another driver than a script moves it.
    pub fn at_rest(id: ActorId, name: String, kind: ActorKind, extent: Extent, pose: Pose2) -> Self {
        let behind = pose.point() - pose.direction();
        Self {
            id,
            name,
            kind,
            extent,
            mass_kg: usual_mass_kg(kind),
            line: Polyline::new(&[behind, pose.point()]).ok().map(Arc::new),
            s_m: 1.0,
            d_m: 0.0,
            heading_rad: 0.0,
            trigger: None,
            motion: Vec::new(),
            vary: Vary::default(),
        }
    }

    /// Recorded motion, if it has one.
    pub fn track(&self) -> Option<&Track> {
        self.motion.iter().find_map(|motion| match motion {
            Motion::Track(track) => Some(track),
            _ => None,
        })
    }

    /// Line that it is placed by, given that of the road.
    pub fn line<'a>(&'a self, road: &'a Polyline) -> &'a Polyline {
        self.line.as_deref().unwrap_or(road)
    }

    /// Pose of its centre at the start of the run, given the line of the road.
    pub fn pose(&self, road: &Polyline) -> Pose2 {
        on_road(self.line(road), self.s_m, self.d_m, self.heading_rad)
    }

    /// Returns true if its body is an upright cylinder (of diameter `extent.width_m`) rather than a box.
    pub fn is_round(&self) -> bool {
        self.kind == ActorKind::Pedestrian
    }

    /// Distance on the ground between its body at the start and a rectangle, metres; zero if they touch.
    pub fn distance_to(&self, line: &Polyline, rectangle: &Obb) -> f64 {
        let pose = self.pose(line);
        if self.is_round() {
            (rectangle.distance_to_point(pose.point()) - 0.5 * self.extent.width_m).max(0.0)
        } else {
            rectangle.distance(&self.extent.footprint(pose))
        }
    }
}

/// Pose at a position of the road, rotated by `heading_rad` relative to the road's heading.
pub(crate) fn on_road(line: &Polyline, s_m: f64, d_m: f64, heading_rad: f64) -> Pose2 {
    let Point2 { x_m, y_m, .. } = line.to_map(FrenetPoint { s_m, d_m });
    Pose2::new(x_m, y_m, line.at(s_m).pose.heading_rad + heading_rad)
}
