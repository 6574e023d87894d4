//! Causal chain that explains the end of a drive, from its log: see [`Why`] and `swerve why`.
//!
//! Times are the stamps of logged messages; waits follow from logged steps, drops and missed deadlines. Changes of
//! plans due to an actor are computed: the logged planner plans again from its logged inputs without the predictions of
//! the actor's tracks. The effect on the car is computed by driving again from the log with such plans, up to where the
//! car deviates.
//!
//! Excluded: recording and measuring of drives, which are in `swerve-drive`, and the text of the chain, which is in
//! `swerve-eval`.

mod command;
mod ego_only;
mod other;
mod sightings;
mod states;
mod timeline;
mod unaware;
mod waits;
mod without;

use core::cell::Cell;
use std::path::Path;

use anyhow::{Context as _, bail};
use swerve_core::{Span, Time};
use swerve_drive::page::LogSoFar;
use swerve_drive::trust::CodeArgs;
use swerve_drive::{
    EgoRun, light_courses, logged_scenario, norm, of_ego, outline, problems_error, track_names,
};
use swerve_eval::{Account, ActorMetrics, Clearances, DecidedBy, Impact, Metrics, Milestone, Until, Why};
use swerve_flow::GraphInfo;
use swerve_log::{Log, PublicationRecord, Record};
use swerve_msg::truth::{EndReason, Verdict, WorldState};
use swerve_msg::{
    ActorId, Decision, Detections, EgoState, GateOutput, Plan, PoseQuality, PredictionList, Route, TrackList,
};
use swerve_scenario::Scenario;
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::Config;
use swerve_stack::pipeline::Pipeline;
use swerve_text::did_you_mean;

pub use command::{WhyArgs, of_run, run};

use sightings::Sightings;
use timeline::{Seen, Timeline};
use unaware::Answer;

/// Deceleration beyond that at the start of a safety-gate stop that counts as an effect, m/s².
const BRAKES_MPS2: f64 = 0.5;

/// A log with its configuration and scenario.
pub struct Logged {
    log: Log,
    config: Setup,
    scenario: Scenario,
}

/// End of a drive, and the actor that decided it.
struct Ending {
    actor: ActorId,
    verdict: Verdict,
    words: String,
    /// Time of the collision; later events are not part of the chain.
    impact: Option<Time>,
}

/// Describes the end of a drive that an actor decided.
fn ending(metrics: &Metrics, decided: &ActorMetrics) -> String {
    let came = || format!("it came within {:.2} m of {}", decided.min_distance_m, decided.name);
    let stands_before = metrics.stands_before == Some(decided.actor);
    match (metrics.verdict, metrics.impact) {
        (_, Some(i)) => {
            let mut stops = metrics.gate.iter().flat_map(|gate| &gate.stops);
            let stop = stops.rfind(|stop| stop.at_s < i.at_s);
            let stopped = stop.map_or_else(String::new, |stop| {
                format!(", stopped by the safety gate from {:.2} s on ({})", stop.at_s, stop.cause.words())
            });
            hit(&decided.name, &i) + &stopped
        }
        (Verdict::LeftRoad, _) => {
            let left_s = metrics.left_road_at_s.unwrap_or_default();
            let then = match stands_before {
                true => format!("later it stood before {}", decided.name),
                false => came(),
            };
            format!("it left the road at {left_s:.2} s; {then}")
        }
        _ if stands_before => format!("it stands before {}", decided.name),
        (Verdict::Timeout, _) if metrics.end == Some(EndReason::Timeout) => {
            let (at_s, speed_mps) = (metrics.drive.duration_s, metrics.drive.speed_end_mps);
            // Backward motion below the displayed resolution counts as none.
            let speed_mps = if speed_mps.abs() < 0.05 { 0.0 } else { speed_mps };
            format!("the time was over at {at_s:.2} s, at {speed_mps:.1} m/s; {}", came())
        }
        (Verdict::Unfinished, _) => {
            let (at_s, least_m) = (metrics.drive.duration_s, decided.min_distance_m);
            format!(
                "it was not over at {at_s:.2} s; by then it had come within {least_m:.2} m of {}",
                decided.name
            )
        }
        _ => came(),
    }
}

