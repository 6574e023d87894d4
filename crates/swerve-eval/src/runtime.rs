//! Run times, missed deadlines and dropped frames per operator.

use serde::{Deserialize, Serialize};
use swerve_core::Span;

use crate::Distribution;

/// Run times of one operator's steps.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct OperatorMetrics {
    /// Operator name.
    pub operator: String,
    /// Number of steps that reached their modelled end.
    pub steps: u64,
    /// Median run time, ms; zero without steps.
    pub p50_ms: f64,
    /// 99th percentile of the run time, ms; zero without steps.
    pub p99_ms: f64,
    /// Longest run time, ms; zero without steps.
    pub max_ms: f64,
    /// Deadlines missed.
    pub misses: u64,
    /// Complete frames dropped by the busy policy.
    pub drops: u64,
}

/// Run-time table under construction; operators are numbered from 0 in table order.
#[derive(Clone, Debug, Default)]
pub struct RunTimes {
    operators: Vec<Counts>,
}

#[derive(Clone, Debug, Default)]
struct Counts {
    name: String,
    steps: Distribution,
    misses: u64,
    drops: u64,
}

impl RunTimes {
    /// Creates a table of the named operators, in this order.
    pub fn new<S: Into<String>>(names: impl IntoIterator<Item = S>) -> Self {
        let counts = |name: S| Counts { name: name.into(), ..Counts::default() };
        Self { operators: names.into_iter().map(counts).collect() }
    }

    /// Records a step of operator number `operator` that took `runtime`.
    ///
    /// # Panics
    /// If there is no operator of that number, as in the other two methods.
    pub fn step(&mut self, operator: usize, runtime: Span) {
        self.operators[operator].steps.take(runtime);
    }

    /// Records a missed deadline of operator number `operator`.
    pub fn missed(&mut self, operator: usize) {
        self.operators[operator].misses += 1;
    }

    /// Records a dropped frame of operator number `operator`.
    pub fn dropped(&mut self, operator: usize) {
        self.operators[operator].drops += 1;
    }

    /// Table so far.
    pub fn table(&self) -> Vec<OperatorMetrics> {
        let row = |counts: &Counts| {
            let steps = counts.steps.summary().unwrap_or_default();
            OperatorMetrics {
                operator: counts.name.clone(),
                steps: steps.count,
                p50_ms: steps.p50_ms,
                p99_ms: steps.p99_ms,
                max_ms: steps.max_ms,
                misses: counts.misses,
                drops: counts.drops,
            }
        };
        self.operators.iter().map(row).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn table_counts_per_operator() {
        let mut times = RunTimes::new(["detector", "planner"]);
        (1..=4).for_each(|ms| times.step(1, Span::from_ms(ms)));
        times.missed(1);
        times.dropped(0);
        let table = times.table();
        assert_eq!((table[0].operator.as_str(), table[0].steps, table[0].drops), ("detector", 0, 1));
        assert_eq!((table[1].steps, table[1].p50_ms, table[1].p99_ms, table[1].max_ms), (4, 2.0, 4.0, 4.0));
        assert_eq!(table[1].misses, 1);
    }
}
