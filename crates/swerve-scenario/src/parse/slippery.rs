//! Patches of the ground with a friction of their own.

use std::collections::BTreeSet;

use swerve_geom::{FrenetPoint, Point2};
use swerve_msg::Route;
use swerve_text::{Range, TableReader};

use super::map::{Loaded, Way};
use super::{FRICTION, PLACE, addressable};
use crate::{Road, Slippery};

/// Largest number of patches: each wheel is compared with all of them in each step of the world.
const PATCHES_MAX: usize = 200;
/// Length of a patch, metres.
const LENGTH: Range = Range::between(0.1, 10_000.0);
/// Width of a patch, metres.
const WIDTH: Range = Range::between(0.1, 200.0);

/// Reads all patches; `map` is `None` without a map, and after a problem of it.
pub(super) fn read(top: &TableReader<'_>, road: &Road, map: Option<&Loaded>) -> Vec<Slippery> {
    let mut tables = top.tables("slippery", |patch| patch.text_if_any("name"));
    if let Some(all) = top.value("slippery").filter(|_| tables.len() > PATCHES_MAX) {
        top.mistyped("slippery", &format!("at most {PATCHES_MAX} tables"), all);
        tables.truncate(PATCHES_MAX);
    }
    if tables.is_empty() {
        return Vec::new();
    }
    let ground = Ground { on_map: top.has("map"), map, route: road.is_line().then(|| road.route()) };
    let mut seen = BTreeSet::new();
    let read = |table: &TableReader<'_>| {
        let name = table.text("name");
        addressable(table, &name);
        if !name.is_empty() && !seen.insert(name.clone()) {
            table.report("name", format!("another patch is named \"{name}\" already"));
        }
        ground.patch(table, name)
    };
    tables.iter().filter_map(read).collect()
}

/// Ground that patches lie on.
struct Ground<'a> {
    on_map: bool,
    map: Option<&'a Loaded>,
    /// Route of the first ego; `None` after a problem.
    route: Option<Route>,
}

impl Ground<'_> {
    /// Reads one patch; `None` after a problem of it or of the ground.
    fn patch(&self, table: &TableReader<'_>, name: String) -> Option<Slippery> {
        let guesses = table.reading().guesses();
        let at_start = self.on_map && table.has("start");
        let friction = table.number("friction", FRICTION);
        let course = if at_start { self.course(table) } else { None };
        let s_m = match &course {
            Some(course) => course.start_m,
            None if at_start => 0.0,
            None => table.number("s_m", PLACE),
        };
        let length_m = table.number("length_m", LENGTH);
        let d_m = table.number_or("d_m", 0.0, PLACE);
        let width_m = table.number_if_any("width_m", WIDTH);
        table.finish();
        if table.reading().guesses() > guesses {
            return None;
        }
        let route = if at_start { &course.as_ref()?.route } else { self.route.as_ref()? };
        let (end_m, all_m) = (s_m + length_m, route.line().length());
        if s_m < 0.0 || end_m > all_m {
            let (key, message) = match at_start {
                true => ("length_m", format!("ends {:.1} m beyond the end of its lanes", end_m - all_m)),
                false => (
                    "s_m",
                    format!("from {s_m} m to {end_m} m: expected a place on the road, 0 to {all_m:.1} m"),
                ),
            };
            table.report(key, message);
            return None;
        }
        let lane_m = || route.lane().left_m(s_m) + route.lane().right_m(s_m);
        let line = route.line().part([s_m, end_m])?;
        let patch = Slippery { name, friction, line, d_m, width_m: width_m.unwrap_or_else(lane_m) };
        if !self.is_below_wheels(&patch, route) {
            let [from_m, to_m] = [-0.5, 0.5].map(|side| patch.d_m + side * patch.width_m);
            let ground = if self.on_map { "a lane of the map" } else { "the road" };
            let message = format!(
                "from {from_m} m to {to_m} m across, all beside the road: expected a place on {ground}"
            );
            table.report("d_m", message);
            return None;
        }
        Some(patch)
    }

    /// Returns true if part of a patch is on ground that cars drive on: on a map any driving lane or shoulder, else the
    /// road. Places every metre are tried, those near the line first.
    fn is_below_wheels(&self, patch: &Slippery, route: &Route) -> bool {
        let on_ground = |point: Point2| match self.map {
            Some(loaded) => {
                let map = &loaded.file.map;
                map.at(point).filter_map(|at| map.lane(at.lane)).any(|lane| lane.kind.is_drivable())
            }
            None => {
                let at = route.project(point);
                (-route.right_m(at.s_m)..=route.left_m(at.s_m)).contains(&at.d_m)
            }
        };
        let even = |from_m: f64, length_m: f64| {
            let count = length_m.ceil().max(1.0);
            (0..=count as usize).map(move |k| from_m + length_m * k as f64 / count)
        };
        let mut across: Vec<f64> = even(patch.d_m - 0.5 * patch.width_m, patch.width_m).collect();
        across.sort_by(|a, b| a.abs().total_cmp(&b.abs()));
        let mut places =
            across.into_iter().flat_map(|d_m| even(0.0, patch.line.length()).map(move |s_m| (s_m, d_m)));
        places.any(|(s_m, d_m)| on_ground(patch.line.to_map(FrenetPoint { s_m, d_m })))
    }

    /// Reads start, via and goal of a patch. After a problem of the map or of the ego they are not read.
    fn course(&self, table: &TableReader<'_>) -> Option<Way> {
        if let Some(map) = self.map {
            return map.course(table, false, f64::INFINITY);
        }
        for key in ["start", "goal", "via"] {
            table.value(key);
        }
        None
    }
}

#[cfg(test)]
mod tests;
