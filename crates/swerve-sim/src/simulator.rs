mod outside;
mod shown;
mod touch;

use std::sync::Arc;

use glam::Vec3;
use rapier3d::prelude::{ColliderHandle, PhysicsWorld};
use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_geom::{Obb, Point2, Vector2};
use swerve_map::Map;
use swerve_msg::truth::{Actor, EgoTruth, EndReason, Infraction, InfractionKind, WorldState};
use swerve_msg::{ActorId, ActorKind, Command, Extent, Route};
use swerve_scenario::{OtherEgo, Scenario};
use swerve_vehicle::{Shape, VehicleParams};
use swerve_world::{Driver, Movement, View};

use self::outside::Outside;
use self::touch::near;
use crate::bodies::{self, Body, Mode, Placed};
use crate::contact::{self, Motion2};
use crate::contacts::Contacts;
use crate::ego::EgoCar;
use crate::neighbours::Neighbours;
use crate::reacting;
use crate::rules::Rules;
use crate::scripted::Scripted;
use crate::traffic::{self, with_traffic};

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
    /// An actor or another ego overlaps the ego at the start.
    #[error("the ego starts inside \"{0}\"")]
    EgoInside(String),
    /// The ego does not start on the road.
    #[error("the ego starts {0:.2} m outside the drivable ground")]
    OffRoad(f64),
}

/// One run of one scenario, step by step.
pub struct Simulator {
    scenario: Scenario,
    params: SimParams,
    map: Arc<Map>,
    world: PhysicsWorld,
    /// The ego of the scenario, then the others.
    egos: Vec<Ego>,
    actors: Vec<Player>,
    contacts: Contacts,
    neighbours: Neighbours,
    /// Actors before the last step.
    earlier_actors: Vec<Actor>,
    /// State in the view of the first ego. Its actors are those of the scenario, then the other egos.
    state: WorldState,
    /// States in the views of the other egos.
    views: Vec<WorldState>,
    /// The state without absent road users; `None` without recorded ones.
    shown: Option<WorldState>,
    /// Another simulator of road users, if there is one.
    outside: Option<Outside>,
}

/// Car of one ego, and what it is judged by.
struct Ego {
    car: EgoCar,
    route: Route,
    rules: Rules,
    /// The last command; the car keeps the one before if it is not finite.
    command: Command,
}

impl Ego {
    /// Puts the ego of a scenario on its free place of the road.
    fn spawn(
        world: &mut PhysicsWorld,
        scenario: &Scenario,
        vehicle: &VehicleParams,
    ) -> Result<Self, SimError> {
        let route = scenario.road.route();
        let pose = scenario.ego_pose(route.line(), &vehicle.shape);
        free_road(scenario, &route, &vehicle.shape)?;
        let car = EgoCar::spawn(world, scenario.ego_id, vehicle, pose, scenario.ego.start_speed());
        bodies::foresee_contacts(world, car.handle());
        Ok(Self { car, route, rules: Rules::new(scenario), command: Command::default() })
    }
}

/// Body and driver of one actor, in addition to its state.
struct Player {
    body: Body,
    driver: Box<dyn Driver>,
    /// Last position along the road, metres.
    s_m: f64,
    /// For road users of the traffic, where the height of the ground was last looked up, and that height.
    ground: Option<(Point2, f64)>,
    /// True while it is too far from all that physics moves to be part of the physics.
    is_away: bool,
}

/// Distance from the egos and from actors that were hit beyond which the traffic is no part of the physics, metres.
const AWAY_M: f64 = 50.0;

/// Way after which the height of the ground below a pedestrian of the traffic is looked up again, metres.
const GROUND_M: f64 = 0.25;

/// Maximum distance along the road in one step, metres.
const STEP_MAX_M: f64 = 5.0;

