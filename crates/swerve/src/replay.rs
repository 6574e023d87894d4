//! `swerve replay`: recomputes a log's streams below a cut, to compare them byte for byte or under other settings.
//!
//! Open loop: operators upstream of the cut publish the logged messages at their logged instants; recomputed commands
//! have no effect. Only the log is read.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};
use swerve_core::Digest;
use swerve_drive::page::{COMMAND, LogSoFar, given_log, pair_of_logs};
use swerve_drive::process::Processes;
use swerve_drive::trust::{self, CodeArgs};
use swerve_drive::{left_out_of_logs, logged_scenario, of_version, problems_error, run_start, set_up};
use swerve_flow::{Decision, Event, Observer, PayloadType, Publication, RunOptions, run_replay};
use swerve_live::graph::LiveGraph;
use swerve_log::{LeavesOut, Log, Record, Recorder, RunEnd, left_out};
use swerve_msg::truth::PointInstances;
use swerve_msg::{Image, LocalPose, PointCloud, PoseMatch, TrackList};
use swerve_report::files::{RunFolder, write_whole};
use swerve_report::output::quoted;
use swerve_report::progress::Progress;
use swerve_stack::Setup;
use swerve_stack::config::programs::Layer;
use swerve_stack::config::{Config, Images};
use swerve_stack::pipeline::Pipeline;
use swerve_stack::{Registry, Role};
use swerve_text::{did_you_mean, parse_assignments};

use crate::run::stem;

/// `swerve replay`.
#[derive(clap::Args, Debug)]
pub struct ReplayArgs {
    /// Log (MCAP), or the folder of a run
    log: PathBuf,
    /// Fail unless every stream below the cut is recomputed as logged, byte for byte
    #[arg(long)]
    verify: bool,
    /// First operator to recompute, with all after it [default: localization, else tracker, else the first operator]
    #[arg(long, value_name = "OPERATOR")]
    from: Option<String>,
    /// Set a configuration key for the recomputed streams
    #[arg(long, value_name = "KEY=VALUE", conflicts_with = "verify")]
    set: Vec<String>,
    /// Folder for the log of the recomputed streams and a page that compares it with the original [default with --set:
    /// a new folder, out/SCENARIO_replayed-1 and so on]
    #[arg(long, value_name = "DIR", conflicts_with = "verify")]
    out: Option<PathBuf>,
    /// Replace the contents of the folder of --out
    #[arg(long, requires = "out")]
    overwrite: bool,
    #[command(flatten)]
    code: CodeArgs,
    /// Number of threads; the result does not depend on it [default: one per processor]
    #[arg(long, value_parser = swerve_drive::threads::parser())]
    threads: Option<usize>,
}

impl ReplayArgs {
    fn command_line(&self) -> String {
        let mut line = format!("swerve replay {}", quoted(&self.log.display().to_string()));
        let from = self.from.iter().map(|from| format!(" --from {}", quoted(from)));
        line.extend(from.chain(self.set.iter().map(|set| format!(" --set {}", quoted(set)))));
        line + self.code.words()
    }
}

