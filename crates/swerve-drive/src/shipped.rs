//! Built-in scenarios, configurations and studies: a run by name needs no checkout.
//!
//! An existing file takes precedence. Otherwise a path is looked up among the repository's files at build time, in the
//! folder of its kind and with or without `.toml`: `person_behind_truck`, `live/autoware`,
//! `configs/studies/planners.toml`.

use std::borrow::Cow;
use std::io::ErrorKind;
use std::path::{Component, Path, PathBuf};

use swerve_scenario::{MapText, Scenario, is_scenario_key};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::Config;
use swerve_stack::config::programs::Layer;
use swerve_text::{Document, Problem, Problems, nearest};

use crate::load::problems_error;
use crate::{commonroad, sumo, trust};

/// A built-in file.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Shipped {
    /// Path relative to the root given to `shipped!`.
    pub path: &'static str,
    /// Content.
    pub text: &'static str,
}

/// Includes files in the program, by paths relative to a root.
#[macro_export]
macro_rules! shipped {
    ($root:literal: $($path:literal)*) => {
        &[$($crate::shipped::Shipped { path: $path, text: include_str!(concat!($root, "/", $path)) }),*]
    };
}
pub use shipped;

/// All `.toml` files of `scenarios/` and `configs/`, the maps, and the problem files.
pub(crate) static FILES: &[Shipped] = shipped! { "..":
    "scenarios/car_behind_truck.toml"
    "scenarios/car_from_alley.toml"
    "scenarios/lane.toml"
    "scenarios/people_crossing.toml"
    "scenarios/person_behind_parked_car.toml"
    "scenarios/person_behind_truck.toml"
    "scenarios/person_crossing.toml"
    "scenarios/street.toml"
    "scenarios/town.toml"
    "scenarios/traffic_jam.toml"
    "scenarios/traffic_light.toml"
    "scenarios/everyday/car_behind_closes_fast.toml"
    "scenarios/everyday/closed_circle.toml"
    "scenarios/everyday/crossing_car_from_left.toml"
    "scenarios/everyday/crossing_car_from_right.toml"
    "scenarios/everyday/cut_in_from_left.toml"
    "scenarios/everyday/cut_in_from_right.toml"
    "scenarios/everyday/cyclist_swerves.toml"
    "scenarios/everyday/double_parked_twice.toml"
    "scenarios/everyday/fast_bend.toml"
    "scenarios/everyday/figure_of_eight.toml"
    "scenarios/everyday/hidden_cyclist.toml"
    "scenarios/everyday/lead_brakes_gently.toml"
    "scenarios/everyday/lead_brakes_hard.toml"
    "scenarios/everyday/lead_emergency_stop.toml"
    "scenarios/everyday/lead_pulls_out.toml"
    "scenarios/everyday/lead_same_speed.toml"
    "scenarios/everyday/lead_slow_oncoming.toml"
    "scenarios/everyday/lead_slow_overtake.toml"
    "scenarios/everyday/lead_slow_single_lane.toml"
    "scenarios/everyday/lead_stop_and_go.toml"
    "scenarios/everyday/lead_too_close.toml"
    "scenarios/everyday/narrow_gap.toml"
    "scenarios/everyday/obstacle_lane_free.toml"
    "scenarios/everyday/obstacle_oncoming_car.toml"
    "scenarios/everyday/oncoming_beside_shoulder.toml"
    "scenarios/everyday/oncoming_over_the_line.toml"
    "scenarios/everyday/parked_at_the_edge.toml"
    "scenarios/everyday/pass_given_up.toml"
    "scenarios/everyday/pedestrian_before_oncoming_car.toml"
    "scenarios/everyday/pedestrian_crosses_late.toml"
    "scenarios/everyday/pedestrian_runs.toml"
    "scenarios/everyday/pedestrian_stops.toml"
    "scenarios/everyday/pedestrian_turns_back.toml"
    "scenarios/everyday/red_light_cross_traffic.toml"
    "scenarios/everyday/road_crosses_itself.toml"
    "scenarios/everyday/start_at_light.toml"
    "scenarios/everyday/start_beside_the_line.toml"
    "scenarios/everyday/start_in_jam.toml"
    "scenarios/everyday/start_on_bend.toml"
    "scenarios/maps/closed_road.toml"
    "scenarios/maps/left_turn.toml"
    "scenarios/maps/light_green.toml"
    "scenarios/maps/light_red.toml"
    "scenarios/maps/merge.toml"
    "scenarios/maps/parked_truck.toml"
    "scenarios/maps/right_before_left.toml"
    "scenarios/maps/roundabout.toml"
    "scenarios/maps/town.toml"
    "scenarios/maps/traffic.toml"
    "scenarios/maps/two_egos.toml"
    "scenarios/routes/01.toml"
    "scenarios/routes/02.toml"
    "scenarios/routes/03.toml"
    "scenarios/routes/04.toml"
    "scenarios/routes/05.toml"
    "scenarios/routes/06.toml"
    "scenarios/routes/07.toml"
    "scenarios/routes/08.toml"
    "scenarios/routes/09.toml"
    "scenarios/routes/10.toml"
    "scenarios/nhtsa/01_vehicle_failure.toml"
    "scenarios/nhtsa/02_control_loss_with_maneuver.toml"
    "scenarios/nhtsa/03_control_loss_without_maneuver.toml"
    "scenarios/nhtsa/04_running_red_light.toml"
    "scenarios/nhtsa/05_running_stop_sign.toml"
    "scenarios/nhtsa/09_animal_with_maneuver.toml"
    "scenarios/nhtsa/10_animal_without_maneuver.toml"
    "scenarios/nhtsa/11_pedestrian_with_maneuver.toml"
    "scenarios/nhtsa/12_pedestrian_without_maneuver.toml"
    "scenarios/nhtsa/13_pedalcyclist_with_maneuver.toml"
    "scenarios/nhtsa/14_pedalcyclist_without_maneuver.toml"
    "scenarios/nhtsa/15_backing_up.toml"
    "scenarios/nhtsa/16_turning_same_direction.toml"
    "scenarios/nhtsa/17_parking_same_direction.toml"
    "scenarios/nhtsa/18_changing_lanes_same_direction.toml"
    "scenarios/nhtsa/19_drifting_same_direction.toml"
    "scenarios/nhtsa/20_maneuver_opposite_direction.toml"
    "scenarios/nhtsa/21_no_maneuver_opposite_direction.toml"
    "scenarios/nhtsa/22_following_making_maneuver.toml"
    "scenarios/nhtsa/23_lead_accelerating.toml"
    "scenarios/nhtsa/24_lead_slower.toml"
    "scenarios/nhtsa/25_lead_decelerating.toml"
    "scenarios/nhtsa/26_lead_stopped.toml"
    "scenarios/nhtsa/27_left_turn_signalized.toml"
    "scenarios/nhtsa/28_right_turn_signalized.toml"
    "scenarios/nhtsa/29_left_turn_non_signalized.toml"
    "scenarios/nhtsa/30_straight_crossing_non_signalized.toml"
    "scenarios/nhtsa/31_turning_non_signalized.toml"
    "scenarios/nhtsa/32_evasive_action_with_maneuver.toml"
    "scenarios/nhtsa/33_evasive_action_without_maneuver.toml"
    "scenarios/nhtsa/35_object_with_maneuver.toml"
    "scenarios/nhtsa/36_object_without_maneuver.toml"
    "scenarios/seeing/child_from_parked_row.toml"
    "scenarios/seeing/crossing_car_behind_van.toml"
    "scenarios/seeing/cut_in_behind_truck.toml"
    "scenarios/seeing/cyclist_at_dusk.toml"
    "scenarios/seeing/debris_behind_van.toml"
    "scenarios/seeing/lead_brakes_behind_van.toml"
    "scenarios/seeing/person_behind_bus.toml"
    "scenarios/seeing/person_left_behind_truck.toml"
    "scenarios/seeing/person_right_behind_truck.toml"
    "scenarios/maps/crossing.xodr"
    "scenarios/maps/crossing_priority.xodr"
    "scenarios/maps/crossing_right_first.xodr"
    "scenarios/maps/ramp.xodr"
    "scenarios/maps/roundabout.xodr"
    "scenarios/maps/town.xodr"
    "scenarios/maps/two_lane_road.xodr"
    "scenarios/maps/two_ways.xodr"
    "configs/brake_failure.toml"
    "configs/camera_objects.toml"
    "configs/deadlines.toml"
    "configs/detector.toml"
    "configs/full.toml"
    "configs/fused_objects.toml"
    "configs/fusion.toml"
    "configs/lidar_localizer.toml"
    "configs/lidar_objects.toml"
    "configs/live/autoware.toml"
    "configs/live/autoware_lidar.toml"
    "configs/live/carla.toml"
    "configs/live/carla_native.toml"
    "configs/live/dataspeed.toml"
    "configs/live/plain.toml"
    "configs/live/raptor.toml"
    "configs/localizer.toml"
    "configs/paper.toml"
    "configs/paper_this_host.toml"
    "configs/problems/detour.json"
    "configs/ros2.toml"
    "configs/segmentation.toml"
    "configs/showcase.toml"
    "configs/showcase_processes.toml"
    "configs/studies/blind.toml"
    "configs/studies/budget.toml"
    "configs/studies/comfort.toml"
    "configs/studies/consistency.toml"
    "configs/studies/consistency_full.toml"
    "configs/studies/deadlines.toml"
    "configs/studies/deadlines_table1.toml"
    "configs/studies/detectors.toml"
    "configs/studies/detectors_at_no_time.toml"
    "configs/studies/detector_ladder.toml"
    "configs/studies/detector_tradeoff.toml"
    "configs/studies/detector_tradeoff_rungs.toml"
    "configs/studies/faults.toml"
    "configs/studies/localization.toml"
    "configs/studies/occlusion.toml"
    "configs/studies/planners.toml"
    "configs/studies/planners_best.toml"
    "configs/studies/planners_paper_visibility.toml"
    "configs/studies/planners_skip_to_latest.toml"
    "configs/studies/planners_this_host.toml"
    "configs/studies/prediction.toml"
    "configs/studies/predictors.toml"
    "configs/studies/robustness.toml"
    "configs/studies/robustness_images.toml"
    "configs/studies/routes_latency.toml"
    "configs/studies/routes_sensors.toml"
    "configs/studies/seeing.toml"
    "configs/studies/sensor_lost.toml"
    "configs/studies/table1.toml"
    "configs/studies/table1_ablation.toml"
    "configs/studies/table1_jerk.toml"
    "configs/studies/timely_detection.toml"
    "configs/studies/timely_segmentation.toml"
    "configs/studies/timely_speed.toml"
    "configs/studies/tracker_tradeoff.toml"
    "configs/studies/tracker_tradeoff_rungs.toml"
    "configs/timing/av.toml"
    "configs/timing/deadlines.toml"
    "configs/timing/policies.toml"
    "configs/traffic_lights.toml"
    "configs/two_hosts.toml"
    "configs/two_processes.toml"
    "configs/urban_gnss.toml"
};

