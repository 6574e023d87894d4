//! Results of cells.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use swerve_core::Digest;
use swerve_eval::score::DrivingScores;

use crate::columns::{AS_EXPECTED, AT_FAULT, NOT_AS_EXPECTED, ROAD_USERS_LEFT_OUT};
use crate::grid::Cell;

/// Result of one cell.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct CellResult {
    /// Labels of the cell in the table, one per axis.
    pub labels: Vec<String>,
    /// Verdict of the run.
    pub verdict: String,
    /// True if nothing was hit.
    #[serde(default)]
    pub no_collision: bool,
    /// True if no part of the ego left the drivable area.
    #[serde(default)]
    pub on_road: bool,
    /// Smallest distance to another actor, m.
    pub min_distance_m: Option<f64>,
    /// Ego speed at the first impact, m/s.
    pub impact_speed_mps: Option<f64>,
    /// Largest raw lateral jerk, m/s³.
    pub lateral_jerk_max: Option<f64>,
    /// Digest of the run.
    pub digest: Option<Digest>,
    /// Median response time, ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response_p50_ms: Option<f64>,
    /// 99th percentile of the response time, ms.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response_p99_ms: Option<f64>,
    /// Missed deadlines, over all operators.
    #[serde(default)]
    pub misses: u64,
    /// All other numeric metrics of the run, by their names in `metrics.json`; missing ones are absent.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub figures: BTreeMap<String, f64>,
    /// Text and boolean metrics of the run, by their names in `metrics.json`; missing ones are absent.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub texts: BTreeMap<String, String>,
    /// Largest added latency at which the run still ends well, ms; only in latency-budget studies.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub budget_ms: Option<f64>,
    /// Curve of the study, if it has one.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub curve: Vec<f64>,
    /// Readings of a timely study.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub timely: Vec<Reading>,
    /// Driving scores of a drive with a goal on a map.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub scores: Option<DrivingScores>,
    /// Error message, if the run itself failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

impl CellResult {
    /// True if the drive met its scenario's expectations; `None` if it has none.
    pub fn as_expected(&self) -> Option<bool> {
        self.truth(AS_EXPECTED)
    }

    /// True if the ego is at fault in its collision; `None` without one.
    pub(crate) fn at_fault(&self) -> Option<bool> {
        self.truth(AT_FAULT)
    }

    fn truth(&self, column: &str) -> Option<bool> {
        self.texts.get(column).map(|text| text == "true")
    }

    /// Unmet expectations.
    pub(crate) fn not_as_expected(&self) -> &str {
        self.texts.get(NOT_AS_EXPECTED).map_or("", String::as_str)
    }

    /// Number of road users of the traffic for which there was no place; `None` without traffic.
    pub(crate) fn road_users_left_out(&self) -> Option<usize> {
        self.figures.get(ROAD_USERS_LEFT_OUT).map(|count| *count as usize)
    }

    /// Operators of which no step ended.
    fn without_steps(&self) -> impl Iterator<Item = &str> {
        let steps = self.figures.iter().filter(|(_, steps)| **steps == 0.0);
        steps.filter_map(|(name, _)| name.strip_prefix("operator.")?.strip_suffix(".steps"))
    }

    /// Note on the operators of which no step ended, with the number of cells for each; empty without such cells.
    pub(crate) fn note_without_steps(results: &[Option<Self>]) -> String {
        let mut cells = BTreeMap::<&str, usize>::new();
        for name in results.iter().flatten().flat_map(Self::without_steps) {
            *cells.entry(name).or_default() += 1;
        }
        let all = results.iter().flatten().count();
        let one = |(name, count): (&str, usize)| format!("{name} in {count}");
        let each: Vec<String> = cells.into_iter().map(one).collect();
        match each.is_empty() {
            true => String::new(),
            false => format!(
                "of {all} cells, no step of {} ended: what they read did not arrive, or they took too long\n",
                each.join(", of ")
            ),
        }
    }

    /// Result without metrics.
    pub fn blank(cell: &Cell, verdict: &str) -> Self {
        Self {
            labels: cell.labels.clone(),
            verdict: verdict.into(),
            no_collision: false,
            on_road: false,
            min_distance_m: None,
            impact_speed_mps: None,
            lateral_jerk_max: None,
            digest: None,
            response_p50_ms: None,
            response_p99_ms: None,
            misses: 0,
            figures: BTreeMap::new(),
            texts: BTreeMap::new(),
            budget_ms: None,
            curve: Vec::new(),
            timely: Vec::new(),
            scores: None,
            error: None,
        }
    }

    /// True if the run ended without collision and on the road.
    pub fn avoided(&self) -> bool {
        matches!(self.verdict.as_str(), "avoided" | "completed")
    }
}

/// Values of one measure at one run time: one per comparison, or one for the whole ride.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Reading {
    /// Measure and anchor.
    pub series: String,
    /// Run time, ms or multiple of the published one.
    pub at: f64,
    /// Values.
    pub values: Vec<f64>,
}