/// Runs `swerve replay`.
pub fn run(args: &ReplayArgs, registry: &Registry) -> anyhow::Result<()> {
    let path = given_log(&args.log)?;
    let whole = || Log::read(&path).context("--verify: expected a complete log");
    let so_far = match args.verify {
        true => LogSoFar::whole(&path, whole()?),
        false => LogSoFar::read(&path, |_| true)?,
    };
    let log = &so_far.log;
    let sets = parse_assignments(&args.set);
    let asks = args.out.is_some() || !args.set.is_empty();
    let name =
        log.start.extra.get("scenario_file").map_or_else(|| "log".into(), |file| stem(Path::new(file)));
    let claim = || RunFolder::claim(args.out.as_deref(), &format!("{name}_replayed"), args.overwrite);
    let folder = asks.then(claim).transpose()?;
    let replayed = folder.as_ref().map(|folder| folder.path.join("log.mcap"));
    let part = folder.as_ref().map(|folder| folder.path.join("log.partial.mcap"));
    let threads = args.threads.unwrap_or_else(swerve_drive::threads::cores);
    let into = part.as_deref().map(|path| (path, args.command_line()));
    let (file, code) = (path.display().to_string(), args.code);
    let how = Replay { file, code, from: args.from.as_deref(), sets: &sets?, threads, into };
    let comparison = how.run(registry, log).inspect_err(|_| {
        // A replay that failed before it began leaves no empty folder; `remove_dir` keeps non-empty ones.
        let _ = folder.as_ref().map(|folder| std::fs::remove_dir(&folder.path));
    })?;
    folder.as_ref().map(RunFolder::name_whole).transpose()?;
    swerve_report::output::print(&comparison.text(args.set.is_empty()))?;
    if let Some(replayed) = replayed {
        let page = replayed.with_file_name("comparison.html");
        let other = LogSoFar::read(&replayed, |_| true)?;
        write_whole(&page, pair_of_logs(registry, &so_far, &other)?.html().as_bytes())?;
        let (log, page) = (replayed.display(), page.display());
        swerve_report::output::print(&format!(
            "what would have come out: {log}\nboth beside each other: {page}\n"
        ))?;
    }
    if args.verify && !comparison.is_same() {
        bail!("{}: the replay differs from the log{}", args.log.display(), of_version(&log.start));
    }
    if args.verify && !log.is_sealed {
        bail!(
            "{}: the log has no seals: its streams are as logged, but changes of its head, scenario, configuration, headers \
             and times cannot be detected",
            args.log.display()
        );
    }
    Ok(())
}

/// Partition of the operators into played back and recomputed.
struct Cut {
    played: Vec<String>,
    computed: Vec<String>,
    /// Sources that the log holds only as fingerprints.
    without_data: Vec<String>,
}

impl Cut {
    /// Cuts before the operator of this name, or, for a configuration table such as `planning`, before the first
    /// operator that it configures. Default: before localization, else the tracker, else the first operator.
    fn new(pipeline: &Pipeline, from: Option<&str>, images: Images) -> anyhow::Result<Self> {
        let assembly = &pipeline.assembly;
        let in_stack = |name: &&str| assembly.node(name).is_some_and(|node| node.role == Role::Stack);
        let known: Vec<&str> = assembly.names().filter(in_stack).collect();
        // Detections are placed and tracked with the estimated pose: localization comes first.
        let usual = || {
            let matcher = assembly.publisher::<PoseMatch>().or_else(|| assembly.publisher::<LocalPose>());
            let usual = matcher.filter(in_stack).or_else(|| assembly.publisher::<TrackList>());
            usual.or(known.first().copied())
        };
        let from = from.or_else(usual).context("the pipeline has no operator to compute again")?;
        let is_set_by = |name: &&str| {
            let section = assembly.node(name).and_then(|node| node.sections().next());
            section.is_some_and(|section| section.table() == Some(from))
        };
        // Planning begins with the behaviour planner, which has its own keys.
        let decides =
            |name: &&str| from == "planning" && assembly.publisher::<swerve_msg::Decision>() == Some(*name);
        let is_set_by = |name: &&str| is_set_by(name) || decides(name);
        let at = known.iter().position(|known| *known == from);
        let Some(at) = at.or_else(|| known.iter().position(is_set_by)) else {
            let near = did_you_mean(from, known.iter().copied());
            bail!(
                "--from {from}: expected one of {}{near}; what is above them is the world and its sensors",
                known.join(", ")
            );
        };
        // An operator that does not run under these settings is replaced by the next one that does.
        let first =
            known[at..].iter().find_map(|name| assembly.operators().iter().position(|o| o.name == *name));
        let first = first.unwrap_or(assembly.operators().len());
        let mut cut = Self { played: Vec::new(), computed: Vec::new(), without_data: Vec::new() };
        let sources: Vec<&str> = pipeline.graph.sources().collect();
        for (k, placed) in assembly.operators().iter().enumerate() {
            let is_source = sources.contains(&placed.name.as_str());
            if is_source && placed.outputs.iter().any(|output| is_left_out(output.port.payload, images)) {
                cut.without_data.push(placed.name.clone());
            }
            // Operators that read data missing from the log cannot be recomputed.
            let is_blind = placed
                .inputs
                .iter()
                .flat_map(|input| &input.from)
                .any(|edge| cut.without_data.contains(&edge.stream));
            let is_above = k < first && !placed.kind.node().follows_from_world;
            let played = is_source || is_blind || is_above;
            if played { &mut cut.played } else { &mut cut.computed }.push(placed.name.clone());
        }
        // Other egos have the same stack, but for its names.
        let of_others = |own: &[String]| -> Vec<String> {
            let in_stack = |name: &&String| assembly.node(name).is_none_or(|node| node.role != Role::World);
            let own: Vec<&String> = own.iter().filter(in_stack).collect();
            pipeline
                .others
                .iter()
                .flat_map(|other| own.iter().map(|name| other.names.operator(name)))
                .collect()
        };
        let (played, computed) = (of_others(&cut.played), of_others(&cut.computed));
        cut.without_data.extend(of_others(&cut.without_data));
        cut.played.extend(played);
        cut.computed.extend(computed);
        let others: Vec<String> = sources
            .into_iter()
            .filter(|source| !cut.played.iter().any(|played| played == source))
            .map(str::to_owned)
            .collect();
        cut.played.extend(others);
        Ok(cut)
    }
}

