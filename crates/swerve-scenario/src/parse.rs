//! Conversion of TOML to a [`Scenario`].

mod actor;
mod egos;
mod expect;
mod map;
mod slippery;
mod track;
mod world;

use std::collections::BTreeSet;
use std::sync::Arc;

use swerve_geom::Pose2;
use swerve_msg::ActorId;
use swerve_text::{Document, Problems, Range, Reading, TableReader, list, nearest};

pub(crate) use self::actor::usual_mass_kg;
use self::egos::EgoTable;
use crate::model::on_road;
use crate::{
    Actor, Course, Draws, EgoStart, End, MapText, OtherEgo, Road, Scenario, Segment, SignalProgram,
    Standstill, Strip, Traffic, TrafficLight, check,
};

/// Positions along and across the road, metres.
const PLACE: Range = Range::between(-PLACE_MAX_M, PLACE_MAX_M);
const PLACE_MAX_M: f64 = 100_000.0;
/// Speeds, m/s.
const SPEED: Range = Range::between(0.0, 100.0);
/// Speeds above zero, m/s.
const MOVING: Range = Range::between(0.01, 100.0);
/// Path lengths and distances, metres.
const WAY: Range = Range::between(0.001, 100_000.0);
/// Durations, seconds.
const DURATION: Range = Range::between(0.001, 86_400.0);
/// Friction coefficients of the ground.
const FRICTION: Range = Range::between(0.01, 4.0);
/// Default distance of a traffic light behind its stop line, metres.
const LIGHT_BEHIND_STOP_M: f64 = 2.0;
/// Default distance of a traffic light to the right of the drivable ground, metres.
const LIGHT_BESIDE_ROAD_M: f64 = 1.0;
/// Angles, radians.
const ANGLE: Range = Range::between(-6.3, 6.3);

/// Largest number of actors: a state of the world contains all of them, and a log all states.
const ACTORS_MAX: usize = 20_000;

impl Scenario {
    /// Parses the text of a scenario file; `file` is used in problems, and a map is read from its folder.
    ///
    /// # Errors
    /// All problems of the text, in the order of their lines.
    pub fn parse(file: &str, text: &str) -> Result<Self, Problems> {
        scenario(&Document::parse(file, text)?, None)
    }

    /// Reads a scenario file.
    ///
    /// # Errors
    /// One problem if the file cannot be read, else as [`parse`](Self::parse).
    pub fn read(path: &std::path::Path) -> Result<Self, Problems> {
        scenario(&Document::read(path)?, None)
    }
}

/// Reads and checks a whole document, given the text of its map, or else with the one in the folder of its file.
pub(crate) fn scenario(document: &Document, map: Option<&MapText>) -> Result<Scenario, Problems> {
    let reading = Reading::of(document);
    let scenario = Scenario { text: document.text.clone(), ..read(&reading.top(&document.table), map) };
    reading.into_problems().or(scenario)
}

/// Valid scenario names, as used in titles, tables and data sets.
const NAME: &str = "a name of letters, digits, spaces, underscores and hyphens";

fn is_name(name: &str) -> bool {
    let is_plain = |c: char| c.is_alphanumeric() || " _-".contains(c);
    !name.is_empty() && name.trim() == name && name.chars().all(is_plain)
}

/// Valid descriptions, which may have several lines.
const DESCRIPTION: &str = "a text that is not blank, without control characters but for ends of lines";

fn is_description(text: &str) -> bool {
    !text.trim().is_empty() && !text.contains(|c: char| c.is_control() && !"\n\r\t".contains(c))
}

