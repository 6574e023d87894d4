//! Text of a report.

use swerve_eval::score::leaderboard::TotalScore;
use swerve_report::output::align;

use super::{Report, Score};

/// A row for each case and version, the rates of several routes, the comparison.
pub(super) fn text(report: &Report) -> String {
    let head =
        ["case", "version", "completion", "penalty", "driving score", "std dev", "difference", "status"];
    let mut rows = vec![head.map(str::to_owned).to_vec()];
    let mut rates = Vec::new();
    for case in &report.cases {
        for (version, score) in &case.scores {
            let (numbers, std_dev, status) = match score {
                Score::Route(route) => {
                    ([route.route_completion, route.penalty, route.driving_score], None, route.status)
                }
                Score::Total(total) => {
                    rates.extend(rate_rows(&case.name, version, total));
                    (
                        [total.route_completion, total.penalty, total.driving_score],
                        total.std_dev,
                        total.status,
                    )
                }
            };
            let [completion, penalty, driving_score] = numbers.map(number);
            let [std_dev, difference] = [std_dev, case.largest_difference.get(version).copied()]
                .map(|value| value.map_or_else(|| "-".to_owned(), number));
            let case = case.name.clone();
            let row = [
                case,
                (*version).to_owned(),
                completion,
                penalty,
                driving_score,
                std_dev,
                difference,
                status.to_string(),
            ];
            rows.push(row.to_vec());
        }
    }
    let mut blocks = Vec::new();
    if !report.cases.is_empty() {
        blocks.push(align(&rows));
    }
    if !rates.is_empty() {
        let head = ["case", "version", "infraction", "per km"].map(str::to_owned).to_vec();
        blocks.push(align(&[vec![head], rates].concat()));
    }
    if let Some(counting) = &report.counting {
        let mut rows = vec![["version", "collisions counted at, s"].map(str::to_owned).to_vec()];
        for (version, instants) in &counting.counted_at_s {
            let instants: Vec<String> = instants.iter().map(ToString::to_string).collect();
            rows.push(vec![(*version).to_owned(), instants.join(", ")]);
        }
        blocks.push(align(&rows));
    }
    if report.compared > 0 {
        blocks.push(comparison(report));
    }
    blocks.join("\n")
}

/// Rates above zero; `outside_route_lanes_km` is a distance.
fn rate_rows(case: &str, version: &str, total: &TotalScore) -> Vec<Vec<String>> {
    let positive = total.per_km.iter().filter(|(_, rate)| **rate > 0.0);
    positive
        .map(|(kind, rate)| vec![case.to_owned(), version.to_owned(), (*kind).to_owned(), number(*rate)])
        .collect()
}

fn comparison(report: &Report) -> String {
    let (compared, differing) = (report.compared, &report.differing);
    if differing.is_empty() {
        return format!("{compared} values compared with the file: all equal within their rounding\n");
    }
    let head = ["case", "version", "value", "expected", "found"].map(str::to_owned).to_vec();
    let row = |one: &super::Difference| {
        [&one.case, one.version, &one.value, &one.expected, &one.found].map(str::to_owned).to_vec()
    };
    let rows: Vec<Vec<String>> = std::iter::once(head).chain(differing.iter().map(row)).collect();
    format!("{compared} values compared with the file, {} differ:\n{}", differing.len(), align(&rows))
}

/// Up to six decimals.
fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
