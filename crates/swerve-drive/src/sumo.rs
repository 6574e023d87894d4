//! Configurations of SUMO as scenarios: the ego drives on the net among SUMO's traffic.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use swerve_map::router::{Stop, find_over};
use swerve_map_io::MapFile;
use swerve_map_io::sumo::{read, read_near};
use swerve_scenario::MapText;
use swerve_sumo::{SumoConfig, SumoError, car_lanes, text_of, ways};
use swerve_text::{Document, Problem};
use toml::{Table, Value};

use crate::commonroad::ends_with;

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

/// Ends of file names.
const ENDS: [&str; 2] = [".sumocfg", ".sumo.cfg"];

/// True if a path has the name of a configuration of SUMO.
pub fn is_config(path: &Path) -> bool {
    ENDS.iter().any(|end| ends_with(path, end))
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
    scenario(path).map(|(document, _)| document)
}

/// As [`document`], with the text of the net.
pub(crate) fn scenario(path: &Path) -> Result<(Document, MapText), Problem> {
    let config = config(path)?;
    let wrong = |error: String| problem(path, error);
    let net = config.net.display().to_string();
    let text = MapText::from(text_of(&config.net).map_err(|error| wrong(error.to_string()))?);
    let folder = path.parent().unwrap_or(Path::new(""));
    let named = config.net.strip_prefix(folder).unwrap_or(&config.net).display().to_string();
    // Problems are those of the whole path.
    let map = text.file(&named).or_else(|_| MapFile::read(&net, &text).map(Arc::new)).map_err(wrong)?;
    let way = Ways::of(&config, &net, &text, &map).and_then(|ways| ways.best());
    let way = way.map_err(|error| wrong(error.to_string()))?;
    let name = path.file_stem().map_or_else(String::new, |stem| stem.to_string_lossy().into_owned());
    let name: String = name.chars().map(|c| if c.is_alphanumeric() || c == '-' { c } else { '_' }).collect();
    let file = path.file_name().map_or_else(String::new, |file| file.to_string_lossy().into_owned());
    let place = |(name, s_m): &(String, f64)| format!("{{ lane = {name:?}, s_m = {s_m:?} }}");
    let document = format!(
        "name = {name:?}\ndescription = \"Among the traffic of a simulation of SUMO\"\n\n[map]\nfile = {named:?}\n\n\
         [world]\nsumo = {file:?}\n\n[ego]\nstart = {}\ngoal = {}\nstart_speed_mps = 0.0\n\n[end]\ntimeout_s = {:?}\n",
        place(&way.ends[0]),
        place(&way.ends[1]),
        (way.length_m / SLOWEST_MPS + WAITING_S).ceil(),
    );
    Ok((Document::parse(&path.display().to_string(), document)?, text))
}