fn read(top: &TableReader<'_>, map: Option<&MapText>) -> Scenario {
    let name = if top.has("name") {
        top.text_like("name", NAME, is_name).unwrap_or_default()
    } else {
        top.text("name")
    };
    let description = top.paragraph_like("description", DESCRIPTION, is_description).unwrap_or_default();
    let sumo = world::read(top);
    let starts_s = sumo.as_ref().map_or(0.0, |sumo| sumo.begin_s + sumo.warmup_s);
    let ground = Ground::read(top, map, starts_s);
    let tables = egos::tables(top);
    let ways: Vec<_> = tables.iter().map(|ego| ground.ego(top, &ego.table)).collect();
    // After a problem of a way, places of actors are not read.
    let map = match &ground {
        Ground::Map(Some(loaded)) if ways.iter().all(Option::is_some) => Some(loaded),
        Ground::Map(_) | Ground::Road(_) => None,
    };
    let egos = tables.into_iter().zip(ways).map(|(EgoTable { name, .. }, way)| {
        let (start, road) = way.unwrap_or_else(|| (NO_START, no_road()));
        (name, start, road)
    });
    let mut egos = egos.collect::<Vec<_>>().into_iter();
    let (ego_name, ego, road) = egos.next().unwrap_or_else(|| match ground {
        Ground::Road(ref road) => (String::new(), NO_START, road.clone()),
        Ground::Map(_) => (String::new(), NO_START, no_road()),
    });
    let slippery = slippery::read(top, &road, map);
    let tables = actor_tables(top);
    let names: Vec<String> = tables.iter().map(|actor| actor.text("name")).collect();
    let traffic = traffic(top, ActorId(names.len() as u32 + 1));
    let first = traffic.map_or(0, |traffic| traffic.count()) as u32 + names.len() as u32 + 1;
    let other = |(id, (name, start, road))| OtherEgo { id: ActorId(id), name, start, road };
    let other_egos: Vec<OtherEgo> = (first..).zip(egos).map(other).collect();
    for name in [&ego_name].into_iter().chain(other_egos.iter().map(|other| &other.name)) {
        if traffic.is_some_and(|traffic| traffic.has_named(name)) {
            top.reading().report(&format!("ego.{name}"), format!("{OF_TRAFFIC} \"{name}\" already"));
        }
    }
    if sumo.is_some() && !other_egos.is_empty() {
        top.report("world", "expected one ego in a world with SUMO");
    }
    unique(&tables, &names, (&ego_name, &other_egos), traffic.as_ref());
    // Actors are numbered in the order of the text, from 1; then come the traffic and other egos.
    let named = (1..).zip(&names).map(|(k, name)| (ActorId(k), name.as_str()));
    let others = other_egos.iter().map(|other| (other.id, other.name.as_str()));
    let known: Vec<(ActorId, &str)> = named.chain(others).collect();
    let actors = tables.iter().zip(&known).map(|(table, (id, name))| {
        let on_map = top.has("map");
        let setting = actor::Setting { id: *id, name, ego: &ego_name, known: &known, on_map, map };
        actor::read(table, setting)
    });
    let mut actors: Vec<Actor> = actors.collect();
    track::react(top, &mut actors);
    // As if it were drawn already.
    let fixed = top.truth_if_any("seeded") == Some(false);
    let draws = fixed.then(|| Draws { trigger_m: vec![0.0; actors.len()], ..Draws::default() });
    let end = end(top, &known);
    let sound = top.reading().guesses() == 0;
    let expect = expect::read(top);
    top.finish();
    let scenario = Scenario {
        name,
        description,
        road,
        slippery,
        ego,
        ego_id: ActorId::EGO,
        ego_name,
        other_egos,
        end,
        actors,
        traffic,
        sumo,
        expect,
        draws,
        text: Arc::default(),
    };
    if sound {
        for (key, message) in check::problems(&scenario) {
            top.reading().report(&key, message);
        }
    }
    scenario
}

/// Tables of the actors, at most [`ACTORS_MAX`].
fn actor_tables<'a>(top: &'a TableReader<'a>) -> Vec<TableReader<'a>> {
    let mut tables = top.tables("actor", |actor| actor.text_if_any("name"));
    if let Some(all) = top.value("actor").filter(|_| tables.len() > ACTORS_MAX) {
        top.mistyped("actor", &format!("at most {ACTORS_MAX} tables"), all);
        tables.truncate(ACTORS_MAX);
    }
    tables
}

/// Begin of the message for a name that the traffic uses.
const OF_TRAFFIC: &str = "a road user of `[traffic]` is named";
/// Largest number of road users of the traffic.
const TRAFFIC_MAX: i64 = 2_000;

/// Reads the traffic; its first road user has this identity.
fn traffic(top: &TableReader<'_>, first_id: ActorId) -> Option<Traffic> {
    let table = top.table_if_any("traffic")?;
    let count = |key| table.whole_if_any(key, 0, TRAFFIC_MAX).unwrap_or(0) as usize;
    let (vehicles, pedestrians, cyclists) = (count("vehicles"), count("pedestrians"), count("cyclists"));
    let traffic = Traffic { vehicles, pedestrians, cyclists, first_id, seed: None };
    if traffic.count() > TRAFFIC_MAX as usize {
        table.report_whole(format!(
            "expected at most {TRAFFIC_MAX} road users in total, found {}",
            traffic.count()
        ));
    }
    if !top.has("map") {
        table.report_whole("expected a scenario on a `[map]`");
    }
    table.finish();
    (traffic.count() > 0).then_some(traffic)
}

