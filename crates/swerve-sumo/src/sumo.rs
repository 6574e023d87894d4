//! A simulation of SUMO around the ego.

use std::collections::BTreeMap;
use std::ffi::OsString;
use std::path::{Path, PathBuf};
use std::time::Duration;

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Pose2};
use swerve_map_io::sumo::Net;
use swerve_msg::ActorId;
use swerve_msg::truth::EgoTruth;
use swerve_world::{Other, Others, OthersError};

use crate::SumoError;
use crate::additional::without_outputs;
use crate::client::{Answer, Client};
use crate::config::SumoConfig;
use crate::ego::{self, EGO};
use crate::lights::{LightProgram, Lights};
use crate::process::{Environment, Process};
use crate::read::text_of;
use crate::states::{Names, State, VARIABLES, between, state};
use crate::wire::{Command, Domain, Value};

/// Oldest version of the protocol that has all commands.
const PROTOCOL_MIN: i32 = 20;

/// Time of a lane change without an option for it, seconds. SUMO's own is none: cars jump to the lane beside.
const LANE_CHANGE_S: f64 = 3.0;

/// Time before the start for which the ego is in SUMO, at rest, seconds: vehicles behind it can stop.
const SETTLING_S: f64 = 10.0;

/// Most failed insertions of the ego in a row.
const INSERTIONS_MAX: u32 = 50;

/// Settings of a simulation.
#[derive(Clone, PartialEq, Debug)]
pub struct Settings {
    /// The configuration (`.sumocfg`).
    pub config: PathBuf,
    /// Step of SUMO.
    pub step: Span,
    /// Simulated time of SUMO at its begin, seconds.
    pub begin_s: f64,
    /// Time that SUMO runs before the start, seconds; at least a step.
    pub warmup_s: f64,
    /// Distance from the ego up to which vehicles are asked for, metres.
    pub range_m: f64,
    /// Longest time of an answer, seconds.
    pub timeout_s: f64,
    /// A place of the map is a place of the net less this, metres.
    pub offset_m: [f64; 2],
    /// Seed of SUMO's random numbers.
    pub seed: u64,
    /// Identity of the first vehicle.
    pub first: ActorId,
    /// Start of the ego, further places on its way, and its goal.
    pub stops: Vec<Pose2>,
    /// Phases of traffic lights.
    pub lights: Vec<LightProgram>,
}

/// A simulation: started with the first question for road users, ended when it is dropped.
pub struct Sumo {
    settings: Settings,
    edges: Vec<String>,
    running: Option<Running>,
    names: Names,
    /// Ends of the present step: the instants, and the vehicles.
    ends: [(Time, State); 2],
    shown: Vec<Other>,
}

/// SUMO while it runs.
struct Running {
    client: Client,
    /// `None` for a peer that is not a child.
    process: Option<Process>,
    lights: Lights,
    /// Commands for the lights, sent with the next step.
    corrections: Vec<Command>,
    /// Steps without the ego in a row; 0 while it is there.
    missing: u32,
    /// Copies of additional files, which are removed at the end.
    #[expect(dead_code, reason = "it is kept until the end")]
    folder: Option<tempfile::TempDir>,
}

impl Sumo {
    /// A simulation that is not started yet.
    pub fn new(settings: Settings) -> Self {
        let names = Names::from(settings.first);
        let ends = [(Time::ZERO, State::new()), (Time::ZERO, State::new())];
        Self { settings, edges: Vec::new(), running: None, names, ends, shown: Vec::new() }
    }

    /// Starts SUMO, and runs it until the start of the run.
    fn start(&mut self, ego: &EgoTruth, outline: &Obb) -> Result<(), SumoError> {
        let config = SumoConfig::read(&self.settings.config, &text_of(&self.settings.config)?)
            .map_err(|problems| SumoError::Setting(problems.to_string()))?;
        let name = config.net.display().to_string();
        let net = swerve_map_io::sumo::read(&name, &text_of(&config.net)?)
            .map_err(|problems| SumoError::Setting(problems.to_string()))?;
        self.settings.lights.iter_mut().for_each(|link| link.gives_way = gives_way(&net, link));
        self.edges = ego::edges(&net, &name, &self.settings.stops, self.settings.offset_m)?;
        let program = Environment::of_process().program()?;
        let folder = tempfile::tempdir().map_err(|error| SumoError::Setting(error.to_string()))?;
        let arguments = arguments(&config, &self.settings, folder.path())?;
        let mut process = Process::start(&program, &arguments)?;
        let timeout = Duration::from_secs_f64(self.settings.timeout_s);
        let client = Client::new(process.connect(timeout)?, timeout)?;
        self.begin(
            Running { process: Some(process), folder: Some(folder), ..Running::of(client) },
            ego,
            outline,
        )
    }

