use anyhow::anyhow;
use swerve_flow::{At, Context, Graph, Operator, Port, Stream, Timer, Window};
use swerve_geom::{Pose2, math};
use swerve_msg::truth::{Surroundings, WorldState};
use swerve_msg::{Detections, EgoState, ObstacleList, PredictionList, TrackList};
use swerve_perception::detector::{Detector, Params};
use swerve_perception::tracker::Tracker as Sort;
use swerve_prediction::{History, HistoryParams, linear};

use super::deadline::{LadderDetector, PeriodicDetector, own_timer};
use super::faulty::faulty;
use super::sensors::{DetectorSight, Obstacles};
use crate::config::Config;
use crate::config::model::Rung;
use crate::config::perception::{Emulated, image_camera};

/// What an emulated detector is given, and what it is.
pub(super) struct Seen {
    surroundings: Stream<Surroundings>,
    emulated: Emulated,
}

/// What there is to see: for the tracker, or for the detector before it.
pub(super) enum Sight {
    Truth(Stream<ObstacleList>),
    Detector(Seen),
}

/// Adds the obstacle sensor.
pub(super) fn sight(
    graph: &mut Graph,
    config: &Config,
    timer: Timer,
    world: Stream<WorldState>,
) -> anyhow::Result<Sight> {
    let wrong = |(key, message): (&str, String)| anyhow!("perception.{key}: {message}");
    let Some(emulated) = config.perception.emulated().map_err(wrong)? else {
        let sensor = Obstacles::new(config, None);
        let obstacles = graph.add("obstacles", sensor, (timer, world)).origin().out();
        return Ok(Sight::Truth(faulty(graph, config, "obstacles", obstacles)?));
    };
    let camera = config.detector_camera(emulated.sensing);
    let sensor = DetectorSight(Obstacles::new(config, camera.as_ref()));
    let node = graph.add("obstacles", sensor, (timer, world)).origin();
    let (_, surroundings) = node.outputs(&["seen", "surroundings"]).out();
    Ok(Sight::Detector(Seen { surroundings, emulated }))
}

/// Adds the tracker, and the detector before it if there is one.
pub(super) fn tracks(
    graph: &mut Graph,
    config: &Config,
    sight: Sight,
    pose: Stream<EgoState>,
) -> anyhow::Result<Stream<TrackList>> {
    let Seen { surroundings, emulated } = match sight {
        Sight::Truth(obstacles) => return Ok(graph.add("tracker", Tracker::new(config), (obstacles,)).out()),
        Sight::Detector(seen) => seen,
    };
    let wrong = |(key, message): (&str, String)| anyhow!("perception.{key}: {message}");
    let params = config.perception.tracker(&emulated.params, config.prediction.past_steps).map_err(wrong)?;
    let camera = config.detector_camera(emulated.sensing).and_then(|camera| image_camera(&camera));
    let boxes = detector(graph, config, surroundings, |params| {
        Ok(Detector::new(params, camera, config.seed, "detector")?)
    })?;
    let boxes = faulty(graph, config, "detector", boxes)?;
    let tracker = SortTracker(Sort::new(params)?);
    Ok(graph.add("tracker", tracker, (boxes, pose)).out())
}

/// Adds the detector, as the model of execution has it.
fn detector(
    graph: &mut Graph,
    config: &Config,
    seen: Stream<Surroundings>,
    emulate: impl Fn(Params) -> anyhow::Result<Detector>,
) -> anyhow::Result<Stream<Detections>> {
    const OUTPUTS: [&str; 2] = ["boxes", "rung"];
    let wrong = |(key, message): (&str, String)| anyhow!("perception.{key}: {message}");
    let params =
        config.perception.emulated().map_err(wrong)?.map(|emulated| emulated.params).unwrap_or_default();
    let mut rungs = config.detector_rungs().map_err(wrong)?;
    if let Some(timer) = own_timer(config, "detector")? {
        let rung = rungs.pop().map(|Rung { name, run_time, .. }| Rung { name, run_time, what: () });
        let periodic = PeriodicDetector { detector: emulate(params)?, rung, last: None };
        return Ok(graph.add("detector", periodic, (timer, seen)).outputs(&OUTPUTS).out().0);
    }
    if rungs.is_empty() {
        return Ok(graph.add("detector", DetectorOperator(emulate(params)?), (seen,)).out());
    }
    let emulate = |Rung { name, run_time, what }| Ok(Rung { name, run_time, what: emulate(what)? });
    let rungs = rungs.into_iter().map(emulate).collect::<anyhow::Result<_>>()?;
    Ok(graph.add("detector", LadderDetector(rungs), (seen,)).outputs(&OUTPUTS).out().0)
}