/// Speed below which an ego that is hit counts as stationary, m/s.
const STANDS_MPS: f64 = 0.1;

/// Describes a contact: a stationary ego is hit, and two vehicles moving towards each other collide.
fn hit(name: &str, impact: &Impact) -> String {
    let Impact { at_s, ego_speed_mps, closing_speed_mps, .. } = *impact;
    if ego_speed_mps.abs() < STANDS_MPS {
        return format!("{name} hit it at {at_s:.2} s with {closing_speed_mps:.1} m/s while it stood");
    }
    if closing_speed_mps > ego_speed_mps.abs() + STANDS_MPS {
        let speeds = format!("it drove {ego_speed_mps:.1} m/s, closing at {closing_speed_mps:.1} m/s");
        return format!("it and {name} collided at {at_s:.2} s: {speeds}");
    }
    format!("it hit {name} at {at_s:.2} s with {ego_speed_mps:.1} m/s")
}

/// Adds the first collision between others, if there is one, to the end of the sentence.
fn with_collision_of_others(mut why: Why, metrics: &Metrics) -> Why {
    if let Some(hit) = &metrics.first_collision_of_others {
        why.sentence += &format!("; {}", hit.words());
    }
    why
}

fn impact_of(metrics: &Metrics) -> Option<Time> {
    metrics.impact.map(|impact| Time::ZERO + Span::from_secs(impact.at_s))
}

impl Logged {
    /// Reads a log without images and point clouds, of the named or the first ego. A truncated log is read as far as possible, with a note on standard
    /// error.
    ///
    /// # Errors
    /// If it is not a log, or is the log of a vehicle, which has no ground truth.
    pub fn read(path: &Path, registry: &Registry, ego: Option<&str>) -> anyhow::Result<Self> {
        Self::read_within((path, ego), registry, usize::MAX)
    }

    /// Same as [`read`](Self::read), for a log that fits into about `bytes_max` bytes of memory.
    ///
    /// # Errors
    /// Same as there, or if it does not fit.
    fn read_within(
        (path, ego): (&Path, Option<&str>),
        registry: &Registry,
        bytes_max: usize,
    ) -> anyhow::Result<Self> {
        const BIG: [&str; 3] = ["::Image", "::PointCloud", "::PointInstances"];
        let bytes = Cell::new(0_usize);
        let is_kept = |record: &Record| {
            let payload = match record {
                Record::Publication(p) if BIG.iter().any(|big| p.stream.type_name.ends_with(big)) => {
                    return false;
                }
                Record::Publication(p) => p.payload_cbor.len(),
                _ => 0,
            };
            bytes.set(bytes.get().saturating_add(size_of::<Record>() + payload));
            bytes.get() <= bytes_max
        };
        let log = LogSoFar::read(path, is_kept)?.log;
        if bytes.get() > bytes_max {
            bail!("the drive is long: `swerve why` of its log needs {} MiB", bytes.get() >> 20);
        }
        let document = Config::logged(&log.start.config)?;
        let config = Setup::from_document_with(registry, &document, &[]).map_err(|p| problems_error(&p))?;
        if config.live.is_some() {
            bail!("{}: of a vehicle: the log does not hold where the others were", path.display());
        }
        let scenario = logged_scenario(&log.start)?;
        Ok(match of_ego(&log, &config, &scenario, ego)? {
            Some(EgoRun { log, setup, scenario }) => Self { log, config: setup, scenario },
            None => Self { log, config, scenario },
        })
    }

    /// Lets the chain run operators in Python again, if the user has consented.
    pub fn allow(&mut self, code: CodeArgs) {
        code.apply(&mut self.config);
    }

