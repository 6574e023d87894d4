//! Scenarios of CommonRoad: read in place of a scenario file, and the solution of a drive.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;
use swerve_commonroad::{Ego, Recorder, Scenario, check};
use swerve_core::Span;
use swerve_flow::{Event, Observer};
use swerve_geom::Vector2;
use swerve_msg::truth::WorldState;
use swerve_stack::pipeline::Pipeline;
use swerve_text::{Document, Problem, read_bytes, unpacked};

/// Largest file, bytes.
const BYTES_MAX: u64 = 256 << 20;

/// Most problems of a file that are shown.
const SHOWN: usize = 20;

/// Ends of file names.
const ENDS: [&str; 2] = [".xml", ".xml.gz"];

/// Option of a run on a scenario of CommonRoad.
#[derive(clap::Args, Clone, Debug)]
pub struct SolutionArgs {
    /// Write the solution of a CommonRoad scenario (model ST2) to this file, and print whether it is valid
    #[arg(long, value_name = "FILE")]
    pub solution: Option<PathBuf>,
}

/// True if a path has the name of a CommonRoad scenario.
pub fn is_scenario(path: &Path) -> bool {
    let name = path.file_name().map(|name| name.to_string_lossy().to_lowercase());
    name.is_some_and(|name| ENDS.iter().any(|end| name.ends_with(end)))
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

/// Text of a file, unpacked.
pub(crate) fn read_text(path: &Path) -> std::io::Result<String> {
    unpacked(read_bytes(path, BYTES_MAX)?).map_err(std::io::Error::other)
}

fn text(path: &Path) -> Result<String, String> {
    read_text(path).map_err(|error| error.to_string())
}

/// Reads a scenario.
fn read(path: &Path) -> Result<Scenario, String> {
    let file = path.display().to_string();
    Scenario::read(&file, &text(path)?).map_err(|problems| problems.first(SHOWN))
}

/// The scenario as a document of Swerve.
///
/// # Errors
/// All faults of the file, or the reason for which it cannot be driven.
pub fn document(path: &Path) -> Result<Document, Problem> {
    let name = path.display().to_string();
    let wrong = |message: String| Problem { file: name.clone(), line: None, key: String::new(), message };
    // The problem has the name of the file already.
    let scenario = read(path).map_err(|message| wrong(message.replace(&format!("{name}:"), "line ")))?;
    let file = path.file_name().map_or_else(String::new, |name| name.to_string_lossy().into_owned());
    let text = scenario.to_toml(&file).map_err(|error| wrong(error.to_string()))?;
    Document::parse(&name, text)
}

/// Text of the map of a scenario, which is its own; `None` for other files.
pub(crate) fn map_of(path: &Path) -> Option<Arc<str>> {
    if is_scenario(path) { text(path).ok().map(Arc::from) } else { None }
}

/// Observer that records the solution of a drive.
#[derive(Debug)]
pub struct Solving {
    recorder: Recorder,
    file: PathBuf,
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
            "--solution: expected a scenario of CommonRoad (.xml or .xml.gz), found {}",
            scenario.display()
        );
        let vehicle = &pipeline.vehicle;
        let cg_ahead_m = vehicle.cg_to_rear_m();
        let recorder = Recorder::new(read(scenario).map_err(|message| anyhow!(message))?);
        Ok(Some(Self { recorder, file, cg_ahead_m }))
    }

    /// Writes the solution; returns lines with its verdict.
    ///
    /// # Errors
    /// If the drive is shorter than two time steps, or the file cannot be written.
    pub fn write(&self) -> anyhow::Result<String> {
        let solution = self.recorder.solution();
        let solution =
            solution.ok_or_else(|| anyhow!("--solution: the drive has fewer than two time steps"))?;
        swerve_report::files::write_whole(&self.file, solution.to_xml().as_bytes())?;
        let verdict = check(self.recorder.scenario(), &solution);
        Ok(format!("solution {}: {verdict}\n", self.file.display()))
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
        for (name, expected) in [("a.xml", true), ("a.cr.XML.gz", true), ("a.toml", false), ("xml", false)] {
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
