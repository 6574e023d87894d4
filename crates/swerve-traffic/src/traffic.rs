//! All actors of the traffic, tick by tick.

mod counts;
mod entry;
mod slots;

use std::sync::Arc;

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Vector2};
use swerve_map::Map;
use swerve_msg::truth::WorldState;
use swerve_msg::{ActorId, ActorKind, Extent};
use swerve_world::Movement;

use crate::car::Car;
use crate::change::Changes;
use crate::junction::Junctions;
use crate::lights::Lights;
use crate::net::Net;
use crate::scene::{Other, Scene};
use crate::setup::TrafficSetup;
use crate::spawn::Entries;
use crate::walk::Walkers;

use slots::{Slot, Slots};

pub use counts::Counts;

/// Distance from its pose at which an actor counts as hit, metres.
const OFF_M: f64 = 0.1;
/// Ticks between two thoughts of a driver about a lane change.
const CHANGE_TICKS: i64 = 5;

/// An actor of the traffic.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct TrafficActor {
    /// Identity.
    pub id: ActorId,
    /// Kind.
    pub kind: ActorKind,
    /// Size.
    pub extent: Extent,
}

/// Simulated traffic on a lane map.
#[derive(Clone, Debug)]
pub struct Traffic {
    map: Arc<Map>,
    pub(crate) net: Net,
    setup: TrafficSetup,
    seed: u64,
    pub(crate) lights: Lights,
    actors: Vec<TrafficActor>,
    slots: Slots,
    pub(crate) cars: Vec<Car>,
    pub(crate) walkers: Walkers,
    /// Where cars and cyclists begin.
    entries: [Entries; 2],
    scene: Scene,
    /// Last number of a grant.
    number: u64,
    /// Instant of the last decisions.
    pub(crate) tick: Time,
    ticks: i64,
    counts: Counts,
}

impl Traffic {
    /// Creates traffic on a map at instant 0, with draws keyed by `seed`. `reserved` is ground to keep clear of, such as
    /// the place of an ego at rest. An actor for which there is no legal place is left out and counted.
    pub fn new(map: Arc<Map>, setup: &TrafficSetup, lights: Lights, seed: u64, reserved: &[Obb]) -> Self {
        let at_rest: Vec<(Obb, Vector2)> = reserved.iter().map(|body| (*body, Vector2::default())).collect();
        Self::among(map, setup, lights, seed, &at_rest)
    }

    /// The same among bodies with velocities in m/s: vehicles behind one begin at a speed from which they follow it.
    pub fn among(
        map: Arc<Map>,
        setup: &TrafficSetup,
        lights: Lights,
        seed: u64,
        bodies: &[(Obb, Vector2)],
    ) -> Self {
        let net = Net::new(&map, &setup.drivers, &setup.closed);
        let mut traffic = Self {
            scene: Scene::new(&net),
            entries: [false, true].map(|cycles| Entries::new(&net, cycles)),
            walkers: Walkers::new(&map, &net),
            map,
            net,
            setup: setup.clone(),
            seed,
            lights,
            actors: Vec::new(),
            slots: Slots::default(),
            cars: Vec::new(),
            number: 0,
            tick: Time::ZERO,
            ticks: 0,
            counts: Counts::default(),
        };
        let other = |&(body, velocity_mps): &(Obb, Vector2)| Other {
            body,
            velocity_mps,
            kind: ActorKind::Car,
            is_ego: false,
        };
        let others: Vec<Other> = bodies.iter().map(other).collect();
        traffic.populate(&others);
        traffic.decide(others);
        traffic
    }

    /// Actors that were placed, ordered by identity.
    pub fn actors(&self) -> &[TrafficActor] {
        &self.actors
    }

    /// Numbers of events since the start.
    pub fn counts(&self) -> Counts {
        self.counts
    }

    /// Observes a state of the world and decides if the time for it has come. A second state of the same instant has no
    /// effect.
    pub fn observe(&mut self, world: &WorldState, ego: Obb) {
        if world.stamp < self.due() {
            return;
        }
        let [x_mps, y_mps, _] = world.ego.velocity_mps.coords.into();
        let mut others = vec![Other {
            body: ego,
            velocity_mps: Vector2::new(x_mps, y_mps),
            kind: ActorKind::Car,
            is_ego: true,
        }];
        for actor in &world.actors {
            let is_ours = match self.movement(actor.id, world.stamp) {
                Some(due) if due.pose.point().distance(actor.pose.point()) < OFF_M => true,
                Some(_) => {
                    self.lose(actor.id);
                    false
                }
                None => false,
            };
            if !is_ours {
                let (body, kind) = (actor.footprint(), actor.kind);
                others.push(Other { body, velocity_mps: actor.velocity_mps, kind, is_ego: false });
            }
        }
        self.advance(world.stamp, &others);
    }

