//! Columns of `cells.csv`: those of a drive by its metrics, and all that drives can have.

mod sample;

use std::collections::BTreeMap;

use serde_json::Value;
use swerve_eval::Metrics;
use swerve_text::did_you_mean;

use self::sample::{ANY, sample};

/// Keys in `metrics.json` and `cells.csv` for whether a drive met its scenario's expectations, and for the unmet ones.
pub(crate) const AS_EXPECTED: &str = "as_expected";
pub(crate) const NOT_AS_EXPECTED: &str = "not_as_expected";

/// Key in `metrics.json` and `cells.csv` for the number of road users of the traffic for which there was no place.
pub(crate) const ROAD_USERS_LEFT_OUT: &str = "road_users_left_out";

/// Key in `metrics.json` and `cells.csv` for whether the ego is at fault in its collision.
pub(crate) const AT_FAULT: &str = "impact.at_fault";

/// Key in `cells.csv` for the name of the ego whose metrics these are, in runs with several.
pub(crate) const EGO: &str = "ego";

/// First columns after a cell's labels, for drives.
pub(crate) const DRIVE: [&str; 10] = [
    "verdict",
    "no_collision",
    "on_road",
    "min_distance_m",
    "impact_speed_mps",
    "lateral_jerk_max",
    "digest",
    "response_p50_ms",
    "response_p99_ms",
    "misses",
];

/// Metrics that always have a column, so that tables of several studies have the same ones.
pub(crate) const ALWAYS: [&str; 14] = [
    "end",
    "impact.actor",
    AT_FAULT,
    "impact.at_s",
    "impact.closing_speed_mps",
    "impact.ego_speed_mps",
    "impact.impulse_n_s",
    "impact_name",
    "left_road_at_s",
    "min_distance_actor",
    "min_distance_name",
    "stands_before",
    STANDS_BEFORE,
    "waits_at_light",
];

/// Column with the name of the actor that `stands_before` identifies by number.
const STANDS_BEFORE: &str = "stands_before_name";

/// Text and boolean metrics of a run by their names in `metrics.json`, without the verdict, which has its own column;
/// and the name of the actor that the ego stopped for.
pub(crate) fn texts(metrics: &Metrics) -> BTreeMap<String, String> {
    let Ok(Value::Object(all)) = serde_json::to_value(metrics) else { return BTreeMap::new() };
    let text = |(name, value)| match value {
        Value::String(text) => Some((name, text)),
        Value::Bool(holds) => Some((name, holds.to_string())),
        _ => None,
    };
    let stands = metrics.actors.iter().find(|actor| Some(actor.actor) == metrics.stands_before);
    let stands = stands.map(|actor| (STANDS_BEFORE.to_owned(), actor.name.clone()));
    let at_fault = metrics.impact.map(|impact| (AT_FAULT.to_owned(), impact.at_fault.to_string()));
    all.into_iter()
        .filter_map(text)
        .filter(|(name, _)| name != "verdict")
        .chain(stands)
        .chain(at_fault)
        .collect()
}

/// Numeric metrics of a run by their names in `metrics.json`, without those that have fixed columns and those in lists
/// of actors and instants; metrics of operators by operator name.
pub(crate) fn figures(metrics: &Metrics) -> BTreeMap<String, f64> {
    fn gather(prefix: &str, value: &Value, into: &mut BTreeMap<String, f64>) {
        match value {
            Value::Number(x) => drop(into.insert(prefix.to_owned(), x.as_f64().unwrap_or(f64::NAN))),
            Value::Object(inner) => {
                for (key, value) in inner {
                    let name = if prefix.is_empty() { key.clone() } else { format!("{prefix}.{key}") };
                    gather(&name, value, into);
                }
            }
            _ => {}
        }
    }
    let mut all = BTreeMap::new();
    gather("", &serde_json::to_value(metrics).unwrap_or_default(), &mut all);
    let told = [
        "min_distance_m",
        "impact_speed_mps",
        "lateral_jerk.raw_max_mps3",
        "response.p50_ms",
        "response.p99_ms",
    ];
    for operator in &metrics.operators {
        let counts = [("steps", operator.steps), ("misses", operator.misses), ("drops", operator.drops)];
        let took = [("p50_ms", operator.p50_ms), ("p99_ms", operator.p99_ms), ("max_ms", operator.max_ms)];
        // An operator without steps has no run time.
        let took = took.into_iter().filter(|_| operator.steps > 0);
        for (what, x) in counts.map(|(what, n)| (what, n as f64)).into_iter().chain(took) {
            all.insert(format!("operator.{}.{what}", operator.operator), x);
        }
    }
    all.retain(|name, x| x.is_finite() && !told.contains(&name.as_str()));
    all
}