/// The ground, before an ego has a way over it.
enum Ground {
    /// A road that the scenario describes.
    Road(Road),
    /// A map; `None` after a problem.
    Map(Option<map::Loaded>),
}

impl Ground {
    /// Reads road or map; programs of lights in a map start at `starts_s`.
    fn read(top: &TableReader<'_>, text: Option<&MapText>, starts_s: f64) -> Self {
        if !top.has("map") {
            return Self::Road(road(top));
        }
        if top.has("road") {
            top.report("road", "expected only one of `map` and `road`");
            top.table_if_any("road");
            top.reading().guess();
        }
        Self::Map(map::read(top, text, starts_s))
    }

    /// Reads the table of an ego: its start, and the ground with its way. `None` after a problem of map or way.
    fn ego(&self, top: &TableReader<'_>, table: &TableReader<'_>) -> Option<(EgoStart, Road)> {
        match self {
            Self::Road(road) => Some((egos::on_strip(table), road.clone())),
            Self::Map(loaded) => {
                let read = loaded.as_ref().and_then(|loaded| loaded.ego(top, table));
                if read.is_none() {
                    top.reading().guess();
                }
                read
            }
        }
    }
}

/// Ground after a problem.
fn no_road() -> Road {
    let strip = Strip { segments: vec![NO_SEGMENT], lane_width_m: 4.0, left_m: 2.0, right_m: 2.0 };
    Road { course: Course::Strip(strip), friction: 0.9, lights: Vec::new() }
}

fn road(top: &TableReader<'_>) -> Road {
    let strip = Strip { segments: Vec::new(), lane_width_m: 4.0, left_m: 2.0, right_m: 2.0 };
    let mut road = Road { course: Course::Strip(strip.clone()), friction: 0.9, lights: Vec::new() };
    let Some(table) = top.table("road") else { return road };
    let mut strip = strip;
    strip.lane_width_m = table.number_or("lane_width_m", strip.lane_width_m, Range::between(0.1, 20.0));
    strip.left_m = table.number_or("left_m", 0.5 * strip.lane_width_m, Range::between(0.05, 100.0));
    strip.right_m = table.number_or("right_m", 0.5 * strip.lane_width_m, Range::between(0.05, 100.0));
    road.friction = table.number_or("friction", road.friction, FRICTION);
    for segment in table.tables("segments", |_| None) {
        // Zero is accepted here: a road without length is reported as one problem.
        let length_m = segment.number("length_m", Range::between(0.0, 100_000.0));
        let curvature_1pm = segment.number_or("curvature_1pm", 0.0, Range::between(-0.2, 0.2));
        segment.finish();
        strip.segments.push(Segment { length_m, curvature_1pm });
    }
    let has_length = strip.is_line();
    road.lights = lights(&table, &strip);
    if !table.has("segments") {
        table.report("segments", "is missing: expected an array of { length_m, curvature_1pm }");
    } else if !has_length {
        table
            .report("segments", "the route has no length: expected at least one piece with length_m above 0");
    }
    table.finish();
    if strip.length_m() == 0.0 {
        strip.segments.push(NO_SEGMENT);
    }
    road.course = Course::Strip(strip);
    road
}

/// Traffic lights of a road.
fn lights(table: &TableReader<'_>, strip: &Strip) -> Vec<TrafficLight> {
    let tables = table.tables("light", |light| light.text_if_any("name"));
    let names: Vec<String> = tables.iter().map(|light| light.text("name")).collect();
    let line = strip.is_line().then(|| strip.line());
    let mut seen = BTreeSet::new();
    let read = |(table, name): (&TableReader<'_>, &String)| {
        addressable(table, name);
        if !name.is_empty() && !seen.insert(name.clone()) {
            table.report("name", format!("another light is named \"{name}\" already"));
        }
        let stop_s_m = table.number("stop_s_m", PLACE);
        let s_m = table.number_or("s_m", stop_s_m + LIGHT_BEHIND_STOP_M, PLACE);
        let d_m = table.number_or("d_m", -(strip.right_m + LIGHT_BESIDE_ROAD_M), PLACE);
        let pose = line.as_ref().map_or(Pose2::new(0.0, 0.0, 0.0), |line| on_road(line, s_m, d_m, 0.0));
        let program = program(table);
        let stop_s_m = Some(stop_s_m);
        let light = TrafficLight { name: name.clone(), pose, stop_s_m, signal: None, program };
        table.finish();
        light
    };
    tables.iter().zip(&names).map(read).collect()
}

