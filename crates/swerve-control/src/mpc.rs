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

mod knot;
mod model;
mod optimum;
#[cfg(test)]
mod optimum_tests;
mod params;
mod program;
mod riccati;
mod stages;
#[cfg(test)]
mod tests;

use clarabel::solver::{DefaultSettings, SolverStatus};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Span, Time};
use swerve_vehicle::Limits;

pub use knot::Knot;
pub use model::State;
use optimum::Optimum;
pub use params::{Params, Weights};
pub use program::Problem;
use program::Program;
use stages::{Bounds, Stages};

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