impl Shipped {
    /// The scenario of a built-in file, with its built-in map.
    ///
    /// # Errors
    /// All problems of the file.
    pub fn scenario(&self) -> anyhow::Result<Scenario> {
        let document = Document::parse(self.path, self.text).ok();
        let map = document.and_then(|document| built_in_map(Path::new(self.path), &document));
        let scenario = Scenario::parse_on(self.path, self.text, map.as_ref(), &[]);
        scenario.map_err(|problems| problems_error(&problems))
    }
}

/// Text of the built-in map that a scenario names, from its own folder or from that of the maps.
fn built_in_map(place: &Path, scenario: &Document) -> Option<MapText> {
    let name = Path::new(scenario.table.get("map")?.get("file")?.as_str()?);
    let folders = [place.parent().unwrap_or(Path::new("")), Path::new(MAPS)];
    let text = |folder: &Path| {
        let path = plain(&folder.join(name))?;
        FILES.iter().find(|file| file.path == path).map(|file| file.text.into())
    };
    folders.into_iter().find_map(text)
}

/// Folder of the maps of the scenarios.
const MAPS: &str = "scenarios/maps";

/// Kind of file, which selects the folder where names are looked up.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub enum Kind {
    /// A scenario.
    Scenario,
    /// A configuration of a simulated drive.
    Config,
    /// A configuration of a drive with a vehicle.
    Live,
    /// A study.
    Study,
    /// A timing pipeline.
    Timing,
    /// Posed planning problems.
    Problems,
}

