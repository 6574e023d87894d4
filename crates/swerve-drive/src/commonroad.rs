//! Scenarios of CommonRoad: read in place of a scenario file, and the solution of a drive.

use std::path::{Path, PathBuf};

use anyhow::anyhow;
use swerve_commonroad::{Ego, Failure, Model, Recorder, Scenario, check, xml_of_protobuf};
use swerve_core::Span;
use swerve_eval::Impact;
use swerve_flow::{Event, Observer};
use swerve_geom::Vector2;
use swerve_msg::truth::WorldState;
use swerve_scenario::MapText;
use swerve_stack::pipeline::Pipeline;
use swerve_text::{Document, Problem, read_bytes, unpacked};
use swerve_vehicle::VehicleParams;

/// Largest file, bytes.
const BYTES_MAX: u64 = 256 << 20;

/// Most problems of a file that are shown.
const SHOWN: usize = 20;

/// Ends of file names.
const ENDS: [&str; 3] = [".xml", ".xml.gz", PROTOBUF];

/// End of the names of files in the protobuf format.
const PROTOBUF: &str = ".pb";

/// Option of a run on a scenario of CommonRoad.
#[derive(clap::Args, Clone, Debug)]
pub struct SolutionArgs {
    /// Write the solution of a CommonRoad scenario to this file, and print whether it is valid
    #[arg(long, value_name = "FILE")]
    pub solution: Option<PathBuf>,
    /// Vehicle model of the solution
    #[arg(long, value_enum, value_name = "MODEL", requires = "solution", default_value_t)]
    pub solution_model: SolutionModel,
}

/// Model of a solution; the vehicle is a BMW 320i (number 2).
#[derive(clap::ValueEnum, Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum SolutionModel {
    /// Single track with tyre slip, ST2: the drive itself
    #[default]
    St,
    /// Kinematic single track, KS2: it follows the drive
    Ks,
}

/// True if a path has the name of a CommonRoad scenario.
pub fn is_scenario(path: &Path) -> bool {
    ENDS.iter().any(|end| ends_with(path, end))
}

/// Reason for which a file is refused by its name; `None` for most.
pub(crate) fn refusal(path: &Path) -> Option<String> {
    let is_pickle = [".pickle", ".pkl"].iter().any(|end| ends_with(path, end));
    is_pickle.then(|| {
        "expected a scenario (TOML, or CommonRoad as .xml, .xml.gz or .pb), found a pickle: to read one may run code".to_owned()
    })
}

/// True if the name of a file has this end, in capitals too.
pub(crate) fn ends_with(path: &Path, end: &str) -> bool {
    path.file_name().is_some_and(|name| name.to_string_lossy().to_lowercase().ends_with(end))
}

/// The scenarios of CommonRoad below a folder, sorted by path: XML files with its root element.
///
/// # Errors
/// If the folder cannot be read.
pub fn scenarios_in(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut files = swerve_report::files::files_below(folder, is_scenario)?;
    files.retain(|file| text(file).is_ok_and(|text| text.contains("<commonRoad ")));
    Ok(files)
}

/// Text of a file, unpacked, in XML.
///
/// # Errors
/// If the file cannot be read, or is not in the format of its name.
pub fn read_text(path: &Path) -> std::io::Result<String> {
    let bytes = read_bytes(path, BYTES_MAX)?;
    match ends_with(path, PROTOBUF) {
        true => xml_of_protobuf(&bytes).map_err(std::io::Error::other),
        false => unpacked(bytes).map_err(std::io::Error::other),
    }
}

fn text(path: &Path) -> Result<String, String> {
    read_text(path).map_err(|error| error.to_string())
}

/// Reads a scenario.
fn read(path: &Path) -> Result<Scenario, String> {
    read_in(path, &text(path)?)
}

/// Reads a scenario from the text of its file.
fn read_in(path: &Path, text: &str) -> Result<Scenario, String> {
    Scenario::read(&path.display().to_string(), text).map_err(|problems| problems.first(SHOWN))
}

/// The scenario as a document of Swerve.
///
/// # Errors
/// All faults of the file, or the reason for which it cannot be driven.
pub fn document(path: &Path) -> Result<Document, Problem> {
    scenario(path).map(|(document, _)| document)
}

