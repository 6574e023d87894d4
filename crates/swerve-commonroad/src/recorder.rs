//! A solution made of the states of a drive.

use swerve_geom::{Pose2, Vector2, angle_between, math};

use crate::kinematic::followed;
use crate::{CostFunction, Driven, Model, Scenario, Solution, SolutionState, VehicleKind};

/// Speed below which a vehicle has no slip angle, m/s: its course is not defined.
const SLOW_MPS: f64 = 0.5;

/// State of the ego at a time step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ego {
    /// Centre of the rear axle, and heading.
    pub pose: Pose2,
    /// Velocity of the centre of the rear axle: ahead and to the left, m/s.
    pub velocity_mps: Vector2,
    /// Yaw rate, rad/s.
    pub yaw_rate_radps: f64,
    /// Steering angle of the front wheels, radians.
    pub steering_rad: f64,
}

/// Collects the states of a drive, one for each time step.
#[derive(Clone, Debug)]
pub struct Recorder {
    scenario: Scenario,
    kind: VehicleKind,
    states: Vec<SolutionState>,
}

impl Recorder {
    /// A recorder of the first planning problem, which the scenario has.
    pub fn new(scenario: Scenario) -> Self {
        Self { scenario, kind: VehicleKind::Bmw320i, states: Vec::new() }
    }

    /// The scenario.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// Seconds from the start of the drive to the next state that is recorded.
    pub fn next_s(&self) -> f64 {
        self.states.len() as f64 * self.scenario.step_s
    }

    /// Adds the state of the next time step.
    ///
    /// The position is as far ahead of the rear axle as the centre of gravity of the vehicle of the solution.
    pub fn push(&mut self, ego: &Ego) {
        let vehicle = self.kind.vehicle();
        let first = self.scenario.problems.first().map(|problem| &problem.initial);
        let (from_step, near_rad) = first.map_or((0, 0.0), |first| (first.step, first.heading_rad));
        // Headings go on from that of the problem without jumps.
        let before_rad = self.states.last().map_or(near_rad, |state| state.heading_rad);
        let heading_rad = before_rad + angle_between(before_rad, ego.pose.heading_rad);
        let sideways_mps = ego.velocity_mps.y + ego.yaw_rate_radps * vehicle.rear_m;
        let speed_mps = math::hypot(ego.velocity_mps.x, sideways_mps).copysign(ego.velocity_mps.x);
        let is_slow = ego.velocity_mps.x < SLOW_MPS;
        self.states.push(SolutionState {
            step: from_step + self.states.len() as u32,
            position: ego.pose.ahead(vehicle.rear_m).point(),
            heading_rad,
            speed_mps: if is_slow { ego.velocity_mps.x } else { speed_mps },
            steering_rad: self.steering(ego, speed_mps),
            yaw_rate_radps: ego.yaw_rate_radps,
            slip_rad: if is_slow { 0.0 } else { math::atan2(sideways_mps, ego.velocity_mps.x) },
        });
    }

    /// Steering angle with which the vehicle of the solution turns as fast without slip; that of the ego if it is slow.
    fn steering(&self, ego: &Ego, speed_mps: f64) -> f64 {
        let vehicle = self.kind.vehicle();
        let angle_rad = match speed_mps < SLOW_MPS {
            true => ego.steering_rad,
            false => math::atan(ego.yaw_rate_radps * vehicle.wheelbase_m() / speed_mps),
        };
        angle_rad.clamp(-vehicle.steering_max_rad, vehicle.steering_max_rad)
    }

    /// The first states, with yaw rate, slip and steering angle such that they lead to the next position and heading: those
    /// of an instant would not, where they change within the step.
    fn smoothed(&self, count: usize) -> Vec<SolutionState> {
        let vehicle = self.kind.vehicle();
        let mut states = self.states[..count].to_vec();
        for k in 1..states.len() {
            let (from, to) = (states[k - 1], states[k]);
            let way = to.position - from.position;
            let turn_rad = to.heading_rad - from.heading_rad;
            let yaw_rate_radps = turn_rad / self.scenario.step_s;
            let state = &mut states[k - 1];
            state.yaw_rate_radps = yaw_rate_radps;
            if from.speed_mps.min(to.speed_mps) < SLOW_MPS {
                continue;
            }
            let middle_rad = from.heading_rad + 0.5 * turn_rad;
            state.slip_rad = angle_between(middle_rad, way.heading());
            let angle_rad = math::atan(yaw_rate_radps * vehicle.wheelbase_m() / from.speed_mps);
            state.steering_rad = angle_rad.clamp(-vehicle.steering_max_rad, vehicle.steering_max_rad);
        }
        states
    }

