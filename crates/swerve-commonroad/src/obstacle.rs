//! Obstacles of a scenario.

use swerve_geom::Point2;

use crate::Shape;

/// State of an obstacle, or the initial state of a planning problem.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct State {
    /// Time step.
    pub step: u32,
    /// Position in the map: for obstacles the origin of their shape.
    pub position: Point2,
    /// Heading as in the file, radians.
    pub heading_rad: f64,
    /// Speed, m/s; 0 if the file has none.
    pub speed_mps: f64,
    /// Acceleration, m/s²; 0 if the file has none.
    pub accel_mps2: f64,
    /// Yaw rate, rad/s; 0 if the file has none.
    pub yaw_rate_radps: f64,
    /// Slip angle, radians; 0 if the file has none.
    pub slip_rad: f64,
}

/// Kind of an obstacle, by its type in the file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum ObstacleKind {
    /// Cars, taxis, parked and priority vehicles, and those of unknown type.
    Car,
    /// Trucks.
    Truck,
    /// Buses.
    Bus,
    /// Trains.
    Train,
    /// Motorcycles.
    Motorcycle,
    /// Bicycles.
    Bicycle,
    /// Pedestrians.
    Pedestrian,
    /// Fixed things: construction zones, road boundaries, buildings, pillars, medians.
    Fixed,
}

/// Space that an obstacle may use at a time step.
#[derive(Clone, PartialEq, Debug)]
pub struct Occupancy {
    /// Time step.
    pub step: u32,
    /// Shapes in the map.
    pub shapes: Vec<Shape>,
}

/// Motion of an obstacle after its initial state.
#[derive(Clone, PartialEq, Debug)]
pub enum Motion {
    /// It stays in its initial state for the whole scenario.
    Static,
    /// States in order of time; the obstacle is absent after the last one.
    Trajectory(Vec<State>),
    /// Occupied sets in order of time.
    Sets(Vec<Occupancy>),
}

/// An obstacle.
#[derive(Clone, PartialEq, Debug)]
pub struct Obstacle {
    /// Identity in the file.
    pub id: u32,
    /// Kind by its type.
    pub kind: ObstacleKind,
    /// Shapes around its origin.
    pub shapes: Vec<Shape>,
    /// First state.
    pub initial: State,
    /// Motion from the initial state on.
    pub motion: Motion,
}

impl Obstacle {
    /// Shapes in the map at a time step; empty where the obstacle is absent.
    ///
    /// States count from the initial one, one per time step, as in the official checker.
    pub fn at(&self, step: u32) -> Vec<Shape> {
        let placed = |state: &State| {
            self.shapes.iter().map(|shape| shape.placed(state.position, state.heading_rad)).collect()
        };
        let Some(ahead) = step.checked_sub(self.initial.step) else { return Vec::new() };
        let later = |k: usize| k.checked_sub(1);
        match (&self.motion, later(ahead as usize)) {
            (Motion::Static, _) | (_, None) => placed(&self.initial),
            (Motion::Trajectory(states), Some(k)) => states.get(k).map(placed).unwrap_or_default(),
            (Motion::Sets(sets), Some(k)) => sets.get(k).map(|set| set.shapes.clone()).unwrap_or_default(),
        }
    }

    /// Last time step at which the obstacle is present; `None` for static ones.
    pub fn last_step(&self) -> Option<u32> {
        let later = match &self.motion {
            Motion::Static => return None,
            Motion::Trajectory(states) => states.len(),
            Motion::Sets(sets) => sets.len(),
        };
        Some(self.initial.step.saturating_add(later as u32))
    }
}