/// True if a log that stores images in this form holds only fingerprints of messages of this type.
fn is_left_out(payload: PayloadType, images: Images) -> bool {
    let big =
        [PayloadType::of::<Image>(), PayloadType::of::<PointCloud>(), PayloadType::of::<PointInstances>()];
    images != Images::Lossless && big.contains(&payload)
}

/// Recomputes the operators of a log from the one named `from` on, and compares. Cameras, radars and lidars of a
/// simulated world are always recomputed: they are functions of the world states in the log.
pub fn replay(
    log: &Log,
    from: &str,
    sets: &[(String, toml::Value)],
    threads: usize,
) -> anyhow::Result<Comparison> {
    replay_with(&Registry::standard(), log, from, sets, threads)
}

/// Same as [`replay`], with a custom registry of operator kinds.
pub fn replay_with(
    registry: &Registry,
    log: &Log,
    from: &str,
    sets: &[(String, toml::Value)],
    threads: usize,
) -> anyhow::Result<Comparison> {
    let (file, code) = ("the log".to_owned(), CodeArgs::default());
    Replay { file, code, from: Some(from), sets, threads, into: None }.run(registry, log)
}

/// A replay's inputs and options.
struct Replay<'a> {
    /// Name of the log in messages.
    file: String,
    code: CodeArgs,
    from: Option<&'a str>,
    sets: &'a [(String, toml::Value)],
    threads: usize,
    /// Log to write, and the command line that repeats the replay.
    into: Option<(&'a Path, String)>,
}

