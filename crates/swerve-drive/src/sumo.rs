//! Configurations of SUMO as scenarios: the ego drives on the net among SUMO's traffic.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use swerve_map::router::{Stop, find_over};
use swerve_map_io::MapFile;
use swerve_map_io::sumo::{read, read_near};
use swerve_sumo::{SumoConfig, SumoError, car_lanes, text_of, ways};
use swerve_text::{Document, Problem};
use toml::{Table, Value};

/// Ways of each route file that are tried, most of all.
const WAYS_MAX: usize = 200;

/// Length from which a way is good enough, metres.
const LONG_M: f64 = 150.0;

/// Distance of the ego's start from the begin of its lane, and of its goal from the end of its lane, metres.
const START_M: f64 = 15.0;
const BEFORE_END_M: f64 = 10.0;

/// Slowest mean speed of a drive, m/s, and the time for waiting, seconds.
const SLOWEST_MPS: f64 = 2.5;
const WAITING_S: f64 = 90.0;

/// True if a path has the name of a configuration of SUMO.
pub fn is_config(path: &Path) -> bool {
    path.extension().is_some_and(|end| end.eq_ignore_ascii_case("sumocfg"))
}

fn problem(file: &Path, message: String) -> Problem {
    // Problems of files name them already.
    let message = message.replace(&format!("{}:", file.display()), "line ");
    Problem { file: file.display().to_string(), line: None, key: String::new(), message }
}

fn config(path: &Path) -> Result<SumoConfig, Problem> {
    let text = text_of(path).map_err(|error| problem(path, error.to_string()))?;
    SumoConfig::read(path, &text).map_err(|problems| problem(path, problems.to_string()))
}

/// A scenario of Swerve on the net of a configuration. The ego drives the way of the first vehicle in the route files that
/// leads over lanes for cars; of short ones, the longest.
///
/// # Errors
/// Faults of the files, or if there is no such way.
pub fn document(path: &Path) -> Result<Document, Problem> {
    let config = config(path)?;
    let wrong = |error: String| problem(path, error);
    let net = config.net.display().to_string();
    let text = text_of(&config.net).map_err(|error| wrong(error.to_string()))?;
    let map = MapFile::read(&net, &text).map_err(wrong)?;
    let way = Ways::of(&config, &net, &text, &map).and_then(|ways| ways.best());
    let way = way.map_err(|error| wrong(error.to_string()))?;
    let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let name: String = name.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
    let file = path.file_name().map_or_else(String::new, |file| file.to_string_lossy().into_owned());
    let folder = path.parent().unwrap_or(Path::new(""));
    let net = config.net.strip_prefix(folder).unwrap_or(&config.net).display().to_string();
    let place = |(name, s_m): &(String, f64)| format!("{{ lane = {name:?}, s_m = {s_m:?} }}");
    let text = format!(
        "name = {name:?}\ndescription = \"Among the traffic of a simulation of SUMO\"\n\n[map]\nfile = {net:?}\n\n\
         [world]\nsumo = {file:?}\n\n[ego]\nstart = {}\ngoal = {}\nstart_speed_mps = 0.0\n\n[end]\ntimeout_s = {:?}\n",
        place(&way.ends[0]),
        place(&way.ends[1]),
        (way.length_m / SLOWEST_MPS + WAITING_S).ceil(),
    );
    Document::parse(&path.display().to_string(), text)
}

/// Text of the net of a configuration; `None` for other files.
pub(crate) fn map_of(path: &Path) -> Option<Arc<str>> {
    let config = is_config(path).then(|| config(path).ok())??;
    text_of(&config.net).ok().map(Arc::from)
}

