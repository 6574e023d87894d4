//! Obstacles and their motion.

use swerve_map_io::content::{all, child, content};
use swerve_map_io::quoted;
use swerve_map_io::xml::{Element, Reader};

use crate::read::{shapes, values};
use crate::{Motion, OBSTACLES_MAX, Obstacle, ObstacleKind, Occupancy, STATES_MAX, State};

/// Types of obstacles with their kinds.
const KINDS: [(&str, ObstacleKind); 17] = [
    ("unknown", ObstacleKind::Car),
    ("car", ObstacleKind::Car),
    ("taxi", ObstacleKind::Car),
    ("parkedVehicle", ObstacleKind::Car),
    ("priorityVehicle", ObstacleKind::Car),
    ("truck", ObstacleKind::Truck),
    ("bus", ObstacleKind::Bus),
    ("train", ObstacleKind::Train),
    ("motorcycle", ObstacleKind::Motorcycle),
    ("bicycle", ObstacleKind::Bicycle),
    ("pedestrian", ObstacleKind::Pedestrian),
    ("constructionZone", ObstacleKind::Fixed),
    ("roadBoundary", ObstacleKind::Fixed),
    ("building", ObstacleKind::Fixed),
    ("pillar", ObstacleKind::Fixed),
    ("medianStrip", ObstacleKind::Fixed),
    ("median_strip", ObstacleKind::Fixed),
];

/// Static and dynamic obstacles in the order of the file.
pub(crate) fn obstacles(xml: &mut Reader, root: Element<'_>) -> Vec<Obstacle> {
    let is_obstacle = |at: &Element<'_>| matches!(at.tag_name().name(), "staticObstacle" | "dynamicObstacle");
    let (mut found, mut states) = (Vec::new(), 0);
    for at in root.children().filter(is_obstacle) {
        if found.len() == OBSTACLES_MAX {
            xml.fault(at, || format!("expected at most {OBSTACLES_MAX} obstacles"));
            break;
        }
        let Some(obstacle) = obstacle(xml, at, &mut states) else { continue };
        if states > STATES_MAX {
            xml.fault(at, || format!("expected at most {STATES_MAX} states of obstacles"));
            break;
        }
        found.push(obstacle);
    }
    found
}

fn obstacle(xml: &mut Reader, at: Element<'_>, states: &mut usize) -> Option<Obstacle> {
    let id = xml.identity(at, "id")?;
    let kind = kind(xml, at);
    let shape = xml.child(at, "shape")?;
    let shapes = shapes::shapes(xml, shape);
    let initial = xml.child(at, "initialState")?;
    let initial = state(xml, initial);
    let is_static = at.tag_name().name() == "staticObstacle";
    let motion = match (child(at, "trajectory"), child(at, "occupancySet")) {
        _ if is_static => Motion::Static,
        (Some(trajectory), _) => {
            let all: Vec<State> = all(trajectory, "state").map(|at| state(xml, at)).collect();
            let steps = all.iter().map(|state| state.step);
            in_sequence(xml, trajectory, initial.step, steps);
            *states += all.len();
            Motion::Trajectory(all)
        }
        (None, Some(sets)) => {
            let all: Vec<Occupancy> = all(sets, "occupancy").filter_map(|at| occupancy(xml, at)).collect();
            let steps = all.iter().map(|set| set.step);
            in_sequence(xml, sets, initial.step, steps);
            *states += all.iter().map(|set| set.shapes.len()).sum::<usize>();
            Motion::Sets(all)
        }
        (None, None) => Motion::Trajectory(Vec::new()),
    };
    Some(Obstacle { id, kind, shapes, initial, motion })
}

fn kind(xml: &mut Reader, at: Element<'_>) -> ObstacleKind {
    let name = child(at, "type").map(content).unwrap_or_default();
    let found = KINDS.iter().find(|(known, _)| *known == name).map(|(_, kind)| *kind);
    found.unwrap_or_else(|| {
        let known: Vec<&str> = KINDS.iter().map(|(known, _)| *known).collect();
        xml.defect(at, || {
            format!("`type`: expected one of {}, found {}: read as a car", known.join(", "), quoted(name))
        });
        ObstacleKind::Car
    })
}

/// A state with exact values.
pub(crate) fn state(xml: &mut Reader, at: Element<'_>) -> State {
    let position = xml.child(at, "position").and_then(|position| match child(position, "point") {
        Some(point) => Some(values::coordinates(xml, point)),
        None => {
            xml.fault(position, || {
                "expected an exact position in `point`; areas are not supported".to_owned()
            });
            None
        }
    });
    State {
        step: values::step(xml, at),
        position: position.unwrap_or_default(),
        heading_rad: values::exact(xml, at, "orientation").unwrap_or_default(),
        speed_mps: values::exact(xml, at, "velocity").unwrap_or_default(),
        accel_mps2: values::exact(xml, at, "acceleration").unwrap_or_default(),
        yaw_rate_radps: values::exact(xml, at, "yawRate").unwrap_or_default(),
        slip_rad: values::exact(xml, at, "slipAngle").unwrap_or_default(),
    }
}

fn occupancy(xml: &mut Reader, at: Element<'_>) -> Option<Occupancy> {
    let shape = xml.child(at, "shape")?;
    Some(Occupancy { shapes: shapes::shapes(xml, shape), step: values::step(xml, at) })
}

/// Reports states that do not follow the initial one step by step; they count as if they did, as in the official checker.
fn in_sequence(xml: &mut Reader, at: Element<'_>, initial: u32, steps: impl Iterator<Item = u32>) {
    let wrong = steps.enumerate().find(|(k, step)| *step as usize != initial as usize + k + 1);
    if let Some((k, found)) = wrong {
        let expected = initial as usize + k + 1;
        xml.defect(at, || {
            format!("expected a state for each time step, {expected} next, found {found}: read as {expected}")
        });
    }
}