/// The scenario as a document of Swerve, and the text of its map, which is its own.
pub(crate) fn scenario(path: &Path) -> Result<(Document, MapText), Problem> {
    let name = path.display().to_string();
    let wrong = |message: String| Problem { file: name.clone(), line: None, key: String::new(), message };
    // The problem has the name of the file already.
    let read = text(path).and_then(|text| Ok((read_in(path, &text)?, text)));
    let (scenario, map) = read.map_err(|message| wrong(message.replace(&format!("{name}:"), "line ")))?;
    let file = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let text = scenario.to_toml(&file).map_err(|error| wrong(error.to_string()))?;
    Ok((Document::parse(&name, text)?, map.into()))
}

/// Observer that records the solution of a drive.
#[derive(Debug)]
pub struct Solving {
    recorder: Recorder,
    model: Model,
    file: Option<PathBuf>,
    /// Distance of the centre of gravity from the rear axle, metres.
    cg_ahead_m: f64,
}

impl Solving {
    /// Records the solution of a run, if one is asked for.
    ///
    /// # Errors
    /// If the scenario is not one of CommonRoad.
    pub fn of(args: &SolutionArgs, scenario: &Path, pipeline: &Pipeline) -> anyhow::Result<Option<Self>> {
        let Some(file) = args.solution.clone() else { return Ok(None) };
        anyhow::ensure!(
            is_scenario(scenario),
            "--solution: expected a scenario of CommonRoad (.xml, .xml.gz or .pb), found {}",
            scenario.display()
        );
        let recorder = Recorder::new(read(scenario).map_err(|message| anyhow!(message))?);
        let model = match args.solution_model {
            SolutionModel::St => Model::St,
            SolutionModel::Ks => Model::Ks,
        };
        Ok(Some(Self { recorder, model, file: Some(file), cg_ahead_m: pipeline.vehicle.cg_to_rear_m() }))
    }

    /// Records the drive of this vehicle through a scenario of CommonRoad, without a file; `None` for other scenarios.
    ///
    /// # Errors
    /// If the file cannot be read.
    pub fn of_drive(scenario: &Path, vehicle: &VehicleParams) -> anyhow::Result<Option<Self>> {
        if !is_scenario(scenario) {
            return Ok(None);
        }
        let recorder = Recorder::new(read(scenario).map_err(|message| anyhow!(message))?);
        Ok(Some(Self { recorder, model: Model::St, file: None, cg_ahead_m: vehicle.cg_to_rear_m() }))
    }

    /// Reasons for which the drive does not solve the planning problem; empty if it does. `hit` is a collision of the
    /// ego: with road users that react, it counts in place of the recorded ones, which may be elsewhere.
    pub fn broken(&self, hit: Option<&Impact>, reacts: bool) -> Vec<String> {
        let Some(solution) = self.recorder.solution(self.model) else {
            return vec!["the drive has fewer than two time steps".to_owned()];
        };
        let scenario = self.recorder.scenario();
        let failures = match reacts {
            true => check(&scenario.without_trajectories(), &solution).failures,
            false => check(scenario, &solution).failures,
        };
        let first_and_last = solution.driven.first().map(|one| (one.states.first(), one.states.last()));
        let steps =
            first_and_last.and_then(|(first, last)| Some(last?.step - first?.step)).unwrap_or_default();
        let until_s = f64::from(steps) * scenario.step_s;
        // Where the goal is reached before the collision, the solution ends.
        let hit = hit.filter(|hit| hit.at_s <= until_s);
        let is_hit = failures.iter().any(|failure| matches!(failure, Failure::Obstacle { .. }));
        let hit = hit.filter(|_| !is_hit).map(|hit| format!("collision after {:.2} s", hit.at_s));
        failures.iter().map(Failure::to_string).chain(hit).collect()
    }

    /// Writes the solution; returns lines with its verdict.
    ///
    /// # Errors
    /// If the drive is shorter than two time steps, or the file cannot be written.
    pub fn write(&self) -> anyhow::Result<String> {
        let solution = self.recorder.solution(self.model);
        let solution =
            solution.ok_or_else(|| anyhow!("--solution: the drive has fewer than two time steps"))?;
        let verdict = check(self.recorder.scenario(), &solution);
        let Some(file) = &self.file else { return Ok(format!("solution: {verdict}\n")) };
        swerve_report::files::write_whole(file, solution.to_xml().as_bytes())?;
        let off = match self.model {
            Model::Ks => format!("; at most {:.2} m from the drive", self.recorder.off_m(&solution)),
            Model::St | Model::Pm => String::new(),
        };
        Ok(format!("solution {}: {verdict}{off}\n", file.display()))
    }
}

