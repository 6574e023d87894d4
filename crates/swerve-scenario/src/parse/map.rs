//! Scenarios on maps: the map, places on it, and ways over it.

mod slopes;

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use swerve_geom::{Point2, Polyline, Pose2};
use swerve_map::router::{self, Stop};
use swerve_map::{Aspect, Map, Signal, SignalPhase};
use swerve_map_io::{FILE_MAX, MapFile};
use swerve_msg::Route;
use swerve_text::{Range, TableReader, nearest, read_bytes, unpacked};

use super::{ANGLE, FRICTION, PLACE, PLACE_MAX_M, SPEED, program};
use crate::{Closure, Course, EgoStart, MapCourse, MapText, Road, SignalProgram, TrafficLight};

/// Length of the line of an actor beyond its start or goal, metres.
const ACTOR_BEYOND_M: f64 = 1_000.0;
/// Most places in a way.
const VIA_MAX: usize = 1_000;
/// Largest distance of a place from the driving lane that it is on, metres.
const OFF_LANE_M: f64 = 20.0;
/// Warning for maps with left-hand traffic.
const LEFT_HAND: &str =
    "its traffic keeps to the left: rights of way and overtaking are those of right-hand traffic";

/// A map under a scenario, while the scenario is read.
pub(super) struct Loaded {
    pub(super) name: String,
    pub(super) text: MapText,
    pub(super) file: Arc<MapFile>,
    pub(super) friction: f64,
    lights: Vec<(Vec<String>, SignalProgram)>,
    /// True if signals without phases are lights too.
    all_lights: bool,
    closures: Vec<Closure>,
    /// Time of the programs of the file at the start of the run, seconds.
    starts_s: f64,
}

/// A way over the map as a line, with the arc lengths of start and end.
pub(super) struct Way {
    pub(super) route: Route,
    /// Start, places on the way, and goal if there is one.
    pub(super) stops: Vec<Stop>,
    pub(super) start_m: f64,
    pub(super) goal_m: f64,
}

/// Reads the table `[map]` and the file that it names: beside the scenario's file, unless its text is given.
/// Its programs of lights are at `starts_s` when the run starts.
pub(super) fn read(top: &TableReader<'_>, given: Option<&MapText>, starts_s: f64) -> Option<Loaded> {
    let table = top.table_if_any("map")?;
    let name = table.text("file");
    let friction = table.number_or("friction", 0.9, FRICTION);
    let tables = table.tables("light", |_| None);
    let lights: Vec<_> = tables.iter().map(light).collect();
    let all_lights = table.truth_if_any("all_lights").unwrap_or(false);
    let closed = table.tables("closure", |_| None);
    table.finish();
    if name.is_empty() {
        return None;
    }
    let loaded = match given {
        Some(text) => Ok(text.clone()),
        None => text_beside(top.reading().file(), &name),
    };
    let file = loaded.and_then(|text| Ok((text.file(&name)?, text)));
    match file {
        Ok((file, text)) => {
            check_lights(&tables, &lights, &file.map);
            let closures = Vec::new();
            let mut loaded = Loaded { name, text, file, friction, lights, all_lights, closures, starts_s };
            loaded.closures = closed.iter().filter_map(|table| loaded.closure(table)).collect();
            Some(loaded)
        }
        Err(message) => {
            table.report("file", message);
            top.reading().guess();
            None
        }
    }
}

/// Text of a map file, which may be packed by gzip, by its path from the folder of the scenario's file.
fn text_beside(scenario: &str, name: &str) -> Result<MapText, String> {
    let path = Path::new(scenario).parent().unwrap_or(Path::new("")).join(name);
    let wrong = |error: &dyn core::fmt::Display| format!("{} cannot be read: {error}", path.display());
    let bytes = read_bytes(&path, FILE_MAX).map_err(|error| wrong(&error))?;
    Ok(unpacked(bytes).map_err(|error| wrong(&error))?.into())
}

/// Names of signals, or of the controllers of signals, and the phases that they show.
fn light(table: &TableReader<'_>) -> (Vec<String>, SignalProgram) {
    let names = match table.only_one(&["signals", "controller"]) {
        Some("controller") => vec![table.text("controller")],
        Some(_) => table.texts("signals"),
        None => Vec::new(),
    };
    let program = program(table);
    table.finish();
    (names, program)
}

