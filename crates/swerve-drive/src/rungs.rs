//! Effect of deadlines on a run: rungs used and time budgets.

use std::collections::BTreeMap;

use serde::Serialize;
use swerve_core::Span;
use swerve_flow::{Event, Observer};
use swerve_msg::{ResponseBudget, RungTaken};

/// Number of uses of a rung of a ladder.
#[derive(Serialize, Clone, PartialEq, Debug)]
pub struct RungCount {
    /// Operator with the ladder.
    pub operator: String,
    /// Rung.
    pub rung: String,
    /// Run time of the rung, ms.
    pub ms: f64,
    /// Number of frames answered by this rung in time.
    pub steps: u64,
}

/// Time that a deadline policy allotted from a frame to its plan.
#[derive(Serialize, Clone, Copy, PartialEq, Debug)]
pub struct Budgets {
    /// Minimum, ms.
    pub least_ms: f64,
    /// Mean over the frames, ms.
    pub mean_ms: f64,
    /// Maximum, ms.
    pub most_ms: f64,
}

/// Counters of rungs and budgets during a run.
#[derive(Default, Clone, Debug)]
pub struct Rungs {
    taken: BTreeMap<(String, Span, String), u64>,
    budgets_ms: Vec<f64>,
}

impl Rungs {
    /// Counts by operator, fastest rung first.
    pub fn counts(&self) -> Vec<RungCount> {
        let count = |((operator, run_time, rung), steps): (&(String, Span, String), &u64)| RungCount {
            operator: operator.clone(),
            rung: rung.clone(),
            ms: run_time.as_ms(),
            steps: *steps,
        };
        self.taken.iter().map(count).collect()
    }

    /// Budgets; `None` if no policy published any.
    pub fn budgets(&self) -> Option<Budgets> {
        let all = &self.budgets_ms;
        let least_ms = all.iter().copied().reduce(f64::min)?;
        let most_ms = all.iter().copied().reduce(f64::max)?;
        Some(Budgets { least_ms, mean_ms: all.iter().sum::<f64>() / all.len() as f64, most_ms })
    }

    /// Text for the terminal; empty if there is nothing to report.
    pub fn text(&self) -> String {
        let mut text = String::new();
        if let Some(Budgets { least_ms, mean_ms, most_ms }) = self.budgets() {
            text += &format!("response budget {least_ms:.0} to {most_ms:.0} ms, mean {mean_ms:.0} ms\n");
        }
        for of_one in self.counts().chunk_by(|a, b| a.operator == b.operator) {
            let said: Vec<String> = of_one.iter().map(|c| format!("{} {}x", c.rung, c.steps)).collect();
            text += &format!("{} took {}\n", of_one[0].operator, said.join(", "));
        }
        text
    }
}

impl Observer for Rungs {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(RungTaken { rung, run_time, .. }) = payload.downcast_ref::<RungTaken>() {
            let key = (publication.operator.to_owned(), *run_time, rung.clone());
            *self.taken.entry(key).or_default() += 1;
        } else if let Some(budget) = payload.downcast_ref::<ResponseBudget>() {
            self.budgets_ms.push(budget.response.as_ms());
        }
    }
}
