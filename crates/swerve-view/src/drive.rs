//! The sequence of runs shown on the page.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use anyhow::Context as _;
use serde::Serialize;
use swerve_drive::page::{RunReport, command_line};
use swerve_drive::process::Processes;
use swerve_drive::views::views_of;
use swerve_drive::{Outcome, RunInput, drive_pipeline, load, trust};
use swerve_flow::{EndReason, Event, Observer};
use swerve_foxglove::Foxglove;
use swerve_msg::{EgoState, Encoding, Image, PointCloud};
use swerve_report::page::{Page, RunPage, photo};
use swerve_scenario::Scenario;
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::agent::{Agent, Seat};
use swerve_stack::config::Config;
use swerve_stack::config::clock::Clock;
use swerve_stack::config::programs::reaches_outside;
use swerve_stack::course::Course;
use swerve_stack::pipeline::Pipeline;
use swerve_stack::span_of_ms;
use swerve_text::parse_assignments;
use swerve_vehicle::Kinematic;

use crate::foxglove::Streams;
use crate::looks::{Sight, from_above};
use crate::show::{Begin, Over, Show};
use crate::wheel::Wheel;

/// Function that returns the content of `metrics.json` for a run.
pub type Summarise<'a> = &'a dyn Fn(&Setup, &Scenario, &Outcome) -> anyhow::Result<String>;

/// Runs the scenarios requested by the page.
pub(crate) struct Driver<'a> {
    pub(crate) begins: Arc<Begins>,
    pub(crate) summarise: Summarise<'a>,
    pub(crate) show: &'a Show,
    /// Foxglove streams.
    pub(crate) streams: Option<Streams>,
}

/// Start parameters of runs. Shared with the server, which refuses invalid ones while the current run continues.
pub(crate) struct Begins {
    registry: Registry,
    /// Input from the command line.
    input: RunInput,
    /// The previous run, for one that continues from an instant of it.
    before: Mutex<Option<Before>>,
}

/// Start parameters and world course of a run.
#[derive(Clone)]
struct Before {
    input: RunInput,
    course: Course,
}

/// Contents of a running page besides the run.
#[derive(Serialize)]
struct Live {
    #[serde(flatten)]
    page: RunPage,
    run: u64,
    speed: Option<f64>,
    by_hand: bool,
    watch_only: bool,
}

/// Page of a run that has just started; it may send requests only to this server.
pub(crate) fn live_page(show: &Show, report: &RunReport, by_hand: bool, watch_only: bool) -> String {
    let (run, speed) = show.upcoming();
    let (title, page) = report.head();
    let html = Page::new("live", title, Live { page, run, speed, by_hand, watch_only }).html();
    html.replacen("img-src data:\"", "img-src data:; connect-src 'self'\"", 1)
}

/// Reason why no command line repeats a run with these parameters; `None` if one does.
fn no_command(with: &Begin) -> Option<String> {
    let why = match (with.from_s, with.by_hand) {
        (_, true) => "it was driven by hand".to_owned(),
        (Some(from_s), _) => format!(
            "up to {from_s:.2} s the car was driven by the commands of the run before, while the stack, as it is set now, \
             looked on"
        ),
        (None, false) => return None,
    };
    Some(format!("No command line repeats this drive: {why}."))
}

/// Feeds a run to the page and paces it as the page requests.
struct Watching<'a> {
    show: &'a Show,
    config: &'a Config,
}

impl Observer for Watching<'_> {
    fn event(&mut self, event: &Event<'_>) {
        self.show.with_report(|report| report.event(event));
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(ego) = payload.downcast_ref::<EgoState>() {
            self.show.frame(publication.visible_at, ego.speed_mps);
        } else if let Some(image) = payload.downcast_ref::<Image>() {
            // Depth and class images are not shown.
            if image.encoding() == Encoding::Rgb8 {
                self.show.look(publication.stream, image.stamp, || photo(image).map(Sight::Photo));
            }
        } else if let (Some(cloud), Some(lidar)) =
            (payload.downcast_ref::<PointCloud>(), self.config.lidar.get(publication.operator))
        {
            let mount = lidar.ego_from_lidar(&self.config.sim.vehicle.shape);
            self.show.look(publication.stream, cloud.stamp, || Some(from_above(cloud, mount)));
        }
    }
}

impl Begins {
    pub(crate) fn new(registry: Registry, input: RunInput) -> Self {
        Self { registry, input, before: Mutex::default() }
    }

    /// Checks that a run can be started with these parameters.
    pub(crate) fn check(&self, with: &Begin) -> anyhow::Result<()> {
        self.load(&self.input(with)?).map(drop)
    }

    /// Programs started by the runs, one per line.
    pub(crate) fn programs(&self) -> anyhow::Result<Vec<String>> {
        Ok(trust::programs(&self.load(&self.input)?.0))
    }

