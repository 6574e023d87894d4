//! A scenario as the text of a scenario of Swerve: the way over the map, the start, and recorded road users.
//!
//! The map of that scenario is the CommonRoad file itself. The run lasts until the last step at which the goal can be
//! reached. The target speed is that with which the ego reaches the goal in time.

mod way;

use core::fmt::Write as _;

use swerve_geom::{Point2, angle_between};
use swerve_map::Map;
use swerve_map::router::Stop;

use crate::{Goal, Motion, Obstacle, ObstacleKind, PlanningProblem, Scenario, Shape, State};

pub use way::NoWay;

/// Slowest and fastest target speed, m/s.
const SPEEDS_MPS: [f64; 2] = [1.0, 60.0];

/// Distance that remains to the end of the map, metres.
const BEFORE_END_M: f64 = 10.0;

/// Largest coordinate of a road user: the limit of scenarios, less the size of any shape, metres.
const FAR_M: f64 = 99_000.0;

/// Target speed by that of the start where the goal has no place.
const FASTER: f64 = 1.25;

/// Least share of the time until the goal's last step after which the ego is to be there.
const LATE: f64 = 0.85;

/// Distance of a target speed from the ends of the interval of a goal, m/s.
const INSIDE_MPS: f64 = 0.5;

/// Height of road users by their kind, metres: files have none.
fn height_m(kind: ObstacleKind) -> f64 {
    match kind {
        ObstacleKind::Truck | ObstacleKind::Bus | ObstacleKind::Train => 3.0,
        ObstacleKind::Motorcycle | ObstacleKind::Bicycle | ObstacleKind::Pedestrian => 1.8,
        ObstacleKind::Car | ObstacleKind::Fixed => 1.5,
    }
}

impl Scenario {
    /// Text (TOML) of a scenario of Swerve with the first planning problem, on the map file `map`.
    ///
    /// # Errors
    /// [`NoWay`] without a planning problem or lanelets, if no way over lanelets leads from the start to the goal, or with
    /// road users more than 100 km from the origin.
    pub fn to_toml(&self, map: &str) -> Result<String, NoWay> {
        let problem = self.problems.first().ok_or(NoWay::NoProblem)?;
        let roads = self.roads.as_ref().ok_or(NoWay::NoLanelets)?;
        if self.obstacles.iter().any(is_far) {
            return Err(NoWay::Far);
        }
        let way = way::find(self, problem, &roads.lanes.map)?;
        let lane = |stop: &Stop| {
            let name = roads.lanes.name(stop.lane);
            format!("{{ lane = {name:?}, s_m = {} }}", number(stop.s_m))
        };
        let lasts_s = f64::from(problem.last_step().saturating_sub(problem.initial.step)) * self.step_s;
        let mut text = String::new();
        let name: String =
            self.benchmark.chars().filter(|c| c.is_alphanumeric() || " _-".contains(*c)).collect();
        let name = if name.trim().is_empty() { "CommonRoad".to_owned() } else { name.trim().to_owned() };
        let via = way.via.map_or_else(String::new, |via| format!("via = [{}]\n", lane(&via)));
        // Writing to a text cannot fail.
        let _infallible = write!(
            text,
            "name = {name:?}\ndescription = \"Planning problem {} of a CommonRoad scenario\"\nseeded = false\n\n[map]\nfile = {map:?}\n\n\
             [ego]\nstart = {}\n{via}goal = {}\nd_m = {}\nheading_rad = {}\ntarget_speed_mps = {}\n\
             start_speed_mps = {}\n\n[end]\ntimeout_s = {}\n",
            problem.id,
            lane(&way.start),
            lane(&way.goal),
            number(way.d_m),
            number(way.turn_rad),
            number(self.target_mps(problem, &way, lasts_s)),
            number(problem.initial.speed_mps.clamp(0.0, SPEEDS_MPS[1])),
            number(lasts_s.max(self.step_s)),
        );
        for obstacle in &self.obstacles {
            self.push(&mut text, obstacle, problem.initial.step);
        }
        Ok(text)
    }

    /// Speed with which the ego reaches the goal in time, and within the goal's interval of speeds, m/s.
    fn target_mps(&self, problem: &PlanningProblem, way: &way::Found, lasts_s: f64) -> f64 {
        let start_mps = problem.initial.speed_mps;
        // Without a place to be at, the vehicles ahead limit the speed, as they did that of the recorded one.
        let mut target_mps = start_mps * FASTER;
        if way.goal_m.is_none() && lasts_s > 0.0 {
            // The map may end.
            target_mps = target_mps.min((way.straight_m - BEFORE_END_M) / lasts_s).max(0.0);
        }
        if let (Some([from_m, to_m]), true) = (way.goal_m, lasts_s > 0.0) {
            // The mean speed that is needed; the difference from the start is made up for.
            let arrives_s = self.arrives_s(problem, lasts_s);
            let [least, most] = [from_m, to_m].map(|way_m| way_m / arrives_s);
            let mean_mps = start_mps.clamp(least.min(most), most.max(least));
            target_mps = mean_mps + 0.4 * (mean_mps - start_mps);
        }
        if let Some(speeds) = problem.goals.iter().find_map(|goal: &Goal| goal.speed_mps) {
            let inside = INSIDE_MPS.min(0.5 * (speeds.to - speeds.from));
            target_mps =
                target_mps.clamp(speeds.from + inside, (speeds.to - inside).max(speeds.from + inside));
        }
        target_mps.clamp(SPEEDS_MPS[0], SPEEDS_MPS[1])
    }

