//! Scenario files in the protobuf format of `commonroad-io` 2024.3, as the XML text of the same scenario.
//!
//! Elements that the reader of scenarios does not use are left out: location, tags, line markings, signals, and all signs
//! but speed limits, stop and give way.
//!
//! **Source.** The definition files (`.proto`) of `commonroad-io` 2024.3.

mod road;
mod wire;

use core::fmt;

use wire::{Message, Writer};

/// Names of the types of obstacles.
const OBSTACLES: [&str; 16] = [
    "unknown",
    "car",
    "truck",
    "bus",
    "bicycle",
    "pedestrian",
    "priorityVehicle",
    "parkedVehicle",
    "constructionZone",
    "train",
    "roadBoundary",
    "motorcycle",
    "taxi",
    "building",
    "pillar",
    "medianStrip",
];

/// Field of the time step in a state.
const TIME_STEP: u64 = 39;

/// Deepest nesting of groups of shapes.
const GROUPS_MAX: usize = 8;

/// A fault of a file in the protobuf format.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct ProtobufError {
    /// Position in the file, bytes.
    pub at: usize,
    /// The field, such as `lanelets.left_bound.points`; empty at the top.
    pub field: String,
    /// The fault: what was expected, and what was found.
    pub message: String,
}

impl fmt::Display for ProtobufError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let colon = if self.field.is_empty() { "" } else { ": " };
        write!(f, "byte {}: {}{colon}{}", self.at, self.field, self.message)
    }
}

impl core::error::Error for ProtobufError {}

type Done = Result<(), ProtobufError>;

/// The XML text of a scenario in the protobuf format, at most 256 MiB.
///
/// # Errors
/// [`ProtobufError`]: the first fault of the file.
pub fn xml_of_protobuf(bytes: &[u8]) -> Result<String, ProtobufError> {
    let mut xml = Writer::default();
    let top = Message::top(bytes);
    let information = top.only(1, "information")?;
    let version = information.text(1, "common_road_version")?;
    let benchmark = information.text(2, "benchmark_id")?;
    let step_s = information.number(7, "time_step_size")?;
    xml.raw("<?xml version=\"1.0\"?>\n");
    xml.open_with(
        "commonRoad",
        &[
            ("commonRoadVersion", version),
            ("benchmarkID", benchmark),
            ("timeStepSize", &format!("{step_s:?}")),
        ],
    );
    for field in top.fields() {
        let field = field?;
        match field.number {
            4 => road::lanelet(&mut xml, &field.message("lanelets")?)?,
            5 => road::sign(&mut xml, &field.message("traffic_signs")?)?,
            6 => road::light(&mut xml, &field.message("traffic_lights")?)?,
            7 => road::intersection(&mut xml, &field.message("intersections")?)?,
            8 => obstacle(&mut xml, "staticObstacle", &field.message("static_obstacles")?)?,
            9 => obstacle(&mut xml, "dynamicObstacle", &field.message("dynamic_obstacles")?)?,
            10 => environment(&mut xml, &field.message("environment_obstacles")?)?,
            12 => problem(&mut xml, &field.message("planning_problems")?)?,
            _ => {}
        }
        xml.within_limit(&field)?;
    }
    xml.close("commonRoad");
    Ok(xml.text())
}

/// The name of a value of an enumeration; its last one for values that it does not have.
fn named<'n>(names: &[&'n str], value: u64) -> &'n str {
    names.get(value as usize).or(names.last()).copied().unwrap_or_default()
}

fn obstacle(xml: &mut Writer, element: &str, of: &Message<'_>) -> Done {
    xml.open_with(element, &[("id", &of.whole(1, "id")?.to_string())]);
    let kind = of.whole(2, "obstacle_type")?;
    xml.leaf("type", OBSTACLES.get(kind as usize).copied().unwrap_or("unknown"));
    xml.open("shape");
    shape(xml, &of.only(3, "shape")?, 0)?;
    xml.close("shape");
    state(xml, "initialState", &of.only(4, "initial_state")?, &[])?;
    if element == "dynamicObstacle" {
        for field in of.fields() {
            let field = field?;
            match field.number {
                5 => trajectory(xml, &field.message("trajectory_prediction")?)?,
                6 => sets(xml, &field.message("set_based_prediction")?)?,
                _ => {}
            }
        }
    }
    xml.close(element);
    Ok(())
}

fn trajectory(xml: &mut Writer, of: &Message<'_>) -> Done {
    xml.open("trajectory");
    for one in of.only(1, "trajectory")?.all(2, "states") {
        state(xml, "state", &one?, &[])?;
    }
    xml.close("trajectory");
    Ok(())
}

fn sets(xml: &mut Writer, of: &Message<'_>) -> Done {
    xml.open("occupancySet");
    for one in of.only(2, "occupancy_set")?.all(1, "occupancies") {
        let one = one?;
        xml.open("occupancy");
        xml.open("shape");
        shape(xml, &one.only(2, "shape")?, 0)?;
        xml.close("shape");
        steps(xml, &one.only(1, "time_step")?)?;
        xml.close("occupancy");
    }
    xml.close("occupancySet");
    Ok(())
}

