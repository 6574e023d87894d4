//! Writer of solutions.

use core::fmt::Write as _;

use crate::{Driven, Model, Solution, SolutionState};

/// Version of the format in the identity of the benchmark.
const VERSION: &str = "2020a";

impl Solution {
    /// Text of the solution file. Numbers have as many digits as reading them back exactly needs; the file has no date,
    /// so that equal drives give equal files.
    pub fn to_xml(&self) -> String {
        let list = |words: Vec<String>| match &words[..] {
            [word] => word.clone(),
            words => format!("[{}]", words.join(",")),
        };
        let vehicle = |one: &Driven| format!("{}{}", one.model.name(), one.vehicle.number());
        let vehicles = list(self.driven.iter().map(vehicle).collect());
        let costs = list(self.driven.iter().map(|one| one.cost.name().to_owned()).collect());
        let benchmark = escaped(&self.benchmark);
        let mut xml = String::from("<?xml version=\"1.0\" ?>\n");
        let identity = format!("{vehicles}:{costs}:{benchmark}:{VERSION}");
        xml += &format!("<CommonRoadSolution benchmark_id=\"{identity}\">\n");
        for driven in &self.driven {
            let name = driven.model.trajectory();
            xml += &format!("  <{name} planningProblem=\"{}\">\n", driven.problem);
            for state in &driven.states {
                push(&mut xml, driven.model, state);
            }
            xml += &format!("  </{name}>\n");
        }
        xml + "</CommonRoadSolution>\n"
    }
}

fn push(xml: &mut String, model: Model, state: &SolutionState) {
    let name = model.state();
    let mut values = vec![("x", state.position.x_m), ("y", state.position.y_m)];
    match model {
        Model::Pm => {
            let velocity =
                swerve_geom::Vector2::<swerve_geom::Map>::from_heading(state.heading_rad) * state.speed_mps;
            values.extend([("xVelocity", velocity.x), ("yVelocity", velocity.y)]);
        }
        Model::Ks | Model::St => values.extend([
            ("steeringAngle", state.steering_rad),
            ("velocity", state.speed_mps),
            ("orientation", state.heading_rad),
        ]),
    }
    if model == Model::St {
        values.extend([("yawRate", state.yaw_rate_radps), ("slipAngle", state.slip_rad)]);
    }
    // Writing to a text cannot fail.
    let _infallible = writeln!(xml, "    <{name}>");
    for (name, value) in values {
        let _infallible = writeln!(xml, "      <{name}>{value}</{name}>");
    }
    let _infallible = writeln!(xml, "      <time>{}</time>\n    </{name}>", state.step);
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('"', "&quot;")
}