    /// Causal chain of the actor that decided the verdict of a run with these metrics, or of the event that did if no
    /// actor did.
    pub fn why(&self, metrics: &Metrics) -> anyhow::Result<Why> {
        let pipeline = Pipeline::build_without_stage(&self.config, &self.scenario)?;
        let why = match metrics.decided_by() {
            DecidedBy::Actor(decided) => {
                let (words, impact) = (ending(metrics, decided), impact_of(metrics));
                let ending = Ending { actor: decided.actor, verdict: metrics.verdict, words, impact };
                self.chain(pipeline, ending)?
            }
            _ => other::told(self, &pipeline, metrics)?,
        };
        Ok(with_collision_of_others(states::with_states(why, metrics), metrics))
    }

    /// Causal chain of the named actor, else of the nearest one at an instant, else of the one that decided the
    /// verdict, or of the event that did if no actor did.
    ///
    /// # Errors
    /// If there is no actor of that name, or no world state at that instant.
    pub fn why_of(&self, actor: Option<&str>, at_s: Option<f64>) -> anyhow::Result<Why> {
        let pipeline = Pipeline::build_without_stage(&self.config, &self.scenario)?;
        let named = actor.map(|name| actor_named(&pipeline, name)).transpose()?;
        let mut evaluation = swerve_eval::Evaluation::new(swerve_eval::Params {
            ego: outline(&pipeline.vehicle.shape),
            dead_time: Span::ZERO,
            operators: Vec::new(),
            actors: pipeline.scenario.names(),
            route: Some(pipeline.route.clone()),
            lights: light_courses(&pipeline.scenario.road, &pipeline.route, pipeline.until),
            norm: norm(&pipeline.scenario),
            tracks_boxes: false,
        });
        let stack = pipeline.stack();
        let assembly = &pipeline.assembly;
        let (gate, plans) = (assembly.publisher::<GateOutput>(), assembly.publisher::<Plan>());
        let (poses, heard) = (assembly.publisher::<EgoState>(), stack.publisher_after_faults::<EgoState>());
        let (routes, decisions) = (assembly.publisher::<Route>(), assembly.publisher::<Decision>());
        let track_names = track_names(assembly, &pipeline.scenario);
        let stream = assembly.publisher::<WorldState>().context("the log is of no simulated world")?;
        let mut near = Clearances::new(outline(&pipeline.vehicle.shape));
        let (mut known_s, mut is_known) = (Vec::new(), at_s.is_none());
        for publication in self.log.all_publications() {
            if is_of::<GateOutput>(publication, gate) {
                evaluation.gate(publication.header.visible_at, &publication.decode()?);
            } else if is_of::<Plan>(publication, plans) {
                evaluation.plan(&publication.decode()?);
            } else if is_of::<Decision>(publication, decisions) {
                let at = publication.header.visible_at;
                evaluation.decision(at, &publication.decode()?, &track_names);
            } else if is_of::<PoseQuality>(publication, poses) {
                evaluation.pose_quality(&publication.decode()?);
            } else if is_of::<EgoState>(publication, heard) {
                evaluation.pose_heard(&publication.decode()?);
            } else if is_of::<Route>(publication, routes) {
                let route: Route = publication.decode()?;
                let lights = light_courses(&pipeline.scenario.road, &route, pipeline.until);
                evaluation.follow(&route, lights);
            }
            if !is_of::<WorldState>(publication, Some(stream)) {
                continue;
            }
            let world: WorldState = publication.decode()?;
            let stamp_s = world.stamp.as_secs();
            if at_s.is_some_and(|at_s| (stamp_s - at_s).abs() < 0.5 * self.config.sim.dt_ms * 1e-3 + 1e-9) {
                near.take(&world);
                is_known = true;
            }
            known_s.push(stamp_s);
            evaluation.world(&world);
        }
        if known_s.is_empty() && self.config.sim.guest {
            bail!(
                "the log holds no states of the world: the program that stepped the stack fed none to the stream `{stream}`"
            );
        }
        if let (false, Some(at_s), [from_s, .., to_s]) = (is_known, at_s, &known_s[..]) {
            bail!(
                "--at {at_s}: no state of the world at that instant: expected {from_s:.2} to {to_s:.2} (seconds)"
            );
        }
        let Some(actor) = named.or(near.smallest().map(|c| c.actor)) else {
            return self.why(&evaluation.metrics());
        };
        let metrics = evaluation.metrics();
        if matches!(metrics.decided_by(), DecidedBy::Actor(decided) if decided.actor == actor) {
            return self.why(&metrics);
        }
        let words = match metrics.actors.iter().find(|a| a.actor == actor) {
            Some(a) => format!("{} was {:.2} m away at least", a.name, a.min_distance_m),
            None => "it was never near".into(),
        };
        let impact = impact_of(&metrics);
        let why = self.chain(pipeline, Ending { actor, verdict: metrics.verdict, words, impact })?;
        Ok(states::with_states(why, &metrics))
    }

