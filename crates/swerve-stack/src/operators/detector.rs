//! Emulated detectors with published accuracy and run time.

use swerve_core::Time;
use swerve_flow::{
    At, Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Outputs, Port,
    PortInfo, RuntimeModel,
};
use swerve_msg::truth::Surroundings;
use swerve_msg::{Detections, RungTaken};
use swerve_perception::detector::{Detector, Params};

use super::ladder::{on_ladder, take};
use crate::config::execution::span_ms;
use crate::config::model::{Model, Rung};
use crate::config::perception::{PerceptionConfig, image_camera};
use crate::kind::{Node, OperatorKind, Scheduled, Settings};
use crate::site::Site;

/// Emulates a detector of a given accuracy, under any execution model.
pub(super) struct EmulatedDetector;

/// Frame of this stamp.
#[derive(Inputs)]
struct In {
    /// Objects visible to its camera, and its pose.
    surroundings: At<Surroundings>,
}

/// Newest frame, at each tick.
#[derive(Inputs)]
struct PeriodicIn {
    /// Period of the detector.
    tick: Every,
    /// Objects visible to its camera, and its pose.
    surroundings: Latest<Surroundings>,
}

/// Boxes, and the rung that found them.
#[derive(Outputs)]
struct LadderOut {
    /// Detected objects.
    boxes: Port<Detections>,
    /// Rung of the ladder that was used.
    rung: Port<RungTaken>,
}

/// Always uses the same detector.
struct Plain(Detector);

/// Uses the rung that fits the time left.
struct OnLadder(Vec<Rung<Detector>>);

/// Runs on a timer, on the newest frame; never twice on the same one.
struct Periodic {
    detector: Detector,
    /// Its rung, if a ladder defines its run time.
    rung: Option<Rung<()>>,
    last: Option<Time>,
}

/// Returns true if it runs on its frames, without a ladder.
fn is_plain(settings: &Settings<'_>) -> bool {
    settings.setup.execution.model != Model::Periodic && !settings.setup.perception.ladder
}

impl OperatorKind for EmulatedDetector {
    fn node(&self) -> Node {
        Node::new("emulated_detector", "boxes of a published accuracy and run time, made from truth")
            .section(&PerceptionConfig::SECTION)
            .only_with("perception.detector = \"NAME\"")
            .stays("sensors are where the world is")
            .scheduled(Scheduled::Detector)
    }

    fn is_there(&self, settings: &Settings<'_>) -> bool {
        settings.setup.perception.emulates()
    }

    fn outputs(&self, settings: &Settings<'_>) -> Vec<OutputInfo> {
        if is_plain(settings) { <Port<Detections> as NamedOutputs>::ports() } else { LadderOut::ports() }
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        match settings.setup.execution.model {
            Model::Periodic => PeriodicIn::ports(),
            _ => In::ports(),
        }
    }

    fn runtime(&self, settings: &Settings<'_>) -> Result<RuntimeModel, String> {
        if settings.setup.perception.ladder {
            return Ok(on_ladder());
        }
        span_ms(settings.setup.perception.published_ms().unwrap_or(0.0)).map(RuntimeModel::Fixed)
    }

    fn takes_ms(&self, settings: &Settings<'_>) -> Option<[f64; 2]> {
        settings.setup.perception.published_ms().map(|ms| [ms, ms])
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let settings = site.settings();
        let (name, config) = (settings.name, settings.setup);
        let resolved = site.resolved().clone();
        let Some(emulated) = resolved.detector else { return Ok(()) };
        let camera = config.detector_camera(emulated.sensing).and_then(|camera| image_camera(&camera));
        let emulate = |params: Params| Detector::new(params, camera, config.seed, name);
        let mut rungs = resolved.detector_rungs;
        let deadline = site.own_deadline();
        if let Some(timer) = site.own_timer() {
            let rung = rungs.pop().map(|Rung { name, run_time, .. }| Rung { name, run_time, what: () });
            let periodic = Periodic { detector: emulate(emulated.params)?, rung, last: None };
            site.add(periodic, Some(timer))?;
        } else if rungs.is_empty() {
            let plain = Plain(emulate(emulated.params)?);
            site.add(plain, None)?;
        } else {
            let rung =
                |Rung { name, run_time, what }| anyhow::Ok(Rung { name, run_time, what: emulate(what)? });
            let rungs = rungs.into_iter().map(rung).collect::<anyhow::Result<_>>()?;
            site.add(OnLadder(rungs), None)?;
        }
        if let Some(deadline) = deadline {
            let _configured = site.node()?.deadline(deadline);
        }
        Ok(())
    }
}

impl Operator for Plain {
    type In = In;
    type Out = Port<Detections>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(surroundings) = input.surroundings.get() {
            out.loan().send(self.0.detect(surroundings));
        }
    }
}

impl Operator for OnLadder {
    type In = In;
    type Out = LadderOut;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut LadderOut) {
        let Some(surroundings) = input.surroundings.get() else { return };
        let (detector, taken) = take(&mut self.0, cx);
        out.boxes.loan().send(detector.detect(surroundings));
        out.rung.send(taken);
    }
}

impl Operator for Periodic {
    type In = PeriodicIn;
    type Out = LadderOut;

    fn step(&mut self, cx: &mut Context<'_>, input: &PeriodicIn, out: &mut LadderOut) {
        let newest = input.surroundings.get().filter(|seen| self.last != Some(seen.stamp));
        let Some(surroundings) = newest else { return };
        self.last = Some(surroundings.stamp);
        if let Some(rung) = &mut self.rung {
            let (_, taken) = take(core::slice::from_mut(rung), cx);
            out.rung.send(taken);
        }
        out.boxes.loan().send(self.detector.detect(surroundings));
    }
}
