//! `report.html` of a study with all its cells, so that the page can pool, filter and rank them itself.

use serde::Serialize;
use swerve_report::page::Page;

use super::grid::Study;
use super::result::CellResult;
use super::table::Columns;

/// Data of a study's page. Numbers have at most four decimals.
#[derive(Clone, PartialEq, Debug, Serialize)]
pub struct StudyPage {
    /// Name of the study.
    pub name: String,
    /// Names of the axes.
    pub axes: Vec<String>,
    /// Verdicts that count as good.
    pub good: Vec<&'static str>,
    /// Axes whose combinations are ranked, with all others pooled; empty if the study has no ranking.
    pub settings: Vec<String>,
    /// Largest latency that a budget search tests, ms; `None` without a budget.
    pub budget_max_ms: Option<f64>,
    /// Names of the columns of `cells.csv` after the axes.
    pub columns: Vec<String>,
    /// All cells, in the order of the study.
    pub cells: Vec<PageCell>,
    /// Pictures as SVG, each with its title.
    pub pictures: Vec<(String, String)>,
    /// Note on the study as a whole.
    pub note: Option<String>,
}

/// Cell and its result.
#[derive(Clone, PartialEq, Debug, Default, Serialize)]
pub struct PageCell {
    /// Labels in tables, one per axis.
    pub labels: Vec<String>,
    /// Command line that repeats the cell.
    pub command: String,
    /// Page of its run, relative to that of the study; `None` if not kept.
    pub report: Option<String>,
    /// Values in the columns; empty if not driven yet.
    pub row: Vec<String>,
    /// Verdict, or `failed` if the drive failed; `None` if not driven yet.
    pub verdict: Option<String>,
    /// Error message.
    pub error: Option<String>,
    /// True if nothing was hit.
    pub no_collision: bool,
    /// True if the whole ego stayed on the road.
    pub on_road: bool,
    /// Smallest distance to another actor.
    pub min_distance_m: Option<f64>,
    /// Ego speed at the first impact; `None` without one.
    pub impact_speed_mps: Option<f64>,
    /// Largest raw lateral jerk.
    pub lateral_jerk_max: Option<f64>,
    /// Median response time.
    pub response_p50_ms: Option<f64>,
    /// 99th percentile of the response time.
    pub response_p99_ms: Option<f64>,
    /// Missed deadlines.
    pub misses: Option<u64>,
    /// Share of the plans made by the comfortable layer, 0 to 1.
    pub comfortable_share: Option<f64>,
    /// Largest added latency at which the run still ends well.
    pub budget_ms: Option<f64>,
    /// Digest of the run.
    pub digest: Option<String>,
}

/// Page of a study. `commands` repeat its cells and `reports` are the pages of their runs, both in the order of the
/// cells.
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
