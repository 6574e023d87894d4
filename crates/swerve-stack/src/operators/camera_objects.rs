//! Object detection in camera images: boxes on the ground, by a detector that the keys name.

use swerve_core::{Ranges as _, Span, Time};
use swerve_flow::{
    At, Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port,
    PortInfo, RuntimeModel, Window,
};
use swerve_msg::{Detections, EgoState, Image, Route, RungTaken, TrackList};
use swerve_perception::camera::{CameraDetector, Shot};
use swerve_text::in_one_line;
use swerve_vehicle::{Pitch, VehicleParams};

use super::ladder::{on_ladder, take};
use crate::config::camera_detectors::{CameraObjectsTable, Chosen};
use crate::config::execution::span_ms;
use crate::config::model::{Model, Rung};
use crate::config::planner::problem;
use crate::detectors::DetectorRung;
use crate::kind::{Heavy, KeyProblems, Node, OperatorKind, Scheduled, Settings};
use crate::section::Section;
use crate::setup::Setup;
use crate::site::Site;

/// Past poses kept to find the one at an image's stamp and to estimate the body's pitch until then: at 100 Hz.
const POSES: usize = 256;

/// Largest integration step of the body's pitch, seconds.
const PITCH_STEP_S: f64 = 0.01;

/// Detects objects in a camera's images, on one rung of a detector or on the one that fits the time left.
pub(super) struct CameraObjects;

/// Image of this stamp, and past poses of the ego.
#[derive(Inputs)]
struct In {
    /// Colour image of the camera.
    image: At<Image>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
    /// Tracks, for a rung that searches around them.
    #[port(feedback)]
    tracks: Option<Latest<TrackList>>,
}

/// Newest image, at each tick.
#[derive(Inputs)]
struct PeriodicIn {
    /// Period of the detector.
    tick: Every,
    /// Colour image of the camera.
    image: Latest<Image>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
    /// Tracks, for a rung that searches around them.
    #[port(feedback)]
    tracks: Option<Latest<TrackList>>,
}

/// Boxes, and the rung that found them.
#[derive(Outputs)]
struct Out {
    /// Detected objects.
    boxes: Port<Detections>,
    /// Rung that was used.
    rung: Port<RungTaken>,
}

/// Implementations that may be chosen for a frame.
type Rungs = Vec<Rung<Box<dyn CameraDetector>>>;

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
    for (name, ms) in &table.run_times_ms {
        let wrong = chosen.known(name).err().or_else(|| span_ms(*ms).err());
        found.extend(wrong.map(|message| (format!("run_times_ms.{name}"), message)));
    }
    match wrong_rung {
        Some(wrong) => found.push(wrong),
        None => found.extend(rungs(&chosen, table).err().into_iter().flatten()),
    }
    found
}