    fn before(&self) -> MutexGuard<'_, Option<Before>> {
        self.before.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Command-line input with the settings of the page, which must not start programs or name files.
    fn input(&self, with: &Begin) -> anyhow::Result<RunInput> {
        for (key, value) in parse_assignments(&with.set)? {
            if let Some(outside) = reaches_outside(&key, &value) {
                anyhow::bail!(
                    "{key}: `{outside}` starts programs or names files: expected it on the command line of `swerve view`"
                );
            }
        }
        let mut input = match with.from_s.and(self.before().as_ref()) {
            Some(before) => before.input.clone(),
            None => RunInput { seed: with.seed.or(self.input.seed), ..self.input.clone() },
        };
        input.set.extend(with.set.iter().cloned());
        Ok(input)
    }

    fn load(&self, input: &RunInput) -> anyhow::Result<(Setup, Scenario)> {
        let (config, scenario) = load(&self.registry, input)?;
        anyhow::ensure!(
            config.clock.source == Clock::Virtual,
            "clock.source: `swerve view` drives in virtual time and shows it at the speed that is asked for"
        );
        trust::check(&config, config.process.keys())?;
        Ok((config, scenario))
    }

    /// Commands of the previous run up to the instant from which the new one differs.
    fn course(&self, with: &Begin) -> anyhow::Result<Course> {
        let before = self.before().clone();
        let (Some(from), Some(before)) = (with.from(), before) else { return Ok(Course::default()) };
        let dt = span_of_ms(load(&self.registry, &before.input)?.0.sim.dt_ms);
        Ok(before.course.up_to(from, dt))
    }
}

impl Driver<'_> {
    /// Runs repeatedly, as requested, until the program ends.
    ///
    /// # Errors
    /// If the first run could not be started; errors of later ones are shown on the page.
    pub(crate) fn drive_until_quit(&self) -> anyhow::Result<()> {
        let mut begin = Some(Begin::default());
        while let Some(with) = begin {
            let (over, whole) = match self.drive(&with) {
                Ok(ended) => ended,
                Err(error) if self.show.upcoming().0 == 1 => return Err(error),
                Err(error) => (Over { problem: Some(format!("{error:#}")), ..Over::default() }, None),
            };
            self.show.end(over, whole);
            begin = self.show.next();
        }
        Ok(())
    }

    fn drive(&self, with: &Begin) -> anyhow::Result<(Over, Option<String>)> {
        let (input, course) = (self.begins.input(with)?, self.begins.course(with)?);
        let (mut config, scenario) = self.begins.load(&input)?;
        config.course = Some(course.clone());
        *self.begins.before() = Some(Before { input: input.clone(), course });
        let seat = with.by_hand.then(Seat::default);
        let mut pipeline = match &seat {
            Some(seat) => Pipeline::build_for(&config, &scenario, &Agent::Command(seat.clone()))?,
            None => Pipeline::build(&config, &scenario)?,
        };
        let wheel = seat.map(|seat| Wheel::new(seat, Kinematic::new(&config.sim.vehicle)));
        let mut report = RunReport::new(&config, &pipeline, command_line(&input, None));
        if let Some(why) = no_command(with) {
            report = report.without_command(&why);
        }
        let page = live_page(self.show, &report, with.by_hand, false);
        self.show.begin(page, report, wheel, Some(pipeline.graph.stop_handle()), with.from());
        let mut streams = self.streams.as_ref().map(|streams| {
            streams.of_run(config.registry.with_views_of(Foxglove::new(views_of(&config, &pipeline))))
        });
        let processes = Processes::start_all(&config, &mut pipeline)?;
        let mut watching = Watching { show: self.show, config: &config };
        let mut observers: Vec<&mut dyn Observer> = Vec::new();
        // Before the page, which holds the run at a frame until it is due.
        observers.extend(streams.as_mut().map(|streams| streams as &mut dyn Observer));
        observers.push(&mut watching);
        let outcome = drive_pipeline(pipeline, config.seed, 1, &mut observers)?;
        drop(processes);
        if outcome.report.end == EndReason::Interrupted {
            return Ok((Over { problem: Some("interrupted".into()), ..Over::default() }, None));
        }
        let (digest, metrics) = (outcome.digest.to_string(), (self.summarise)(&config, &scenario, &outcome)?);
        let report = self.show.with_report(|report| report.clone()).context("a run has its report")?;
        let page = report.finish(&digest, &metrics)?;
        let verdict = page.of.metrics["verdict"].as_str().map(str::to_owned);
        Ok((Over { verdict, digest: Some(digest), problem: None }, Some(page.html())))
    }
}

#[cfg(test)]
mod tests;
