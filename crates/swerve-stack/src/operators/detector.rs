//! Emulated detectors with published accuracy and run time.

use swerve_flow::{
    At, Context, Inputs, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port, PortInfo,
    RuntimeModel,
};
use swerve_msg::Detections;
use swerve_msg::truth::Surroundings;
use swerve_perception::detector::Detector;

use crate::config::execution::span_ms;
use crate::config::model::Model;
use crate::config::perception::{PerceptionConfig, image_camera};
use crate::kind::{Node, OperatorKind, Scheduled, Settings};
use crate::ladder::Ladder;
use crate::site::Site;

/// Emulates a detector of a given accuracy.
pub(super) struct EmulatedDetector;

/// Frame of this stamp.
#[derive(Inputs)]
struct In {
    /// Objects visible to its camera, and its pose.
    surroundings: At<Surroundings>,
}

/// Boxes.
#[derive(Outputs)]
struct Out {
    /// Detected objects.
    boxes: Port<Detections>,
}

impl OperatorKind for EmulatedDetector {
    fn node(&self) -> Node {
        Node::new("emulated_detector", "boxes of a published accuracy and run time, made from truth")
            .section(&PerceptionConfig::SECTION)
            .only_with("perception.detector = \"NAME\"")
            .stays("sensors are where the world is")
            .scheduled(Scheduled::Detector)
            .on_ladder()
    }

    fn is_there(&self, settings: &Settings<'_>) -> bool {
        settings.setup.perception.emulates()
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        Out::ports()
    }

    fn inputs(&self, _: &Settings<'_>) -> Vec<PortInfo> {
        In::ports()
    }

    fn ladder(&self, settings: &Settings<'_>) -> Option<Ladder> {
        let setup = settings.setup;
        let rungs = setup.perception.rungs().unwrap_or_default();
        let reports = setup.perception.ladder || setup.execution.model == Model::Periodic;
        reports.then_some(Ladder { sets_run_time: !rungs.is_empty(), rungs })
    }

    fn runtime(&self, settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        if settings.setup.perception.ladder {
            return Ok(RuntimeModel::LADDER);
        }
        span_ms(settings.setup.perception.published_ms().unwrap_or(0.0)).map(RuntimeModel::Fixed)
    }

    fn takes_ms(&self, settings: &Settings<'_>) -> Option<[f64; 2]> {
        settings.setup.perception.published_ms().map(|ms| [ms, ms])
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let settings = site.settings();
        let (name, config) = (settings.name, settings.setup);
        let Some(emulated) = &site.resolved().detector else { return Ok(()) };
        let camera = config.detector_camera(emulated.sensing).and_then(|camera| image_camera(&camera));
        let detector = Detector::new(emulated.params, camera, config.seed, name)?;
        site.add(Emulated(detector), None)
    }
}

/// An emulated detector.
struct Emulated(Detector);

impl Operator for Emulated {
    type In = In;
    type Out = Out;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Out) {
        if let Some(surroundings) = input.surroundings.get() {
            out.boxes.loan().send(self.0.detect(surroundings));
        }
    }
}
