//! Solutions, and their reader.

use swerve_geom::Point2;
use swerve_map_io::content::content;
use swerve_map_io::xml::{Element, Reader, parse};
use swerve_map_io::{Problems, quoted};

use crate::read::values;
use crate::{CostFunction, Model, STATES_MAX, VehicleKind};

/// State of the solved vehicle; values that its model does not have are 0.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct SolutionState {
    /// Time step.
    pub step: u32,
    /// Centre of gravity in the map.
    pub position: Point2,
    /// Heading as in the file, radians; for the point mass the course.
    pub heading_rad: f64,
    /// Speed along the heading, m/s; for the point mass the speed over ground.
    pub speed_mps: f64,
    /// Steering angle of the front wheels, radians.
    pub steering_rad: f64,
    /// Yaw rate, rad/s (single track).
    pub yaw_rate_radps: f64,
    /// Slip angle at the centre of gravity, radians (single track).
    pub slip_rad: f64,
}

/// Solution of one planning problem.
#[derive(Clone, PartialEq, Debug)]
pub struct Driven {
    /// Identity of the planning problem.
    pub problem: u32,
    /// Model of the vehicle.
    pub model: Model,
    /// Kind of the vehicle.
    pub vehicle: VehicleKind,
    /// Cost function that the solution names.
    pub cost: CostFunction,
    /// States in order of time, at least two, one per time step.
    pub states: Vec<SolutionState>,
}

/// Solutions of the planning problems of a scenario.
#[derive(Clone, PartialEq, Debug)]
pub struct Solution {
    /// Identity of the benchmark's scenario.
    pub benchmark: String,
    /// Solutions in the order of the file.
    pub driven: Vec<Driven>,
}

impl Solution {
    /// Reads the text of a solution file.
    ///
    /// # Errors
    /// All faults of the file: an unknown vehicle, model or cost function, states that are missing or not finite.
    pub fn read(file: &str, text: &str) -> Result<Self, Problems> {
        let document = parse(file, text)?;
        let root = document.root_element();
        let mut xml = Reader::default();
        let solution = solution(&mut xml, root);
        let is_whole = xml.faults() == 0;
        let (faults, ..) = xml.finish(file, text);
        solution.filter(|_| is_whole).ok_or(faults)
    }
}

fn solution(xml: &mut Reader, root: Element<'_>) -> Option<Solution> {
    if root.tag_name().name() != "CommonRoadSolution" {
        let name = root.tag_name().name();
        xml.fault(root, || format!("expected the element `CommonRoadSolution`, found {}", quoted(name)));
        return None;
    }
    let identity = xml.text(root, "benchmark_id");
    let parts: Vec<&str> = identity.split(':').collect();
    let [vehicles, costs, benchmark, version] = parts[..] else {
        xml.fault_in(root, "benchmark_id", || {
            format!("expected VEHICLES:COSTS:SCENARIO:VERSION, found {}", quoted(&identity))
        });
        return None;
    };
    if !matches!(version, "2020a" | "2018b") {
        xml.fault_in(root, "benchmark_id", || format!("expected version 2020a, found {}", quoted(version)));
    }
    let elements: Vec<_> = root.children().filter(Element::is_element).collect();
    let [vehicles, costs] = [vehicles, costs].map(words);
    for (name, count) in [("vehicles", vehicles.len()), ("cost functions", costs.len())] {
        if count != elements.len() {
            let solutions = elements.len();
            xml.fault_in(root, "benchmark_id", || {
                format!("expected as many {name} as trajectories, found {count} and {solutions}")
            });
            return None;
        }
    }
    if elements.is_empty() {
        xml.fault(root, || "expected a trajectory, found none".to_owned());
    }
    let all = elements.into_iter().zip(vehicles.iter().zip(costs));
    let driven: Vec<Driven> =
        all.filter_map(|(at, (vehicle, cost))| driven(xml, at, vehicle, cost)).collect();
    Some(Solution { benchmark: benchmark.to_owned(), driven })
}

/// Words of a list such as `[KS2,KS2]`, or a single word.
fn words(list: &str) -> Vec<&str> {
    list.trim_matches(['[', ']']).split(',').map(str::trim).collect()
}

fn driven(xml: &mut Reader, at: Element<'_>, vehicle: &str, cost: &str) -> Option<Driven> {
    let split = vehicle.len().checked_sub(1).filter(|split| vehicle.is_char_boundary(*split)).unwrap_or(0);
    let (model, kind) = vehicle.split_at(split);
    let model = Model::named(model);
    let kind = kind.parse().ok().and_then(VehicleKind::numbered);
    let (Some(model), Some(kind)) = (model, kind) else {
        xml.fault(at, || {
            format!("expected a vehicle PM, KS or ST with a number from 1 to 3, found {}", quoted(vehicle))
        });
        return None;
    };
    let Some(function) = CostFunction::named(cost) else {
        xml.fault(at, || format!("expected one of {}, found {}", CostFunction::names(), quoted(cost)));
        return None;
    };
    let name = at.tag_name().name();
    if name != model.trajectory() {
        xml.fault(at, || format!("expected the element `{}`, found {}", model.trajectory(), quoted(name)));
        return None;
    }
    let problem = xml.identity(at, "planningProblem")?;
    let mut states = Vec::new();
    for state in at.children().filter(Element::is_element) {
        if states.len() == STATES_MAX {
            xml.fault(state, || format!("expected at most {STATES_MAX} states"));
            break;
        }
        states.push(self::state(xml, state, model));
    }
    states.sort_by_key(|state| state.step);
    let is_sequence = states.windows(2).all(|two| two[1].step == two[0].step + 1);
    if states.len() < 2 || !is_sequence {
        xml.fault(at, || "expected at least two states, one for each time step".to_owned());
    }
    Some(Driven { problem, model, vehicle: kind, cost: function, states })
}

fn state(xml: &mut Reader, at: Element<'_>, model: Model) -> SolutionState {
    let name = at.tag_name().name();
    if name != model.state() {
        xml.fault(at, || format!("expected the element `{}`, found {}", model.state(), quoted(name)));
        return SolutionState::default();
    }
    let step = xml.child(at, "time").map_or(0, |time| match content(time).parse::<f64>() {
        Ok(value) => values::whole(xml, time, value),
        Err(_) => {
            xml.fault(time, || format!("expected a time step, found {}", quoted(content(time))));
            0
        }
    });
    let position = values::coordinates(xml, at);
    let mut of = |name| xml.measure(at, name);
    match model {
        Model::Pm => {
            let velocity = swerve_geom::Vector2::<swerve_geom::Map>::new(of("xVelocity"), of("yVelocity"));
            SolutionState {
                step,
                position,
                heading_rad: velocity.heading(),
                speed_mps: velocity.norm(),
                ..SolutionState::default()
            }
        }
        Model::Ks | Model::St => {
            let state = SolutionState {
                step,
                position,
                steering_rad: of("steeringAngle"),
                speed_mps: of("velocity"),
                heading_rad: of("orientation"),
                ..SolutionState::default()
            };
            match model {
                Model::St => {
                    SolutionState { yaw_rate_radps: of("yawRate"), slip_rad: of("slipAngle"), ..state }
                }
                _ => state,
            }
        }
    }
}

#[cfg(test)]
mod tests;
