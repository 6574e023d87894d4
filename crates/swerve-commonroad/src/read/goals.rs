//! Planning problems.

use std::collections::BTreeMap;

use swerve_map_io::content::{all, child};
use swerve_map_io::xml::{Element, Reader};

use crate::read::{motion, shapes, values};
use crate::{Goal, GoalPosition, Interval, Lanelet, PlanningProblem};

/// Most planning problems of a scenario.
const PROBLEMS_MAX: usize = 100;

/// Most goal states of a planning problem.
const GOALS_MAX: usize = 1000;

/// Planning problems in the order of the file.
pub(crate) fn problems(
    xml: &mut Reader,
    root: Element<'_>,
    lanelets: &BTreeMap<u32, Lanelet>,
) -> Vec<PlanningProblem> {
    let mut found = Vec::new();
    for at in all(root, "planningProblem") {
        if found.len() == PROBLEMS_MAX {
            xml.fault(at, || format!("expected at most {PROBLEMS_MAX} planning problems"));
            break;
        }
        found.extend(problem(xml, at, lanelets));
    }
    found
}

fn problem(xml: &mut Reader, at: Element<'_>, lanelets: &BTreeMap<u32, Lanelet>) -> Option<PlanningProblem> {
    let id = xml.identity(at, "id")?;
    let start = xml.child(at, "initialState")?;
    for name in ["orientation", "velocity"] {
        xml.child(start, name);
    }
    let mut initial = motion::state(xml, start);
    if child(start, "acceleration").is_none() {
        // As the official reader (`commonroad-io` 2024.3): it reads these fields last, and none after one that is missing.
        (initial.yaw_rate_radps, initial.slip_rad) = (0.0, 0.0);
    }
    let goals: Vec<Goal> = all(at, "goalState").take(GOALS_MAX).map(|at| goal(xml, at, lanelets)).collect();
    if goals.is_empty() {
        xml.fault(at, || "expected at least one `goalState`, found none".to_owned());
    }
    Some(PlanningProblem { id, initial, goals })
}

fn goal(xml: &mut Reader, at: Element<'_>, lanelets: &BTreeMap<u32, Lanelet>) -> Goal {
    xml.child(at, "time");
    let steps = values::interval(xml, at, "time").unwrap_or(Interval { from: 0.0, to: 0.0 });
    for end in [steps.from, steps.to] {
        values::whole(xml, at, end);
    }
    Goal {
        steps,
        position: child(at, "position").map(|at| position(xml, at, lanelets)),
        heading_rad: values::interval(xml, at, "orientation"),
        speed_mps: values::interval(xml, at, "velocity"),
    }
}

fn position(xml: &mut Reader, at: Element<'_>, lanelets: &BTreeMap<u32, Lanelet>) -> GoalPosition {
    if child(at, "lanelet").is_none() {
        return GoalPosition::Shapes(shapes::shapes(xml, at));
    }
    let mut ids = Vec::new();
    for lanelet in all(at, "lanelet") {
        let Some(id) = xml.identity(lanelet, "ref") else { continue };
        if !lanelets.contains_key(&id) {
            xml.fault_in(lanelet, "ref", || format!("expected the identity of a lanelet, found {id}"));
        }
        ids.push(id);
    }
    GoalPosition::Lanelets(ids)
}
