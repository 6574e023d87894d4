//! Comparison of results with those in the file.

use serde::Serialize;
use swerve_eval::score::leaderboard::{RouteScore, Status, Version};

use super::Score;
use super::file::{Case, Counting};

/// A result that differs from that in the file.
#[derive(Serialize)]
pub(super) struct Difference {
    pub(super) case: String,
    pub(super) version: &'static str,
    pub(super) value: String,
    pub(super) expected: String,
    pub(super) found: String,
}

/// Comparison of some results with those in the file.
#[derive(Default)]
pub(super) struct Comparison {
    /// Number of values compared.
    pub(super) compared: usize,
    /// Those that differ by more than their rounding.
    pub(super) differing: Vec<Difference>,
    /// Largest difference of numbers; `None` if none is compared.
    pub(super) largest: Option<f64>,
}

/// Half of the last place of scores, and of rates and standard deviations of 2.x; with room for the error of doubles.
const SCORE_TOLERANCE: f64 = 0.500_001e-6;
const OTHER_TOLERANCE: f64 = 0.500_001e-3;

/// Compares the scores of a case with its `status` and `expect`.
pub(super) fn compare(case: &Case, score: &Score, version: Version) -> Comparison {
    let mut list = Comparisons { case: &case.name, version, of: Comparison::default() };
    let routes = match score {
        Score::Route(route) => std::slice::from_ref(route),
        Score::Total(total) => &total.routes,
    };
    if let Some(expected) = case.expected_status(version) {
        let found = match score {
            Score::Route(route) => route.status,
            Score::Total(total) => total.status,
        };
        list.status(expected, found);
    }
    let Some(expect) = case.expected(version) else { return list.of };
    let one = |of: fn(&RouteScore) -> f64| match routes {
        [route] => Some(of(route)),
        _ => None,
    };
    let total = match score {
        Score::Route(_) => None,
        Score::Total(total) => Some(total),
    };
    let other = if version.is_second() { OTHER_TOLERANCE } else { SCORE_TOLERANCE };
    list.number("penalty", expect.penalty, one(|route| route.penalty), SCORE_TOLERANCE);
    list.number("driving_score", expect.driving_score, one(|route| route.driving_score), SCORE_TOLERANCE);
    if let Some(scores) = &expect.driving_scores {
        for k in 0..scores.len().max(routes.len()) {
            let name = format!("driving_scores[{k}]");
            let found = routes.get(k).map(|route| route.driving_score);
            match scores.get(k) {
                Some(expected) => list.number(&name, Some(*expected), found, SCORE_TOLERANCE),
                None => list.differs(name, "-".to_owned(), shown(found)),
            }
        }
    }
    list.number("mean", expect.mean, total.map(|total| total.driving_score), SCORE_TOLERANCE);
    list.number("std_dev", expect.std_dev, total.and_then(|total| total.std_dev), other);
    for (kind, rate) in &expect.per_km {
        let found = total.and_then(|total| total.per_km.get(kind.as_str()).copied());
        list.number(&format!("per_km.{kind}"), Some(*rate), found, other);
    }
    list.of
}

/// Same, for the instants of collisions.
pub(super) fn compare_counting(counting: &Counting, found: &[f64], version: Version) -> Comparison {
    let mut list = Comparisons { case: "counting", version, of: Comparison::default() };
    if let Some(expect) = counting.expect.of(version) {
        list.of.compared += 1;
        if expect.counted_at_s != found {
            let name = "counted_at_s".to_owned();
            list.differs(name, format!("{:?}", expect.counted_at_s), format!("{found:?}"));
        }
    }
    list.of
}

struct Comparisons<'a> {
    case: &'a str,
    version: Version,
    of: Comparison,
}

impl Comparisons<'_> {
    /// A result is compared if the file has one.
    fn number(&mut self, value: &str, expected: Option<f64>, found: Option<f64>, tolerance: f64) {
        let Some(expected) = expected else { return };
        self.of.compared += 1;
        let difference = found.map(|found| (found - expected).abs());
        self.of.largest = [self.of.largest, difference].into_iter().flatten().reduce(f64::max);
        if difference.is_none_or(|difference| difference > tolerance) {
            self.differs(value.to_owned(), shown(Some(expected)), shown(found));
        }
    }

    fn status(&mut self, expected: &str, found: Status) {
        self.of.compared += 1;
        if expected != found.to_string() {
            self.differs("status".to_owned(), expected.to_owned(), found.to_string());
        }
    }

    fn differs(&mut self, value: String, expected: String, found: String) {
        let (case, version) = (self.case.to_owned(), self.version.name());
        self.of.differing.push(Difference { case, version, value, expected, found });
    }
}

/// Up to nine decimals: more than the tolerances.
fn shown(found: Option<f64>) -> String {
    let Some(found) = found else { return "-".to_owned() };
    let text = format!("{found:.9}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}