    /// The solution up to the first state that reaches a goal, or with all states if none does; `None` with fewer than
    /// two states or without a planning problem.
    ///
    /// With [`Model::St`] the states are those of the drive. With [`Model::Ks`] they are those of the kinematic vehicle
    /// that follows the drive.
    pub fn solution(&self, model: Model) -> Option<Solution> {
        let problem = self.scenario.problems.first()?;
        let reaches = |state: &SolutionState| self.scenario.reaches(problem, state);
        let up_to_goal =
            |states: &[SolutionState]| states.iter().position(reaches).map_or(states.len(), |k| k + 1);
        let states = match model {
            Model::Ks => {
                let mut states = followed(&self.kind.vehicle(), &self.states, self.scenario.step_s);
                states.truncate(up_to_goal(&states));
                states
            }
            Model::St | Model::Pm => self.smoothed(up_to_goal(&self.states)),
        };
        let is_drive = states.len() > 1;
        let model = if model == Model::Ks { Model::Ks } else { Model::St };
        let driven =
            Driven { problem: problem.id, model, vehicle: self.kind, cost: CostFunction::Sm1, states };
        let solution = Solution { benchmark: self.scenario.benchmark.clone(), driven: vec![driven] };
        is_drive.then_some(solution)
    }

    /// Largest distance of a solution from the drive, metres.
    pub fn off_m(&self, solution: &Solution) -> f64 {
        let states = solution.driven.iter().flat_map(|driven| &driven.states);
        let off = states.zip(&self.states).map(|(state, own)| state.position.distance(own.position));
        off.fold(0.0, f64::max)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check;

    /// The official reader takes the yaw rate of the start from files with its acceleration only.
    #[test]
    fn yaw_rate_of_the_start_counts_beside_its_acceleration() {
        let text = include_str!("read/tests/small.xml");
        let (rate, accel) =
            ("<yawRate><exact>0</exact></yawRate>", "<acceleration><exact>0</exact></acceleration>");
        let turning = text.replacen(rate, "<yawRate><exact>-0.2</exact></yawRate>", 1);
        let with_accel = text.replacen(rate, &format!("{accel}<yawRate><exact>-0.2</exact></yawRate>"), 1);
        for (text, model, is_valid) in
            [(&turning, Model::St, true), (&with_accel, Model::St, false), (&with_accel, Model::Ks, true)]
        {
            let mut recorder = Recorder::new(Scenario::read("small.xml", text).unwrap());
            let back_m = VehicleKind::Bmw320i.vehicle().rear_m;
            for k in 0..30_u32 {
                recorder.push(&Ego {
                    pose: Pose2::new(20.0 - back_m + f64::from(k), 1.5, 0.0),
                    velocity_mps: Vector2::new(10.0, 0.0),
                    yaw_rate_radps: 0.0,
                    steering_rad: 0.0,
                });
            }
            let verdict = check(recorder.scenario(), &recorder.solution(model).unwrap());
            assert_eq!(verdict.is_valid(), is_valid, "{model:?} {verdict}");
            assert!(is_valid || verdict.to_string().contains("yaw rate"), "{verdict}");
        }
    }

    /// A drive straight on, and one that ends before the goal's time.
    #[test]
    fn recorded_drive_is_a_valid_solution_up_to_the_goal() {
        let text = include_str!("read/tests/small.xml");
        for (steps, is_valid) in [(30_u32, true), (5, false)] {
            let mut recorder = Recorder::new(Scenario::read("small.xml", text).unwrap());
            let back_m = VehicleKind::Bmw320i.vehicle().rear_m;
            for k in 0..steps {
                assert!((recorder.next_s() - 0.1 * f64::from(k)).abs() < 1e-12);
                recorder.push(&Ego {
                    pose: Pose2::new(20.0 - back_m + f64::from(k), 1.5, 0.0),
                    velocity_mps: Vector2::new(10.0, 0.0),
                    yaw_rate_radps: 0.0,
                    steering_rad: 0.0,
                });
            }
            for model in [Model::St, Model::Ks] {
                let solution = recorder.solution(model).unwrap();
                let verdict = check(recorder.scenario(), &solution);
                assert_eq!(verdict.is_valid(), is_valid, "{verdict}");
                assert_eq!(solution.driven[0].model, model);
                assert_eq!(solution.driven[0].states.len(), if is_valid { 11 } else { 5 });
                assert!(recorder.off_m(&solution) < 1e-6);
            }
        }
    }
}
