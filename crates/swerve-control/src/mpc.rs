//! Linear time-varying model predictive control of the kinematic bicycle.
//!
//! States: position, heading, speed, steering angle, acceleration; inputs: steering rate and jerk, constant over steps
//! of 0.1 s. The model is linearised along knots: the poses of the path that the ego can reach with its speed, one per
//! step ([`Knot`]). Deviations are expressed in the axes of each knot, along and across the path, so that costs are
//! diagonal and constant and the corridor is a bound; each step is one quadratic program. If its unconstrained optimum
//! satisfies all bounds, it is the solution (a Riccati sweep); otherwise an interior-point method over such sweeps
//! finds it, and Clarabel if that does not converge. The number of iterations depends only on the program, and there is
//! no time limit.
//!
//! - Bounds on steering angle and rate, acceleration, jerk and speed are hard, except that a bound violated by the
//!   start state is widened to the hardest allowed way back, so that it cannot make the problem infeasible.
//! - The corridor is soft: its slack has a linear cost (so that the corridor is kept exactly if possible) and a
//!   quadratic one.
//! - Non-finite numbers are rejected before the solver, which would report them as infeasible.
//! - If the solver finds no solution, the last solution is shifted to the present; once it is too old, the car brakes
//!   with the wheels held. The [`Report`] states which applies.

mod model;
mod optimum;
#[cfg(test)]
mod optimum_tests;
mod program;
mod riccati;
mod stages;
#[cfg(test)]
mod tests;

use clarabel::solver::{DefaultSettings, SolverStatus};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Span, Time};
use swerve_geom::Pose2;
use swerve_vehicle::Limits;

pub use model::State;
use optimum::Optimum;
pub use program::Problem;
use program::Program;
use stages::Stages;

/// Parameters of the controller.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Params {
    /// Number of steps of the horizon.
    pub horizon: usize,
    /// Duration of a step, seconds.
    #[schemars(range(min = 0.01, max = 1.0))]
    pub dt_s: f64,
    /// Weights of the cost.
    #[ranges(nested)]
    pub weights: Weights,
    /// Largest jerk, m/s³.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub jerk_max_mps3: f64,
    /// Upper bound on the speed, m/s.
    #[schemars(range(min = 0.0, max = 200.0))]
    pub speed_max_mps: f64,
    /// Half width of the corridor around the path, metres, limited by the drivable ground.
    #[schemars(range(min = 0.01, max = 100.0))]
    pub corridor_m: f64,
    /// Distance that the corridor keeps between the car's side and the edge of the drivable ground, metres.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub edge_m: f64,
    /// Time offset between the measured state and the command taken from the solution, seconds: the delay of actuators
    /// and tyres, which the model lacks.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub lead_s: f64,
    /// Largest age of an earlier solution that replaces a failed one, seconds.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub shift_max_s: f64,
    /// Deceleration without a solution to shift, m/s² (positive).
    #[schemars(range(min = 0.0, max = 20.0))]
    pub fallback_brake_mps2: f64,
}

impl Default for Params {
    fn default() -> Self {
        Self {
            horizon: 20,
            dt_s: 0.1,
            weights: Weights::default(),
            jerk_max_mps3: 30.0,
            speed_max_mps: 40.0,
            corridor_m: 1.2,
            edge_m: 0.2,
            lead_s: 0.25,
            shift_max_s: 0.5,
            fallback_brake_mps2: 5.0,
        }
    }
}

/// Weights of the cost, per square of the unit named, each multiplied by 1/2.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct Weights {
    /// Weight of the longitudinal error along the path, metres.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub along: f64,
    /// Weight of the lateral error from the path, metres.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub across: f64,
    /// Weight of the heading error, radians.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub heading: f64,
    /// Weight of the speed error, m/s.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub speed: f64,
    /// Weight of the steering deviation from the path's curvature, radians.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub steering: f64,
    /// Weight of the acceleration error, m/s².
    #[schemars(range(min = 0.0, max = 1e9))]
    pub accel: f64,
    /// Weight of the steering rate, rad/s.
    #[schemars(range(min = 1e-6, max = 1e9))]
    pub steering_rate: f64,
    /// Weight of the jerk, m/s³.
    #[schemars(range(min = 1e-6, max = 1e9))]
    pub jerk: f64,
    /// Factor on the costs of the last state.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub terminal: f64,
    /// Linear cost of leaving the corridor, per metre.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub slack: f64,
    /// Quadratic cost of leaving the corridor, metres.
    #[schemars(range(min = 1e-6, max = 1e9))]
    pub slack_squared: f64,
}

impl Default for Weights {
    fn default() -> Self {
        Self {
            along: 1.0,
            across: 4.0,
            heading: 20.0,
            speed: 1.0,
            steering: 1.0,
            accel: 0.05,
            steering_rate: 5.0,
            jerk: 0.001,
            terminal: 2.0,
            slack: 50.0,
            slack_squared: 50.0,
        }
    }
}

