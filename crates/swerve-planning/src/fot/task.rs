//! Input of a search.

use super::lateral::FrenetState;
use super::line::Line;
use super::motion::Checks;
use super::params::Params;

/// Input of a search.
#[derive(Clone, Copy, Debug)]
pub struct Task<'a> {
    /// Limits and weights.
    pub params: &'a Params,
    /// The reference line.
    pub line: &'a Line,
    /// Samples beyond this arc length are ignored, metres; infinite: the line continues.
    pub cut_m: f64,
    /// Start state of the ego.
    pub start: FrenetState,
    /// Target speed, m/s.
    pub target_mps: f64,
    /// Conditions on the result.
    pub checks: Checks<'a>,
}
