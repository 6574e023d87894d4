//! Vehicles of SUMO at the ends of its steps, and between them.

use std::collections::BTreeMap;

use core::f64::consts::FRAC_PI_2;

use swerve_geom::{Map, Point2, Pose2, Vector2, angle_between, wrap_angle};
use swerve_msg::{ActorId, ActorKind, Extent};
use swerve_world::{Movement, Other};

use crate::SumoError;
use crate::client::Values;
use crate::wire::Value;

/// Variables of vehicles.
const POSITION: u8 = 0x42;
const ANGLE: u8 = 0x43;
const SPEED: u8 = 0x40;
pub(crate) const LENGTH: u8 = 0x44;
pub(crate) const WIDTH: u8 = 0x4d;
const HEIGHT: u8 = 0xbc;
const CLASS: u8 = 0x49;

/// Variables that are asked for.
pub(crate) const VARIABLES: [u8; 7] = [POSITION, ANGLE, SPEED, LENGTH, WIDTH, HEIGHT, CLASS];

/// Most vehicles around the ego.
pub(crate) const VEHICLES_MAX: usize = 2_000;

/// Most names of a run.
const NAMES_MAX: usize = 1_000_000;

/// Largest coordinate, metres.
const PLACE_MAX_M: f64 = 1e7;

/// Fastest vehicle, m/s.
const SPEED_MAX_MPS: f64 = 150.0;

/// A vehicle that moves farther in a step than by its speed and this has jumped, m/s and metres.
const FASTER_MPS: f64 = 8.0;
const FARTHER_M: f64 = 0.5;

/// Identities of vehicles by their names, in the order in which they came.
#[derive(Clone, Debug)]
pub(crate) struct Names {
    next: u32,
    known: BTreeMap<String, ActorId>,
}

impl Names {
    pub(crate) fn from(first: ActorId) -> Self {
        Self { next: first.0, known: BTreeMap::new() }
    }

    fn id(&mut self, name: &str) -> Result<ActorId, SumoError> {
        if let Some(id) = self.known.get(name) {
            return Ok(*id);
        }
        if self.known.len() == NAMES_MAX {
            return Err(SumoError::Answer(format!("expected at most {NAMES_MAX} vehicles in a run")));
        }
        let id = ActorId(self.next);
        self.next += 1;
        self.known.insert(name.to_owned(), id);
        Ok(id)
    }

    /// Name of a vehicle.
    pub(crate) fn of(&self, id: ActorId) -> &str {
        self.known.iter().find(|(_, known)| **known == id).map_or("", |(name, _)| name)
    }
}

/// Vehicles at the end of a step, by identity; their speeds are SUMO's, along their headings.
pub(crate) type State = BTreeMap<ActorId, Other>;

/// The vehicles of an answer but the ego, in the map; names are numbered in their order.
pub(crate) fn state(
    objects: &[(String, Values)],
    ego: &str,
    offset_m: [f64; 2],
    names: &mut Names,
) -> Result<State, SumoError> {
    let mut sorted: Vec<&(String, Values)> = objects.iter().filter(|(name, _)| name != ego).collect();
    sorted.sort_by(|a, b| a.0.cmp(&b.0));
    if sorted.len() > VEHICLES_MAX {
        let message =
            format!("expected at most {VEHICLES_MAX} vehicles around the ego, found {}", sorted.len());
        return Err(SumoError::Answer(message));
    }
    if let Some([twice, _]) = sorted.array_windows().find(|[a, b]| a.0 == b.0) {
        let why = "expected one vehicle of this name, found two".to_owned();
        return Err(SumoError::Vehicle { name: twice.0.clone(), why });
    }
    let mut state = State::new();
    for (name, values) in sorted {
        let wrong = |why: String| SumoError::Vehicle { name: name.clone(), why };
        let id = names.id(name)?;
        state.insert(id, vehicle(id, values, offset_m).map_err(wrong)?);
    }
    Ok(state)
}

/// A vehicle by its variables.
fn vehicle(id: ActorId, values: &Values, [x_m, y_m]: [f64; 2]) -> Result<Other, String> {
    let number = |variable: u8, what: &str, [least, most]: [f64; 2]| match values.get(&variable) {
        Some(Value::Double(value)) if (least..=most).contains(value) => Ok(*value),
        found => Err(format!("expected {what} of {least} to {most}, found {found:?}")),
    };
    let within = -PLACE_MAX_M..=PLACE_MAX_M;
    let front = match values.get(&POSITION) {
        Some(Value::Position([x, y])) if within.contains(x) && within.contains(y) => {
            Point2::<Map>::new(x - x_m, y - y_m)
        }
        found => return Err(format!("expected a place, found {found:?}")),
    };
    let angle_deg = number(ANGLE, "an angle", [-720.0, 720.0])?;
    let speed_mps = number(SPEED, "a speed", [-SPEED_MAX_MPS, SPEED_MAX_MPS])?;
    let extent = Extent {
        length_m: number(LENGTH, "a length", [0.1, 200.0])?,
        width_m: number(WIDTH, "a width", [0.1, 20.0])?,
        height_m: number(HEIGHT, "a height", [0.1, 20.0])?,
    };
    let Some(Value::Text(class)) = values.get(&CLASS) else {
        return Err(format!("expected a class, found {:?}", values.get(&CLASS)));
    };
    let heading_rad = wrap_angle(FRAC_PI_2 - angle_deg.to_radians());
    let pose = Pose2::new(front.x_m, front.y_m, heading_rad);
    let movement =
        Movement { pose: pose.ahead(-0.5 * extent.length_m), velocity_mps: pose.direction() * speed_mps };
    Ok(Other { id, kind: kind_of(class), extent, movement })
}

/// Kind of a vehicle by its class in SUMO.
fn kind_of(class: &str) -> ActorKind {
    match class {
        "bicycle" | "scooter" => ActorKind::Cyclist,
        "motorcycle" | "moped" => ActorKind::Motorcycle,
        "pedestrian" | "wheelchair" => ActorKind::Pedestrian,
        "truck" | "trailer" | "bus" | "coach" | "tram" | "rail" | "rail_urban" | "rail_electric"
        | "rail_fast" | "cable_car" | "subway" => ActorKind::Truck,
        _ => ActorKind::Car,
    }
}

/// Vehicles at a share of the step between two states: those of both, on a straight line and turned by the short way.
/// One that comes, or jumps, is there at the end of the step; one that goes is there until its begin.
pub(crate) fn between(from: &State, to: &State, share: f64, step_s: f64) -> Vec<Other> {
    let at_end = share >= 1.0;
    let one = |next: &Other| -> Option<Other> {
        let Some(last) = from.get(&next.id) else { return at_end.then(|| next.clone()) };
        let (a, b) = (last.movement.pose, next.movement.pose);
        let way = b.point() - a.point();
        let fastest_mps = last.movement.velocity_mps.norm().max(next.movement.velocity_mps.norm());
        if way.norm() > (fastest_mps + FASTER_MPS) * step_s + FARTHER_M {
            return Some(if at_end { next.clone() } else { last.clone() });
        }
        let velocity_mps: Vector2 = way * (1.0 / step_s);
        let pose = match at_end {
            true => b,
            false => {
                let at = a.point() + way * share;
                let turn_rad = share * angle_between(a.heading_rad, b.heading_rad);
                Pose2::new(at.x_m, at.y_m, wrap_angle(a.heading_rad + turn_rad))
            }
        };
        Some(Other { movement: Movement { pose, velocity_mps }, ..next.clone() })
    };
    to.values().filter_map(one).collect()
}