    /// Causal chain of one actor.
    fn chain(&self, pipeline: Pipeline, ending: Ending) -> anyhow::Result<Why> {
        let name = pipeline.scenario.actor(ending.actor);
        let name = name.map_or_else(|| ending.actor.0.to_string(), |actor| actor.name.clone());
        let (mut steps, until) = self.steps(pipeline, ending.actor, ending.impact)?;
        // The steps are in order of time.
        steps.retain(|(_, at, _)| ending.impact.is_none_or(|impact| *at < impact));
        Ok(Why::new(name, ending.verdict, (&ending.words, until), &steps))
    }

    /// True if an operator is a class in Python that the user has not consented to run again.
    fn is_refused(&self, operator: &str) -> bool {
        let process = self.config.process_of(operator);
        let is_python = |name: &&str| self.config.process[*name].python.is_some();
        process.filter(is_python).is_some_and(|name| self.config.refusal(name).is_some())
    }

    /// Graph of the run. A foreign world is in it as the simulated one that reads the commands.
    fn graph(&self, pipeline: &Pipeline) -> anyhow::Result<GraphInfo> {
        if !self.config.sim.guest {
            return Ok(pipeline.graph.describe()?);
        }
        let mut simulated = self.config.clone();
        simulated.sim.guest = false;
        Ok(Pipeline::build_without_stage(&simulated, &self.scenario)?.graph.describe()?)
    }

