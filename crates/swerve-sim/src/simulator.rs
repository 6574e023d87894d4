use std::sync::Arc;

use glam::Vec3;
use rapier3d::prelude::{ColliderHandle, PhysicsWorld};
use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_geom::{Obb, Point2, Vector2};
use swerve_map::Map;
use swerve_msg::truth::{Actor, Collision, Infraction, InfractionKind, WorldState};
use swerve_msg::{ActorId, Command, Route};
use swerve_scenario::Scenario;
use swerve_world::{Driver, Movement, View, World};

use crate::bodies::{self, Body, Mode, Placed};
use crate::contact::{self, Motion2};
use crate::contacts::{Contacts, PARTED_M, PATIENCE, Touch};
use swerve_vehicle::VehicleParams;

use crate::ego::EgoCar;
use crate::rules::Rules;
use crate::scripted::Scripted;

/// Simulation parameters.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct SimParams {
    /// Length of one step. Default 5 ms (200 Hz); range 1 ms to 20 ms.
    pub dt: Span,
    /// The ego vehicle.
    pub vehicle: VehicleParams,
}

impl Default for SimParams {
    fn default() -> Self {
        Self { dt: Span::from_ms(5), vehicle: VehicleParams::default() }
    }
}

/// Reason why a scenario cannot be simulated with the given parameters.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum SimError {
    /// The step is too long for contacts or too short for `f32`.
    #[error("a world step of {0} is outside 1 ms to 20 ms")]
    Step(Span),
    /// An actor overlaps the ego at the start.
    #[error("the ego starts inside the actor \"{0}\"")]
    EgoInside(String),
    /// The ego does not start on the road.
    #[error("the ego starts {0:.2} m outside the drivable ground")]
    OffRoad(f64),
}

/// One run of one scenario, step by step.
pub struct Simulator {
    scenario: Scenario,
    params: SimParams,
    route: Route,
    map: Arc<Map>,
    world: PhysicsWorld,
    ego: EgoCar,
    ego_collider: ColliderHandle,
    actors: Vec<Player>,
    contacts: Contacts,
    rules: Rules,
    state: WorldState,
    /// The last command; the car keeps the one before if it is not finite.
    command: Command,
}

/// Body and driver of one actor, in addition to its state.
struct Player {
    body: Body,
    driver: Box<dyn Driver>,
    /// Last position along the road, metres.
    s_m: f64,
}

/// Maximum distance along the road in one step, metres.
const STEP_MAX_M: f64 = 5.0;

/// World just before a step: the ego, the actors, and those that were hit.
struct Before {
    actors: Vec<Actor>,
    /// Indices of the actors that were hit.
    loose: Vec<usize>,
    outline: Obb,
    motion: Motion2,
    speed_mps: f64,
}

/// Gap across which physics may act on bodies, metres.
const MARGIN_M: f64 = 0.05;

impl Simulator {
    /// Creates a run of the scenario with the random draws of `seed`, at instant 0. A scenario that already contains
    /// draws is run unchanged.
    ///
    /// # Errors
    /// If the step is out of range, or the ego (in the outline of `params`) does not start on free road.
    pub fn new(scenario: &Scenario, params: &SimParams, seed: u64) -> Result<Self, SimError> {
        Self::exact(scenario.drawn(seed), params)
    }

    /// Creates a run of the scenario exactly as given, without random draws.
    ///
    /// # Errors
    /// Same as [`new`](Self::new).
    pub fn exact(scenario: Scenario, params: &SimParams) -> Result<Self, SimError> {
        if params.dt < Span::from_ms(1) || params.dt > Span::from_ms(20) {
            return Err(SimError::Step(params.dt));
        }
        let route = scenario.road.route();
        let pose = scenario.ego_pose(route.line(), &params.vehicle.shape);
        free_road(&scenario, &route, &params.vehicle.shape.footprint(pose))?;
        let mut world = PhysicsWorld::new();
        world.gravity = Vec3::new(0.0, 0.0, -9.81);
        world.integration_parameters.dt = params.dt.as_secs() as f32;
        bodies::ground(&mut world, scenario.road.friction);
        let ego = EgoCar::spawn(&mut world, &params.vehicle, pose, scenario.ego.start_speed());
        bodies::foresee_contacts(&mut world, ego.handle());
        let ego_collider = ego.collider();
        let state = WorldState {
            stamp: Time::ZERO,
            ego: ego.truth(&world),
            actors: Vec::new(),
            collisions: Vec::new(),
            infractions: Vec::new(),
            ended: None,
        };
        let rules = Rules::new(&scenario);
        let map = scenario.road.map();
        let mut simulator = Self {
            scenario,
            params: params.clone(),
            route,
            map,
            world,
            ego,
            ego_collider,
            actors: Vec::new(),
            contacts: Contacts::default(),
            rules,
            state,
            command: Command::default(),
        };
        simulator.populate();
        simulator.show();
        Ok(simulator)
    }