    /// Starts with a peer that runs already.
    #[cfg(test)]
    pub(crate) fn begin_with(
        &mut self,
        client: Client,
        ego: &EgoTruth,
        outline: &Obb,
    ) -> Result<(), SumoError> {
        self.begin(Running::of(client), ego, outline)
    }

    /// Number of commands for lights that the next step will send.
    #[cfg(test)]
    pub(crate) fn corrections(&self) -> usize {
        self.running.as_ref().map_or(0, |running| running.corrections.len())
    }

    /// Runs SUMO until the start, with the ego from then on.
    fn begin(&mut self, running: Running, ego: &EgoTruth, outline: &Obb) -> Result<(), SumoError> {
        let running = self.running.insert(running);
        let Settings { begin_s, warmup_s, step, .. } = self.settings;
        match running.client.ask(Command::version())? {
            Answer::Version(PROTOCOL_MIN.., _) => {}
            Answer::Version(version, program) => {
                return Err(SumoError::Setting(format!(
                    "{program} has version {version} of TraCI, expected at least {PROTOCOL_MIN}"
                )));
            }
            found => return Err(SumoError::Answer(format!("expected a version, found {found:?}"))),
        }
        // Whole steps with the ego at rest; at least one.
        let settling = (warmup_s.min(SETTLING_S) / step.as_secs()).round().max(1.0) as i64;
        let free_s = warmup_s - settling as f64 * step.as_secs();
        if free_s > 0.5 * step.as_secs() {
            running.send(&[Command::step(begin_s + free_s)])?;
        }
        let known = match running.client.ask(Command::get(Domain::Light, 0x00, ""))? {
            Answer::Value(Value::Texts(names)) => names,
            found => return Err(SumoError::Answer(format!("expected names of lights, found {found:?}"))),
        };
        running.lights = Lights::of(&self.settings.lights, &known);
        let mut commands = running.lights.subscriptions();
        commands.push(ego::route(&self.edges));
        running.send(&commands)?;
        self.ends[1] = (Time::ZERO - step * settling, State::new());
        while self.ends[1].0 < Time::ZERO {
            self.step(ego, outline)?;
        }
        Ok(())
    }

    /// Takes a step of SUMO, with the ego where it will be at its end. Before the start, the ego is at rest, and vehicles in
    /// its place are removed.
    fn step(&mut self, ego: &EgoTruth, outline: &Obb) -> Result<(), SumoError> {
        let Settings { step, offset_m, range_m, .. } = self.settings;
        let Some(running) = &mut self.running else { return Ok(()) };
        let at = self.ends[1].0;
        let end = at + step;
        let ahead_s = if at < Time::ZERO { 0.0 } else { step.as_secs() };
        let mut commands = core::mem::take(&mut running.corrections);
        let is_missing = running.missing > 0;
        if is_missing {
            commands.extend(ego::insertion(outline));
        }
        commands.push(ego::move_to(ego, outline, ahead_s, offset_m));
        commands.push(Command::step(0.0));
        let mut answers = running.send(&commands)?;
        if is_missing {
            // SUMO answers a step after all other commands of its message.
            answers.extend(running.send(&[Command::vehicles_around(EGO, range_m, &VARIABLES)])?);
        }
        let mut results = Vec::new();
        for answer in answers {
            if let Answer::Subscribed(more) = answer {
                results.extend(more);
            }
        }
        running.corrections = running.lights.corrections(&results, end, step)?;
        let around = results.iter().find(|result| result.name == EGO);
        running.missing = if around.is_some() { 0 } else { running.missing + 1 };
        if running.missing > INSERTIONS_MAX {
            let why = format!("SUMO has removed it, and did not insert it again in {INSERTIONS_MAX} steps");
            return Err(SumoError::Vehicle { name: EGO.to_owned(), why });
        }
        self.ends.swap(0, 1);
        let before = &self.ends[0].1;
        let now = match around {
            Some(around) => {
                let mut now = state(&around.objects, EGO, offset_m, &mut self.names)?;
                if let Some(inside) = newly_inside(&now, before, outline) {
                    let name = self.names.of(inside).to_owned();
                    if at >= Time::ZERO {
                        let why = "it appears inside the ego, expected a free place".to_owned();
                        return Err(SumoError::Vehicle { name, why });
                    }
                    running.corrections.push(Command::remove_vehicle(&name));
                    now.remove(&inside);
                }
                now
            }
            // Without the ego, the last vehicles stay.
            None => before.clone(),
        };
        self.ends[1] = (end, now);
        Ok(())
    }

