//! Files named by a configuration: the route, and the recording that replaces a vehicle.

use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow};
use swerve_drive::read_scenario;
use swerve_drive::shipped::Kind;
use swerve_scenario::Scenario;
use swerve_stack::config::live::LiveConfig;
use swerve_text::Document;

/// Reads the scenario whose road is the route of a configuration; returns it with its file.
///
/// # Errors
/// If it cannot be read or is invalid; the error states the position of the key.
pub(crate) fn read(
    config: &Path,
    sets: &[(String, toml::Value)],
    live: &LiveConfig,
) -> anyhow::Result<(PathBuf, Scenario)> {
    let route = route_file(Kind::Live.place(config), &live.route);
    if let Err(problem) = Kind::Scenario.text(&route) {
        let is_set = sets.iter().any(|(key, _)| key == "live.route");
        return Err(wrong_file(config, is_set, "live.route", &problem.into()));
    }
    let scenario = read_scenario(&route).context("live.route")?;
    Ok((route, scenario))
}

/// Error for a file named by a key of a configuration, with the position of the key; `is_set` if `--set` names it.
pub(crate) fn wrong_file(config: &Path, is_set: bool, key: &str, error: &anyhow::Error) -> anyhow::Error {
    let document = Kind::Live.document(config).ok().filter(|_| !is_set);
    let message = format!("{error:#}");
    document.map_or_else(|| anyhow!("{key}: {message}"), |document| document.problem(key, &message).into())
}

/// File of a route, relative to the folder of the configuration, or a built-in one.
fn route_file(config: &Path, route: &str) -> PathBuf {
    let beside = config.parent().unwrap_or(Path::new("")).join(route);
    Kind::Scenario.meant(Path::new(route), beside)
}

/// Problems of the route named by a configuration, regardless of other problems in it.
pub fn route_problems(config: &Path, document: &Document) -> Vec<String> {
    let route = document.table.get("live").and_then(|live| live.get("route")).and_then(toml::Value::as_str);
    let Some(route) = route.filter(|route| !route.is_empty()) else { return Vec::new() };
    let file = route_file(config, route);
    let unread = Kind::Scenario.text(&file).err().filter(|_| file.exists());
    if let Some(unread) = unread {
        return vec![document.problem("live.route", unread.to_string()).to_string()];
    }
    match read_scenario(&file) {
        Ok(_) => Vec::new(),
        Err(_) if !file.exists() => {
            let message = format!("there is no file {}: expected a scenario", file.display());
            vec![document.problem("live.route", message).to_string()]
        }
        Err(error) => error.to_string().lines().map(str::to_owned).collect(),
    }
}
