//! Places in texts, and the output of ways over lanes.

use std::collections::BTreeMap;

use serde_json::{Value, json};
use swerve_geom::Point2;
use swerve_map::router::{Step, Stop, Way};
use swerve_map::{LaneHint, LaneId, LaneIndex, LaneKind, Map};

use crate::import::{Imported, LaneSource};
use crate::lane_map::LaneMap;
use crate::opendrive::Network;

/// Place of a text `x,y` in the frame of the map, metres: on the nearest driving lane. `None` for texts without comma.
fn stop_near(map: &Map, text: &str, form: &dyn Fn() -> String) -> Option<Result<Stop, String>> {
    let (x, y) = text.split_once(',')?;
    let [x, y] = [x, y].map(|part| part.trim().parse::<f64>().ok().filter(|value| value.is_finite()));
    let (Some(x), Some(y)) = (x, y) else { return Some(Err(form())) };
    let index = LaneIndex::of(map, |lane| lane.kind == LaneKind::Driving);
    let found = index.nearest_from(Point2::new(x, y), &mut LaneHint::default());
    Some(match found {
        Some(found) => Ok(on_lane(map, found.lane, found.place.s_m)),
        None => Err("the map has no driving lanes".to_owned()),
    })
}

/// Place in a text: `lane:s` with the identity of the lane in the file and s along it, or `x,y` in the frame of the map,
/// metres; the nearest driving lane.
///
/// # Errors
/// If the text has neither form, or names a place that is not on a driving lane.
pub fn stop_on(lanes: &LaneMap, text: &str) -> Result<Stop, String> {
    let form = || format!("expected lane:s or x,y, found {text:?}");
    if let Some(stop) = stop_near(&lanes.map, text, &form) {
        return stop;
    }
    let (name, s) = text.rsplit_once(':').ok_or_else(form)?;
    let s_m = s.parse::<f64>().map_err(|_| form())?;
    stop_on_named(&lanes.map, &lanes.names, name, s_m)
}

/// Place on a driving lane of this name.
pub(crate) fn stop_on_named(
    map: &Map,
    names: &BTreeMap<LaneId, String>,
    name: &str,
    s_m: f64,
) -> Result<Stop, String> {
    let lane = names.iter().find(|(_, other)| *other == name).and_then(|(lane, _)| map.lane(*lane));
    let lane = lane.ok_or_else(|| format!("there is no lane {name:?}"))?;
    let length_m = lane.line.length();
    if lane.kind != LaneKind::Driving {
        return Err(format!("expected a driving lane, found one of another kind: {name}"));
    }
    if !(0.0..=length_m).contains(&s_m) {
        return Err(format!("expected a place from 0 to {length_m:.3} m on lane {name}, found {s_m}"));
    }
    Ok(Stop { lane: lane.id, s_m })
}

/// Place in a text: `road:lane:s` with s along the road, or `x,y` in the frame of the map, metres; the nearest driving
/// lane.
///
/// # Errors
/// If the text has neither form, or names a place that is not on a driving lane.
pub fn stop(network: &Network, imported: &Imported, text: &str) -> Result<Stop, String> {
    let form = || format!("expected road:lane:s or x,y, found {text:?}");
    if let Some(stop) = stop_near(&imported.map, text, &form) {
        return stop;
    }
    let mut parts = text.rsplitn(3, ':');
    let (Some(s), Some(lane), Some(road)) = (parts.next(), parts.next(), parts.next()) else {
        return Err(form());
    };
    let (Ok(s_m), Ok(lane)) = (s.parse::<f64>(), lane.parse::<i32>()) else { return Err(form()) };
    stop_on_road(network, (&imported.map, &imported.lanes), (road, lane, s_m))
}

/// Place on a driving lane at an arc length of its road.
pub(crate) fn stop_on_road(
    network: &Network,
    (map, lanes): (&Map, &[LaneSource]),
    (road, lane, s_m): (&str, i32, f64),
) -> Result<Stop, String> {
    let section = network.road(road).map_or(0, |road| road.section_at(s_m));
    let sample = network.sample(road, section, lane, s_m).map_err(|error| error.to_string())?;
    let is = |source: &LaneSource| {
        network.roads[source.road].id == road && source.section == section && source.lane == lane
    };
    let found = lanes.iter().position(is).map(|k| &map.lanes()[k]);
    let found = found.filter(|lane| lane.kind == LaneKind::Driving).ok_or_else(|| {
        let kind = network.road(road).and_then(|road| road.sections.get(section)?.lane(lane));
        let kind = kind.map_or("none", |lane| lane.kind.name());
        format!("expected a driving lane, found one of type {kind}: {road}:{lane}:{s_m}")
    })?;
    let [x, y, _] = sample.position_m;
    Ok(on_lane(map, found.id, found.line.project(Point2::new(x, y)).s_m))
}

/// The place at an arc length of a lane, within its ends.
pub(crate) fn on_lane(map: &Map, lane: LaneId, s_m: f64) -> Stop {
    let length_m = map.lane(lane).map_or(0.0, |lane| lane.line.length());
    Stop { lane, s_m: s_m.clamp(0.0, length_m) }
}

/// Name of a lane of a network as `road:section:lane`.
pub fn lane_name(network: &Network, imported: &Imported, lane: LaneId) -> String {
    source_name(network, imported.lanes[lane.0 as usize])
}

pub(crate) fn source_name(network: &Network, source: LaneSource) -> String {
    format!("{}:{}:{}", network.roads[source.road].id, source.section, source.lane)
}

/// Route for a terminal, with the names of its lanes.
pub fn text(map: &Map, name: &dyn Fn(LaneId) -> String, way: &Way) -> String {
    let mut out = format!(
        "route       {:.1} m over {} lanes, {} lane changes\n",
        way.length_m,
        way.lanes.len(),
        way.changes()
    );
    for (step, lane) in &way.lanes {
        let length_m = map.lane(*lane).map_or(0.0, |lane| lane.line.length());
        out.push_str(&format!("  {:<14}{:<16}{length_m:>9.1} m long\n", step.name(), name(*lane)));
    }
    out
}

/// Route for programs, with the names of its lanes.
pub fn json(name: &dyn Fn(LaneId) -> String, way: &Way) -> Value {
    let lane = |(step, lane): &(Step, LaneId)| json!({ "lane": name(*lane), "step": step.name() });
    let lanes: Vec<Value> = way.lanes.iter().map(lane).collect();
    json!({ "length_m": way.length_m, "changes": way.changes(), "lanes": lanes })
}

#[cfg(test)]
mod tests;
