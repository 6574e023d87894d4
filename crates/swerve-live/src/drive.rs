//! Validated parts of a drive, and its result.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use swerve_drive::page::{REPORT, page_of_log};
use swerve_drive::problems_error;
use swerve_drive::shipped::Kind;
use swerve_flow::{RunError, RunReport};
use swerve_report::files::write_whole;
use swerve_ros2::mapping::{Mapping, Role};
use swerve_scenario::Scenario;
use swerve_stack::config::LiveConfig;
use swerve_stack::config::clock::Clock;
use swerve_stack::{Registry, Setup};

use crate::feed::FeedReport;
use crate::route::{self, route_problems};
use crate::sink::SinkReport;
use crate::watch::DriveFigures;

/// Validated parts of a drive.
pub struct Drive {
    /// The configuration.
    pub config: Setup,
    /// Its `[live]` table.
    pub live: LiveConfig,
    /// Mapping of the topics.
    pub mapping: Mapping,
    /// Scenario whose road is followed.
    pub scenario: Scenario,
    /// File of the scenario.
    pub route: PathBuf,
}

impl Drive {
    /// Reads a configuration and the route that it names.
    ///
    /// # Errors
    /// All problems found in them.
    pub fn load(registry: &Registry, file: &Path, sets: &[(String, toml::Value)]) -> anyhow::Result<Self> {
        // A vehicle moves in real time.
        let wall = ("clock.source".to_owned(), toml::Value::from("wall"));
        let sets: Vec<_> = std::iter::once(wall).chain(sets.iter().cloned()).collect();
        let mut config = Kind::Live.config(registry, &[file.to_owned()], &sets).map_err(|problems| {
            let mut all: Vec<String> = problems.iter().map(ToString::to_string).collect();
            let is_set = sets.iter().any(|(key, _)| key == "live.route");
            if let Some(document) = Kind::Live.document(file).ok().filter(|_| !is_set) {
                all.extend(route_problems(Kind::Live.place(file), &document));
            }
            problems_error(&all)
        })?;
        if config.source.is_some() {
            // A recording is played in virtual time.
            config.clock.source = Clock::Virtual;
        }
        let live = config.live.clone().with_context(|| {
            format!("{}: `[live]` is missing: expected at least its key `route`", file.display())
        })?;
        let (route, scenario) = route::read(file, &sets, &live)?;
        let mapping = config.ros2_mapping()?;
        Ok(Self { config, live, mapping, scenario, route })
    }
}

impl Drive {
    /// Writes the report page of a recorded drive into this folder.
    pub(crate) fn report(&self, folder: &Path) -> anyhow::Result<()> {
        let page = page_of_log(&self.config.registry, &folder.join("log.mcap"), None)?;
        write_whole(&folder.join(REPORT), page.html().as_bytes())
    }
}

/// Result of a drive.
pub struct Driven {
    /// Report of the engine, or the error.
    pub report: Result<RunReport, RunError>,
    /// Report of the feed.
    pub feed: FeedReport,
    /// Report of the sink.
    pub sink: SinkReport,
    /// Metrics of the drive.
    pub figures: DriveFigures,
}

/// Roles of the topics that provide the ego's position, or from which localization estimates it.
pub(crate) fn located_by(config: &Setup) -> &'static [Role] {
    match (config.localization.estimates(), config.localization.reads_lidar(&config.registry)) {
        (false, _) => &[Role::Odometry],
        (true, false) => &[Role::Imu, Role::Gnss],
        (true, true) => &[Role::Imu, Role::Gnss, Role::Lidar],
    }
}