    fn populate(&mut self) {
        let line = Arc::new(self.route.line().clone());
        for actor in &self.scenario.actors {
            let driver = Scripted::new(actor, &self.scenario, &line, self.params.dt);
            // An actor that moves from the start has a speed in the first state, too.
            let movement = driver.movement(Time::ZERO, Time::ZERO);
            let movement = movement.unwrap_or_else(|| Movement::at_rest(actor.pose(&line)));
            let at = actor.line(&line).project_near(movement.pose.point(), actor.s_m, STEP_MAX_M);
            let state = Actor {
                id: actor.id,
                kind: actor.kind,
                pose: movement.pose,
                z_m: self.scenario.road.ground_m(at.d_m),
                extent: actor.extent,
                velocity_mps: movement.velocity_mps,
            };
            let body = Body::insert(&mut self.world, &state, actor.mass_kg);
            self.actors.push(Player { body, driver: Box::new(driver), s_m: at.s_m });
            self.state.actors.push(state);
        }
        let actors = &self.state.actors;
        for [i, j] in contact::near_pairs(actors, 0.0) {
            if contact::gap_of_actors_m(&actors[i], &actors[j]) == 0.0 {
                self.contacts.touch_from_start([actors[i].id, actors[j].id]);
            }
        }
    }

    /// Gives an actor another driver, in place of the script of the scenario, before the first step; the driver observes
    /// the state at instant 0. Returns false, and changes nothing, if there is no such actor or it never moves
    /// (`static`).
    pub fn set_driver(&mut self, id: ActorId, mut driver: Box<dyn Driver>) -> bool {
        let Ok(i) = self.state.actors.binary_search_by_key(&id, |actor| actor.id) else { return false };
        if self.actors[i].body.mode != Mode::Driven {
            return false;
        }
        driver.observe(&View { own: id, world: &self.state, ego: self.outline(), map: &self.map });
        self.actors[i].driver = driver;
        true
    }

    /// Scenario of the run, with the draws of the seed.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Road as published to the stack.
    pub fn route(&self) -> &Route {
        &self.route
    }

    /// Simulation parameters.
    pub fn params(&self) -> &SimParams {
        &self.params
    }

    /// State after the last step; that of instant 0 before the first.
    pub fn state(&self) -> &WorldState {
        &self.state
    }

    /// Speeds of the ego's wheels after the last step, rad/s: front left, front right, rear left, rear right.
    pub fn wheel_speeds_radps(&self) -> [f64; 4] {
        self.ego.car().wheels().map(|wheel| wheel.spin_radps)
    }

    /// Advances the world by one step under `command` and returns the new state.
    ///
    /// A command that is not finite is refused: the previous one stays in force. One out of range is clamped.
    pub fn step(&mut self, command: Command) -> &WorldState {
        let before = self.before();
        self.state.stamp += self.params.dt;
        self.state.collisions.clear();
        self.state.infractions.clear();
        for i in 0..self.actors.len() {
            self.send(i, &before);
        }
        let dt_s = self.params.dt.as_secs();
        self.ego.apply(&mut self.world, &command, self.scenario.road.friction, dt_s);
        self.world.step();
        self.state.ego = self.ego.truth(&self.world);
        self.state.ego.state.stamp = self.state.stamp;
        let outline = self.outline();
        for i in 0..self.actors.len() {
            self.receive(i, &before, &outline);
        }
        self.contacts_of_others(&before);
        self.judge(&outline);
        self.show();
        &self.state
    }

    fn outline(&self) -> Obb {
        self.params.vehicle.shape.footprint(self.state.ego.state.pose)
    }

    fn before(&self) -> Before {
        let body = &self.world.bodies[self.ego.handle()];
        let (at, velocity) = (body.center_of_mass(), body.linvel());
        let velocity_mps = Vector2::new(f64::from(velocity.x), f64::from(velocity.y));
        let motion = Motion2 {
            at: Point2::new(f64::from(at.x), f64::from(at.y)),
            velocity_mps,
            yaw_rate_radps: f64::from(body.angvel().z),
        };
        let is_loose = |&i: &usize| self.actors[i].body.mode == Mode::Hit;
        let loose = (0..self.actors.len()).filter(is_loose).collect();
        let actors = self.state.actors.clone();
        Before { actors, loose, outline: self.outline(), motion, speed_mps: velocity_mps.norm() }
    }