    /// Advances to an instant, among road users that are not of the traffic.
    pub(crate) fn advance(&mut self, now: Time, others: &[Other]) {
        while now >= self.due() {
            self.tick += self.setup.tick;
            self.ticks += 1;
            let dt_s = self.setup.tick.as_secs();
            for car in self.cars.iter_mut().filter(|car| !car.is_hit) {
                car.advance(dt_s);
                car.since_change_s += dt_s;
                if let Some(change) = &mut car.change {
                    change.since_s += dt_s;
                    if change.since_s >= crate::car::CHANGE_S {
                        car.change = None;
                    }
                }
                car.stands_s = if car.speed_mps < 0.1 { car.stands_s + dt_s } else { 0.0 };
                car.plan(&self.net, self.seed);
            }
            self.walkers.advance(dt_s);
            self.renew(others);
            self.decide(others.to_vec());
        }
    }

    /// Advances to an instant without other road users.
    pub fn advance_alone(&mut self, now: Time) {
        self.advance(now, &[]);
    }

    /// Movement of an actor at an instant from the last decisions on; `None` for an unknown actor, and for one that
    /// physics moves since a collision.
    pub fn movement(&self, id: ActorId, at: Time) -> Option<Movement> {
        let after_s = (at - self.tick).as_secs().clamp(0.0, 2.0 * self.setup.tick.as_secs());
        match self.slots.of(id)? {
            Slot::Car(k) if self.cars[k].is_hit => None,
            Slot::Car(k) => {
                let car = &self.cars[k];
                let (pose, velocity_mps) = car.rests_at.unwrap_or_else(|| car.movement(&self.net, after_s));
                Some(Movement { pose, velocity_mps })
            }
            Slot::Walker(k) => self.walkers.movement(k, after_s),
        }
    }

    /// Instant of the next decisions: states of the world before it have no effect.
    pub(crate) fn due(&self) -> Time {
        self.tick + self.setup.tick
    }

    /// Gives an actor up to physics.
    fn lose(&mut self, id: ActorId) {
        match self.slots.of(id) {
            Some(Slot::Car(k)) => self.cars[k].is_hit = true,
            Some(Slot::Walker(k)) => self.walkers.lose(k),
            None => {}
        }
    }

    /// Decisions of all actors at the present tick.
    fn decide(&mut self, others: Vec<Other>) {
        let dt_s = self.setup.tick.as_secs();
        self.scene.update(&self.net, &self.cars, others);
        self.change_lanes();
        let (net, lights, params) = (&self.net, &self.lights, &self.setup.drivers);
        let junctions = Junctions { net, scene: &self.scene, lights, params, now: self.tick, dt_s };
        let reds: Vec<Option<f64>> =
            self.cars.iter_mut().map(|car| if car.is_hit { None } else { junctions.red_m(car) }).collect();
        let granted = junctions.grant(&mut self.cars, &reds, &mut self.number);
        self.counts.circles += granted.circles;
        self.counts.full_roads += granted.full_roads;
        let walls: Vec<Vec<f64>> = self.cars.iter().map(|car| self.walkers.stops_m(&self.net, car)).collect();
        let decide = |who: usize| junctions.decide(&self.cars, who, reds[who], &walls[who]);
        let decisions: Vec<(f64, bool)> = (0..self.cars.len()).map(decide).collect();
        self.walkers.decide(&self.net, &self.cars, &self.scene, (lights, self.tick), dt_s);
        for (car, (gain_mps2, at_red)) in self.cars.iter_mut().zip(decisions) {
            (car.gain_mps2, car.at_red) = (gain_mps2, at_red);
            car.rests_at = car.rests().then(|| car.movement(&self.net, 0.0));
            self.counts.hard_brakes += u64::from(gain_mps2 < -8.5 && car.speed_mps > 1.0);
            if at_red {
                car.stands_s = 0.0;
            }
        }
    }

    /// Begins lane changes: decisions of all, then those that do not meet in the same gap.
    fn change_lanes(&mut self) {
        let mobil = &self.setup.drivers.mobil;
        let changes = Changes { map: &self.map, net: &self.net, scene: &self.scene, mobil, seed: self.seed };
        let mut begun: Vec<(usize, f64)> = Vec::new();
        for who in 0..self.cars.len() {
            let its_turn = (self.ticks + self.cars[who].key) % CHANGE_TICKS == 0;
            let Some(target) = its_turn.then(|| changes.wanted(&self.cars, who)).flatten() else { continue };
            if begun.iter().any(|(lane, s_m)| *lane == target.lane && (s_m - target.s_m).abs() < 60.0) {
                continue;
            }
            begun.push((target.lane, target.s_m));
            changes.begin(&mut self.cars[who], target);
            self.counts.lane_changes += 1;
        }
        if !begun.is_empty() {
            let others = core::mem::take(&mut self.scene.others);
            self.scene.update(&self.net, &self.cars, others);
        }
    }

    /// Interval of decisions.
    pub fn interval(&self) -> Span {
        self.setup.tick
    }
}
