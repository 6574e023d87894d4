use crate::{Bound, Expectation, Metric, Verdict};
use swerve_text::{Range, TableReader};

const FIGURE: Range = Range::between(-1e9, 1e9);

/// Reads the `[expect]` table and its `[expect.pipeline.NAME]` tables; returns nothing if there are none.
pub(super) fn read(top: &TableReader<'_>) -> Vec<Expectation> {
    let Some(table) = top.table_if_any("expect") else { return Vec::new() };
    let mut expect = Vec::new();
    let pipelines = table.table_if_any("pipeline");
    // If there are entries for named pipelines only, there is no expectation for the others.
    let only_named = pipelines.is_some() && table.keys().len() == 1;
    if !only_named {
        expect.push(expectation(&table, None));
    }
    if let Some(pipelines) = pipelines {
        for name in pipelines.keys() {
            if let Some(own) = pipelines.named_table(name) {
                expect.push(expectation(&own, Some(name.to_owned())));
            }
        }
    }
    expect
}

fn expectation(table: &TableReader<'_>, pipeline: Option<String>) -> Expectation {
    let verdict = table.one_of("verdict", &Verdict::OF_SCENARIOS.map(Verdict::name)).unwrap_or(0);
    let bounds: Vec<Bound> = Metric::ALL.into_iter().filter_map(|metric| bound(table, metric)).collect();
    table.finish();
    Expectation { pipeline, verdict: Verdict::OF_SCENARIOS[verdict], bounds }
}

fn bound(table: &TableReader<'_>, metric: Metric) -> Option<Bound> {
    let own = table.table_if_any(metric.name())?;
    let (min, max) = (own.number_if_any("min", FIGURE), own.number_if_any("max", FIGURE));
    own.finish();
    match (min, max) {
        (None, None) => {
            table.report(metric.name(), "expected { min = ... }, { max = ... } or both");
            None
        }
        (Some(low), Some(high)) if low > high => {
            table.report(metric.name(), format!("the lowest value {low} is above the highest {high}"));
            None
        }
        _ => Some(Bound { metric, min, max }),
    }
}