/// Rungs that may be used, the fastest first and the named one last; on a ladder each with its longest run time.
fn rungs(chosen: &Chosen<'_>, table: &CameraObjectsTable) -> Result<Rungs, KeyProblems> {
    let mut rungs = Vec::new();
    for rung in chosen.taken() {
        let what = chosen.build(rung)?;
        let time = chosen.run_time(rung).map(|time| time.most_ms());
        let wrong = |message| vec![("run_times_ms".to_owned(), message)];
        let most_ms = match (time, table.ladder) {
            (None, true) => return Err(wrong(untimed(rung))),
            (time, _) => time.unwrap_or(0.0),
        };
        let run_time = span_ms(most_ms).map_err(wrong)?;
        rungs.push(Rung { name: rung.name.to_string(), run_time, what });
    }
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
    }

    fn schema(&self) -> Option<schemars::Schema> {
        Some(schemars::schema_for!(CameraObjectsTable))
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        Out::ports()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        let mut ports = match settings.setup.execution.model {
            Model::Periodic => PeriodicIn::ports(),
            _ => In::ports(),
        };
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
            return Ok(on_ladder());
        }
        let chosen = table.chosen(&settings.setup.registry).map_err(|(_, message)| message)?;
        chosen.run_time(chosen.named()).ok_or_else(|| untimed(chosen.named()))?.model()
    }

    fn takes_ms(&self, settings: &Settings<'_>) -> Option<[f64; 2]> {
        let table = table(settings);
        let time = table.run_time(&settings.setup.registry)?;
        Some([if table.ladder { time.most_ms() } else { time.typical_ms() }, time.most_ms()])
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let table = table(&site.settings());
        let wrong = |found: KeyProblems| anyhow::anyhow!("operator.{}: {}", site.name(), in_one_line(&found));
        let chosen = table.chosen(&site.setup().registry).map_err(|found| wrong(vec![found]))?;
        let (rungs, around) = (rungs(&chosen, &table).map_err(wrong)?, site.surroundings());
        let (route, vehicle) = (around.route.clone(), around.vehicle.clone());
        let detector = Detector { rungs, spends: table.ladder, route, vehicle };
        match site.own_timer() {
            Some(timer) => site.add(Periodic { detector, last: None }, Some(timer))?,
            None => site.add(detector, None)?,
        }
        if let Some(deadline) = site.own_deadline() {
            let _configured = site.node()?.deadline(deadline);
        }
        Ok(())
    }
}

/// Runs on the images of its input.
struct Detector {
    rungs: Rungs,
    /// True on a ladder, where the rung defines the run time of a step.
    spends: bool,
    route: Route,
    vehicle: VehicleParams,
}

/// Runs on a timer, on the newest image; never twice on the same one.
struct Periodic {
    detector: Detector,
    last: Option<Time>,
}

/// Past poses of the ego, and the tracks.
type Around<'a> = (&'a [EgoState], Option<&'a TrackList>);

impl Detector {
    fn look(&mut self, cx: &mut Context<'_>, image: &Image, (poses, tracks): Around<'_>, out: &mut Out) {
        let before = poses.partition_point(|pose| pose.stamp <= image.stamp);
        let Some(measured) = poses[..before].last().or(poses.first()) else { return };
        let ego = measured.pose_after((image.stamp - measured.stamp).as_secs());
        let pitch_rad = pitch_rad(&poses[..before], &self.vehicle);
        let (objects, taken) = if self.spends {
            take(&mut self.rungs, cx)
        } else {
            let left = cx.deadline().map(|deadline| deadline - cx.now());
            let Some(Rung { name, run_time, what }) = self.rungs.last_mut() else { return };
            (what, RungTaken { stamp: cx.stamp(), rung: name.clone(), run_time: *run_time, left })
        };
        let mut found = Detections::default();
        let shot = Shot { image, ego, pitch_rad, route: Some(&self.route) };
        if let Err(error) = objects.detect(&shot, tracks, &mut found) {
            return cx.stop_run(format!("{}: {error}", cx.name()));
        }
        out.boxes.loan().send(found);
        out.rung.send(taken);
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

impl Operator for Detector {
    type In = In;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Out) {
        let Some(image) = input.image.get() else { return };
        let poses: Vec<EgoState> = input.poses.get().iter().map(|pose| **pose).collect();
        let tracks = input.tracks.as_ref().and_then(|tracks| Some(&**tracks.get()?));
        self.look(cx, image, (&poses, tracks), out);
    }
}

impl Operator for Periodic {
    type In = PeriodicIn;
    type Out = Out;

    fn step(&mut self, cx: &mut Context<'_>, input: &PeriodicIn, out: &mut Out) {
        let newest = input.image.get().filter(|image| self.last != Some(image.stamp));
        let Some(image) = newest else { return };
        self.last = Some(image.stamp);
        let poses: Vec<EgoState> = input.poses.get().iter().map(|pose| **pose).collect();
        let tracks = input.tracks.as_ref().and_then(|tracks| Some(&**tracks.get()?));
        self.detector.look(cx, image, (&poses, tracks), out);
    }
}
