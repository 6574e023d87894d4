//! Evaluation of a drive: verdict, distances, impact, comfort, response times, run times.
//!
//! Every measure is a small accumulator that takes in one sample at a time, so that a run of any length is
//! evaluated while it happens; [`Evaluation`] holds one of each and gives [`Metrics`], which serialise to
//! `metrics.json`. Inputs are messages and the simulator's truth (map frame, SI units, radians); all times
//! are instants of the run.
//! Absences: no engine, no simulator, no file, no clock; whether a result is good enough is for the caller.

mod average_precision;
mod distance;
mod distribution;
mod drive;
mod evaluation;
mod gate;
mod ground;
mod jerk;
mod overlap;
mod plan;
mod response;
mod runtime;
mod verdict;

pub use average_precision::{AveragePrecision, Found, Recalls};
pub use distance::{Clearance, Clearances, Outline};
pub use distribution::{Distribution, Summary};
pub use drive::{Drive, DriveMetrics};
pub use evaluation::{ActorMetrics, Evaluation, JerkMetrics, Metrics, Params, Sight};
pub use gate::{GateMetrics, GateStop, GateUse};
pub use jerk::{CUTOFF_HZ, LateralJerk, LowPass};
pub use overlap::{ground_iou, image_iou, shared_area_m2, volume_iou};
pub use plan::{PlanCounts, PlanMetrics};
pub use response::ResponseTimes;
pub use runtime::{OperatorMetrics, RunTimes};
pub use swerve_msg::truth::Verdict;
pub use verdict::{Impact, Outcome};

/// Seconds of an instant, divided so that decimal instants print as such (1.95, not 1.9500000000000002).
fn seconds(at: swerve_core::Time) -> f64 {
    at.ns() as f64 / 1e9
}
