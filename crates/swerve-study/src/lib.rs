//! Studies: a base run varied along axes over configuration keys, with one result per cell.
//!
//! Cells run in parallel, each on one thread. Finished cells are stored, so that a second call continues where the
//! first was stopped. Shards need no coordination: cell `k` belongs to shard `k mod n`.
//!
//! Excluded: training, and the evaluation of results in files; drives, their pages and logs are those of `swerve-drive`.

mod budget;
mod consent;
mod folder;
mod idle;
mod joint;
pub mod layer;
mod limit;

pub mod cells;
mod chance;
mod cluster;
mod columns;
mod csv;
pub mod curve;
mod domain;
pub mod grid;
pub mod heatmap;
mod merge;
mod output;
pub mod page;
mod plot;
mod programs;
pub mod ranking;
pub mod report;
pub mod result;
pub mod suite;
pub mod table;
pub mod tables;
pub mod timely;
mod timely_prediction;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use anyhow::{Context as _, bail};
use swerve_core::{Digest, Hasher};
use swerve_drive::commonroad::{self, Solving};
use swerve_drive::interrupt::on_interrupt;
use swerve_drive::page::RunReport;
use swerve_drive::pictures::PictureArgs;
use swerve_drive::program::Program;
use swerve_drive::shipped::Kind;
use swerve_drive::trust::CodeArgs;
use swerve_drive::{Outcome, drive_unless, problems_error};
use swerve_flow::Observer;
use swerve_report::files::{CELLS, read_whole, write_whole};
use swerve_scenario::{Scenario, split_sets};
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::pipeline::{Pipeline, drawn};
use swerve_text::{Problem, Problems};

use consent::{Bases, StudyConsent};

use cells::{CellStore, Runner, Shard};
use cluster::{Cluster, Job};
use columns::ROAD_USERS_LEFT_OUT;
use folder::OutArgs;
use grid::{Cell, Study};
use result::CellResult;

/// `swerve study`.
#[derive(clap::Args, Debug)]
#[command(args_conflicts_with_subcommands = true, subcommand_negates_reqs = true)]
pub struct StudyArgs {
    #[command(subcommand)]
    command: Option<StudyCommand>,
    /// Study file (TOML), or the name of a built-in one
    #[arg(required = true)]
    file: Option<PathBuf>,
    #[command(flatten)]
    out: OutArgs,
    #[command(flatten)]
    pictures: PictureArgs,
    /// Number of cells run at the same time [default: one per core]
    #[arg(long, value_parser = swerve_drive::threads::parser())]
    threads: Option<usize>,
    /// Run only this share of the cells: 2/4 is the second of four
    #[arg(long, value_name = "I/N")]
    shard: Option<Shard>,
    /// Submit the study to a cluster whose machines share this folder
    #[arg(long, conflicts_with = "shard")]
    on: Option<Cluster>,
    /// Number of shards that a cluster runs at the same time, with --threads cores each
    #[arg(long, requires = "on", default_value_t = 8)]
    shards: usize,
    /// Keep the page of every run in cells/, about 0.5 MB each, linked from the study's page
    #[arg(long, conflicts_with = "on")]
    reports: bool,
    /// Set a key of the configuration or the scenario in every cell. A table, KEY={...}, changes the keys that it names
    #[arg(long, value_name = "KEY=VALUE")]
    set: Vec<String>,
    #[command(flatten)]
    code: CodeArgs,
}

#[derive(clap::Subcommand, Debug)]
enum StudyCommand {
    /// Merge the finished cells of shards into one table
    Merge {
        /// Output folders of the shards
        #[arg(required = true)]
        folders: Vec<PathBuf>,
        /// Study file (TOML)
        #[arg(long)]
        study: PathBuf,
        #[command(flatten)]
        out: OutArgs,
        #[command(flatten)]
        pictures: PictureArgs,
        /// Set a configuration key in every cell, as in the shards' calls
        #[arg(long, value_name = "KEY=VALUE")]
        set: Vec<String>,
    },
}

