//! The latency budget: the largest added latency at which a run still ends well.

use swerve_drive::drive;
use swerve_eval::Verdict;
use swerve_scenario::Scenario;
use swerve_stack::config::Config;

use super::cells::CellResult;
use super::grid::{Budget, Cell};

/// Finds the latency budget of one cell; a run that fails without added latency has none.
pub(super) fn largest_latency(
    cell: &Cell,
    config: &Config,
    scenario: &Scenario,
    budget: &Budget,
) -> anyhow::Result<CellResult> {
    let mut result = CellResult::blank(cell, "collision");
    result.budget_ms = edge(budget, |added_ms| {
        let mut config = config.clone();
        config.planning.added_latency_ms += added_ms;
        Ok(drive(&config, scenario)?.metrics.verdict == Verdict::Avoided)
    })?;
    if result.budget_ms.is_some() {
        result.verdict = "avoided".into();
    }
    Ok(result)
}

/// The largest good value below the first bad one, in ms: scanned in steps from zero, then bisected. `None` when
/// zero itself is bad.
///
/// What is good again beyond the first bad value is so by chance, and nobody would build on it.
pub(super) fn edge(
    budget: &Budget,
    mut good: impl FnMut(f64) -> anyhow::Result<bool>,
) -> anyhow::Result<Option<f64>> {
    if !good(0.0)? {
        return Ok(None);
    }
    let (mut low, mut high) = (0.0, budget.scan_ms);
    while high <= budget.max_ms && good(high)? {
        (low, high) = (high, high + budget.scan_ms);
    }
    if high > budget.max_ms {
        return Ok(Some(low));
    }
    while high - low > budget.resolution_ms {
        let middle = 0.5 * (low + high);
        if good(middle)? { low = middle } else { high = middle }
    }
    Ok(Some(low))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_edge_is_found_to_the_resolution() {
        let budget = Budget { max_ms: 600.0, scan_ms: 50.0, resolution_ms: 5.0, limit: None };
        let found = edge(&budget, |ms| Ok(!(231.0..=400.0).contains(&ms))).unwrap().unwrap();
        assert!((226.0..231.0).contains(&found), "{found}");
        assert_eq!(edge(&budget, |ms| Ok(ms > 0.0)).unwrap(), None);
        assert_eq!(edge(&budget, |_| Ok(true)).unwrap(), Some(600.0));
    }
}