fn environment(xml: &mut Writer, of: &Message<'_>) -> Done {
    xml.open_with("environmentObstacle", &[("id", &of.whole(1, "environment_obstacle_id")?.to_string())]);
    let kind = of.whole(2, "obstacle_type")?;
    xml.leaf("type", OBSTACLES.get(kind as usize).copied().unwrap_or("unknown"));
    xml.open("shape");
    shape(xml, &of.only(3, "obstacle_shape")?, 0)?;
    xml.close("shape");
    xml.close("environmentObstacle");
    Ok(())
}

fn problem(xml: &mut Writer, of: &Message<'_>) -> Done {
    xml.open_with("planningProblem", &[("id", &of.whole(1, "planning_problem_id")?.to_string())]);
    state(xml, "initialState", &of.only(2, "initial_state")?, &[])?;
    for goal in of.all(3, "goal_states") {
        let goal = goal?;
        let lanelets = goal.wholes(2, "goal_position_lanelets")?;
        state(xml, "goalState", &goal.only(1, "state")?, &lanelets)?;
    }
    xml.close("planningProblem");
    Ok(())
}

/// A state; `lanelets` are the places of a goal.
fn state(xml: &mut Writer, element: &str, of: &Message<'_>, lanelets: &[u64]) -> Done {
    // States of earlier definitions have four fields less before the time step.
    let is_earlier =
        of.maybe(TIME_STEP, "time_step")?.is_none() && of.maybe(TIME_STEP - 4, "time_step")?.is_some();
    let (time_step, acceleration) = if is_earlier { (TIME_STEP - 4, 32) } else { (TIME_STEP, 34) };
    let values = [
        (3, "orientation"),
        (4, "velocity"),
        (acceleration, "acceleration"),
        (7, "yawRate"),
        (8, "slipAngle"),
    ];
    xml.open(element);
    let (at, area) = (of.maybe(1, "point")?, of.maybe(2, "shape")?);
    if at.is_some() || area.is_some() || !lanelets.is_empty() {
        xml.open("position");
        for lanelet in lanelets {
            xml.empty_with("lanelet", &[("ref", &lanelet.to_string())]);
        }
        if lanelets.is_empty() {
            at.map_or(Ok(()), |at| point(xml, "point", &at))?;
            area.map_or(Ok(()), |area| shape(xml, &area, 0))?;
        }
        xml.close("position");
    }
    for (number, name) in values {
        let Some(value) = of.maybe(number, name)? else { continue };
        xml.open(name);
        match value.maybe(2, "interval")? {
            Some(ends) => {
                xml.number("intervalStart", ends.number(1, "start")?);
                xml.number("intervalEnd", ends.number(2, "end")?);
            }
            None => xml.number("exact", value.number(1, "exact")?),
        }
        xml.close(name);
    }
    steps(xml, &of.only(time_step, "time_step")?)?;
    xml.close(element);
    Ok(())
}

/// A time step or an interval of them.
fn steps(xml: &mut Writer, of: &Message<'_>) -> Done {
    // Negative numbers have ten bytes.
    let signed = |value: u64| (value as i64).to_string();
    xml.open("time");
    match of.maybe(2, "interval")? {
        Some(ends) => {
            xml.leaf("intervalStart", &signed(ends.whole(1, "start")?));
            xml.leaf("intervalEnd", &signed(ends.whole(2, "end")?));
        }
        None => xml.leaf("exact", &signed(of.whole(1, "exact")?)),
    }
    xml.close("time");
    Ok(())
}

fn point(xml: &mut Writer, element: &str, of: &Message<'_>) -> Done {
    let [x, y] = [of.number(1, "x")?, of.number(2, "y")?];
    xml.open(element);
    xml.number("x", x);
    xml.number("y", y);
    xml.close(element);
    Ok(())
}

fn shape(xml: &mut Writer, of: &Message<'_>, depth: usize) -> Done {
    for field in of.fields() {
        let field = field?;
        match field.number {
            1 => rectangle(xml, &field.message("rectangle")?)?,
            2 => {
                let circle = field.message("circle")?;
                xml.open("circle");
                xml.number("radius", circle.number(1, "radius")?);
                circle.maybe(2, "center")?.map_or(Ok(()), |at| point(xml, "center", &at))?;
                xml.close("circle");
            }
            3 => {
                xml.open("polygon");
                for corner in field.message("polygon")?.all(1, "vertices") {
                    point(xml, "point", &corner?)?;
                }
                xml.close("polygon");
            }
            4 if depth == GROUPS_MAX => {
                return Err(
                    field.fault(&format!("expected at most {GROUPS_MAX} groups of shapes in each other"))
                );
            }
            4 => {
                for one in field.message("shape_group")?.all(1, "shapes") {
                    shape(xml, &one?, depth + 1)?;
                }
            }
            _ => {}
        }
    }
    Ok(())
}

fn rectangle(xml: &mut Writer, of: &Message<'_>) -> Done {
    xml.open("rectangle");
    xml.number("length", of.number(1, "length")?);
    xml.number("width", of.number(2, "width")?);
    if let Some(heading_rad) = of.maybe_number(4, "orientation")? {
        xml.number("orientation", heading_rad);
    }
    of.maybe(3, "center")?.map_or(Ok(()), |at| point(xml, "center", &at))?;
    xml.close("rectangle");
    Ok(())
}

#[cfg(test)]
mod tests;
