//! Records of routes as read from a file, and their check.

use std::collections::BTreeMap;

use serde::Deserialize;
use swerve_eval::score::leaderboard::{Collisions, Contact, Counts, Failure, RouteRecord, Version};
use swerve_geom::Point2;
use swerve_text::{KeyProblem, Problems, did_you_mean, json_problems, list, read_json};
use toml::Value;

/// Maximum number of problems reported for a file.
const PROBLEMS_MAX: usize = 50;

/// Records of a file.
pub(super) struct Cases {
    pub(super) cases: Vec<Case>,
    pub(super) counting: Option<Counting>,
}

/// One route, or several together.
pub(super) struct Case {
    pub(super) name: String,
    /// True for several routes, also if the list has one only.
    pub(super) is_total: bool,
    routes: Vec<Entry>,
    status: ByVersion<String>,
    expect: ByVersion<Expect>,
}

impl Case {
    /// Records of the routes, with the facts that their status in the file gives.
    pub(super) fn records(&self, version: Version) -> Vec<RouteRecord> {
        self.routes.iter().map(|route| route.record(version)).collect()
    }

    pub(super) fn expected(&self, version: Version) -> Option<&Expect> {
        self.expect.of(version)
    }

    pub(super) fn expected_status(&self, version: Version) -> Option<&str> {
        self.status.of(version).map(String::as_str)
    }
}

/// Values by version; `2.x` stands for both 2.0 and 2.1.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ByVersion<T> {
    #[serde(rename = "1.0")]
    first: Option<T>,
    #[serde(rename = "2.x")]
    both: Option<T>,
    #[serde(rename = "2.0")]
    second: Option<T>,
    #[serde(rename = "2.1")]
    third: Option<T>,
}

impl<T> Default for ByVersion<T> {
    fn default() -> Self {
        Self { first: None, both: None, second: None, third: None }
    }
}

impl<T> ByVersion<T> {
    pub(super) fn of(&self, version: Version) -> Option<&T> {
        match version {
            Version::V1_0 => self.first.as_ref(),
            Version::V2_0 => self.second.as_ref().or(self.both.as_ref()),
            Version::V2_1 => self.third.as_ref().or(self.both.as_ref()),
        }
    }

    fn each(&self) -> impl Iterator<Item = (&'static str, &T)> {
        let all = [("1.0", &self.first), ("2.x", &self.both), ("2.0", &self.second), ("2.1", &self.third)];
        all.into_iter().filter_map(|(name, value)| Some((name, value.as_ref()?)))
    }
}

/// Expected results.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Expect {
    pub(super) penalty: Option<f64>,
    pub(super) driving_score: Option<f64>,
    pub(super) driving_scores: Option<Vec<f64>>,
    pub(super) mean: Option<f64>,
    pub(super) std_dev: Option<f64>,
    #[serde(default)]
    pub(super) per_km: BTreeMap<String, f64>,
}

/// A case, or a route of a case.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Entry {
    name: Option<String>,
    /// Several routes together.
    routes: Option<Vec<Entry>>,
    /// In `routes`: name or place of an earlier case that is meant.
    route: Option<String>,
    route_length_m: Option<f64>,
    route_completion: Option<f64>,
    #[serde(default)]
    counts: Counts,
    #[serde(default)]
    outside_route_lanes_percent: f64,
    #[serde(default)]
    min_speed_checkpoints_percent: Vec<f64>,
    route_dev: Option<u32>,
    vehicle_blocked: Option<u32>,
    route_timeout: Option<u32>,
    #[serde(default)]
    status: ByVersion<String>,
    #[serde(default)]
    expect: ByVersion<Expect>,
    /// Explanation for readers.
    #[serde(rename = "working")]
    _working: Option<Value>,
}