    /// Time after which the ego is to be at the goal, seconds: the middle of the goal's time, but late.
    fn arrives_s(&self, problem: &PlanningProblem, lasts_s: f64) -> f64 {
        let first = problem.goals.iter().map(|goal| goal.steps.from).fold(f64::INFINITY, f64::min);
        let first_s = (first - f64::from(problem.initial.step)) * self.step_s;
        (0.5 * (first_s + lasts_s)).clamp(LATE * lasts_s, lasts_s)
    }

    /// Adds a road user from the step `from` on. Sets of occupied space are no motion and are left out.
    fn push(&self, text: &mut String, obstacle: &Obstacle, from: u32) {
        let Some(shape) = obstacle.shapes.first() else { return };
        let later: &[State] = match &obstacle.motion {
            Motion::Trajectory(states) => states,
            Motion::Static => &[],
            Motion::Sets(_) => return,
        };
        let states: Vec<&State> =
            core::iter::once(&obstacle.initial).chain(later).filter(|state| state.step >= from).collect();
        let states = if states.is_empty() && obstacle.motion == Motion::Static {
            vec![&obstacle.initial]
        } else {
            states
        };
        let Some(first) = states.first() else { return };
        let kind = match (obstacle.kind, &obstacle.motion) {
            (_, Motion::Static) | (ObstacleKind::Fixed, _) => "static",
            (ObstacleKind::Pedestrian, _) => "pedestrian",
            (ObstacleKind::Bicycle, _) => "cyclist",
            (ObstacleKind::Motorcycle, _) => "motorcycle",
            (ObstacleKind::Truck | ObstacleKind::Bus | ObstacleKind::Train, _) => "truck",
            (ObstacleKind::Car, _) => "car",
        };
        let [length_m, width_m] = shape.extent_m().map(|size| size.clamp(0.05, 900.0));
        let height_m = height_m(obstacle.kind);
        let size = match kind {
            "pedestrian" => {
                let radius_m = 0.5 * length_m.max(width_m).min(3.9);
                format!("{{ radius_m = {}, height_m = {height_m} }}", number(radius_m))
            }
            _ => {
                let (length, width) = (number(length_m), number(width_m));
                format!("{{ length_m = {length}, width_m = {width}, height_m = {height_m} }}")
            }
        };
        let states = if kind == "static" { &states[..1] } else { &states[..] };
        let centers: Vec<(Point2, f64)> = states.iter().map(|state| pose(shape, state)).collect();
        let at: Vec<String> =
            centers.iter().map(|(at, _)| format!("[{}, {}]", number(at.x_m), number(at.y_m))).collect();
        let headings: Vec<String> = centers.iter().map(|(_, heading)| number(*heading)).collect();
        let from_s = f64::from(first.step.saturating_sub(from)) * self.step_s;
        let _infallible = write!(
            text,
            "\n[[actor]]\nname = \"obstacle_{}\"\nkind = \"{kind}\"\nsize = {size}\ntrack = {{ from_s = {}, step_s = {}, \
             at = [{}], heading_rad = [{}] }}\n",
            obstacle.id,
            number(from_s),
            number(self.step_s),
            at.join(", "),
            headings.join(", "),
        );
    }
}

/// True if a place of a road user is beyond those that scenarios can have.
fn is_far(obstacle: &Obstacle) -> bool {
    let states = match &obstacle.motion {
        Motion::Trajectory(states) => &states[..],
        Motion::Static | Motion::Sets(_) => &[],
    };
    let mut places = core::iter::once(&obstacle.initial).chain(states).map(|state| state.position);
    places.any(|at| at.x_m.abs().max(at.y_m.abs()) > FAR_M)
}

/// Centre and heading of the shape of a road user.
fn pose(shape: &Shape, state: &State) -> (Point2, f64) {
    let placed = shape.placed(state.position, state.heading_rad);
    let heading_rad = match &placed {
        Shape::Rectangle(rectangle) => rectangle.center.heading_rad,
        Shape::Circle(..) | Shape::Polygon(_) => angle_between(0.0, state.heading_rad),
    };
    (placed.center(), heading_rad)
}

/// A number with a decimal point, as TOML has it.
fn number(value: f64) -> String {
    format!("{value:?}")
}

/// Lanes of a map at a point with the given heading, the best first: arc length, offset and turn from the lane.
fn places(map: &Map, at: Point2, heading_rad: f64) -> Vec<(Stop, f64, f64)> {
    let mut found: Vec<(Stop, f64, f64)> = map
        .at(at)
        .filter_map(|found| {
            let lane = map.lane(found.lane).filter(|lane| lane.kind.is_drivable())?;
            let along_rad = lane.line.at(found.place.s_m).pose.heading_rad;
            let turn_rad = angle_between(along_rad, heading_rad);
            let stop = Stop { lane: found.lane, s_m: found.place.s_m.clamp(0.0, lane.line.length()) };
            (turn_rad.abs() < core::f64::consts::FRAC_PI_2).then_some((stop, found.place.d_m, turn_rad))
        })
        .collect();
    found.sort_by(|a, b| (a.1.abs() + 2.0 * a.2.abs()).total_cmp(&(b.1.abs() + 2.0 * b.2.abs())));
    found
}

#[cfg(test)]
mod tests;