/// Runs or merges a study.
pub fn run(args: &StudyArgs, registry: &Registry) -> anyhow::Result<()> {
    match (&args.command, &args.file) {
        (Some(StudyCommand::Merge { folders, study, out, set, pictures }), _) => {
            merge::merge(registry, study, folders, (out, *pictures), set)
        }
        (None, Some(file)) => {
            let bench = Bench::open(registry, file, &args.set)?.with_code(args.code);
            bench.refuse_programs()?;
            bench.note_domain()?;
            anyhow::ensure!(
                !args.reports || bench.is_of_drives(),
                "--reports: a cell of this study is not a single drive, so there is no page to keep"
            );
            let out = &args.out.folder(&bench.study)?;
            if let Some(cluster) = args.on {
                let threads = args.threads.unwrap_or(1);
                // Shards run in other folders; programs without consent have been refused above.
                let code = CodeArgs { allow_code: args.code.allow_code || !bench.programs().is_empty() };
                let (sets, overwrite, shards) = (&args.set, args.out.overwrite, args.shards);
                return Job { file, sets, code, out, overwrite, shards, threads }.submit(cluster);
            }
            let (threads, shard, reports) = (args.threads, args.shard, args.reports);
            let how = How { out, threads, shard, reports, pictures: args.pictures, is_quiet: false };
            let driven = bench.drive_cells(&how)?;
            finish(&bench.study, &driven, shard)
        }
        (None, None) => bail!("expected a study file"),
    }
}

/// Execution settings and output of a study's cells.
struct How<'a> {
    out: &'a Path,
    threads: Option<usize>,
    shard: Option<Shard>,
    reports: bool,
    pictures: PictureArgs,
    /// True if nothing is printed about the results.
    is_quiet: bool,
}

/// Returns an error if a cell failed or was not reached.
fn finish(study: &Study, (results, stopped): &Driven, shard: Option<Shard>) -> anyhow::Result<()> {
    if let Some((cell, error)) =
        study.cells.iter().zip(results).find_map(|(c, r)| Some((c, r.as_ref()?.error.as_ref()?)))
    {
        let failed = results.iter().flatten().filter(|r| r.error.is_some()).count();
        bail!(
            "{failed} cells failed, the first of them [{}]: {error}\n  {}",
            cell.labels.join(" "),
            study.command(cell)
        );
    }
    let mine = |cell: &Cell| shard.is_none_or(|shard| shard.holds(cell));
    let missing =
        study.cells.iter().zip(results).filter(|(cell, result)| result.is_none() && mine(cell)).count();
    if *stopped && missing > 0 {
        bail!("stopped with {missing} cells to go; the same command goes on from here");
    }
    Ok(())
}

/// Results of the cells in their order, `None` for one that was not reached; and true if a signal stopped them.
type Driven = (Vec<Option<CellResult>>, bool);

/// Study with everything that its cells share.
pub struct Bench {
    /// Study.
    pub study: Study,
    /// Scenarios by file.
    scenarios: joint::Scenarios,
    bases: Bases,
    consent: StudyConsent,
    registry: Registry,
    /// Digest of the program, since results of other builds are not reused.
    program: Digest,
    /// Set by the first signal: drives end, and no cell is started.
    stop: Arc<AtomicBool>,
}

impl Bench {
    /// Reads a study, its scenarios and its base configurations; `sets` are applied to every cell, before the axes.
    ///
    /// # Errors
    /// All problems of the study, its scenarios and the configurations of its cells.
    pub fn open(registry: &Registry, file: &Path, sets: &[String]) -> anyhow::Result<Self> {
        let study = read(registry, file, sets)?;
        let given = swerve_text::parse_assignments(sets)?;
        Ok(Self { consent: StudyConsent::of(given), ..Self::of(registry, study)? })
    }

    /// [`open`](Self::open) for a study that has been read already.
    ///
    /// # Errors
    /// All problems of its scenarios and the configurations of its cells.
    fn of(registry: &Registry, study: Study) -> anyhow::Result<Self> {
        let mut bench = Self::unexpanded(registry, study)?;
        bench.study = bench.study.expand();
        Ok(bench)
    }

    /// [`open`](Self::open) without expansion to cells: only the checks.
    ///
    /// # Errors
    /// As for [`open`](Self::open).
    pub fn check(registry: &Registry, file: &Path) -> anyhow::Result<Self> {
        Self::unexpanded(registry, read(registry, file, &[])?)
    }

    fn unexpanded(registry: &Registry, study: Study) -> anyhow::Result<Self> {
        let mut scenarios = joint::Scenarios::default();
        let mut unread = Vec::new();
        for path in study.scenarios() {
            if let Err(problem) = Kind::Scenario.text(path) {
                unread.push(study.unread(path, problem).to_string());
                continue;
            }
            match swerve_drive::read_scenario(path) {
                Ok(scenario) => scenarios.insert(path, scenario),
                Err(error) => unread.push(error.to_string()),
            }
        }
        let bases = Bases::read(&study, &mut unread);
        // All problems are reported before the first cell runs.
        let mut problems = joint::problems(&study, &bases.documents, &scenarios, registry);
        if problems.is_empty() && unread.is_empty() {
            problems = idle::problems(&study, &bases.documents, registry);
        }
        if problems.is_empty() && unread.is_empty() {
            let (registry, consent) = (registry.clone(), StudyConsent::default());
            let (program, stop) = (Program::digest()?, Arc::default());
            return Ok(Self { study, scenarios, bases, consent, registry, program, stop });
        }
        let problems = problems.iter().map(Problem::to_string);
        Err(problems_error(&unread.into_iter().chain(problems).collect::<Vec<_>>()))
    }