    fn take(&mut self, to: Time, ego: &EgoTruth, outline: &Obb) -> Result<(), SumoError> {
        if self.running.is_none() {
            self.start(ego, outline)?;
        }
        while to > self.ends[1].0 {
            self.step(ego, outline)?;
        }
        let [(from_at, from), (to_at, end)] = &self.ends;
        let step = *to_at - *from_at;
        self.shown = match step > Span::ZERO {
            true => between(from, end, (to - *from_at).as_secs() / step.as_secs(), step.as_secs()),
            false => end.values().cloned().collect(),
        };
        Ok(())
    }
}

impl Others for Sumo {
    fn at(&mut self, to: Time, ego: &EgoTruth, outline: &Obb) -> Result<&[Other], OthersError> {
        match self.take(to, ego, outline) {
            Ok(()) => Ok(&self.shown),
            Err(error) => {
                let process = self.running.take().and_then(|running| running.process);
                let error = match (error, process) {
                    // The exit says more than the connection.
                    (SumoError::Ended(_), Some(mut process)) => process.ended(),
                    (error, _) => error,
                };
                let at_s = to.as_secs();
                let config = self.settings.config.display();
                Err(OthersError(format!("{config}: at {at_s} s: {error}")))
            }
        }
    }
}

impl Running {
    fn of(client: Client) -> Self {
        let lights = Lights::default();
        Self { client, process: None, lights, corrections: Vec::new(), missing: 1, folder: None }
    }

    fn send(&mut self, commands: &[Command]) -> Result<Vec<Answer>, SumoError> {
        if commands.is_empty() {
            return Ok(Vec::new());
        }
        self.client.send(commands)
    }
}

/// True if green of a link is that of minor traffic in a phase of the net.
fn gives_way(net: &Net, link: &LightProgram) -> bool {
    let programs = net.programs.iter().filter(|program| program.light == link.light);
    let mut phases = programs.flat_map(|program| &program.phases);
    phases.any(|phase| phase.states.as_bytes().get(link.link) == Some(&b'g'))
}

/// A vehicle that was not there before and is inside the ego.
fn newly_inside(state: &State, before: &State, outline: &Obb) -> Option<ActorId> {
    let is_new = |other: &&Other| !before.contains_key(&other.id);
    let is_inside = |other: &&Other| outline.overlaps(&other.extent.footprint(other.movement.pose));
    state.values().filter(is_new).find(is_inside).map(|other| other.id)
}

/// Arguments of SUMO: the files of the configuration and its options, the step, and options without which cars jump or
/// vanish.
fn arguments(config: &SumoConfig, settings: &Settings, folder: &Path) -> Result<Vec<OsString>, SumoError> {
    let mut options: BTreeMap<String, OsString> = BTreeMap::new();
    let list = |files: &[PathBuf]| -> OsString {
        files.iter().map(|file| file.as_os_str()).collect::<Vec<_>>().join(OsString::from(",").as_os_str())
    };
    options.insert("net-file".into(), config.net.clone().into());
    if !config.routes.is_empty() {
        options.insert("route-files".into(), list(&config.routes));
    }
    let additional: Result<Vec<PathBuf>, SumoError> =
        (0..).zip(&config.additional).map(|(number, path)| without_outputs(path, folder, number)).collect();
    let additional = additional?;
    if !additional.is_empty() {
        options.insert("additional-files".into(), list(&additional));
    }
    for (name, value) in &config.options {
        options.insert(name.clone(), value.into());
    }
    if !options.contains_key("lateral-resolution") {
        options.entry("lanechange.duration".into()).or_insert_with(|| LANE_CHANGE_S.to_string().into());
    }
    for (name, value) in [
        ("begin", settings.begin_s.to_string()),
        ("step-length", settings.step.as_secs().to_string()),
        // SUMO's seeds are integers of 32 bits.
        ("seed", (settings.seed & 0x7fff_ffff).to_string()),
        ("time-to-teleport", "-1".to_owned()),
        ("collision.action", "none".to_owned()),
        ("no-step-log", "true".to_owned()),
        ("no-warnings", "true".to_owned()),
        ("xml-validation", "never".to_owned()),
    ] {
        options.insert(name.to_owned(), value.into());
    }
    Ok(options.into_iter().flat_map(|(name, value)| [format!("--{name}").into(), value]).collect())
}
