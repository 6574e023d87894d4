//! Log of a run: its contents, and the reaction to a write failure.

use std::path::Path;

use anyhow::Context as _;
use swerve_flow::{Event, Observer, StopHandle};
use swerve_foxglove::Foxglove;
use swerve_log::{LeavesOut, LogError, Recorder, RunStart, Views};
use swerve_msg::truth::PointInstances;
use swerve_msg::{Image, PointCloud};
use swerve_osi::GroundTruthViews;
use swerve_scenario::{MapText, Scenario};
use swerve_stack::Setup;
use swerve_stack::config::Images;
use swerve_stack::config::clock::Clock;
use swerve_stack::pipeline::Pipeline;

use crate::ego::OfEgo;
use crate::load::problems_error;
use crate::views::{osi_of, views_of};

/// Records a run. A failure is reported at once on standard error. It ends a run in virtual time; a run under wall
/// clock continues.
pub struct Recording {
    recorder: Recorder,
    /// Ends the run on failure; `None` under wall clock.
    stop: Option<StopHandle>,
    told: bool,
}

impl Recording {
    /// Creates the recording of a run under this clock.
    pub fn new(recorder: Recorder, clock: Clock, stop: StopHandle) -> Self {
        let stop = (clock == Clock::Virtual).then_some(stop);
        Self { recorder, stop, told: false }
    }

    /// Waits until everything is written.
    ///
    /// # Errors
    /// The write failure, again.
    pub fn finish(self) -> Result<u64, LogError> {
        self.recorder.finish()
    }

    fn tell(&mut self) {
        let Some(error) = self.recorder.failure() else { return };
        self.told = true;
        let bytes = std::fs::metadata(self.recorder.path()).map_or(0, |file| file.len());
        let then = if self.stop.is_some() { "the run ends" } else { "the run drives on without its log" };
        #[expect(clippy::print_stderr, reason = "it cannot wait until the end")]
        {
            eprintln!("warning: {error} ({bytes} bytes are written); {then}");
        }
        if let Some(stop) = &self.stop {
            stop.stop();
        }
    }
}

impl Observer for Recording {
    fn event(&mut self, event: &Event<'_>) {
        self.recorder.event(event);
        if !self.told {
            self.tell();
        }
    }
}

/// Payloads of which a log holds only the digest.
pub fn left_out_of_logs(images: Images) -> Option<LeavesOut> {
    match images {
        Images::None | Images::Jpeg => Some(|payload| {
            payload.is::<Image>() || payload.is::<PointCloud>() || payload.is::<PointInstances>()
        }),
        Images::Lossless => None,
    }
}

/// Configures the recorder as the configuration requires.
pub fn set_up(recorder: &mut Recorder, config: &Setup, pipeline: &Pipeline) {
    if let Some(images) = left_out_of_logs(config.log.images) {
        recorder.leave_out(images);
    }
    if config.log.foxglove {
        let own = Foxglove::new(views_of(config, pipeline));
        let views: Box<dyn Views> = Box::new(config.registry.with_views_of(own));
        recorder.show(Box::new(OfEgo::new(&pipeline.names, views)));
    }
    if config.log.osi {
        let views: Box<dyn Views> = Box::new(GroundTruthViews::new(osi_of(config, pipeline)));
        recorder.show(Box::new(OfEgo::new(&pipeline.names, views)));
    }
}

/// Scenario of a run, from the head of its log.
///
/// # Errors
/// If the log has none, or one that this version does not read.
pub fn logged_scenario(start: &RunStart) -> anyhow::Result<Scenario> {
    let text = start.extra.get("scenario").context("the log holds no scenario")?;
    let map = start.extra.get("map").map(|text| MapText::from(text.as_str()));
    let scenario = Scenario::parse_on("scenario of the log", text, map.as_ref(), &[]);
    scenario.map_err(|problems| problems_error(&problems)).map_err(|error| match &*of_version(start) {
        "" => error,
        version => error.context(format!("a log{version}")),
    })
}

/// Addition to a message about a log: empty if this version has written it.
pub fn of_version(start: &RunStart) -> String {
    const OWN: &str = env!("CARGO_PKG_VERSION");
    match &*start.version {
        OWN => String::new(),
        other => {
            format!(" of swerve {other}; this is {OWN}, whose results may differ: docs/howto/upgrade.md")
        }
    }
}

/// Head of a log: everything needed to run again without the files.
pub fn run_start(config: &Setup, scenario: &Scenario, file: &Path) -> RunStart {
    let texts = [
        ("scenario", Some(scenario.text.to_string())),
        ("scenario_file", Some(file.display().to_string())),
        ("map", scenario.road.map_text().map(|text| text.to_string())),
    ];
    let texts = texts.into_iter().filter_map(|(key, text)| Some((key.to_owned(), text?)));
    RunStart {
        version: env!("CARGO_PKG_VERSION").into(),
        seed: config.seed,
        config: config.to_text(),
        extra: texts.collect(),
    }
}

#[cfg(test)]
mod tests;