impl Observer for Solving {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(world) = publication.payload.and_then(|payload| payload.downcast_ref::<WorldState>()) else {
            return;
        };
        // The first state at or after each time step.
        if world.stamp - swerve_core::Time::ZERO < Span::from_secs(self.recorder.next_s()) {
            return;
        }
        let ego = &world.ego;
        let heading = ego.state.pose.direction();
        let velocity_mps = Vector2::new(ego.velocity_mps.coords.x, ego.velocity_mps.coords.y);
        let yaw_rate_radps = ego.state.yaw_rate_radps;
        let sideways_mps = velocity_mps.dot(heading.left()) - yaw_rate_radps * self.cg_ahead_m;
        self.recorder.push(&Ego {
            pose: ego.state.pose,
            velocity_mps: Vector2::new(ego.state.speed_mps, sideways_mps),
            yaw_rate_radps,
            steering_rad: ego.state.steering_rad,
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_recognised_by_their_names() {
        for (name, expected) in
            [("a.xml", true), ("a.cr.XML.gz", true), ("a.pb", true), ("a.toml", false), ("xml", false)]
        {
            assert_eq!(is_scenario(Path::new(name)), expected, "{name}");
        }
    }

    /// A hand-written scenario.
    const SMALL: &str = include_str!("../../swerve-commonroad/src/read/tests/small.xml");

    #[test]
    fn scenario_is_driven_on_its_own_map_among_recorded_road_users() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("small.xml");
        std::fs::write(&path, SMALL).unwrap();
        let scenario = crate::read_scenario(&path).unwrap();
        assert_eq!((&*scenario.name, scenario.end.timeout_s), ("ZAM_Small-1_1_T-1", 2.0));
        let [parked, car] = &scenario.actors[..] else { panic!("{:?}", scenario.actors) };
        assert!(parked.track().is_none() && parked.kind == swerve_msg::ActorKind::Static);
        assert_eq!(car.track().map(|track| track.poses.len()), Some(3));
        assert_eq!(scenario.drawn(7).ego, scenario.ego, "recorded road users do not know of draws");
    }

    #[test]
    fn pickle_is_refused_by_its_name() {
        let error = crate::read_scenario(Path::new("missing/tracks.pkl")).unwrap_err().to_string();
        assert!(error.starts_with("missing/tracks.pkl: ") && error.contains("found a pickle"), "{error}");
    }

    #[test]
    fn solution_is_judged_by_the_drive_where_road_users_react() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("small.xml");
        std::fs::write(&path, SMALL).unwrap();
        assert!(Solving::of_drive(Path::new("lane.toml"), &VehicleParams::default()).unwrap().is_none());
        let mut solving = Solving::of_drive(&path, &VehicleParams::default()).unwrap().unwrap();
        assert_eq!(solving.broken(None, false), ["the drive has fewer than two time steps"]);
        let back_m = 1.423;
        for k in 0..30 {
            solving.recorder.push(&Ego {
                pose: swerve_geom::Pose2::new(20.0 - back_m + f64::from(k), 1.5, 0.0),
                velocity_mps: Vector2::new(10.0, 0.0),
                yaw_rate_radps: 0.0,
                steering_rad: 0.0,
            });
        }
        let hit = |at_s| Impact {
            actor: swerve_msg::ActorId(2),
            at_s,
            ego_speed_mps: 10.0,
            closing_speed_mps: 1.0,
            impulse_n_s: 0.0,
            at_fault: true,
        };
        let none: [&str; 0] = [];
        assert_eq!(solving.broken(None, false), none);
        // The goal is reached after 1 s.
        assert_eq!(solving.broken(Some(&hit(1.5)), true), none);
        assert_eq!(solving.broken(Some(&hit(0.5)), true), ["collision after 0.50 s"]);
    }

    #[test]
    fn scenario_without_a_way_is_refused_with_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("beside.xml");
        std::fs::write(&path, SMALL.replace("<x>20</x><y>1.5</y>", "<x>20</x><y>15</y>")).unwrap();
        let error = crate::read_scenario(&path).unwrap_err().to_string();
        assert!(
            error.contains("beside.xml: expected the start of the planning problem on a lanelet"),
            "{error}"
        );
    }
}
