//! Evaluation of driving: verdict, distances, impact, comfort, response times, run times; of perception: detections,
//! tracks, segmentation, also with latency taken into account ([`timely`]); of localization: trajectory errors and
//! filter consistency; and of predictions ([`forecast`]). [`score`] has the driving scores of other benchmarks.
//!
//! Every metric is a small accumulator of samples, so that runs of any length are evaluated online. [`Evaluation`]
//! holds one of each and computes [`Metrics`], which serialise to `metrics.json`. Inputs are messages and the
//! simulator's ground truth (map frame, SI units, radians); all times are instants of the run.
//! The crate depends on no engine, simulator, file or clock. Judging whether a result is good enough is up to the
//! caller.

mod average_precision;
mod behaviour;
mod coco;
pub mod comfort;
mod consistency;
mod distance;
mod distribution;
mod drive;
mod evaluation;
pub mod forecast;
mod gate;
mod ground;
mod jerk;
mod kitti;
mod light;
mod localization;
mod others;
mod overlap;
mod plan;
mod response;
mod runtime;
pub mod score;
mod segmentation;
pub mod timely;
mod tracking;
mod tracks;
mod traffic;
mod trajectory;
mod verdict;
mod why;

pub use average_precision::{AveragePrecision, Found, Recalls};
pub use behaviour::{Behaviour, BehaviourMetrics, StateChange};
pub use coco::{CocoClass, CocoFound, CocoMetrics, CocoTruth};
pub use consistency::Consistency;
pub use distance::{Clearance, Clearances, Outline};
pub use distribution::{Distribution, Summary, median};
pub use drive::{Drive, DriveMetrics};
pub use evaluation::{ActorMetrics, DecidedBy, Evaluation, JerkMetrics, Metrics, Params, Sight};
pub use gate::{GateMetrics, GateStop, GateUse};
pub use jerk::{CUTOFF_HZ, LateralJerk, LowPass};
pub use kitti::{KittiAp, KittiClass, KittiFound, KittiKind, KittiLevel, KittiTruth, kitti_ap};
pub use light::LightCourse;
pub use localization::{Localization, LocalizationMetrics, PoseGap, QualityMetrics};
pub use others::OthersImpact;
pub use overlap::{ground_iou, overlapping, shared_area_m2, volume_iou};
pub use plan::{PlanCounts, PlanMetrics};
pub use response::ResponseTimes;
pub use runtime::{OperatorMetrics, RunTimes};
pub use segmentation::{Confusion, UnknownClass};
pub use swerve_geom::image_iou;
pub use swerve_msg::truth::Verdict;
pub use tracking::{ClearMot, Hota, IdentityScore, SIMILARITY_MIN, TrackingFrame, TrackingMetrics};
pub use tracks::{Followed, TrackComparison, TrackMetrics, VELOCITY_KNOWN_MPS, actor_at};
pub use traffic::{Directions, Norm, TrafficMetrics};
pub use trajectory::{
    Alignment, PoseErrors, SpacePose, TrajectoryErrors, absolute_errors, aligned, relative_errors,
};
pub use verdict::{Impact, Outcome};
pub use why::{Account, Milestone, Until, Wait, Why, WhyStep};

/// Seconds of an instant, divided so that decimal instants print as such (1.95, not 1.9500000000000002).
fn seconds(at: swerve_core::Time) -> f64 {
    at.ns() as f64 / 1e9
}