    /// Scenario of a cell.
    fn scenario(&self, cell: &Cell) -> anyhow::Result<Arc<Scenario>> {
        let file = self.study.scenario(cell);
        let (sets, _) = split_sets(&cell.sets);
        let scenario = self.scenarios.changed(file, &sets).context("the scenario is not read")?;
        scenario.map_err(|problems| in_cell(cell, &problems))
    }

    fn config(&self, cell: &Cell) -> anyhow::Result<Setup> {
        let (_, sets) = split_sets(&cell.sets);
        let base = &self.bases.documents[&cell.config];
        let mut config = Setup::from_document_with(&self.registry, base, &sets)
            .map_err(|problems| in_cell(cell, &problems))?;
        self.trust(&mut config, cell);
        Ok(config)
    }

    /// Digest of all inputs of a cell's result.
    pub fn fingerprint(&self, cell: &Cell) -> anyhow::Result<Digest> {
        let mut hasher = Hasher::new();
        let config = self.config(cell)?;
        hasher.value(&(self.program, config.to_text(), &*self.scenario(cell)?.text));
        for file in config.files() {
            hasher.bytes(&read_whole(file)?);
        }
        let file = self.study.scenario(cell);
        if commonroad::is_scenario(file) {
            // The goal is in the file alone.
            hasher.bytes(&read_whole(file)?);
        }
        hasher.value(&(self.study.curve.is_some(), &self.study.timely));
        hasher
            .value(&self.study.budget.as_ref().map(|b| (b.max_ms, b.scan_ms, b.resolution_ms, &cell.labels)));
        Ok(hasher.digest())
    }

    /// Line of `commands.txt` for a cell. For a latency budget, the drive with that latency (the largest that ends
    /// well), or without added latency if none does. A comment if the result is not of a single drive.
    fn repeat(&self, cell: &Cell, result: Option<&CellResult>) -> anyhow::Result<String> {
        let command = self.study.command(cell);
        if self.study.budget.is_none() {
            return Ok(command);
        }
        if is_limit(cell) {
            return Ok(format!(
                "# [{}]: a search over manoeuvres without a pipeline, no drive",
                cell.labels.join(" ")
            ));
        }
        let Some(added_ms) = result.and_then(|result| result.budget_ms) else { return Ok(command) };
        let whole_ms = self.config(cell)?.planning.added_latency_ms + added_ms;
        Ok(format!("{command} --set planning.added_latency_ms={whole_ms}"))
    }

    /// True if each cell is one drive.
    fn is_of_drives(&self) -> bool {
        self.study.budget.is_none() && self.study.curve.is_none() && self.study.timely.is_none()
    }

    /// Drives the unfinished cells, writes all results and prints their table.
    fn drive_cells(&self, how: &How<'_>) -> anyhow::Result<Driven> {
        // Until here there is nothing to finish, and a signal ends the program at once.
        let on_signal = self.stop.clone();
        let stopping = move || {
            // Cells are stored whole, so a second signal that ends the program at once loses no finished cell.
            on_signal.store(true, Ordering::SeqCst);
            eprintln!("\nstopping the current drives; finished ones are kept; interrupt again to stop now");
        };
        on_interrupt(stopping).context("listening for Ctrl-C")?;
        let store = CellStore::open(how.out)?;
        let _claim = folder::claim(how.out, how.shard.is_some())?;
        let threads = how.threads.unwrap_or_else(swerve_drive::threads::cores);
        let (shard, reports, stop) = (how.shard, how.reports, &*self.stop);
        let runner = Runner { store: &store, threads, shard, reports, stop };
        let run = |cell: &Cell, fingerprint| {
            let page = how.reports.then(|| store.report(cell, fingerprint));
            self.run_cell(cell, page.as_deref())
        };
        let results = runner.run(&self.study, |cell| self.fingerprint(cell), run)?;
        let text = output::report(self, &results, how.out, how.pictures)?;
        if !how.is_quiet {
            swerve_report::output::print(&text)?;
        }
        Ok((results, stop.load(Ordering::SeqCst)))
    }

    /// Drives a cell and writes its page to a file.
    fn drive_for_page(
        &self,
        cell: &Cell,
        (config, scenario): (&Setup, &Scenario),
        file: &Path,
        solving: Option<&mut Solving>,
    ) -> anyhow::Result<Outcome> {
        let mut page = RunReport::new(config, &Pipeline::build(config, scenario)?, self.study.command(cell));
        let mut observers: Vec<&mut dyn Observer> = vec![&mut page];
        observers.extend(solving.map(|solving| solving as &mut dyn Observer));
        let outcome = drive_unless(&self.stop, config, scenario, &mut observers)?;
        let metrics = serde_json::to_string(&outcome.metrics)?;
        let html = page.finish(&outcome.digest.to_string(), &metrics)?.html();
        write_whole(file, html.as_bytes())?;
        Ok(outcome)
    }