impl Weights {
    /// Pylot's weights: Q = diag(1, 1, 0.01, 0.01) on x, y, speed and heading, R = diag(0.01, 0.1) on acceleration and
    /// steering, Rd = diag(0.01, 1) on their change per step of 0.1 s. Pylot's R weights the steering itself; here it
    /// weights the deviation from the path's curvature.
    pub fn pylot() -> Self {
        Self {
            along: 1.0,
            across: 1.0,
            heading: 0.01,
            speed: 0.01,
            steering: 0.1,
            accel: 0.01,
            steering_rate: 1.0 * 0.1 * 0.1,
            jerk: 0.01 * 0.1 * 0.1,
            terminal: 1.0,
            ..Self::default()
        }
    }

    fn states(&self) -> [f64; model::N_STATES] {
        [self.along, self.across, self.heading, self.speed, self.steering, self.accel]
    }
}

/// Hard bounds.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Bounds {
    pub(crate) steering_max_rad: f64,
    pub(crate) steering_rate_max_radps: f64,
    pub(crate) accel_min_mps2: f64,
    pub(crate) accel_max_mps2: f64,
    pub(crate) jerk_max_mps3: f64,
    pub(crate) speed_max_mps: f64,
}

/// One step of the path: the linearisation point, and the targets there.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Knot {
    /// A pose of the path, with the expected speed, steering and acceleration.
    pub state: State,
    /// Target position ahead of the pose along its heading, metres.
    pub wanted_along_m: f64,
    /// Target speed, m/s.
    pub wanted_speed_mps: f64,
    /// Target acceleration, m/s².
    pub wanted_accel_mps2: f64,
    /// Room to the left of the pose for the ego origin, metres; negative if the pose is outside.
    pub left_m: f64,
    /// Room to the right of the pose for the ego origin, metres; negative if the pose is outside.
    pub right_m: f64,
}

impl Knot {
    /// A knot on the x axis, with a metre of room to both sides.
    pub(crate) fn straight(x_m: f64, speed_mps: f64) -> Self {
        let state = State { pose: Pose2::new(x_m, 0.0, 0.0), speed_mps, ..State::default() };
        Self { state, wanted_speed_mps: speed_mps, left_m: 1.0, right_m: 1.0, ..Self::default() }
    }

    fn is_finite(&self) -> bool {
        self.state.is_finite()
            && [self.wanted_along_m, self.wanted_speed_mps, self.wanted_accel_mps2, self.left_m, self.right_m]
                .iter()
                .all(|x| x.is_finite())
    }
}

/// Source of a command.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Source {
    /// The solution of this step.
    Solution,
    /// An earlier solution, shifted to the present.
    Shifted,
    /// No usable solution: wheels held, brakes applied.
    Brake,
}

/// Termination status of the solver.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Ending {
    /// Solved.
    Solved,
    /// Solved to reduced accuracy.
    AlmostSolved,
    /// No point satisfies the constraints.
    Infeasible,
    /// Iteration limit reached, or no progress.
    Stalled,
    /// A number was not finite: the solver was not called.
    Refused,
}

/// Report of one step of the controller.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema)]
pub struct Report {
    /// Source of the command.
    pub source: Source,
    /// Termination status of the solver.
    pub ending: Ending,
    /// Iterations of the solver; 0 if no bound is active.
    pub iterations: u32,
    /// Largest distance of the solution outside the corridor, metres.
    pub slack_max_m: f64,
}

/// Output of the controller.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Step {
    /// Angle of the road wheels, radians.
    pub steering_rad: f64,
    /// Acceleration along the heading, m/s².
    pub accel_mps2: f64,
    /// Source of the command, and solver status.
    pub report: Report,
}

/// Model predictive controller. Allocates at construction; a step allocates only if Clarabel solves it.
pub struct Mpc {
    params: Params,
    stages: Stages,
    optimum: Optimum,
    /// Solver for programs on which `optimum` does not converge.
    program: Program,
    /// The last solution: states at its instant and after each step.
    solution: Vec<State>,
    solved_at: Option<Time>,
    steering_rad: f64,
}

impl Mpc {
    /// Creates a controller for a car with this wheelbase and these limits.
    pub fn new(params: Params, wheelbase_m: f64, limits: &Limits) -> Self {
        let bounds = Bounds {
            steering_max_rad: limits.steering_max_rad,
            steering_rate_max_radps: limits.steering_rate_max_radps,
            accel_min_mps2: -limits.brake_max_mps2,
            accel_max_mps2: limits.accel_max_mps2,
            jerk_max_mps3: params.jerk_max_mps3,
            speed_max_mps: params.speed_max_mps,
        };
        let horizon = params.horizon.max(1);
        let stages = Stages::new(horizon, params.dt_s, wheelbase_m, &params.weights, &bounds);
        Self {
            params: Params { horizon, ..params },
            optimum: Optimum::new(horizon),
            program: Program::new(&stages, settings()),
            stages,
            solution: Vec::with_capacity(horizon + 1),
            solved_at: None,
            steering_rad: 0.0,
        }
    }