/// A detector of a given accuracy, emulated.
struct DetectorOperator(Detector);

impl Operator for DetectorOperator {
    type In = (At<Surroundings>,);
    type Out = Port<Detections>;

    fn step(&mut self, _: &mut Context<'_>, (seen,): &Self::In, out: &mut Self::Out) {
        if let Some(seen) = seen.get() {
            out.loan().send(self.0.detect(seen));
        }
    }
}

/// Past poses kept to find the one measured at a frame's stamp: as old as frames get, at 100 Hz.
const POSES: usize = 256;

/// Follows what a detector reports, in the map.
struct SortTracker(Sort);

impl Operator for SortTracker {
    type In = (At<Detections>, Window<EgoState, POSES>);
    type Out = Port<TrackList>;

    fn step(&mut self, _: &mut Context<'_>, (boxes, poses): &Self::In, out: &mut Self::Out) {
        let (Some(boxes), poses) = (boxes.get(), poses.get()) else { return };
        // Measured before the frame: a later one is not known where a detector takes no time.
        let before = poses.iter().rev().find(|pose| pose.header().stamp <= boxes.stamp);
        let Some(measured) = before.or(poses.first()) else { return };
        out.loan().send(self.0.update(boxes, moved_on(measured, (boxes.stamp - measured.stamp).as_secs())));
    }
}

/// The pose a moment later: along the arc that speed and turn rate make.
fn moved_on(ego: &EgoState, dt_s: f64) -> Pose2 {
    let heading_rad = ego.pose.heading_rad + ego.yaw_rate_radps * dt_s;
    let (sin, cos) = math::sin_cos(ego.pose.heading_rad + 0.5 * ego.yaw_rate_radps * dt_s);
    let way_m = ego.speed_mps * dt_s;
    Pose2::new(ego.pose.x_m + way_m * cos, ego.pose.y_m + way_m * sin, heading_rad)
}

/// Follows what the sensor reports by its identity and keeps past sightings.
pub(super) struct Tracker {
    history: History,
}

impl Tracker {
    pub(super) fn new(config: &Config) -> Self {
        let params =
            HistoryParams { sightings_max: config.prediction.past_steps, ..HistoryParams::default() };
        Self { history: History::new(params) }
    }
}

impl Operator for Tracker {
    type In = (At<ObstacleList>,);
    type Out = Port<TrackList>;

    fn step(&mut self, _: &mut Context<'_>, (obstacles,): &Self::In, out: &mut Self::Out) {
        if let Some(obstacles) = obstacles.get() {
            out.loan().send(self.history.update(obstacles));
        }
    }
}

/// Straight lines through past sightings.
pub(super) struct Predictor {
    params: linear::Params,
}

impl Predictor {
    pub(super) fn new(config: &Config) -> Self {
        Self { params: linear_params(config) }
    }
}

fn linear_params(config: &Config) -> linear::Params {
    let prediction = &config.prediction;
    linear::Params {
        past_steps: prediction.past_steps,
        future_steps: (prediction.horizon_ms / prediction.step_ms).round() as usize,
        step_s: prediction.step_ms * 1e-3,
        ..prediction.preset.linear()
    }
}

impl Operator for Predictor {
    type In = (At<TrackList>,);
    type Out = Port<PredictionList>;