impl Kind {
    fn folder(self) -> &'static str {
        match self {
            Self::Scenario => "scenarios",
            Self::Config => "configs",
            Self::Live => "configs/live",
            Self::Study => "configs/studies",
            Self::Timing => "configs/timing",
            Self::Problems => "configs/problems",
        }
    }

    fn noun(self) -> &'static str {
        match self {
            Self::Scenario => "scenario",
            Self::Config | Self::Live => "configuration",
            Self::Study => "study",
            Self::Timing => "timing file",
            Self::Problems => "problem file",
        }
    }

    fn ending(self) -> &'static str {
        if self == Self::Problems { ".json" } else { ".toml" }
    }

    /// The built-in files of this kind with their names, in order. The name of a scenario in a subfolder of
    /// `scenarios/` includes the subfolder: `everyday/start_in_jam`. The subfolders of `configs/` hold other kinds.
    pub fn all(self) -> impl Iterator<Item = (&'static str, &'static Shipped)> {
        FILES.iter().filter_map(move |file| {
            let name =
                file.path.strip_prefix(self.folder())?.strip_prefix('/')?.strip_suffix(self.ending())?;
            (self == Self::Scenario || !name.contains('/')).then_some((name, file))
        })
    }

    /// Names of the built-in files of this kind in a subfolder, such as `everyday`; empty if there is no such
    /// subfolder.
    pub fn in_folder(self, folder: &Path) -> Vec<&'static str> {
        let Some(folder) = plain(folder) else { return Vec::new() };
        let folder = folder.strip_prefix(self.folder()).map_or(&*folder, |rest| rest.trim_start_matches('/'));
        let is_in = |name: &&str| name.strip_prefix(folder).is_some_and(|rest| rest.starts_with('/'));
        self.all().map(|(name, _)| name).filter(is_in).collect()
    }

    /// Built-in name whose last component is nearest to that of `given`.
    fn nearest(self, given: &Path) -> Option<&'static str> {
        let last = |name: &'static str| name.rsplit('/').next().unwrap_or(name);
        let stem = given.file_stem().unwrap_or_default().to_string_lossy();
        let near = nearest(&stem, self.all().map(|(name, _)| last(name)))?;
        self.all().map(|(name, _)| name).find(|name| last(name) == near)
    }

    /// Hint on where to find the built-in names: the names themselves, or the first ones.
    fn listed(self) -> String {
        const FEW: usize = 5;
        let names: Vec<&str> = self.all().map(|(name, _)| name).collect();
        match self {
            Self::Scenario if names.len() > FEW => {
                "; `swerve scenarios` lists those of the program".to_owned()
            }
            _ if names.len() > FEW => {
                let (first, more) = (names[..FEW].join(", "), names.len() - FEW);
                format!("; the program has {first} and {more} more")
            }
            _ => format!("; the program has {}", names.join(", ")),
        }
    }

    /// Built-in file named by `given`.
    fn find(self, given: &Path) -> Option<&'static Shipped> {
        let path = plain(given)?;
        let path = path.strip_suffix(self.ending()).unwrap_or(&path);
        let is_meant = |file: &&Shipped| {
            let whole = file.path.strip_suffix(self.ending()).unwrap_or(file.path);
            let in_folder = whole.strip_prefix(self.folder()).and_then(|rest| rest.strip_prefix('/'));
            whole == path || in_folder == Some(path)
        };
        let found = FILES.iter().find(is_meant);
        // A simulated drive may have the configuration of a vehicle.
        found.or_else(|| if self == Self::Config { Self::Live.find(given) } else { None })
    }

    /// Returns the text of a file, or of the built-in one of this name.
    ///
    /// # Errors
    /// If it cannot be read. If there is no such file, the error gives the nearest name.
    pub fn text(self, given: &Path) -> Result<Cow<'static, str>, Problem> {
        let is_packed = self == Self::Scenario && commonroad::is_scenario(given);
        self.text_by(if is_packed { commonroad::read_text } else { swerve_text::read_text }, given)
    }

    fn text_by(
        self,
        read: impl FnOnce(&Path) -> std::io::Result<String>,
        given: &Path,
    ) -> Result<Cow<'static, str>, Problem> {
        let error = match read(given) {
            Ok(text) => return Ok(text.into()),
            Err(error) => error,
        };
        let mut problem = swerve_text::unreadable(given, &error);
        if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::IsADirectory) {
            if let Some(file) = self.find(given) {
                return Ok(file.text.into());
            }
            let other = match self {
                Self::Scenario => Some(Self::Config),
                Self::Config => Some(Self::Scenario),
                _ => None,
            };
            if let Some(other) = other.filter(|other| other.find(given).is_some()) {
                problem.message = other.in_place_of(self);
                return Err(problem);
            }
            problem.message += &match self.nearest(given) {
                Some(near) => format!("; did you mean the {} `{near}` that is in the program?", self.noun()),
                None => self.listed(),
            };
        }
        Err(problem)
    }

    /// Same as [`text`](Self::text), parsed. Also reads a descriptor passed by the caller on the command line
    /// (`/dev/stdin`, `<(...)`).
    ///
    /// # Errors
    /// If it cannot be read, or is not TOML.
    pub fn document(self, given: &Path) -> Result<Document, Problem> {
        let text = self.text_by(swerve_text::read_given_text, given)?;
        Document::parse(&given.display().to_string(), text)
    }

    /// Parses a scenario file as TOML, or makes a scenario of one of CommonRoad or of a configuration of SUMO. Also returns
    /// the text of its map, if that is not beside the scenario's file.
    ///
    /// # Errors
    /// Same as [`document`](Self::document), or if it is a configuration.
    pub(crate) fn scenario(given: &Path) -> Result<(Document, Option<MapText>), Problem> {
        if let Some(message) = commonroad::refusal(given) {
            let file = given.display().to_string();
            return Err(Problem { file, line: None, key: String::new(), message });
        }
        if commonroad::is_scenario(given) {
            return commonroad::scenario(given).map(|(document, map)| (document, Some(map)));
        }
        if sumo::is_config(given) {
            return sumo::scenario(given).map(|(document, map)| (document, Some(map)));
        }
        let document = Self::Scenario.document(given)?;
        let has = |is_one: &dyn Fn(&str) -> bool| document.table.keys().any(|key| is_one(key));
        let of_config = swerve_text::keys::<Config>("").unwrap_or_default();
        match !has(&is_scenario_key) && has(&|key| of_config.contains(&key)) {
            true => Err(document.problem("", Self::Config.in_place_of(Self::Scenario))),
            false => {
                let map = Self::map_of(given, &document);
                Ok((document, map))
            }
        }
    }

    /// Text of the map file that a scenario names, if the program has it and there is none beside the scenario's file.
    fn map_of(given: &Path, scenario: &Document) -> Option<MapText> {
        let name = Path::new(scenario.table.get("map")?.get("file")?.as_str()?);
        if given.parent().unwrap_or(Path::new("")).join(name).exists() {
            return None;
        }
        built_in_map(Self::Scenario.place(given), scenario)
    }

    /// Merges several configuration files, or built-in ones of these names, to one document; later files override
    /// earlier ones. Files that name programs are also returned as layers, in order.
    ///
    /// # Errors
    /// If one cannot be read, or is not TOML.
    pub fn layers(self, given: &[PathBuf]) -> Result<(Document, Vec<Layer>), Problem> {
        let documents: Vec<Document> =
            given.iter().map(|path| self.document(path)).collect::<Result<_, _>>()?;
        for document in &documents {
            // Every scenario has a road or a map; no configuration has one.
            if ["road", "map"].iter().any(|key| document.table.contains_key(*key)) {
                return Err(document.problem("", Self::Scenario.in_place_of(self)));
            }
        }
        let named =
            given.iter().zip(&documents).filter(|(_, document)| Layer::names_programs(&document.table));
        let layers =
            named.map(|(path, document)| Layer::of_file(document.clone(), self.doubt(path, &document.text)));
        let layers = layers.collect();
        match Config::layered(documents) {
            Some(document) => Ok((document, layers)),
            None => Ok((Document::parse("defaults", "")?, layers)),
        }
    }

    /// Reason to distrust the programs named in a file with this text; `None` for a built-in file and for the user's
    /// own.
    pub fn doubt(self, given: &Path, text: &str) -> Option<String> {
        let is_shipped = self.find(given).is_some_and(|file| file.text == text);
        if is_shipped { None } else { trust::doubt(given, text) }
    }

    /// Error for a file of this kind in place of another one.
    fn in_place_of(self, expected: Self) -> String {
        let (noun, other) = (self.noun(), expected.noun());
        let how = match (self, expected) {
            // `swerve live` does not take scenarios.
            (_, Self::Live) => "",
            (Self::Config, _) => ": a configuration is given after `-c`",
            _ => ": a scenario is given without `-c`",
        };
        format!("it is a {noun}, expected a {other}{how}")
    }

    /// Reads the configuration of files, or of the built-in ones of these names, later over earlier, with the
    /// assignments of a command line; all defaults if there is none. It may start the programs named in the user's own
    /// files and on the command line.
    ///
    /// # Errors
    /// All errors in the configuration.
    pub fn config(
        self,
        registry: &Registry,
        given: &[PathBuf],
        sets: &[(String, toml::Value)],
    ) -> Result<Setup, Problems> {
        let (document, mut layers) = self.layers(given)?;
        layers.push(Layer::of_sets("--set", sets, None));
        let mut config = Setup::from_document_with(registry, &document, sets)?;
        config.trust(&layers);
        Ok(config)
    }

    /// Resolves `named` in a file, where `at` is the path relative to that file: an existing file, or a built-in one.
    pub fn meant(self, named: &Path, at: PathBuf) -> PathBuf {
        let is_name = !at.exists() && self.find(&at).is_none() && self.find(named).is_some();
        if is_name { named.to_owned() } else { at }
    }

    /// Location of the file named by `given`, for resolving the paths in it.
    pub fn place(self, given: &Path) -> &Path {
        match self.find(given) {
            Some(file) if !given.is_file() => Path::new(file.path),
            _ => given,
        }
    }
}

/// Normalized relative path; `None` if it leads out of its base.
pub(crate) fn plain(path: &Path) -> Option<String> {
    let mut parts: Vec<&str> = Vec::new();
    for part in path.components() {
        match part {
            Component::Normal(name) => parts.push(name.to_str()?),
            Component::CurDir => {}
            Component::ParentDir => {
                parts.pop()?;
            }
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    Some(parts.join("/"))
}

#[cfg(test)]
mod tests;