    /// Number of steps of the horizon; [`step`](Self::step) expects one knot more.
    pub fn horizon(&self) -> usize {
        self.params.horizon
    }

    /// States of the last solution: at its instant and after each step. Empty before the first.
    pub fn solution(&self) -> &[State] {
        &self.solution
    }

    /// The latest problem passed to the solver, for inspection and comparison.
    pub fn problem(&self) -> Problem {
        self.program.problem(&self.stages)
    }

    /// Command for a car at `start` at `now`, to drive along `knots`: `knots[k]` belongs to `now + k dt`. A number of
    /// knots other than `horizon + 1` is rejected like non-finite numbers.
    pub fn step(&mut self, now: Time, start: &State, knots: &[Knot]) -> Step {
        let usable = knots.len() == self.params.horizon + 1;
        let (ending, iterations) = if usable && start.is_finite() && knots.iter().all(Knot::is_finite) {
            self.stages.fill(start, knots);
            self.solve()
        } else {
            (Ending::Refused, 0)
        };
        if matches!(ending, Ending::Solved | Ending::AlmostSolved) {
            self.keep(now, start, knots);
            let slack_max_m = self.optimum.slack_max_m();
            return self.command(now, Report { source: Source::Solution, ending, iterations, slack_max_m });
        }
        let shift_max = Span::from_secs(self.params.shift_max_s);
        let source = match self.solved_at {
            Some(at) if now >= at && now - at <= shift_max => Source::Shifted,
            _ => Source::Brake,
        };
        self.command(now, Report { source, ending, iterations, slack_max_m: 0.0 })
    }

    /// Stores the optimum as the last solution.
    fn keep(&mut self, now: Time, start: &State, knots: &[Knot]) {
        self.solution.clear();
        self.solution.push(*start);
        let deviations = knots[1..].iter().zip(self.optimum.solution());
        let deviated = deviations.map(|(knot, (values, _))| model::deviated(&knot.state, &values.states));
        self.solution.extend(deviated);
        self.solved_at = Some(now);
    }

    /// Solves the program in `stages`.
    fn solve(&mut self) -> (Ending, u32) {
        if self.optimum.unbounded(&self.stages) {
            return (Ending::Solved, 0);
        }
        if let Some(iterations) = self.optimum.bounded(&self.stages) {
            return (Ending::Solved, iterations);
        }
        let (status, iterations) = self.program.solve(&self.stages);
        self.optimum.adopt(self.program.solution());
        (ending(status), iterations)
    }

    /// Command from the last solution at `now` plus the lead, or the brake.
    fn command(&mut self, now: Time, report: Report) -> Step {
        let accel_mps2 = match self.solved_at {
            Some(at) if report.source != Source::Brake => {
                let (steering_rad, accel_mps2) = self.solution_at((now - at).as_secs() + self.params.lead_s);
                self.steering_rad = steering_rad;
                accel_mps2
            }
            _ => -self.params.fallback_brake_mps2,
        };
        Step { steering_rad: self.steering_rad, accel_mps2, report }
    }

    /// Steering and acceleration `after_s` seconds after the instant of the last solution.
    fn solution_at(&self, after_s: f64) -> (f64, f64) {
        let steps = (after_s / self.params.dt_s).clamp(0.0, self.params.horizon as f64);
        let k = (steps as usize).min(self.params.horizon - 1);
        let (a, b, t) = (&self.solution[k], &self.solution[k + 1], steps - k as f64);
        let mix = |a: f64, b: f64| a + (b - a) * t;
        (mix(a.steering_rad, b.steering_rad), mix(a.accel_mps2, b.accel_mps2))
    }
}

/// Settings under which Clarabel's data can be updated and the number of iterations depends only on the problem.
///
/// With these tolerances, angles and accelerations agree with tighter ones to about 1e-4.
fn settings() -> DefaultSettings<f64> {
    DefaultSettings {
        verbose: false,
        max_iter: 50,
        presolve_enable: false,
        input_sparse_dropzeros: false,
        max_threads: 1,
        direct_solve_method: "qdldl".to_string(),
        tol_gap_abs: 1e-5,
        tol_gap_rel: 1e-5,
        tol_feas: 1e-6,
        iterative_refinement_reltol: 1e-8,
        iterative_refinement_abstol: 1e-8,
        ..DefaultSettings::default()
    }
}

fn ending(status: SolverStatus) -> Ending {
    match status {
        SolverStatus::Solved => Ending::Solved,
        SolverStatus::AlmostSolved => Ending::AlmostSolved,
        SolverStatus::PrimalInfeasible
        | SolverStatus::DualInfeasible
        | SolverStatus::AlmostPrimalInfeasible
        | SolverStatus::AlmostDualInfeasible => Ending::Infeasible,
        SolverStatus::Unsolved
        | SolverStatus::MaxIterations
        | SolverStatus::MaxTime
        | SolverStatus::NumericalError
        | SolverStatus::InsufficientProgress
        | SolverStatus::CallbackTerminated => Ending::Stalled,
    }
}