/// World just before a step: the first ego, and the actors.
struct Before {
    actors: Vec<Actor>,
    /// Indices of the actors that physics moves: those that were hit, and other egos.
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
        Self::exact(with_traffic(scenario.drawn(seed), &params.vehicle.shape, seed), params)
    }

    /// Creates a run of the scenario exactly as given, without random draws but those of traffic that is not placed yet.
    ///
    /// # Errors
    /// Same as [`new`](Self::new).
    pub fn exact(scenario: Scenario, params: &SimParams) -> Result<Self, SimError> {
        if params.dt < Span::from_ms(1) || params.dt > Span::from_ms(20) {
            return Err(SimError::Step(params.dt));
        }
        let scenario = with_traffic(scenario, &params.vehicle.shape, 0);
        let mut world = PhysicsWorld::new();
        world.gravity = Vec3::new(0.0, 0.0, -9.81);
        world.integration_parameters.dt = params.dt.as_secs() as f32;
        bodies::ground(&mut world, scenario.road.friction);
        let mut egos = vec![Ego::spawn(&mut world, &scenario, &params.vehicle)?];
        for other in &scenario.other_egos {
            let view = scenario.of_ego(other.id).expect("it is one of the egos");
            egos.push(Ego::spawn(&mut world, &view, &params.vehicle)?);
        }
        let state = WorldState {
            stamp: Time::ZERO,
            ego: egos[0].car.truth(&world),
            actors: Vec::new(),
            collisions: Vec::new(),
            infractions: Vec::new(),
            ended: None,
        };
        let map = scenario.road.map();
        let mut simulator = Self {
            scenario,
            params: params.clone(),
            map,
            world,
            egos,
            actors: Vec::new(),
            contacts: Contacts::default(),
            neighbours: Neighbours::default(),
            earlier_actors: Vec::new(),
            state,
            views: Vec::new(),
            shown: None,
            outside: None,
        };
        simulator.populate();
        simulator.views = simulator.views();
        simulator.show();
        Ok(simulator)
    }

    fn populate(&mut self) {
        let line = Arc::new(self.route().line().clone());
        let mut drivers = reacting::drivers(&self.scenario);
        if let Some(traffic) = traffic::of_scenario(&self.scenario, &self.params.vehicle.shape) {
            let boxed = |(id, driver)| (id, Box::new(driver) as Box<dyn Driver>);
            drivers.extend(traffic.drivers().1.into_iter().map(boxed));
        }
        for actor in &self.scenario.actors {
            let scripted = || Box::new(Scripted::new(actor, &self.scenario, &line, self.params.dt));
            let driver: Box<dyn Driver> = drivers.remove(&actor.id).unwrap_or_else(|| scripted());
            // An actor that moves from the start has a speed in the first state, too.
            let movement = driver.movement(Time::ZERO, Time::ZERO);
            let movement = movement.unwrap_or_else(|| Movement::at_rest(actor.pose(&line)));
            let at = actor.line(&line).project_near(movement.pose.point(), actor.s_m, STEP_MAX_M);
            let state = Actor {
                id: actor.id,
                kind: actor.kind,
                pose: movement.pose,
                z_m: self.scenario.road.ground_m(movement.pose.point(), at.d_m),
                extent: actor.extent,
                velocity_mps: movement.velocity_mps,
            };
            let body = Body::insert(&mut self.world, &state, actor.mass_kg);
            let comes_and_goes = traffic::is_of_traffic(&self.scenario, actor.id) || actor.track().is_some();
            let ground = comes_and_goes.then_some((state.pose.point(), state.z_m));
            self.actors.push(Player { body, driver, s_m: at.s_m, ground, is_away: false });
            self.state.actors.push(state);
        }
        let others: Vec<Actor> =
            self.egos[1..].iter().map(|ego| self.as_actor(&ego.car.truth(&self.world))).collect();
        self.state.actors.extend(others);
        let actors = &self.state.actors;
        for [i, j] in contact::near_pairs(actors, 0.0) {
            if contact::gap_of_actors_m(&actors[i], &actors[j]) == 0.0 {
                self.contacts.touch_from_start([actors[i].id, actors[j].id]);
            }
        }
    }

    /// An ego as others see it.
    fn as_actor(&self, ego: &EgoTruth) -> Actor {
        let Shape { length_m, width_m, height_m, .. } = self.params.vehicle.shape;
        let [x, y, _] = ego.velocity_mps.coords.into();
        Actor {
            id: ego.id,
            kind: ActorKind::Car,
            pose: self.params.vehicle.shape.footprint(ego.state.pose).center,
            z_m: 0.0,
            extent: Extent { length_m, width_m, height_m },
            velocity_mps: Vector2::new(x, y),
        }
    }

    /// The state in the view of each other ego.
    fn views(&self) -> Vec<WorldState> {
        let first = self.as_actor(&self.state.ego);
        let truths = self.egos[1..].iter().map(|ego| ego.car.truth(&self.world));
        let ended = self.views.iter().map(|view| view.ended).chain(core::iter::repeat(None));
        let view = |(mut ego, ended): (EgoTruth, Option<EndReason>)| {
            ego.state.stamp = self.state.stamp;
            let others = self.state.actors.iter().filter(|actor| actor.id != ego.id);
            let actors = core::iter::once(&first).chain(others).cloned().collect();
            let collisions = self.state.collisions.iter().map(|hit| hit.seen_by(ego.id)).collect();
            WorldState { stamp: self.state.stamp, ego, actors, collisions, infractions: Vec::new(), ended }
        };
        truths.zip(ended).map(view).collect()
    }

    /// Gives an actor another driver, in place of the script of the scenario, before the first step; the driver observes
    /// the state at instant 0. Returns false, and changes nothing, if there is no such actor or it never moves
    /// (`static`).
    pub fn set_driver(&mut self, id: ActorId, mut driver: Box<dyn Driver>) -> bool {
        let Ok(i) = self.state.actors.binary_search_by_key(&id, |actor| actor.id) else { return false };
        if self.actors.get(i).is_none_or(|actor| actor.body.mode != Mode::Driven) {
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

    /// First route of the first ego.
    pub fn route(&self) -> &Route {
        &self.egos[0].route
    }

    /// Simulation parameters.
    pub fn params(&self) -> &SimParams {
        &self.params
    }

    /// State after the last step, in the view of the first ego; that of instant 0 before the first step.
    pub fn state(&self) -> &WorldState {
        self.shown.as_ref().unwrap_or(&self.state)
    }

    /// Speeds of the first ego's wheels after the last step, rad/s: front left, front right, rear left, rear right.
    pub fn wheel_speeds_radps(&self) -> [f64; 4] {
        self.egos[0].car.car().wheels().map(|wheel| wheel.spin_radps)
    }

    /// Advances the world by one step under `command` of the first ego and returns the new state.
    ///
    /// A command that is not finite is refused: the previous one stays in force. One out of range is clamped. Nothing
    /// happens once another simulator of road users has failed.
    pub fn step(&mut self, command: Command) -> &WorldState {
        self.egos[0].command = command;
        if !self.lead(self.state.stamp + self.params.dt) {
            return self.state();
        }
        let before = self.before();
        self.state.stamp += self.params.dt;
        self.state.collisions.clear();
        self.state.infractions.clear();
        for i in 0..self.actors.len() {
            self.send(i, &before);
        }
        let dt_s = self.params.dt.as_secs();
        let road = self.params.vehicle.tyre.friction_on(self.scenario.road.friction);
        let friction = |point: Point2| self.scenario.slippery_at(point).unwrap_or(road);
        for ego in &mut self.egos {
            ego.car.apply(&mut self.world, &ego.command, friction, dt_s);
        }
        self.world.step();
        self.state.ego = self.egos[0].car.truth(&self.world);
        self.state.ego.state.stamp = self.state.stamp;
        for k in 1..self.egos.len() {
            let i = self.actors.len() + k - 1;
            self.state.actors[i] = self.as_actor(&self.egos[k].car.truth(&self.world));
        }
        let outline = self.outline();
        for i in 0..self.actors.len() {
            self.receive(i, &before, &outline);
        }
        for i in self.actors.len()..self.state.actors.len() {
            self.contact(i, &before, &outline);
        }
        self.contacts_of_others(&before);
        self.earlier_actors = before.actors;
        self.judge();
        self.show();
        self.state()
    }

    fn outline(&self) -> Obb {
        self.params.vehicle.shape.footprint(self.state.ego.state.pose)
    }

    fn before(&mut self) -> Before {
        let body = &self.world.bodies[self.egos[0].car.handle()];
        let (at, velocity) = (body.center_of_mass(), body.linvel());
        let velocity_mps = Vector2::new(f64::from(velocity.x), f64::from(velocity.y));
        let motion = Motion2 {
            at: Point2::new(f64::from(at.x), f64::from(at.y)),
            velocity_mps,
            yaw_rate_radps: f64::from(body.angvel().z),
        };
        let is_loose = |&i: &usize| self.body(i).0 == Mode::Hit;
        let loose = (0..self.state.actors.len()).filter(is_loose).collect();
        let mut actors = core::mem::take(&mut self.earlier_actors);
        actors.clone_from(&self.state.actors);
        Before { actors, loose, outline: self.outline(), motion, speed_mps: velocity_mps.norm() }
    }

    /// A movement of actor `i` on the ground. Vehicles of the traffic stay on the road.
    fn placed(&self, i: usize, movement: Movement) -> Placed {
        if let Some((at, z_m)) = self.actors[i].ground {
            let point = movement.pose.point();
            let walks = self.state.actors[i].kind == ActorKind::Pedestrian && at.distance(point) > GROUND_M;
            let z_m = if walks { self.scenario.road.ground_m(point, 0.0) } else { z_m };
            return Placed { movement, z_m, s_m: 0.0 };
        }
        let line = self.scenario.actors[i].line(self.route().line());
        let at = line.project_near(movement.pose.point(), self.actors[i].s_m, STEP_MAX_M);
        let z_m = self.scenario.road.ground_m(movement.pose.point(), at.d_m);
        Placed { movement, z_m, s_m: at.s_m }
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
        if self.actors[i].body.mode != Mode::Driven || self.is_away(i, before) {
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

    /// Returns true if actor `i` is of the traffic and far from all that physics moves; its body is then no part of it.
    fn is_away(&mut self, i: usize, before: &Before) -> bool {
        if self.actors[i].ground.is_none() {
            return false;
        }
        let at = self.state.actors[i].pose.point();
        let is_far = |point: Point2| at.distance(point) > AWAY_M;
        let is_away = is_far(before.outline.center.point())
            && before.loose.iter().all(|&j| is_far(self.state.actors[j].pose.point()));
        if is_away != self.actors[i].is_away {
            self.actors[i].is_away = is_away;
            let now = self.placed(i, Movement::at_rest(self.state.actors[i].pose));
            self.actors[i].body.set_away(&mut self.world, is_away, &now);
        }
        is_away
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
        let player = &mut self.actors[i];
        player.s_m = s_m;
        let point = movement.pose.point();
        if let Some(ground) = player.ground.as_mut().filter(|(at, _)| at.distance(point) > GROUND_M) {
            *ground = (point, z_m);
        }
        (actor.pose, actor.z_m, actor.velocity_mps) = (movement.pose, z_m, movement.velocity_mps);
    }

    /// Mode and collider of the body of an actor or other ego, by its place in the state.
    fn body(&self, i: usize) -> (Mode, ColliderHandle) {
        match self.actors.get(i) {
            Some(actor) => (actor.body.mode, actor.body.collider),
            None => (Mode::Hit, self.egos[i - self.actors.len() + 1].car.collider()),
        }
    }

    /// Judges every ego in its view of the state.
    fn judge(&mut self) {
        self.views = self.views();
        let views = core::iter::once(&mut self.state).chain(&mut self.views);
        for (ego, view) in self.egos.iter_mut().zip(views) {
            let outline = self.params.vehicle.shape.footprint(view.ego.state.pose);
            let center = outline.center.point();
            ego.rules.follow(&ego.route, center);
            if ego.rules.leaves_road(&ego.route, &outline) {
                view.infractions.push(Infraction { stamp: view.stamp, kind: InfractionKind::LeftRoad });
            }
            let ended = ego.rules.ended(view, center);
            view.ended = view.ended.or(ended);
        }
    }
}

fn free_road(scenario: &Scenario, route: &Route, shape: &Shape) -> Result<(), SimError> {
    let outline = shape.footprint(scenario.ego_pose(route.line(), shape));
    let margin_m = route.margin_m(&outline);
    if margin_m < 0.0 {
        return Err(SimError::OffRoad(-margin_m));
    }
    let actor = scenario.actors.iter().find(|actor| actor.distance_to(route.line(), &outline) == 0.0);
    let is_inside = |other: &&OtherEgo| outline.distance(&shape.footprint(other.pose(shape))) == 0.0;
    let ego = scenario.other_egos.iter().find(is_inside);
    match actor.map(|actor| &actor.name).or(ego.map(|ego| &ego.name)) {
        Some(name) => Err(SimError::EgoInside(name.clone())),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
