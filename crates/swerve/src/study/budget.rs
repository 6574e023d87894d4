//! The latency budget: the largest added latency at which a run still ends well.

use swerve_scenario::Scenario;

use super::cells::CellResult;
use super::grid::{Budget, Cell};
use super::is_good;
use crate::config::Config;
use crate::run::drive;

/// Scans added latencies in steps, then bisects the edge between the last good step and the first bad one.
///
/// The edge is the *first* from zero on: what avoids again at a still larger latency does so by chance, and
/// nobody would build on it. A run that fails without added latency has no budget.
pub(super) fn largest_latency(
    cell: &Cell,
    config: &Config,
    scenario: &Scenario,
    budget: &Budget,
) -> anyhow::Result<CellResult> {
    let good = |added_ms: f64| -> anyhow::Result<bool> {
        let mut config = config.clone();
        config.planning.added_latency_ms += added_ms;
        Ok(is_good(drive(&config, scenario)?.metrics.verdict))
    };
    let mut result = CellResult {
        labels: cell.labels.clone(),
        verdict: "collision".into(),
        min_distance_m: None,
        impact_speed_mps: None,
        lateral_jerk_max: None,
        digest: None,
        budget_ms: None,
        error: None,
    };
    if !good(0.0)? {
        return Ok(result);
    }
    result.verdict = "avoided".into();
    let (mut low, mut high) = (0.0, budget.scan_ms);
    while high <= budget.max_ms && good(high)? {
        (low, high) = (high, high + budget.scan_ms);
    }
    if high <= budget.max_ms {
        while high - low > budget.resolution_ms {
            let middle = 0.5 * (low + high);
            if good(middle)? { low = middle } else { high = middle }
        }
    }
    result.budget_ms = Some(low);
    Ok(result)
}