impl Entry {
    /// Events that end the route, each with its count and the number beside the counts.
    fn beside<'a>(&self, counts: &'a mut Counts) -> [(&'static str, &'a mut u32, Option<u32>); 3] {
        [
            ("route_dev", &mut counts.route_dev, self.route_dev),
            ("vehicle_blocked", &mut counts.vehicle_blocked, self.vehicle_blocked),
            ("route_timeout", &mut counts.route_timeout, self.route_timeout),
        ]
    }

    fn record(&self, version: Version) -> RouteRecord {
        let mut counts = self.counts;
        for (_, count, beside) in self.beside(&mut counts) {
            *count = beside.unwrap_or(*count);
        }
        let failure = self.status.of(version).and_then(|text| reason(text).ok().flatten());
        match failure {
            Some(Failure::Blocked) => counts.vehicle_blocked = counts.vehicle_blocked.max(1),
            Some(Failure::Deviated) => counts.route_dev = counts.route_dev.max(1),
            Some(Failure::TimedOut) => counts.route_timeout = counts.route_timeout.max(1),
            _ => {}
        }
        RouteRecord {
            route_length_m: self.route_length_m.unwrap_or_default(),
            route_completion: self.route_completion.unwrap_or_default(),
            counts,
            outside_route_lanes_percent: self.outside_route_lanes_percent,
            min_speed_checkpoints_percent: self.min_speed_checkpoints_percent.clone(),
            failure,
        }
    }
}

/// Reason of the failure in a status.
fn reason(status: &str) -> Result<Option<Failure>, String> {
    let Some(text) = status.strip_prefix("Failed - ") else {
        return match status {
            "Perfect" | "Completed" | "Failed" => Ok(None),
            _ => Err(format!(
                "expected \"Perfect\", \"Completed\", \"Failed\" or \"Failed - REASON\", found \"{status}\""
            )),
        };
    };
    let known = Failure::ALL.map(Failure::text);
    let found = Failure::ALL.into_iter().find(|failure| failure.text() == text);
    found.map(Some).ok_or_else(|| {
        format!("expected the reason {}, found \"{text}\"{}", list(&known), did_you_mean(text, known))
    })
}

/// Contacts of the ego, and the instants of those that count.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Counting {
    /// Rows: instant in seconds, kind and identity of the other party, position along x in metres and speed in m/s of the
    /// ego.
    events: Vec<(f64, Party, u64, f64, f64)>,
    #[serde(default)]
    pub(super) expect: ByVersion<CountingExpect>,
    #[serde(rename = "name")]
    _name: Option<Value>,
    #[serde(rename = "note")]
    _note: Option<Value>,
    #[serde(rename = "columns")]
    _columns: Option<Value>,
    #[serde(rename = "working")]
    _working: Option<Value>,
}

#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct CountingExpect {
    pub(super) counted_at_s: Vec<f64>,
}

/// Kind of the other party. The rules do not depend on it.
#[derive(Clone, Copy, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Party {
    Pedestrian,
    Vehicle,
    Layout,
}

