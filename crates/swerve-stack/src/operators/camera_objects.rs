//! Object detection in camera images: boxes on the ground, by a detector that the keys name.

use swerve_core::{Ranges as _, Span};
use swerve_flow::{
    At, Context, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port, PortInfo,
    RuntimeModel, Window,
};
use swerve_msg::{Detections, EgoState, Image, Route, TrackList};
use swerve_perception::camera::{CameraDetector, Shot};
use swerve_text::in_one_line;
use swerve_vehicle::{Pitch, VehicleParams};
use toml::Table;

use crate::algorithms::Chosen;
use crate::config::camera_detectors::CameraObjectsTable;
use crate::config::domain::Domain;
use crate::config::execution::span_ms;
use crate::detectors::DetectorRung;
use crate::kind::{Heavy, Node, OperatorKind, Scheduled, Settings};
use crate::ladder::{Ladder, Rung};
use crate::problems::{KeyProblems, problem};
use crate::section::Section;
use crate::setup::Setup;
use crate::site::Site;

/// Past poses kept to find the one at an image's stamp and to estimate the body's pitch until then: at 100 Hz.
const POSES: usize = 256;

/// Largest integration step of the body's pitch, seconds.
const PITCH_STEP_S: f64 = 0.01;

/// Detects objects in a camera's images, on a rung of a detector.
pub(super) struct CameraObjects;

/// Image of this stamp, and past poses of the ego.
#[derive(Inputs)]
struct In {
    /// Colour image of the camera.
    image: At<Image>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
    /// Route of the ego: the ground on which objects are expected.
    route: Latest<Route>,
    /// Tracks, for a rung that searches around them.
    #[port(feedback)]
    tracks: Option<Latest<TrackList>>,
}

/// Boxes.
#[derive(Outputs)]
struct Out {
    /// Detected objects.
    boxes: Port<Detections>,
}

fn problems(table: &CameraObjectsTable, Setup { registry, .. }: &Setup) -> KeyProblems {
    let mut found: KeyProblems = table.out_of_range().into_iter().map(problem).collect();
    // With a wrong rung, the detector is that of the table without one.
    let other = CameraObjectsTable { rung: CameraObjectsTable::default().rung, ..table.clone() };
    let (chosen, wrong_rung) = match table.chosen(registry) {
        Ok(chosen) => (Ok(chosen), None),
        Err(wrong) if wrong.0 == "rung" => (other.chosen(registry), Some(wrong)),
        Err(wrong) => (Err(wrong), None),
    };
    let chosen = match chosen {
        Ok(chosen) => chosen,
        Err(wrong) => {
            found.push(wrong);
            return found;
        }
    };
    found.extend(Domain::of_detector(&table.detector).err().map(|message| ("detector".to_owned(), message)));
    for (name, ms) in &table.run_times_ms {
        let wrong = chosen.known(name).err().or_else(|| span_ms(*ms).err());
        found.extend(wrong.map(|message| (format!("run_times_ms.{name}"), message)));
    }
    match wrong_rung {
        Some(wrong) => found.push(wrong),
        None => {
            let built = |rung| chosen.build(rung).map(drop);
            found.extend(chosen.taken().find_map(|rung| built(rung).err()).into_iter().flatten());
            found.extend(rungs(&chosen, table).err().map(|message| ("run_times_ms".to_owned(), message)));
        }
    }
    found
}

/// Rungs that may be used, the fastest first and the named one last, each with its longest run time.
///
/// # Errors
/// A rung of a ladder has no run time, or it is out of range.
fn rungs(chosen: &Chosen<'_>, table: &CameraObjectsTable) -> Result<Vec<Rung>, String> {
    let rung = |rung: &DetectorRung| {
        let most_ms = match chosen.run_time(rung) {
            None if table.ladder => return Err(untimed(rung)),
            time => time.map_or(0.0, |time| time.most_ms()),
        };
        let name = rung.name.to_string();
        let keys =
            Table::from_iter([("rung".to_owned(), name.clone().into()), ("ladder".to_owned(), false.into())]);
        Ok(Rung { name, run_time: span_ms(most_ms)?, keys })
    };
    let mut rungs = chosen.taken().map(rung).collect::<Result<Vec<_>, String>>()?;
    // A rung slower than a better one is left out.
    let top = rungs.last().map_or(Span::ZERO, |rung| rung.run_time);
    rungs.retain(|rung| rung.run_time <= top);
    rungs.sort_by_key(|rung| rung.run_time);
    Ok(rungs)
}