/// Reports a name that cannot be part of a key of `--set` or of an axis: `actor.NAME.KEY=VALUE`.
fn addressable(table: &TableReader<'_>, name: &str) {
    if let Some(sign) = name.chars().find(|sign| ".=".contains(*sign)) {
        let message =
            format!("expected a name without `.` and `=`, which separate keys in --set; found `{sign}`");
        table.report("name", message);
    }
}

/// Durations of green, yellow and red of a light.
fn program(table: &TableReader<'_>) -> SignalProgram {
    let guesses = table.reading().guesses();
    let durations_s = [
        table.number("green_s", DURATION),
        table.number_or("yellow_s", 3.0, Range::between(0.0, 3_600.0)),
        table.number("red_s", DURATION),
    ];
    let offset_s = table.number_or("offset_s", 0.0, Range::between(0.0, 86_400.0));
    let program = SignalProgram::green_yellow_red(durations_s, offset_s);
    let cycle_s = program.cycle_s();
    if table.reading().guesses() == guesses && offset_s >= cycle_s {
        table.report("offset_s", format!("an offset of {offset_s} s is not within the cycle of {cycle_s} s"));
    }
    program
}

/// Values after a problem.
const NO_SEGMENT: Segment = Segment { length_m: 0.0, curvature_1pm: 0.0 };
const NO_START: EgoStart = EgoStart {
    s_m: 0.0,
    d_m: 0.0,
    heading_rad: 0.0,
    target_speed_mps: 0.0,
    start_speed_mps: None,
    end_m: 0.0,
};

fn end(top: &TableReader<'_>, known: &[(ActorId, &str)]) -> End {
    let mut end = End { timeout_s: 30.0, after_collision_s: 2.0, standstill: None };
    let Some(table) = top.table_if_any("end") else { return end };
    end.timeout_s = table.number_or("timeout_s", end.timeout_s, Range::between(0.1, 86_400.0));
    end.after_collision_s =
        table.number_or("after_collision_s", end.after_collision_s, Range::between(0.0, 3_600.0));
    if let Some(still) = table.table_if_any("standstill") {
        let near = still.text_if_any("near").and_then(|name| {
            let found = identity(&name, known);
            if found.is_none() {
                still.report("near", unknown_actor(&name, known, &[]));
            }
            found
        });
        let within_m = if still.has("near") {
            still.number("within_m", WAY)
        } else {
            still.number_or("within_m", 1e5, WAY)
        };
        end.standstill = Some(Standstill { near, within_m, for_s: still.number("for_s", DURATION) });
        still.finish();
    }
    table.finish();
    end
}

fn unique(
    tables: &[TableReader<'_>],
    names: &[String],
    (ego, others): (&str, &[OtherEgo]),
    traffic: Option<&Traffic>,
) {
    let mut seen = BTreeSet::new();
    for (table, name) in tables.iter().zip(names) {
        addressable(table, name);
        if name == "ego" {
            table.report("name", "\"ego\" is the ego vehicle's own name");
        } else if name == ego || others.iter().any(|other| other.name == *name) {
            table.report("name", format!("an ego is named \"{name}\" already"));
        }
        if !name.is_empty() && !seen.insert(name) {
            table.report("name", format!("another actor is named \"{name}\" already"));
        }
        if traffic.is_some_and(|traffic| traffic.has_named(name)) {
            table.report("name", format!("{OF_TRAFFIC} \"{name}\" already"));
        }
    }
}

/// Identity of the first actor or other ego of this name.
fn identity(name: &str, known: &[(ActorId, &str)]) -> Option<ActorId> {
    known.iter().find(|(_, known)| *known == name).map(|(id, _)| *id)
}

/// Message for a name that matches no actor, nor a name of the first ego if those are given.
fn unknown_actor(name: &str, known: &[(ActorId, &str)], egos: &[&str]) -> String {
    let known = known.iter().map(|(_, name)| *name).chain(egos.iter().copied());
    let mut known: Vec<&str> = known.filter(|n| !n.is_empty()).collect();
    known.dedup();
    match nearest(name, known.iter().copied()) {
        Some(near) => format!("unknown actor \"{name}\"; did you mean `{near}`?"),
        None if known.is_empty() => format!("unknown actor \"{name}\"; the scenario has none"),
        None => format!("unknown actor \"{name}\"; expected one of {}", list(&known)),
    }
}

#[cfg(test)]
mod tests;