impl Replay<'_> {
    fn run(&self, registry: &Registry, log: &Log) -> anyhow::Result<Comparison> {
        let document = Config::logged(&log.start.config)?;
        let mut config = Setup::from_document_with(registry, &document, self.sets)
            .map_err(|problems| problems_error(&problems))?;
        let mut of_log = document;
        of_log.file.clone_from(&self.file);
        config.trust(&[
            Layer::of_file(of_log, Some(trust::DOUBT_OF_LOGS.into())),
            Layer::of_sets("--set", self.sets, None),
        ]);
        self.code.apply(&mut config);
        let scenario = logged_scenario(&log.start)?;
        let build = || match config.live.is_some() {
            true => Ok(LiveGraph::build(&config, &scenario)?.pipeline),
            false => Pipeline::build(&config, &scenario),
        };
        let mut processes = Vec::new();
        let mut pipeline = build()?;
        let cut = Cut::new(&pipeline, self.from, config.log.images)?;
        let mut lacks_data = false;
        for operator in &cut.played {
            // The log holds only fingerprints of these.
            let gone = cut.without_data.contains(operator);
            let played = if gone { Vec::new() } else { log.playback(operator) };
            pipeline.graph.playback(operator, played)?;
            pipeline.graph.playback_steps(operator, log.held(operator))?;
            lacks_data |= gone && log.all_publications().any(|p| p.stream.operator == *operator);
        }
        processes.push(Processes::start_needed(&config, &mut pipeline)?);
        let decided = decisions(log, self.sets.is_empty())?;
        // An operator that was restarted in the logged run is restarted again, with the initial state of a pipeline.
        for _ in 0..decided.iter().filter(|decision| matches!(decision, Decision::Restarted { .. })).count() {
            let mut spare = build()?;
            processes.push(Processes::start_needed(&config, &mut spare)?);
            pipeline.graph.spare(spare.graph);
        }
        let compared: Vec<&str> = cut.computed.iter().map(String::as_str).collect();
        let mut comparison = Comparison::against(log, &compared);
        comparison.leaves_out = left_out_of_logs(config.log.images);
        if lacks_data {
            // Without images and clouds, the digest over all streams cannot match.
            comparison.logged_digest = None;
        }
        let last = log.whole_until();
        let options = RunOptions { seed: log.start.seed, threads: self.threads, until: Some(last) };
        let mut recorder =
            self.into.as_ref().map(|into| recorder(into, log, &config, &pipeline)).transpose()?;
        let mut progress = Progress::simulated(last.as_secs());
        let mut observers: Vec<&mut dyn Observer> = vec![&mut comparison, &mut progress];
        observers.extend(recorder.as_mut().map(|recorder| recorder as &mut dyn Observer));
        let report = run_replay(pipeline.graph, &options, decided.into_iter().collect(), observers)?;
        progress.finish();
        recorder.map(Recorder::finish).transpose()?;
        comparison.digest = report.digest;
        Ok(comparison)
    }
}

/// Recorder for the log of a replay.
fn recorder(
    (path, command): &(&Path, String),
    log: &Log,
    config: &Setup,
    pipeline: &Pipeline,
) -> anyhow::Result<Recorder> {
    let file = log.start.extra.get("scenario_file").map_or("", String::as_str);
    let mut start = run_start(config, &pipeline.scenario, Path::new(file));
    start.extra.insert(COMMAND.into(), command.clone());
    let mut recorder = Recorder::create(path, &start)?;
    set_up(&mut recorder, config, pipeline);
    Ok(recorder)
}

/// Logged decisions. Under other settings only the end of the run: the rest follows from the settings.
fn decisions(log: &Log, all: bool) -> anyhow::Result<Vec<Decision>> {
    let decisions: Result<Vec<Decision>, _> = log.decisions().map(|record| record.decode()).collect();
    Ok(decisions?.into_iter().filter(|d| all || matches!(d, Decision::End { .. })).collect())
}

/// Comparison of the streams below the cut with the log.
pub struct Comparison {
    expected: BTreeMap<String, std::vec::IntoIter<Said>>,
    streams: BTreeMap<String, Counts>,
    logged_digest: Option<Digest>,
    digest: Digest,
    leaves_out: Option<LeavesOut>,
    incomplete: Option<String>,
}

/// A publication, reduced to the parts that must match.
#[derive(Clone, PartialEq, Debug)]
struct Said {
    /// (stamp, watermark, visible_at, reused_from, origin), ns.
    header: [Option<i64>; 5],
    payload: Vec<u8>,
}

#[derive(Clone, Default)]
struct Counts {
    same: u64,
    different: u64,
    missing: u64,
    more: u64,
    first: Option<String>,
}