/// Error message for a rung without a run time.
fn untimed(rung: &DetectorRung) -> String {
    format!("expected a run time of rung `{}`: none was measured", rung.name)
}

/// Keys of an operator.
fn table(settings: &Settings<'_>) -> CameraObjectsTable {
    CameraObjectsTable::of(settings.setup, settings.name)
}

impl OperatorKind for CameraObjects {
    fn node(&self) -> Node {
        Node::new("camera_objects", "boxes of people, cars, trucks and cyclists in a camera's images")
            .section(const { &Section::own(problems) })
            .heavy(Heavy::Yes)
            .scheduled(Scheduled::Detector)
            .on_ladder()
    }

    fn schema(&self) -> Option<schemars::Schema> {
        Some(schemars::schema_for!(CameraObjectsTable))
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        Out::ports()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        let mut ports = In::ports();
        let table = table(settings);
        let chosen = table.chosen(&settings.setup.registry);
        if !chosen.is_ok_and(|chosen| chosen.taken().any(|rung| rung.follows_tracks)) {
            ports.retain(|port| port.name != "tracks");
        }
        ports
    }

    fn runtime(&self, settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        let table = table(settings);
        if table.ladder {
            return Ok(RuntimeModel::LADDER);
        }
        let chosen = table.chosen(&settings.setup.registry).map_err(|(_, message)| message)?;
        chosen.run_time(chosen.named()).ok_or_else(|| untimed(chosen.named()))?.model()
    }

    fn takes_ms(&self, settings: &Settings<'_>) -> Option<[f64; 2]> {
        let table = table(settings);
        let time = table.run_time(&settings.setup.registry)?;
        Some([if table.ladder { time.most_ms() } else { time.typical_ms() }, time.most_ms()])
    }

    fn domain(&self, settings: &Settings<'_>) -> Option<Domain> {
        Domain::of_detector(&table(settings).detector).ok()?
    }

    fn ladder(&self, settings: &Settings<'_>) -> Option<Ladder> {
        let table = table(settings);
        let rungs = rungs(&table.chosen(&settings.setup.registry).ok()?, &table).ok()?;
        Some(Ladder { rungs, sets_run_time: table.ladder })
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let wrong = |found: KeyProblems| anyhow::anyhow!("operator.{}: {}", site.name(), in_one_line(&found));
        let objects = table(&site.settings()).detector(&site.setup().registry).map_err(wrong)?;
        let around = site.surroundings();
        let vehicle = around.vehicle.clone();
        site.add(Detector { objects, vehicle }, None)
    }
}

/// Detects the objects in an image.
struct Detector {
    objects: Box<dyn CameraDetector>,
    vehicle: VehicleParams,
}

impl Operator for Detector {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        let Some(image) = input.image.get() else { return };
        let poses: Vec<EgoState> = input.poses.get().iter().map(|pose| **pose).collect();
        let before = poses.partition_point(|pose| pose.stamp <= image.stamp);
        let Some(measured) = poses[..before].last().or(poses.first()) else { return };
        let ego = measured.pose_after((image.stamp - measured.stamp).as_secs());
        let pitch_rad = pitch_rad(&poses[..before], &self.vehicle);
        let tracks = input.tracks.as_ref().and_then(|tracks| Some(&**tracks.get()?));
        let mut found = Detections::default();
        let route = input.route.get().map(|route| &**route);
        let shot = Shot { image, ego, pitch_rad, route };
        match self.objects.detect(&shot, tracks, &mut found) {
            Ok(()) => out.boxes.loan().send(found),
            Err(error) => cx.stop_run(format!("{}: {error}", cx.name())),
        }
    }
}

/// Pitch of the body after these poses, radians, positive nose down.
pub(super) fn pitch_rad(poses: &[EgoState], vehicle: &VehicleParams) -> f64 {
    let mut pitch = Pitch::default();
    for pair in poses.windows(2).filter(|pair| pair[0].is_plausible()) {
        let passed_s = (pair[1].stamp - pair[0].stamp).as_secs().clamp(0.0, 1.0);
        let steps = (passed_s / PITCH_STEP_S).ceil();
        for _ in 0..steps as usize {
            pitch.step(vehicle, pair[0].accel_mps2, passed_s / steps);
        }
    }
    pitch.angle_rad
}