/// Keys of `[world]` that a scenario leaves to its configuration of SUMO, with their values.
///
/// # Errors
/// If the configuration or its net cannot be read.
pub(crate) fn left_out(document: &Document) -> Result<Vec<(String, Value)>, Problem> {
    let Some(world) = document.table.get("world").and_then(Value::as_table) else { return Ok(Vec::new()) };
    let text = |table: Option<&Table>, key: &str| Some(table?.get(key)?.as_str()?.to_owned());
    // Other values are refused by the reader of scenarios.
    let Some(name) = text(Some(world), "sumo") else { return Ok(Vec::new()) };
    let path: PathBuf = document.folder().join(name);
    let wrong = |message: String| document.problem("world.sumo", message);
    let config = config(&path).map_err(|problem| wrong(problem.to_string()))?;
    let mut values = vec![("begin_s", config.begin_s)];
    values.extend(config.step_s.map(|step_s| ("step_s", step_s)));
    let is_net = text(document.table.get("map").and_then(Value::as_table), "file").is_some_and(|file| {
        let file = file.to_lowercase();
        file.ends_with(".net.xml") || file.ends_with(".net.xml.gz")
    });
    let read = if is_net { read_near } else { read };
    let net = config.net.display().to_string();
    let text = text_of(&config.net).map_err(|error| wrong(error.to_string()))?;
    let [x_m, y_m] = read(&net, &text).map_err(|problems| wrong(problems.to_string()))?.net_offset_m;
    values.extend([("offset_x_m", x_m), ("offset_y_m", y_m)]);
    let missing = values.into_iter().filter(|(key, _)| !world.contains_key(*key));
    Ok(missing.map(|(key, value)| (format!("world.{key}"), value.into())).collect())
}

/// Ways that the ego may drive.
struct Ways<'a> {
    map: &'a MapFile,
    /// Names of lanes of each edge on which cars may drive, and their lengths.
    lanes: Vec<(String, f64)>,
    ways: Vec<Vec<String>>,
    net: String,
}

/// A way: the ends as lane and place, and its length.
struct Way {
    ends: [(String, f64); 2],
    length_m: f64,
}

impl<'a> Ways<'a> {
    fn of(config: &SumoConfig, net: &str, text: &str, map: &'a MapFile) -> Result<Self, SumoError> {
        let wrong = |problems: swerve_map_io::Problems| SumoError::Setting(problems.to_string());
        let open = car_lanes(net, text).map_err(wrong)?;
        let lanes = map.map.lanes().iter().filter(|lane| lane.kind.is_drivable());
        let lanes = lanes.map(|lane| (map.name(lane.id), lane.line.length()));
        let lanes = lanes.filter(|(name, _)| open.contains(name)).collect();
        let mut found = Vec::new();
        for file in &config.routes {
            found.extend(ways(&file.display().to_string(), &text_of(file)?, WAYS_MAX).map_err(wrong)?);
        }
        Ok(Self { map, lanes, ways: found, net: net.to_owned() })
    }

    /// Lanes of an edge.
    fn of_edge<'s>(&'s self, edge: &'s str) -> impl Iterator<Item = &'s (String, f64)> + Clone {
        self.lanes.iter().filter(move |(name, _)| name.rsplit_once('_').is_some_and(|(of, _)| of == edge))
    }

    /// The way from an edge to another with the fewest lane changes.
    fn between(&self, from: &str, to: &str) -> Option<Way> {
        let pairs = self.of_edge(from).flat_map(|start| self.of_edge(to).map(move |goal| (start, goal)));
        let way = |((start, start_m), (goal, goal_m)): (&(String, f64), &(String, f64))| {
            let start_s_m = START_M.min(0.5 * start_m);
            let goal_s_m = (goal_m - BEFORE_END_M).max(0.5 * goal_m);
            let stop = |name: &str, s_m: f64| -> Option<Stop> { self.map.on_lane(name, s_m).ok() };
            let stops = [stop(start, start_s_m)?, stop(goal, goal_s_m)?];
            let found = find_over(&self.map.map, &stops, &[]).ok()?;
            let ends = [(start.clone(), start_s_m), (goal.clone(), goal_s_m)];
            Some((found.changes(), Way { ends, length_m: found.length_m }))
        };
        pairs.filter_map(way).min_by_key(|(changes, _)| *changes).map(|(_, way)| way)
    }

    fn best(&self) -> Result<Way, SumoError> {
        let mut best: Option<Way> = None;
        for edges in &self.ways {
            let (Some(from), Some(to)) = (edges.first(), edges.last()) else { continue };
            let Some(way) = self.between(from, to) else { continue };
            if best.as_ref().is_none_or(|best| way.length_m > best.length_m) {
                best = Some(way);
            }
            if best.as_ref().is_some_and(|best| best.length_m >= LONG_M) {
                break;
            }
        }
        best.ok_or_else(|| {
            SumoError::Setting(format!(
                "no vehicle of the route files has a way over lanes for cars of {}: set scenario.ego.start and \
                 scenario.ego.goal in a scenario with `world.sumo`",
                self.net
            ))
        })
    }
}