    fn step(&mut self, _: &mut Context<'_>, (tracks,): &Self::In, out: &mut Self::Out) {
        if let Some(tracks) = tracks.get() {
            out.loan().send(linear::predict(tracks, &self.params));
        }
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use swerve_core::{Span, Time};
    use swerve_flow::{Event, Observer};
    use swerve_scenario::Scenario;

    use super::super::Pipeline;
    use super::*;
    use crate::config::text::{Document, parse_assignment};
    use crate::run::drive_pipeline;

    /// Boxes with the instant of their publication, tracks, and states of the world.
    #[derive(Default)]
    struct Seen {
        boxes: Vec<(Time, Detections)>,
        tracks: Vec<TrackList>,
        worlds: Vec<WorldState>,
    }

    impl Observer for Seen {
        fn event(&mut self, event: &Event<'_>) {
            let Event::Publication(publication) = event else { return };
            let Some(payload) = publication.payload.map(|payload| payload.as_any()) else { return };
            if let Some(boxes) = payload.downcast_ref::<Detections>() {
                self.boxes.push((publication.visible_at, boxes.clone()));
            } else if let Some(tracks) = payload.downcast_ref::<TrackList>() {
                self.tracks.push(tracks.clone());
            } else if let Some(world) = payload.downcast_ref::<WorldState>() {
                self.worlds.push(world.clone());
            }
        }
    }

    /// The first second with the truck near by, and what was seen of it.
    fn drive(detector: &str, sets: &[&str]) -> (Seen, swerve_core::Digest) {
        let path =
            Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../scenarios/person_behind_truck.toml"));
        let text = std::fs::read_to_string(path).unwrap().replace("s_m = 110.0", "s_m = 40.0");
        let scenario = Scenario::parse("near", &text).unwrap();
        let sets: Vec<_> = sets.iter().map(|set| parse_assignment(set).unwrap()).collect();
        let text = format!("[perception]\ndetector = \"{detector}\"\n");
        let config = Config::from_document(&Document::parse("test", text).unwrap(), &sets).unwrap();
        let mut pipeline = Pipeline::build(&config, &scenario).unwrap();
        pipeline.until = Time::from_ms(1000);
        let mut seen = Seen::default();
        let digest = drive_pipeline(pipeline, config.seed, 1, &mut [&mut seen]).unwrap().digest;
        (seen, digest)
    }

    /// Parameters under which nothing is wrong.
    const PERFECT: [&str; 9] = [
        "perception.params.recall_best=1",
        "perception.params.half_distance_m=10000",
        "perception.params.half_share=-1",
        "perception.params.ghosts_per_frame=0",
        "perception.params.score_gap=20",
        "perception.params.range_noise_share=0",
        "perception.params.bearing_noise_rad=0",
        "perception.params.size_noise_share=0",
        "perception.params.heading_noise_rad=0",
    ];

    #[test]
    fn a_detector_without_fault_is_followed_where_its_truth_is() {
        let (seen, _) = drive("custom", &PERFECT);
        let tracks = seen.tracks.last().unwrap();
        let world = seen.worlds.iter().find(|world| world.stamp >= tracks.stamp).unwrap();
        let truck = &world.actors[0];
        let track = tracks.tracks.iter().find(|track| track.kind == truck.kind).unwrap();
        let off_m = track.pose.point().distance(truck.pose.point());
        assert!(off_m < 0.05 && track.velocity_mps.norm() < 0.2, "{off_m} {:?}", track.velocity_mps);
        assert!(track.history.len() > 3);
        assert!(seen.boxes.iter().all(|(_, frame)| frame.boxes.iter().all(|b| b.image_px.is_some())));
    }

    #[test]
    fn boxes_come_after_the_published_run_time_or_the_configured_one() {
        for (sets, ms) in [(&[][..], 28), (&["operator.detector.runtime={ fixed_ms = 7 }"][..], 7)] {
            let (seen, digest) = drive("efficientdet-d3@v100", sets);
            assert!(seen.boxes.len() >= 18, "{}", seen.boxes.len());
            assert!(seen.boxes.iter().all(|(at, frame)| *at - frame.stamp == Span::from_ms(ms)));
            assert!(seen.boxes.iter().any(|(_, frame)| !frame.boxes.is_empty()));
            assert_eq!(digest, drive("efficientdet-d3@v100", sets).1);
        }
    }

    #[test]
    fn a_slow_detector_drops_frames() {
        let (seen, _) = drive("efficientdet-d7x@v100", &[]);
        // 153 ms on frames that come every 50 ms: a new one every 153 ms.
        assert!((5..=7).contains(&seen.boxes.len()), "{}", seen.boxes.len());
        assert_eq!(seen.boxes.len(), seen.tracks.len());
    }

    #[test]
    fn a_pose_moves_on_along_its_arc() {
        let ego = EgoState { speed_mps: 10.0, yaw_rate_radps: 0.5, ..EgoState::default() };
        let later = moved_on(&ego, 0.2);
        // Radius 20 m, a tenth of a radian.
        let exact = [20.0 * math::sin(0.1), 20.0 * (1.0 - math::cos(0.1)), 0.1];
        for (a, b) in [later.x_m, later.y_m, later.heading_rad].into_iter().zip(exact) {
            assert!((a - b).abs() < 1e-3, "{later:?}");
        }
        assert_eq!(moved_on(&ego, 0.0), ego.pose);
    }
}