/// Reports names that the map does not have, signals for no lane, and signals that already have phases by an earlier
/// table.
fn check_lights(tables: &[TableReader<'_>], lights: &[(Vec<String>, SignalProgram)], map: &Map) {
    let named = |name: &str| -> Vec<&Signal> {
        map.signals().iter().filter(|signal| is_named(signal, name)).collect()
    };
    let acts = |signal: &Signal| acts(signal, map);
    let mut given = BTreeMap::new();
    for (k, (table, (names, _))) in tables.iter().zip(lights).enumerate() {
        let (key, of) = match table.has("controller") {
            true => ("controller", "controller of signals"),
            false => ("signals", "signal"),
        };
        for name in names {
            if named(name).is_empty() {
                let controllers = map.signals().iter().filter_map(|signal| signal.controller.as_deref());
                let signals = map.signals().iter().map(|signal| signal.name.as_str());
                let near = if key == "signals" { nearest(name, signals) } else { nearest(name, controllers) };
                let hint = near.map_or_else(String::new, |near| format!("; did you mean \"{near}\"?"));
                table.report(key, format!("the map has no {of} \"{name}\"{hint}"));
            } else if !named(name).into_iter().any(acts) {
                let message = format!(
                    "the {of} \"{name}\" is for no lane: the map has none of the lanes that it names"
                );
                table.report(key, message);
            }
        }
        let signals: Vec<&Signal> = names.iter().flat_map(|name| named(name)).collect();
        let earlier = signals.iter().find_map(|signal| Some((*signal, given.get(&signal.id)?)));
        if let Some((signal, before)) = earlier {
            let name = &signal.name;
            table.report(key, format!("the signal \"{name}\" has its phases by map.light[{before}] already"));
        }
        for signal in signals {
            given.entry(signal.id).or_insert(k);
        }
    }
}

/// Program of a light that is off.
fn off() -> SignalProgram {
    SignalProgram { phases: vec![SignalPhase { aspect: Aspect::Off, duration_s: 1.0 }], offset_s: 0.0 }
}

/// True for a signal that the traffic of a lane obeys.
fn acts(signal: &Signal, map: &Map) -> bool {
    let has_line = || map.stop_lines().iter().any(|line| line.signals.contains(&signal.id));
    !signal.lanes.is_empty() || has_line()
}

fn is_named(signal: &Signal, name: &str) -> bool {
    signal.name == name || signal.controller.as_deref() == Some(name)
}

impl Loaded {
    /// Reads a place under a key of a table; `None` after a problem.
    pub(super) fn place(&self, table: &TableReader<'_>, key: &'static str) -> Option<Stop> {
        let place = table.table(key)?;
        self.stop(&place)
    }

    fn closure(&self, table: &TableReader<'_>) -> Option<Closure> {
        let at = self.place(table, "at");
        let reported_s = table.number_or("reported_s", 0.0, Range::between(0.0, 86_400.0));
        table.finish();
        Some(Closure { at: at?, reported_s })
    }

    fn stop(&self, place: &TableReader<'_>) -> Option<Stop> {
        let guesses = place.reading().guesses();
        let stop = if place.has("x_m") || place.has("y_m") {
            let at = Point2::new(place.number("x_m", PLACE), place.number("y_m", PLACE));
            let heading = place.number_if_any("heading_rad", ANGLE);
            self.file.near(at, heading).and_then(|stop| {
                let lane = self.file.map.lane(stop.lane);
                let off_m = lane.map_or(0.0, |lane| lane.line.at(stop.s_m).pose.point().distance(at));
                match off_m > OFF_LANE_M {
                    true => {
                        Err(format!("expected a place on a driving lane, found one {off_m:.1} m from it"))
                    }
                    false => Ok(stop),
                }
            })
        } else if self.file.has_roads() {
            let lane = place.whole_if_any("lane", -1_000, 1_000);
            if !place.has("lane") {
                place.report("lane", "is missing: expected the number of a lane of the road");
                place.reading().guess();
            }
            let s_m = place.number("s_m", Range::between(0.0, 100_000.0));
            self.file.on_road(&place.text("road"), lane.unwrap_or(0) as i32, s_m)
        } else {
            let s_m = place.number("s_m", Range::between(0.0, 100_000.0));
            self.file.on_lane(&place.text("lane"), s_m)
        };
        place.finish();
        // After another problem of the place, one of its position may follow from it.
        let is_read = place.reading().guesses() == guesses;
        stop.map_err(|message| {
            if is_read {
                place.report_whole(message)
            }
        })
        .ok()
        .filter(|_| is_read)
    }

    /// Reads start, via and goal of a table, and the way between them, which is driven at `speed_mps` at most; without
    /// a goal the start alone.
    pub(super) fn course(&self, table: &TableReader<'_>, needs_goal: bool, speed_mps: f64) -> Option<Way> {
        let mut stops = vec![self.place(table, "start")];
        let via = table.tables("via", |_| None);
        if via.len() > VIA_MAX {
            table.report("via", format!("expected at most {VIA_MAX} places"));
            return None;
        }
        stops.extend(via.iter().map(|place| self.stop(place)));
        if needs_goal || table.has("goal") {
            stops.push(self.place(table, "goal"));
        }
        let stops = stops.into_iter().collect::<Option<Vec<Stop>>>()?;
        let way = match router::find_over(&self.file.map, &stops, &[]) {
            Ok(way) => way,
            Err(k) => {
                let name = |stop: &Stop| format!("{} at {:.1} m", self.file.name(stop.lane), stop.s_m);
                let [from, to] = [name(&stops[k - 1]), name(&stops[k])];
                let key = if k + 1 == stops.len() { "goal" } else { "via" };
                table.report(key, format!("no way leads over driving lanes from {from} to {to}"));
                return None;
            }
        };
        let beyond_m = if needs_goal { MapCourse::BEYOND_GOAL_M } else { ACTOR_BEYOND_M };
        match Route::over(&self.file.map, &way, beyond_m, speed_mps) {
            Ok((route, [start_m, goal_m])) => Some(Way { route, stops, start_m, goal_m }),
            Err(error) => {
                table.report("start", error.to_string());
                None
            }
        }
    }

    /// Reads the table of an ego: its start, and the ground with its way. `None` after a problem of the way.
    pub(super) fn ego(&self, top: &TableReader<'_>, table: &TableReader<'_>) -> Option<(EgoStart, Road)> {
        let target_mps = table.number_if_any("target_speed_mps", SPEED);
        let course = self.course(table, true, target_mps.unwrap_or(f64::INFINITY))?;
        let limits = course.route.stretches().iter().filter_map(|stretch| stretch.speed_limit_mps);
        let target_mps = target_mps.or_else(|| limits.reduce(f64::max));
        if target_mps.is_none() {
            table.report("target_speed_mps", "is missing: the map has no speed limit on the way");
            table.reading().guess();
        }
        let ego = EgoStart {
            s_m: course.start_m,
            d_m: table.number_or("d_m", 0.0, PLACE),
            heading_rad: table.number_or("heading_rad", 0.0, ANGLE),
            target_speed_mps: target_mps.unwrap_or(0.0),
            start_speed_mps: table.number_if_any("start_speed_mps", SPEED),
            end_m: course.goal_m,
        };
        table.finish();
        let lights = self.lights(&course.route);
        let course = Course::Map(Arc::new(self.on(top, course)));
        Some((ego, Road { course, friction: self.friction, lights }))
    }

    /// Traffic lights of the map that have phases: those of the scenario, else those of the file. With `all_lights`,
    /// the others are lights that are off. Lights that the ego obeys have the stop line on its route.
    fn lights(&self, route: &Route) -> Vec<TrafficLight> {
        let map = &self.file.map;
        let phased = |signal: &Signal| {
            let named = |(names, _): &&(Vec<String>, _)| names.iter().any(|name| is_named(signal, name));
            let given = self.lights.iter().find(named).map(|(_, program)| program.clone());
            let of_file = || {
                let program = signal.program.clone()?;
                Some(SignalProgram { offset_s: program.offset_s + self.starts_s, ..program })
            };
            let dark = || (self.all_lights && acts(signal, map)).then(off);
            given.or_else(of_file).or_else(dark)
        };
        let signals = map.signals().iter().filter_map(|signal| Some((signal, phased(signal)?)));
        let light = |(signal, program): (&Signal, SignalProgram)| TrafficLight {
            name: match signal.name.is_empty() {
                true => format!("signal {}", signal.id.0),
                false => signal.name.clone(),
            },
            pose: Pose2::new(
                signal.position.x_m,
                signal.position.y_m,
                signal.heading_rad + core::f64::consts::PI,
            ),
            stop_s_m: route.stop_s_m(map, signal),
            signal: Some(signal.id),
            program,
        };
        signals.map(light).collect()
    }

    /// The map under the ego's route. On a way that is too steep or too much banked, that is a problem.
    fn on(&self, top: &TableReader<'_>, course: Way) -> MapCourse {
        let slopes = slopes::warning(&self.file, &course).unwrap_or_else(|message| {
            top.reading().report("map.file", message);
            None
        });
        let left_hand = self.file.left_hand.then(|| LEFT_HAND.to_owned());
        let points = course.route.line().points();
        if let Some(far) = points.iter().find(|at| at.x_m.abs().max(at.y_m.abs()) > PLACE_MAX_M) {
            let message = format!(
                "the way leads over ({:.0}, {:.0}) m: expected coordinates up to {PLACE_MAX_M:.0} m, beyond which the \
                 single precision of the physics is coarser than a centimetre; move the map towards its origin",
                far.x_m, far.y_m
            );
            top.reading().report("map.file", message);
        }
        let (file, text, map) = (self.name.clone(), self.text.clone(), Arc::clone(&self.file.map));
        MapCourse {
            file,
            text,
            map,
            route: course.route,
            stops: course.stops,
            closures: self.closures.clone(),
            warnings: slopes.into_iter().chain(left_hand).collect(),
        }
    }
}

/// Line of an actor's own way.
pub(super) fn line_of(course: Way) -> Arc<Polyline> {
    Arc::new(course.route.line().clone())
}

#[cfg(test)]
mod tests;