    /// Pages of the cells' runs that exist in `out`, relative to it.
    fn reports(&self, out: &Path) -> anyhow::Result<Vec<Option<String>>> {
        let kept = |name: String| name.ends_with(".html").then_some(name);
        let names = std::fs::read_dir(out.join(CELLS))?.map(|entry| Ok(entry?.file_name()));
        let names: Vec<_> = names.collect::<std::io::Result<_>>()?;
        let pages: BTreeSet<String> =
            names.into_iter().filter_map(|name| name.into_string().ok().and_then(kept)).collect();
        let page = |cell: &Cell| -> anyhow::Result<Option<String>> {
            if pages.is_empty() {
                return Ok(None);
            }
            let name = format!("{:06}-{}.html", cell.index, self.fingerprint(cell)?);
            Ok(pages.contains(&name).then(|| format!("cells/{name}")))
        };
        self.study.cells.iter().map(page).collect()
    }

    /// Runs one cell; if it is a single drive, its page is written to `page`.
    pub fn run_cell(&self, cell: &Cell, page: Option<&Path>) -> anyhow::Result<CellResult> {
        let (config, scenario) = (self.config(cell)?, self.scenario(cell)?);
        let scenario = &*scenario;
        if let Some(timely) = &self.study.timely {
            return timely.run(cell, &config, scenario, &self.stop);
        }
        let expected = scenario.expectation(&config.pipeline_name());
        let mut solving = Solving::of_drive(self.study.scenario(cell), &config.sim.vehicle)?;
        let reacts = scenario.actors.iter().any(|actor| actor.track().is_some_and(|track| track.reacts));
        let of_drive = |outcome: &Outcome, solving: Option<&Solving>| {
            let mut result = CellResult::of(cell, outcome, expected);
            if let Some(solving) = solving {
                result.expects(&solving.broken(outcome.metrics.impact.as_ref(), reacts));
            }
            if scenario.traffic.is_some() {
                let count = drawn(&config, scenario).left_out();
                result.figures.insert(ROAD_USERS_LEFT_OUT.to_owned(), count as f64);
            }
            result
        };
        match &self.study.budget {
            Some(budget) if is_limit(cell) => {
                limit::largest_reaction(cell, (&config, scenario), budget, &self.stop)
            }
            Some(budget) => budget::largest_latency(cell, (&config, scenario), budget, &self.stop),
            None => match self.study.curve {
                Some(curve) => {
                    let (outcome, curve) = curve.drive(&config, scenario, &self.stop)?;
                    Ok(CellResult { curve, ..of_drive(&outcome, None) })
                }
                None => {
                    let outcome = match page {
                        Some(file) => {
                            self.drive_for_page(cell, (&config, scenario), file, solving.as_mut())?
                        }
                        None => {
                            let observers = solving.iter_mut().map(|solving| solving as &mut dyn Observer);
                            drive_unless(&self.stop, &config, scenario, &mut observers.collect::<Vec<_>>())?
                        }
                    };
                    Ok(of_drive(&outcome, solving.as_ref()))
                }
            },
        }
    }
}

/// Reads a study file; `sets` are applied to every cell, before the axes. The error of a study with wrong axes also has
/// the unknown keys of the others.
fn read(registry: &Registry, file: &Path, sets: &[String]) -> anyhow::Result<Study> {
    let sets = swerve_text::parse_assignments(sets);
    Study::read_meant(file, &sets?).map_err(|(problems, meant)| {
        let mut all: Vec<String> = problems.iter().map(Problem::to_string).collect();
        // The configuration may be wrong only because of the missing axes, but no axis makes a key known.
        let rest = meant.map(|study| Bench::unexpanded(registry, *study).err()).unwrap_or_default();
        let rest = rest.map(|error| error.to_string()).unwrap_or_default();
        all.extend(rest.lines().filter(|line| line.contains(": unknown key")).map(str::to_owned));
        problems_error(&all)
    })
}

/// Problems of a cell that the check of the whole study missed.
fn in_cell(cell: &Cell, problems: &Problems) -> anyhow::Error {
    problems_error(problems).context(format!("cell [{}] of the study", cell.labels.join(" ")))
}

/// True if the cell is for the vehicle's own limit.
fn is_limit(cell: &Cell) -> bool {
    cell.labels.iter().any(|label| label == grid::LIMIT)
}