impl Comparison {
    fn against(log: &Log, operators: &[&str]) -> Self {
        let mut expected: BTreeMap<String, Vec<Said>> = BTreeMap::new();
        let last = log.whole_until();
        for record in &log.records {
            match record {
                // Publications of the last instant of a truncated log may be missing.
                Record::Publication(p) if p.header.visible_at > last => break,
                Record::Watermark(w) if w.visible_at > last => break,
                Record::Publication(p) if operators.contains(&p.stream.operator.as_str()) => {
                    let h = &p.header;
                    let times =
                        [Some(h.stamp), Some(h.watermark), Some(h.visible_at), h.reused_from, h.origin];
                    let said =
                        Said { header: times.map(|t| t.map(|t| t.ns())), payload: p.payload_cbor.to_vec() };
                    expected.entry(p.stream.stream.clone()).or_default().push(said);
                }
                Record::Watermark(w) if operators.contains(&w.operator.as_str()) => {
                    let times = [None, Some(w.watermark), Some(w.visible_at), None, None];
                    let said = Said { header: times.map(|t| t.map(|t| t.ns())), payload: Vec::new() };
                    expected.entry(w.stream.clone()).or_default().push(said);
                }
                _ => {}
            }
        }
        let streams = expected.keys().map(|name| (name.clone(), Counts::default())).collect();
        Self {
            expected: expected.into_iter().map(|(name, said)| (name, said.into_iter())).collect(),
            streams,
            logged_digest: log.end.as_ref().and_then(RunEnd::whole_digest),
            digest: Digest::default(),
            leaves_out: None,
            incomplete: log.end.as_ref().and_then(RunEnd::incomplete),
        }
    }

    /// True if every stream was recomputed as logged, and so the digest over all streams.
    pub fn is_same(&self) -> bool {
        let streams = self.streams.values().all(|c| c.different + c.missing + c.more == 0);
        streams && self.logged_digest.is_none_or(|logged| logged == self.digest)
    }

    fn text(&self, compare_digest: bool) -> String {
        let head = ["stream", "identical", "different", "missing", "extra"].map(str::to_owned).to_vec();
        let rows = self.streams.iter().map(|(name, c)| {
            let numbers = [c.same, c.different, c.missing, c.more].map(|n| n.to_string());
            std::iter::once(name.clone()).chain(numbers).collect()
        });
        let mut text = swerve_report::output::align(&std::iter::once(head).chain(rows).collect::<Vec<_>>());
        for (name, counts) in &self.streams {
            if let Some(first) = &counts.first {
                text += &format!("{name}: first difference {first}\n");
            }
        }
        if let Some(incomplete) = &self.incomplete {
            text += &format!("{incomplete}; the comparison ends before it, without the digest\n");
        }
        if compare_digest && let Some(logged) = self.logged_digest {
            let relation = if logged == self.digest { "as logged" } else { "not the logged one" };
            text += &format!("digest {}, {relation} ({logged})\n", self.digest);
        }
        text
    }

    fn compare(&mut self, stream: &str, said: &Said) {
        let counts = self.streams.entry(stream.to_owned()).or_default();
        let what = match self.expected.get_mut(stream).and_then(Iterator::next) {
            None => {
                counts.more += 1;
                "is not in the log"
            }
            Some(logged) if logged == *said => {
                counts.same += 1;
                return;
            }
            Some(logged) => {
                counts.different += 1;
                match logged.header == said.header {
                    true => "differs from the log",
                    false => "comes at another time than in the log, or of another frame",
                }
            }
        };
        counts.first.get_or_insert_with(|| {
            let at = said.header[2].unwrap_or_default() as f64 * 1e-9;
            format!("at {at:.3} s: the message {what}")
        });
    }
}

impl Observer for Comparison {
    fn event(&mut self, event: &Event<'_>) {
        match event {
            Event::Publication(p) if self.streams.contains_key(p.stream) => {
                self.compare(p.stream, &said(p, self.leaves_out))
            }
            Event::End(_) => {
                for (stream, rest) in &mut self.expected {
                    self.streams.entry(stream.clone()).or_default().missing += rest.count() as u64;
                }
            }
            _ => {}
        }
    }
}

fn said(p: &Publication<'_>, leaves_out: Option<LeavesOut>) -> Said {
    let mut payload = Vec::new();
    match p.payload {
        Some(carried) if leaves_out.is_some_and(|is_left_out| is_left_out(carried)) => {
            left_out(carried, &mut payload);
        }
        Some(carried) => carried.to_cbor(&mut payload),
        None => {}
    }
    let (reused, origin) = if p.stamp.is_some() { (p.reused_from, p.origin) } else { (None, None) };
    let times = [p.stamp, Some(p.watermark), Some(p.visible_at), reused, origin];
    Said { header: times.map(|t| t.map(|t| t.ns())), payload }
}
