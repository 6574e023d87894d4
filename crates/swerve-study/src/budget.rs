//! The latency budget: the largest added latency at which a run still ends well.

use swerve_drive::drive;
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
        Ok(drive(&config, scenario)?.metrics.verdict.is_success())
    })?;
    if result.budget_ms.is_some() {
        result.verdict = "avoided".into();
    }
    Ok(result)
}

/// The largest good value below the first bad one, in ms: scanned in steps from zero, of which the last ends at the
/// largest value, then bisected. That largest value when none is bad, `None` when zero itself is.
///
/// What is good again beyond the first bad value is so by chance, and nobody would build on it.
pub(super) fn edge(
    budget: &Budget,
    mut good: impl FnMut(f64) -> anyhow::Result<bool>,
) -> anyhow::Result<Option<f64>> {
    if !good(0.0)? {
        return Ok(None);
    }
    let (mut low, mut high) = (0.0, budget.scan_ms.min(budget.max_ms));
    while good(high)? {
        if high >= budget.max_ms {
            return Ok(Some(budget.max_ms));
        }
        (low, high) = (high, (high + budget.scan_ms).min(budget.max_ms));
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

    #[test]
    fn all_up_to_the_largest_value_is_looked_at() {
        for (max_ms, scan_ms, first_bad_ms) in
            [(300.0, 70.0, 290.0), (300.0, 100.0, 299.0), (300.0, 300.0, 20.0), (300.0, 70.0, 301.0)]
        {
            let budget = Budget { max_ms, scan_ms, resolution_ms: 5.0, limit: None };
            let mut most = 0.0_f64;
            let found = edge(&budget, |ms| {
                most = most.max(ms);
                Ok(ms < first_bad_ms)
            });
            let (found, wanted) = (found.unwrap().unwrap(), first_bad_ms.min(max_ms));
            assert!(wanted - 5.0 <= found && found <= wanted, "{max_ms}, {scan_ms}: {found} for {wanted}");
            assert!(most <= max_ms, "{most}");
        }
    }
}