    fn steps(
        &self,
        pipeline: Pipeline,
        actor: ActorId,
        impact: Option<Time>,
    ) -> anyhow::Result<(Vec<Account>, Until)> {
        let mut until = if impact.is_some() { Until::Impact } else { Until::End };
        let world =
            pipeline.assembly.publisher::<WorldState>().context("the log is of no simulated world")?;
        let planner =
            pipeline.assembly.publisher::<Plan>().context("no operator publishes plans in this log")?;
        let (world, planner) = (world.to_owned(), planner.to_owned());
        let timeline = Timeline::new(&self.log, self.graph(&pipeline)?);
        let sightings = Sightings::new(&self.log, &timeline, &world, actor);
        let mut steps = Vec::new();
        let Some(seen) = sightings.first_visible(&pipeline.assembly)? else { return Ok((steps, until)) };
        steps.push((Milestone::Visible, seen, Vec::new()));
        // The newest step: its instant and the stamp of its frame.
        let mut last = Seen { stamp: seen, at: seen };
        let predicted =
            timeline.upstream::<PredictionList>(&planner).context("the planner reads no predictions")?;
        let tracks =
            timeline.upstream::<TrackList>(timeline.publisher(&predicted)).context("there are no tracks")?;
        if let Some(boxes) = timeline.upstream::<Detections>(timeline.publisher(&tracks)) {
            let Some(found) = sightings.first_detected(&boxes, seen)? else { return Ok((steps, until)) };
            steps.push((Milestone::Detected, found.at, timeline.waits(&boxes, last, found, "missed by")));
            last = found;
        }
        let Some((tracked, ids)) = sightings.tracks(&tracks, last.stamp)? else { return Ok((steps, until)) };
        let confirmed = timeline.waits(&tracks, last, tracked, "confirmation by");
        steps.push((Milestone::Tracked, tracked.at, confirmed));
        if self.is_refused(&planner) {
            return Ok((steps, Until::Track));
        }
        last = tracked;
        let plans =
            timeline.stream_of::<Plan>(&planner).context("the planner publishes no plans")?.to_owned();
        let path = timeline.path(&planner, &world);
        let end = path.last().map_or(planner.as_str(), String::as_str);
        let (dead_time, delay) = (Span::from_secs(pipeline.vehicle.dead_time_s), timeline.delay(&planner));
        let (log, setup) = (&self.log, &self.config);
        let without = without::Without { log, setup, stream: &predicted, ids: &ids, from: tracked.stamp };
        // From a plan to the simulation step that applies its first command.
        let way = |stamp| {
            let planned = timeline.seen(&plans, stamp)?;
            let mut waits = vec![(format!("delay of {planner}"), delay)];
            let commanded = timeline.follow((&path, &world), planned.at + delay, &mut waits);
            let readable = commanded.map(|at| at + timeline.delay(end));
            let tick = readable.and_then(|at| timeline.all(&world).map(|s| s.stamp).find(|s| *s > at));
            Some((planned, commanded, waits, tick))
        };
        let tick = |stamp| way(stamp)?.3;
        let until_at = impact.or(self.log.end.as_ref().map(|end| end.at)).unwrap_or(Time::MAX);
        let spare = Pipeline::build_without_stage(&self.config, &self.scenario)?;
        let unaware = without.compare([pipeline, spare], (&planner, &world), &timeline, (&tick, until_at))?;
        let Some(first) = unaware.changes.first().copied() else { return Ok((steps, until)) };
        let mut change = way(first).context("the plan is not in the log")?;
        let (mut effect, mut idle) = (None, "no difference to");
        match unaware.answer {
            Answer::Effect(at) if change.3.is_some_and(|tick| tick < at) => {
                effect = Some(at);
                // Earlier changes of plans that had no effect are not causes.
                let later = unaware.changes.into_iter().skip(1).rev();
                if let Some(led) = later.filter_map(way).find(|led| led.3.is_some_and(|tick| tick < at)) {
                    (change, idle) = (led, "no lasting difference to");
                }
            }
            Answer::Nothing => {}
            _ => until = Until::Command,
        }
        let (planned, commanded, mut waits, tick) = change;
        steps.push((Milestone::Planned, planned.at, timeline.waits(&plans, last, planned, idle)));
        let Some(at) = commanded else { return Ok((steps, until)) };
        waits.retain(|(_, span)| *span > Span::ZERO);
        steps.push((Milestone::Commanded, at, waits));
        if let Some((tick, effect)) = tick.zip(effect) {
            let instants = [at, at + timeline.delay(end), tick, (tick + dead_time).min(effect), effect];
            let waits = [
                format!("delay of {end}"),
                format!("phase of {world}"),
                "dead time of the vehicle".into(),
                "build-up of the effect".into(),
            ];
            let waits = waits.into_iter().zip(instants.windows(2)).map(|(wait, t)| (wait, t[1] - t[0]));
            steps.push((Milestone::Effect, effect, waits.filter(|(_, s)| *s > Span::ZERO).collect()));
        }
        Ok((steps, until))
    }
}

/// True if an operator published this as a message of the type.
fn is_of<T>(publication: &PublicationRecord, operator: Option<&str>) -> bool {
    let stream = &publication.stream;
    operator == Some(stream.operator.as_str()) && stream.type_name == core::any::type_name::<T>()
}

/// Actor of the scenario with the name that `--actor` gives.
fn actor_named(pipeline: &Pipeline, name: &str) -> anyhow::Result<ActorId> {
    let actors = &pipeline.scenario.actors;
    let of_name = actors.iter().find(|actor| actor.name == name).map(|actor| actor.id);
    of_name.with_context(|| {
        if actors.is_empty() {
            return format!("--actor {name}: there is no actor in the scenario");
        }
        let names = || actors.iter().map(|actor| actor.name.as_str());
        let known = names().collect::<Vec<_>>().join(", ");
        format!("--actor {name}: expected one of {known}{}", did_you_mean(name, names()))
    })
}

#[cfg(test)]
mod tests;