/// Keys of `[world]` that a scenario leaves to its configuration of SUMO, with their values; `net` is the net if the scenario
/// was made of the configuration.
///
/// # Errors
/// If the configuration or its net cannot be read.
pub(crate) fn left_out(document: &Document, net: Option<&MapText>) -> Result<Vec<(String, Value)>, Problem> {
    let Some(world) = document.table.get("world").and_then(Value::as_table) else { return Ok(Vec::new()) };
    let text = |table: Option<&Table>, key: &str| Some(table?.get(key)?.as_str()?.to_owned());
    // Other values are refused by the reader of scenarios.
    let Some(name) = text(Some(world), "sumo") else { return Ok(Vec::new()) };
    let path: PathBuf = document.folder().join(name);
    let wrong = |message: String| document.problem("world.sumo", message);
    let config = config(&path).map_err(|problem| wrong(problem.to_string()))?;
    let mut values = vec![("begin_s", config.begin_s)];
    values.extend(config.step_s.map(|step_s| ("step_s", step_s)));
    let map = text(document.table.get("map").and_then(Value::as_table), "file").unwrap_or_default();
    let known = net.and_then(|net| net.file(&map).ok()?.net_offset_m);
    let offset = |map: &str| -> Result<[f64; 2], String> {
        let map = map.to_lowercase();
        let is_net = map.ends_with(".net.xml") || map.ends_with(".net.xml.gz");
        let read = if is_net { read_near } else { read };
        let text = text_of(&config.net).map_err(|error| error.to_string())?;
        let net = read(&config.net.display().to_string(), &text);
        Ok(net.map_err(|problems| problems.to_string())?.net_offset_m)
    };
    let [x_m, y_m] = known.map_or_else(|| offset(&map), Ok).map_err(wrong)?;
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

#[cfg(test)]
mod tests {
    use swerve_scenario::{Course, Scenario};
    use swerve_stack::Setup;
    use swerve_tests::{data_or_skip, skipped};

    use super::*;

    const NET: &str = include_str!("../../swerve-map-io/maps/junction.net.xml");
    const TRIPS: &str = "<routes><trip id=\"t\" from=\"nowhere\" to=\"out\"/><trip id=\"u\" from=\"in\" to=\"out\"/></routes>";
    const CONFIG: &str = "<configuration><net-file value=\"a.net.xml\"/><route-files value=\"a.rou.xml\"/>\
                          <begin value=\"100\"/><step-length value=\"0.2\"/></configuration>";

    /// A folder with a configuration on a small net.
    fn small(routes: &str) -> (tempfile::TempDir, PathBuf) {
        let folder = tempfile::tempdir().unwrap();
        for (file, text) in [("a.net.xml", NET), ("a.rou.xml", routes), ("a.sumocfg", CONFIG)] {
            std::fs::write(folder.path().join(file), text).unwrap();
        }
        let path = folder.path().join("a.sumocfg");
        (folder, path)
    }

    #[test]
    fn files_are_recognised_by_their_names() {
        for (name, expected) in
            [("a.sumocfg", true), ("a/b.sumo.CFG", true), ("a.cfg", false), ("sumocfg", false)]
        {
            assert_eq!(is_config(Path::new(name)), expected, "{name}");
        }
    }

    #[test]
    fn configuration_is_a_scenario_on_its_net_with_the_way_of_a_vehicle() {
        let (folder, path) = small(TRIPS);
        let scenario = crate::read_scenario(&path).unwrap();
        let world = scenario.sumo.clone().unwrap();
        assert_eq!((world.begin_s, world.step_s, world.warmup_s), (100.0, 0.2, 60.0));
        assert_eq!(world.offset_m, [100.0, 50.0]);
        assert_eq!(world.config, path);
        assert_eq!((&*scenario.name, scenario.ego.start_speed()), ("a", 0.0));
        // A scenario with the same world, on the map by its own name.
        let text = "name = \"own\"\n[map]\nfile = \"a.net.xml\"\n[world]\nsumo = \"a.sumocfg\"\nbegin_s = 7.0\n\
                    [ego]\nstart = { lane = \"in_2\", s_m = 10.0 }\ngoal = { lane = \"out_0\", s_m = 30.0 }\n";
        let own = folder.path().join("own.toml");
        std::fs::write(&own, text).unwrap();
        let world = crate::read_scenario(&own).unwrap().sumo.unwrap();
        assert_eq!((world.begin_s, world.step_s, world.offset_m), (7.0, 0.2, [100.0, 50.0]));
        // Its text is enough, without the files, as in a log.
        let Course::Map(course) = &scenario.road.course else { panic!("it is on a map") };
        let again = Scenario::parse_on("log", &scenario.text, Some(&course.text), &[]).unwrap();
        assert_eq!(again.sumo.map(|sumo| sumo.begin_s), Some(100.0));
        assert_eq!((again.ego, again.road.lights), (scenario.ego, scenario.road.lights));
    }

    #[test]
    fn wrong_configurations_are_refused_with_their_file() {
        let refused = |path: &Path| crate::read_scenario(path).unwrap_err().to_string();
        let (folder, path) = small("<routes><trip id=\"t\" from=\"nowhere\" to=\"out\"/></routes>");
        assert!(refused(&path).contains("no vehicle of the route files has a way"), "{}", refused(&path));
        std::fs::write(folder.path().join("a.rou.xml"), "<routes>").unwrap();
        assert!(refused(&path).contains("a.rou.xml:1:"), "{}", refused(&path));
        std::fs::write(folder.path().join("a.net.xml"), "<net/>").unwrap();
        assert!(refused(&path).contains("a.net.xml:1:"), "{}", refused(&path));
        std::fs::remove_file(folder.path().join("a.net.xml")).unwrap();
        assert!(refused(&path).contains("a.net.xml cannot be read"), "{}", refused(&path));
        std::fs::write(&path, "<configuration/>").unwrap();
        assert!(refused(&path).contains("line 1:"), "{}", refused(&path));
        let own = folder.path().join("own.toml");
        std::fs::write(&own, "name = \"x\"\n[map]\nfile = \"m\"\n[world]\nsumo = \"none.sumocfg\"\n")
            .unwrap();
        assert!(refused(&own).contains("own.toml:5: world.sumo"), "{}", refused(&own));
    }

    /// Configurations of the test data, and nets that have none.
    fn published(folder: &Path) -> Option<Vec<PathBuf>> {
        let data = data_or_skip("worlds/sumo")?;
        let mut found: Vec<PathBuf> =
            ["bologna_acosta/run", "resco_cologne1/cologne1", "resco_ingolstadt1/ingolstadt1"]
                .map(|name| data.join(format!("{name}.sumocfg")))
                .to_vec();
        for (name, net, routes) in [
            ("cross", "made/cross.net.xml", "made/cross.rou.xml"),
            ("town01", "made/town01.net.xml", "made/town01.rou.xml"),
            ("two_way", "two_way/single-intersection.net.xml", "two_way/single-intersection-gen.rou.xml"),
        ] {
            let [net, routes] = [net, routes].map(|file| data.join(file).display().to_string());
            let text = format!(
                "<configuration><net-file value=\"{net}\"/><route-files value=\"{routes}\"/></configuration>"
            );
            found.push(folder.join(format!("{name}.sumocfg")));
            std::fs::write(found.last().unwrap(), text).unwrap();
        }
        Some(found)
    }

    #[test]
    fn published_simulations_are_scenarios_near_the_origin_with_lights() {
        let folder = tempfile::tempdir().unwrap();
        let Some(files) = published(folder.path()) else { return };
        for file in files {
            let scenario = crate::read_scenario(&file).unwrap();
            let route = scenario.road.route();
            let points = route.line().points();
            assert!(points.iter().all(|at| at.x_m.abs().max(at.y_m.abs()) < 9_000.0), "{}", file.display());
            let obeyed = scenario.road.lights.iter().filter(|light| light.stop_s_m.is_some()).count();
            let (name, length_m) = (&scenario.name, scenario.ego.end_m - scenario.ego.s_m);
            println!("{name}: {length_m:.0} m, {obeyed} of {} lights on the way", scenario.road.lights.len());
            assert!(length_m > 80.0);
            // CARLA's Town01 has no lights in its net.
            assert_eq!(obeyed == 0, name == "town01", "{name}");
        }
    }

    /// SUMO itself drives the others: one digest on one thread and on eight, and no collision of the ego.
    #[test]
    fn drive_among_the_traffic_of_sumo_is_repeatable() {
        let folder = tempfile::tempdir().unwrap();
        let Some(files) = published(folder.path()) else { return };
        if let Err(missing) = swerve_sumo::Environment::of_process().program() {
            return skipped(&missing.to_string());
        }
        let scenario = crate::read_scenario(&files[3]).unwrap();
        let outcome =
            |threads| crate::drive_observed(&Setup::default(), &scenario, threads, &mut []).unwrap();
        let first = outcome(1);
        assert_eq!(first.metrics.verdict, swerve_eval::Verdict::Avoided, "{:?}", first.metrics.impact);
        assert_eq!(first.metrics.red_lights_passed, 0);
        for threads in [1, 8] {
            assert_eq!(outcome(threads).digest, first.digest, "{threads} threads");
        }
    }
}
