//! Latency budget: the largest added latency at which a run still ends well.

use std::sync::atomic::AtomicBool;

use swerve_drive::drive_unless;
use swerve_eval::Metrics;
use swerve_msg::truth::Verdict;
use swerve_scenario::Scenario;
use swerve_stack::Setup;

use super::grid::{Budget, Cell};
use super::result::CellResult;

/// Finds the latency budget of one cell; `None` for a run that fails without added latency. Its drives end once `stop` is
/// set.
pub(super) fn largest_latency(
    cell: &Cell,
    (config, scenario): (&Setup, &Scenario),
    budget: &Budget,
    stop: &AtomicBool,
) -> anyhow::Result<CellResult> {
    let mut without = None;
    let budget_ms = edge(budget, |added_ms| {
        let mut config = config.clone();
        config.planning.added_latency_ms += added_ms;
        let outcome = drive_unless(stop, &config, scenario, &mut [])?;
        let (_, metrics) = outcome.worst();
        without.get_or_insert(metrics.verdict);
        Ok(ends_well(metrics))
    })?;
    // The first drive is the one without added latency.
    let verdict = without.map_or("collision", Verdict::name);
    Ok(CellResult { budget_ms, ..CellResult::blank(cell, verdict) })
}

/// Returns true if the drive reached its end, or stands before someone who is in its way.
fn ends_well(metrics: &Metrics) -> bool {
    metrics.verdict.is_success() || metrics.verdict == Verdict::Stopped && metrics.stands_before.is_some()
}

/// Searches for the largest good value below the first bad one, ms: a scan from zero in fixed steps up to the maximum,
/// then bisection. Returns the maximum if no value is bad, `None` if zero is.
///
/// Good values beyond the first bad one are due to chance and are ignored.
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
    fn edge_finds_the_first_edge_to_the_resolution() {
        let budget = Budget { max_ms: 600.0, scan_ms: 50.0, resolution_ms: 5.0, limit: None };
        let found = edge(&budget, |ms| Ok(!(231.0..=400.0).contains(&ms))).unwrap().unwrap();
        assert!((226.0..231.0).contains(&found), "{found}");
        assert_eq!(edge(&budget, |ms| Ok(ms > 0.0)).unwrap(), None);
        assert_eq!(edge(&budget, |_| Ok(true)).unwrap(), Some(600.0));
    }

    #[test]
    fn edge_scans_up_to_the_maximum() {
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
