//! `report.html` of a study: every cell, so that the page can pool, filter and rank them itself.

use serde::Serialize;
use swerve_report::page::Page;

use super::cells::CellResult;
use super::grid::Study;
use super::table::Columns;

/// A study. Numbers have four decimals at most.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct StudyPage {
    /// Its name.
    pub name: String,
    /// Names of its axes.
    pub axes: Vec<String>,
    /// Verdicts that count as good.
    pub good: Vec<&'static str>,
    /// The axes whose combinations are ranked, all others being pooled; empty where the study does not say.
    pub settings: Vec<String>,
    /// The largest latency that a budget can be found to be, ms; none where no budget is asked for.
    pub budget_max_ms: Option<f64>,
    /// Names of the columns that `cells.csv` has behind the axes.
    pub columns: Vec<String>,
    /// All cells, in the order of the study.
    pub cells: Vec<PageCell>,
    /// Pictures as SVG, each with its title.
    pub pictures: Vec<(String, String)>,
    /// What is to be known of the study as a whole; none where nothing is.
    pub note: Option<String>,
}

/// A cell and what it came to.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct PageCell {
    /// What stands in the table, one an axis.
    pub labels: Vec<String>,
    /// The command line that repeats it.
    pub command: String,
    /// The page of its run, seen from that of the study; none where it was not kept.
    pub report: Option<String>,
    /// What it has in the columns; empty before it was driven.
    pub row: Vec<String>,
    /// How it ended, `failed` where it could not be made; none before it was driven.
    pub verdict: Option<String>,
    /// What went wrong.
    pub error: Option<String>,
    /// Whether nothing was hit.
    pub no_collision: bool,
    /// Whether all of the ego stayed on the road.
    pub on_road: bool,
    /// Smallest distance to another actor.
    pub min_distance_m: Option<f64>,
    /// Ego speed at the first impact; none without one.
    pub impact_speed_mps: Option<f64>,
    /// Largest raw lateral jerk.
    pub lateral_jerk_max: Option<f64>,
    /// Median response time.
    pub response_p50_ms: Option<f64>,
    /// 99th percentile of the response time.
    pub response_p99_ms: Option<f64>,
    /// Deadlines missed.
    pub misses: Option<u64>,
    /// Share of the plans that the comfortable layer made, 0 to 1.
    pub comfortable_share: Option<f64>,
    /// Largest added latency that still avoids.
    pub budget_ms: Option<f64>,
    /// Digest of the run.
    pub digest: Option<String>,
}

/// The page of a study; `commands` repeat its cells and `reports` are the pages of their runs, in their order.
pub(super) fn page(
    study: &Study,
    results: &[Option<CellResult>],
    (commands, reports): (&[String], Vec<Option<String>>),
    pictures: Vec<(String, String)>,
    note: Option<String>,
) -> Page<StudyPage> {
    let columns = Columns::of(study, results);
    let cells = study.cells.iter().zip(results).zip(commands).zip(reports);
    let good = [
        ("avoided", true),
        ("completed", true),
        ("stopped", study.timeout_is_good),
        ("timeout", study.timeout_is_good),
        ("left_road", study.off_road_is_good),
    ];
    let title = if study.description.is_empty() { &study.name } else { &study.description };
    let ranked = study.ranking.as_ref().map(|ranking| ranking.settings.clone());
    let of = StudyPage {
        name: study.name.clone(),
        axes: study.axes.clone(),
        good: good.into_iter().filter_map(|(verdict, counts)| counts.then_some(verdict)).collect(),
        settings: ranked.unwrap_or_default(),
        budget_max_ms: study.budget.as_ref().map(|budget| budget.max_ms),
        cells: cells
            .map(|(((cell, result), command), report)| PageCell {
                report: report.filter(|_| result.is_some()),
                row: result.as_ref().map_or_else(Vec::new, |result| columns.row(study, result)),
                ..page_cell(&cell.labels, result.as_ref(), command)
            })
            .collect(),
        columns: columns.names(),
        pictures,
        note,
    };
    Page::new("study", title, of)
}

fn page_cell(labels: &[String], result: Option<&CellResult>, command: &str) -> PageCell {
    let blank = PageCell { labels: labels.to_vec(), command: command.to_owned(), ..PageCell::default() };
    let Some(result) = result else { return blank };
    if let Some(error) = &result.error {
        return PageCell { verdict: Some("failed".into()), error: Some(error.clone()), ..blank };
    }
    PageCell {
        verdict: Some(result.verdict.clone()),
        no_collision: result.no_collision,
        on_road: result.on_road,
        min_distance_m: result.min_distance_m.map(rounded),
        impact_speed_mps: result.impact_speed_mps.filter(|_| !result.no_collision).map(rounded),
        lateral_jerk_max: result.lateral_jerk_max.map(rounded),
        response_p50_ms: result.response_p50_ms.map(rounded),
        response_p99_ms: result.response_p99_ms.map(rounded),
        misses: Some(result.misses),
        comfortable_share: result.figures.get("plans.comfortable_share").copied().map(rounded),
        budget_ms: result.budget_ms.map(rounded),
        digest: result.digest.map(|digest| digest.to_string()),
        ..blank
    }
}

fn rounded(value: f64) -> f64 {
    (value * 1e4).round() / 1e4
}