    /// A movement of actor `i` on the ground.
    fn placed(&self, i: usize, movement: Movement) -> Placed {
        let line = self.scenario.actors[i].line(self.route.line());
        let at = line.project_near(movement.pose.point(), self.actors[i].s_m, STEP_MAX_M);
        Placed { movement, z_m: self.scenario.road.ground_m(at.d_m), s_m: at.s_m }
    }

    /// Instant before the present step.
    fn earlier(&self) -> Time {
        Time::from_ns(self.state.stamp.ns() - self.params.dt.ns())
    }

    /// Movement of actor `i` at the end of the present step by its driver; `None` at rest.
    fn driven(&self, i: usize) -> Option<Placed> {
        let movement = self.actors[i].driver.movement(self.earlier(), self.state.stamp)?;
        Some(self.placed(i, movement))
    }

    /// Prepares actor `i` for the step that ends at the present stamp.
    fn send(&mut self, i: usize, before: &Before) {
        if self.actors[i].body.mode != Mode::Driven {
            return;
        }
        if self.may_be_hit(i, before) {
            let now = self.actors[i].driver.movement(self.earlier(), self.earlier());
            let now = now.unwrap_or_else(|| Movement::at_rest(self.state.actors[i].pose));
            let now = self.placed(i, now);
            self.actors[i].body.try_physics(&mut self.world, &now);
        } else if let Some(next) = self.driven(i) {
            self.actors[i].body.follow(&mut self.world, &next);
        }
    }

    /// True if the ego or another dynamic body could touch actor `i` within one step.
    fn may_be_hit(&self, i: usize, before: &Before) -> bool {
        let dt_s = self.params.dt.as_secs();
        let actor = &self.state.actors[i];
        let own = actor.velocity_mps.norm();
        let reach_m = (before.speed_mps + own) * dt_s + MARGIN_M;
        if near(&before.outline, actor, reach_m) && actor.gap_m(&before.outline) <= reach_m {
            return true;
        }
        before.loose.iter().filter(|&&j| j != i).any(|&j| {
            let other = &self.state.actors[j];
            let reach_m = (other.velocity_mps.norm() + own) * dt_s + MARGIN_M;
            let outline = other.footprint();
            near(&outline, actor, reach_m) && actor.gap_m(&outline) <= reach_m
        })
    }

    /// Updates the state of actor `i` after the step, and records a contact with the ego.
    fn receive(&mut self, i: usize, before: &Before, outline: &Obb) {
        match self.actors[i].body.mode {
            Mode::Fixed => {}
            Mode::Driven => {
                if let Some(now) = self.driven(i) {
                    self.put(i, now);
                }
            }
            Mode::Trial | Mode::Hit => self.actors[i].body.read(&self.world, &mut self.state.actors[i]),
        }
        let touches_ego = self.contact(i, before, outline);
        if self.actors[i].body.mode == Mode::Trial {
            if touches_ego || self.touches_loose(i) {
                self.actors[i].body.mode = Mode::Hit;
            } else {
                let rests = || self.placed(i, Movement::at_rest(before.actors[i].pose));
                let now = self.driven(i).unwrap_or_else(rests);
                self.actors[i].body.restore(&mut self.world, &now);
                self.put(i, now);
            }
        }
    }

    fn put(&mut self, i: usize, Placed { movement, z_m, s_m }: Placed) {
        let actor = &mut self.state.actors[i];
        self.actors[i].s_m = s_m;
        (actor.pose, actor.z_m, actor.velocity_mps) = (movement.pose, z_m, movement.velocity_mps);
    }

    fn touches_loose(&self, i: usize) -> bool {
        let own = self.actors[i].body.collider;
        self.actors.iter().enumerate().any(|(j, other)| {
            let loose = j != i && other.body.mode == Mode::Hit;
            loose && bodies::impulse_n_s(&self.world, own, other.body.collider) > 0.0
        })
    }

    /// Updates the contact between the ego and actor `i`; returns true if they touch in this step.
    fn contact(&mut self, i: usize, before: &Before, outline: &Obb) -> bool {
        let actor = &self.state.actors[i];
        let parties = [ActorId::EGO, actor.id];
        if !near(outline, actor, 2.0 * PARTED_M) && !self.contacts.contains(parties) {
            return false;
        }
        let collider = self.actors[i].body.collider;
        let impulse_n_s = bodies::impulse_n_s(&self.world, self.ego_collider, collider);
        let touch = Touch { gap_m: actor.gap_m(outline), impulse_n_s };
        let (earlier, horizon_s) = (&before.actors[i], self.horizon_s());
        let stamp = self.state.stamp;
        let collision = self.contacts.update((parties, stamp), touch, PATIENCE, || Collision {
            stamp,
            parties,
            impulse_n_s: 0.0,
            closing_speed_mps: contact::closing_speed(&before.outline, &before.motion, earlier, horizon_s),
            speeds_mps: [before.speed_mps, earlier.velocity_mps.norm()],
        });
        self.state.collisions.extend(collision);
        touch.is_contact()
    }