/// Checks that a column can have numbers or booleans.
///
/// # Errors
/// A message with the nearest column.
pub(crate) fn check_numeric(column: &str) -> Result<(), String> {
    let all = possible();
    let is = |pattern: &str| match pattern.split_once(ANY) {
        Some((before, after)) => column
            .strip_prefix(before)
            .and_then(|rest| rest.strip_suffix(after))
            .is_some_and(|name| !name.is_empty()),
        None => pattern == column,
    };
    match all.iter().find(|(pattern, _)| is(pattern)) {
        Some((_, true)) => Ok(()),
        Some((_, false)) => Err(format!("expected a column with numbers or booleans; `{column}` has words")),
        None => {
            let named = all.iter().filter(|(name, is_numeric)| **is_numeric && !name.contains(ANY));
            let near = did_you_mean(column, named.map(|(name, _)| name.as_str()));
            let common = || {
                let numeric = DRIVE.iter().filter(|name| all.get(**name) == Some(&true));
                let quoted: Vec<String> = numeric.map(|name| format!("`{name}`")).collect();
                format!("; columns of every drive are {}", quoted.join(", "))
            };
            let hint = if near.is_empty() { common() } else { near };
            Err(format!("`cells.csv` has no column `{column}`{hint}"))
        }
    }
}

/// Columns of drives, in which `*` is any name; true for those with numbers or booleans.
fn possible() -> BTreeMap<String, bool> {
    let mut metrics: Metrics = sample().expect("all metrics are read by the names of their fields");
    // An operator without steps has no run times.
    metrics.operators.iter_mut().for_each(|operator| operator.steps = 1);
    let mut all = BTreeMap::new();
    for (name, text) in texts(&metrics) {
        all.insert(name, matches!(text.as_str(), "true" | "false"));
    }
    all.extend(figures(&metrics).into_keys().map(|name| (name, true)));
    all.extend(DRIVE.map(|name| (name.to_owned(), !["verdict", "digest"].contains(&name))));
    let more = [(AS_EXPECTED, true), (NOT_AS_EXPECTED, false), (EGO, false), (ROAD_USERS_LEFT_OUT, true)];
    all.extend(more.map(|(name, is_numeric)| (name.to_owned(), is_numeric)));
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_known_before_the_first_drive() {
        for column in [
            "min_distance_m",
            "no_collision",
            "as_expected",
            "misses",
            "impact.closing_speed_mps",
            "impact.at_fault",
            "first_collision_of_others.closing_speed_mps",
            "left_road_at_s",
            "lateral_jerk.smooth_max_mps3",
            "comfort.share_within",
            "safety.min_ttc_s",
            "drive.duration_s",
            "response.p90_ms",
            "plans.counts.comfortable",
            "plans.comfortable_share",
            "behaviour.seconds.follow",
            "gate.stopping_s",
            "localization.rms_m",
            "localization.quality.lost_share",
            "operator.planner.p99_ms",
            "operator.a.b.drops",
            "scores.driving_score",
            "scores.leaderboard.1.0.driving_score",
            "scores.nuplan.score",
            "road_users_left_out",
        ] {
            assert_eq!(check_numeric(column), Ok(()));
        }
        let all = possible();
        assert!(ALWAYS.iter().all(|name| all.contains_key(*name)), "{all:?}");
    }

    #[test]
    fn unknown_column_and_column_of_words_are_refused() {
        for (column, wanted) in [
            ("min_distanc_m", "`cells.csv` has no column `min_distanc_m`; did you mean `min_distance_m`?"),
            ("operator..p99_ms", "`cells.csv` has no column `operator..p99_ms`"),
            ("operator.planner.p98_ms", "`cells.csv` has no column `operator.planner.p98_ms`"),
            (
                "avoided",
                "`cells.csv` has no column `avoided`; columns of every drive are `no_collision`, `on_road`, \
                 `min_distance_m`,",
            ),
            ("verdict", "expected a column with numbers or booleans; `verdict` has words"),
            ("impact_name", "expected a column with numbers or booleans; `impact_name` has words"),
        ] {
            let message = check_numeric(column).unwrap_err();
            assert!(message.starts_with(wanted), "{message}");
        }
    }
}
