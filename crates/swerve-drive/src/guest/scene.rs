//! State of a foreign world that gives only the poses of the ego and of everybody else, with what happened to the ego.

use std::collections::BTreeSet;

use anyhow::{bail, ensure};
use swerve_core::{Span, Time};
use swerve_geom::{LineTracker, Obb, Point, Point2, Transform, Vector, math};
use swerve_map::Route;
use swerve_msg::truth::{Actor, Collision, EgoTruth, EndReason, Infraction, InfractionKind, WorldState};
use swerve_msg::{ActorId, EgoState, Obstacle};
use swerve_scenario::{Course, Scenario};
use swerve_vehicle::Shape;

/// Range around the last place of the ego along its route in which it is looked for, metres.
const REACH_M: f64 = 15.0;

/// Judges a foreign world by the rules of the simulator: collisions, leaving the road, and the end.
pub struct Referee {
    shape: Shape,
    place: LineTracker,
    touching: BTreeSet<ActorId>,
    is_off_road: bool,
    first_collision: Option<Time>,
}

impl Referee {
    /// Referee of a drive that begins, of an ego with this outline.
    pub fn new(shape: Shape) -> Self {
        Self {
            shape,
            place: LineTracker::default(),
            touching: BTreeSet::new(),
            is_off_road: false,
            first_collision: None,
        }
    }

    /// State of the world after the ego and the others have moved, in the frame of the scenario's map.
    ///
    /// # Errors
    /// If a number is not finite or impossible on a road, or if the others are not ordered by identity, each once, from 1
    /// on.
    pub fn judge(
        &mut self,
        ego: EgoState,
        others: &[Obstacle],
        (scenario, route): (&Scenario, &Route),
    ) -> anyhow::Result<WorldState> {
        ensure!(
            ego.is_plausible(),
            "ego: expected finite numbers that are possible on a road, found {ego:?}"
        );
        check(others)?;
        Ok(self.state(ego, others, (scenario, route)))
    }

    /// As [`judge`](Self::judge), of numbers that are checked.
    pub(super) fn state(
        &mut self,
        ego: EgoState,
        others: &[Obstacle],
        (scenario, route): (&Scenario, &Route),
    ) -> WorldState {
        let outline = self.shape.footprint(ego.pose);
        let truth = truth(ego);
        let collisions = self.collisions(&truth, &outline, others);
        if self.first_collision.is_none() && !collisions.is_empty() {
            self.first_collision = Some(ego.stamp);
        }
        let mut infractions = Vec::new();
        if self.leaves_road(&ego, &outline, (scenario, route)) {
            infractions.push(Infraction { stamp: ego.stamp, kind: InfractionKind::LeftRoad });
        }
        let ended = self.ended(&ego, &outline, (scenario, route));
        let actors = others.iter().map(actor).collect();
        WorldState { stamp: ego.stamp, ego: truth, actors, collisions, infractions, ended }
    }

    /// Contacts of the ego that began in this state.
    fn collisions(&mut self, ego: &EgoTruth, outline: &Obb, others: &[Obstacle]) -> Vec<Collision> {
        let touches = |other: &&Obstacle| actor(other).gap_m(outline) <= 0.0;
        let touching: Vec<&Obstacle> = others.iter().filter(touches).collect();
        let now: BTreeSet<ActorId> = touching.iter().map(|other| other.id).collect();
        let before = core::mem::replace(&mut self.touching, now);
        let (sin, cos) = math::sin_cos(ego.state.pose.heading_rad);
        let (vx, vy) = (ego.state.speed_mps * cos, ego.state.speed_mps * sin);
        let begun = touching.into_iter().filter(|other| !before.contains(&other.id));
        begun
            .map(|other| {
                let way = other.pose.point() - outline.center.point();
                let (dx, dy) = (vx - other.velocity_mps.x, vy - other.velocity_mps.y);
                let closing = (dx * way.x + dy * way.y) / way.norm().max(1e-9);
                Collision {
                    stamp: ego.state.stamp,
                    parties: [ActorId::EGO, other.id],
                    impulse_n_s: 0.0,
                    closing_speed_mps: closing.max(0.0),
                    speeds_mps: [ego.state.speed_mps, other.velocity_mps.norm()],
                }
            })
            .collect()
    }

    /// True if the ego leaves the drivable ground in this state.
    fn leaves_road(&mut self, ego: &EgoState, outline: &Obb, (scenario, route): (&Scenario, &Route)) -> bool {
        let s_m = self.place.locate(route.line(), ego.pose).s_m;
        let near = |corner: Point2| route.project_near(corner, s_m, REACH_M);
        let is_beside = route.borders().margin_m(outline.corners(), near) < 0.0;
        let is_ground = match &scenario.road.course {
            Course::Strip(_) => false,
            Course::Map(course) => outline.corners().iter().all(|corner| course.is_ground(*corner)),
        };
        let was_off = core::mem::replace(&mut self.is_off_road, is_beside && !is_ground);
        self.is_off_road && !was_off
    }

    fn ended(
        &mut self,
        ego: &EgoState,
        outline: &Obb,
        (scenario, route): (&Scenario, &Route),
    ) -> Option<EndReason> {
        let s_m = self.place.locate(route.line(), ego.pose).s_m;
        let center_s_m = route.project_near(outline.center.point(), s_m, REACH_M).s_m;
        let over = |since: Time, for_s: f64| ego.stamp - since >= Span::from_secs(for_s);
        if self.first_collision.is_some_and(|since| over(since, scenario.end.after_collision_s)) {
            Some(EndReason::Collision)
        } else if center_s_m >= scenario.ego.end_m {
            Some(EndReason::Goal)
        } else {
            over(Time::ZERO, scenario.end.timeout_s).then_some(EndReason::Timeout)
        }
    }
}

/// Refuses obstacles that cannot be on a road, and identities that are not unique.
pub(super) fn check(obstacles: &[Obstacle]) -> anyhow::Result<()> {
    if let Some(k) = obstacles.iter().position(|obstacle| !obstacle.is_plausible()) {
        bail!(
            "obstacles[{k}]: expected finite numbers that are possible on a road, found {:?}",
            obstacles[k]
        );
    }
    for pair in obstacles.windows(2) {
        let [a, b] = [pair[0].id.0, pair[1].id.0];
        ensure!(a < b, "obstacles: identity {b} after {a}: expected them in order, each once");
    }
    ensure!(
        obstacles.first().is_none_or(|first| first.id != ActorId::EGO),
        "obstacles[0]: identity 0 is the ego's: expected 1 or more"
    );
    Ok(())
}

/// An obstacle as an actor that stands on the ground.
fn actor(obstacle: &Obstacle) -> Actor {
    let &Obstacle { id, kind, pose, extent, velocity_mps, .. } = obstacle;
    Actor { id, kind, pose, z_m: 0.0, extent, velocity_mps }
}

/// The ego on flat ground. Its specific force is that of its accelerations.
fn truth(state: EgoState) -> EgoTruth {
    let origin = Point::new(state.pose.x_m, state.pose.y_m, 0.0);
    let (sin, cos) = math::sin_cos(state.pose.heading_rad);
    EgoTruth {
        id: ActorId::EGO,
        map_from_ego: Transform::from_roll_pitch_yaw(origin, 0.0, 0.0, state.pose.heading_rad),
        state,
        velocity_mps: Vector::new(state.speed_mps * cos, state.speed_mps * sin, 0.0),
        specific_force_mps2: Vector::new(state.accel_mps2, state.lateral_accel_mps2, 9.81),
        angular_velocity_radps: Vector::new(0.0, 0.0, state.yaw_rate_radps),
    }
}