impl Counting {
    /// Instants of the collisions that count, seconds.
    pub(super) fn counted_at_s(&self, version: Version) -> Vec<f64> {
        let mut collisions = Collisions::new(version);
        let counts = |(at_s, _, id, x_m, speed_mps): &(f64, Party, u64, f64, f64)| {
            let other = Some(*id).filter(|id| *id != 0);
            let contact =
                Contact { at_s: *at_s, other, ego: Point2::new(*x_m, 0.0), ego_speed_mps: *speed_mps };
            collisions.step(*at_s, contact.ego);
            collisions.counts(&contact).then_some(*at_s)
        };
        self.events.iter().filter_map(counts).collect()
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct CaseFile {
    #[serde(rename = "meta")]
    _meta: Option<Value>,
    cases: Vec<Entry>,
    counting: Option<Counting>,
}

/// Reads the records of a file.
///
/// # Errors
/// All problems, with line and key.
pub(super) fn read(path: &str, text: &str) -> Result<Cases, Problems> {
    let file: CaseFile = read_json(path, text)?;
    let mut found = Vec::new();
    let mut cases: Vec<Case> = Vec::new();
    for (k, entry) in file.cases.into_iter().enumerate() {
        cases.push(case(&format!("cases[{k}]"), entry, &cases, &mut found));
    }
    if let Some(counting) = &file.counting {
        for (k, pair) in counting.events.windows(2).enumerate() {
            if pair[1].0 < pair[0].0 {
                let message =
                    format!("expected at least {} s, the instant before, found {}", pair[0].0, pair[1].0);
                found.push((format!("counting.events[{}]", k + 1), message));
            }
        }
    }
    if cases.is_empty() && file.counting.is_none() {
        found.push(("cases".to_owned(), "expected at least one case".to_owned()));
    }
    found.truncate(PROBLEMS_MAX);
    match found.is_empty() {
        true => Ok(Cases { cases, counting: file.counting }),
        false => Err(json_problems(path, text, found)),
    }
}

/// Checks a case, and resolves the routes that it refers to.
fn case(key: &str, entry: Entry, before: &[Case], found: &mut Vec<KeyProblem>) -> Case {
    let Entry { name, routes, status, expect, .. } = entry.clone();
    let name = name.unwrap_or_else(|| {
        found.push((format!("{key}.name"), "is missing: expected a text".to_owned()));
        String::new()
    });
    if !name.is_empty() && before.iter().any(|case| case.name == name) {
        found.push((format!("{key}.name"), format!("another case is named \"{name}\" already")));
    }
    let is_total = routes.is_some();
    let routes = match routes {
        None => {
            check(key, &entry, found);
            vec![entry]
        }
        Some(routes) => {
            if entry.route_length_m.is_some() || entry.route_completion.is_some() {
                let message =
                    "expected either several routes, or the length and completion of one".to_owned();
                found.push((format!("{key}.routes"), message));
            }
            if routes.is_empty() {
                found.push((format!("{key}.routes"), "expected at least one route".to_owned()));
            }
            let one =
                |(k, route): (usize, Entry)| route_of(&format!("{key}.routes[{k}]"), route, before, found);
            routes.into_iter().enumerate().map(one).collect()
        }
    };
    Case { name, is_total, routes, status, expect }
}

/// A route of several: its own record, or that of an earlier case.
fn route_of(key: &str, route: Entry, before: &[Case], found: &mut Vec<KeyProblem>) -> Entry {
    if route.expect.each().next().is_some() {
        found.push((format!("{key}.expect"), "expected only in a case".to_owned()));
    }
    let Some(meant) = &route.route else {
        if route.routes.is_some() {
            found.push((format!("{key}.routes"), "expected no routes inside of routes".to_owned()));
        } else {
            check(key, &route, found);
        }
        return route;
    };
    const PLACES: [&str; 10] =
        ["first", "second", "third", "fourth", "fifth", "sixth", "seventh", "eighth", "ninth", "tenth"];
    let place = meant.strip_suffix(" case above");
    let place = place.and_then(|place| PLACES.iter().position(|name| *name == place));
    let case = match place {
        Some(place) => before.get(place),
        None => before.iter().find(|case| case.name == *meant),
    };
    if let Some(Case { is_total: false, routes, .. }) = case {
        return routes[0].clone();
    }
    let names = before.iter().filter(|case| !case.is_total).map(|case| case.name.as_str());
    let near = did_you_mean(meant, names);
    let message = format!(
        "expected the name of an earlier case of one route, or `first case above` and so on, found \"{meant}\"{near}"
    );
    found.push((format!("{key}.route"), message));
    route
}

/// Checks the numbers of a record.
fn check(key: &str, entry: &Entry, found: &mut Vec<KeyProblem>) {
    let mut within = |name: &str, value: Option<f64>, [low, high]: [f64; 2]| match value {
        None => found.push((format!("{key}.{name}"), "is missing: expected a number".to_owned())),
        Some(value) if !(low..=high).contains(&value) => {
            found.push((format!("{key}.{name}"), format!("expected {low} to {high}, found {value}")));
        }
        Some(_) => {}
    };
    within("route_length_m", entry.route_length_m, [1e-3, 1e9]);
    within("route_completion", entry.route_completion, [0.0, 100.0]);
    within("outside_route_lanes_percent", Some(entry.outside_route_lanes_percent), [0.0, 100.0]);
    for (k, percent) in entry.min_speed_checkpoints_percent.iter().enumerate() {
        within(&format!("min_speed_checkpoints_percent[{k}]"), Some(*percent), [0.0, 1e9]);
    }
    for (name, count) in entry.counts.each() {
        within(&format!("counts.{name}"), Some(f64::from(count)), [0.0, 1e6]);
    }
    let mut counts = entry.counts;
    let beside = entry.beside(&mut counts).map(|(name, count, beside)| (name, *count, beside));
    for (name, _, beside) in beside {
        within(name, Some(beside.map_or(0.0, f64::from)), [0.0, 1e6]);
    }
    for (name, count, beside) in beside {
        if let Some(beside) = beside.filter(|beside| count > 0 && *beside != count) {
            found.push((format!("{key}.{name}"), format!("expected {count} as in `counts`, found {beside}")));
        }
    }
    for (version, text) in entry.status.each() {
        if let Err(message) = reason(text) {
            found.push((format!("{key}.status.{version}"), message));
        }
    }
    if entry.route.is_some() {
        found.push((format!("{key}.route"), "expected only in `routes`".to_owned()));
    }
}