    /// Updates the contacts between actors, once all of them have moved. Two that both rest cannot begin to touch.
    fn contacts_of_others(&mut self, before: &Before) {
        let actors = &self.state.actors;
        let has_moved = |i: usize| actors[i].pose != before.actors[i].pose;
        let mut pairs = Vec::new();
        if (0..actors.len()).any(has_moved) {
            pairs = contact::near_pairs(actors, PARTED_M);
            pairs.retain(|pair| pair.iter().any(|&i| has_moved(i)));
        }
        let index = |id: ActorId| actors.binary_search_by_key(&id, |actor| actor.id).ok();
        pairs.extend(self.contacts.parties().filter_map(|[a, b]| Some([index(a)?, index(b)?])));
        pairs.sort_unstable();
        pairs.dedup();
        for pair in pairs {
            self.contact_of_others(pair, before);
        }
    }

    /// Updates the contact between two actors, given by their indices.
    fn contact_of_others(&mut self, pair: [usize; 2], before: &Before) {
        let (stamp, horizon_s) = (self.state.stamp, self.horizon_s());
        let [a, b] = pair.map(|i| &self.actors[i].body);
        // Drivers do not feel impulses: only bodies that were hit exert them.
        let are_driven = a.mode != Mode::Hit && b.mode != Mode::Hit;
        let impulse_n_s =
            if are_driven { 0.0 } else { bodies::impulse_n_s(&self.world, a.collider, b.collider) };
        let patience = if are_driven { 0 } else { PATIENCE };
        let [a, b] = pair.map(|i| &self.state.actors[i]);
        let parties = [a.id, b.id];
        let touch = Touch { gap_m: contact::gap_of_actors_m(a, b), impulse_n_s };
        let collision = self.contacts.update((parties, stamp), touch, patience, || {
            let [a, b] = pair.map(|i| &before.actors[i]);
            Collision {
                stamp,
                parties,
                impulse_n_s: 0.0,
                closing_speed_mps: contact::closing_speed_of_actors(a, b, horizon_s),
                speeds_mps: [a, b].map(|actor| actor.velocity_mps.norm()),
            }
        });
        self.state.collisions.extend(collision);
    }

    /// Time ahead of a step within which a contact in it begins, seconds.
    fn horizon_s(&self) -> f64 {
        2.0 * self.params.dt.as_secs()
    }

    fn judge(&mut self, outline: &Obb) {
        let center = outline.center.point();
        self.rules.follow(&self.route, center);
        if self.rules.leaves_road(&self.route, outline) {
            self.state
                .infractions
                .push(Infraction { stamp: self.state.stamp, kind: InfractionKind::LeftRoad });
        }
        let ended = self.rules.ended(&self.state, center);
        self.state.ended = self.state.ended.or(ended);
    }

    /// Shows the present state to all drivers.
    fn show(&mut self) {
        let ego = self.outline();
        for (player, actor) in self.actors.iter_mut().zip(&self.state.actors) {
            player.driver.observe(&View { own: actor.id, world: &self.state, ego, map: &self.map });
        }
    }
}

impl World for Simulator {
    fn map(&self) -> &Arc<Map> {
        &self.map
    }

    fn state(&self) -> &WorldState {
        &self.state
    }

    fn advance(&mut self, until: Time, commands: &[(ActorId, Command)]) -> &WorldState {
        if let Some((_, command)) = commands.iter().find(|(id, _)| *id == ActorId::EGO) {
            self.command = *command;
        }
        while self.state.stamp < until {
            self.step(self.command);
        }
        &self.state
    }
}

impl core::fmt::Debug for Simulator {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.debug_struct("Simulator")
            .field("scenario", &self.scenario.name)
            .field("stamp", &self.state.stamp)
            .finish_non_exhaustive()
    }
}

/// True if the bounding circles of the two come within `reach_m` of each other.
fn near(outline: &Obb, actor: &Actor, reach_m: f64) -> bool {
    let radius = outline.radius() + actor.footprint().radius() + reach_m;
    (outline.center.point() - actor.pose.point()).norm_squared() <= radius * radius
}

fn free_road(scenario: &Scenario, route: &Route, outline: &Obb) -> Result<(), SimError> {
    let margin_m = route.margin_m(outline);
    if margin_m < 0.0 {
        return Err(SimError::OffRoad(-margin_m));
    }
    match scenario.actors.iter().find(|actor| actor.distance_to(route.line(), outline) == 0.0) {
        Some(actor) => Err(SimError::EgoInside(actor.name.clone())),
        None => Ok(()),
    }
}
