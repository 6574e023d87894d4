//! `swerve timing`: sizes a pipeline before any of it is implemented.
//!
//! A file describes operators of which only the timing is known: their inputs, run times, policies while busy,
//! deadlines and shared resources. The engine runs them over a span in virtual time, under the rules of
//! `docs/execution.md`. The output is response times, losses and utilisation, every publication as JSON, and a chart.

mod chain;
mod gantt;
mod json;
mod page;
mod pipeline;
mod read;
mod simulate;
mod table;
mod tally;
mod trace;

#[cfg(test)]
mod tests;

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_drive::pictures::PictureArgs;
use swerve_drive::shipped::Kind;
use swerve_text::{Document, Problems};

pub use pipeline::{BlackBox, Pipeline, Resource, Timer};
pub use tally::{OperatorTally, Tally};
pub use trace::{Mark, Publication, Step, Trace};

/// Runs a pipeline of black boxes and prints its response times, losses and utilisation.
#[derive(Clone, Debug, clap::Args)]
pub struct TimingArgs {
    /// Pipeline file (TOML).
    pub file: PathBuf,
    /// Draw a chart of all steps, publications, misses and drops into this file.
    #[arg(long, value_name = "FILE")]
    pub picture: Option<PathBuf>,
    /// Options of the chart.
    #[command(flatten)]
    pub pictures: PictureArgs,
    /// Write a page with all steps, each with its chain, and the run times into this file.
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
    /// Options for replacing existing files.
    #[command(flatten)]
    pub overwrite: OverwriteArgs,
    /// Print every publication, in commit order, as one JSON array and nothing else.
    #[arg(long)]
    pub json: bool,
    /// Seed of the random run times.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// Worker threads; the result does not depend on them.
    #[arg(long, default_value_t = 1, value_parser = swerve_drive::threads::parser())]
    pub threads: usize,
}

/// Runs `swerve timing`.
///
/// # Errors
/// If the file cannot be read or has problems (all are reported, with line and key), if the run fails (a full queue
/// under `fail`), or if the chart or the page cannot be written.
pub fn run(args: &TimingArgs) -> anyhow::Result<()> {
    for path in [&args.picture, &args.report].into_iter().flatten() {
        swerve_report::files::refuse_toml(path)?;
        args.overwrite.check([path.as_path()])?;
    }
    let pipeline = read_file(&args.file).map_err(|problems| swerve_drive::problems_error(&problems))?;
    // All events are kept only if an output needs them: the table takes an eighth of the memory.
    let all = args.picture.is_some() || args.report.is_some() || args.json;
    let mut trace = Trace::default();
    let tally = simulate::simulate(&pipeline, args.seed, args.threads, all.then_some(&mut trace))
        .with_context(|| args.file.display().to_string())?;
    if let Some(path) = &args.picture {
        args.pictures.write(path, &draw(&pipeline, &trace))?;
    }
    if let Some(path) = &args.report {
        let page = page::page(&args.file, args.seed, &pipeline, (&trace, &tally));
        swerve_report::files::write_whole(path, page.html().as_bytes())?;
    }
    let text = if args.json { json(&pipeline, &trace) } else { table(&pipeline, &tally) };
    swerve_report::output::print(&text)
}

/// Reads the pipeline that a file describes.
///
/// # Errors
/// If the file cannot be read or is invalid: all problems, with file, line, key and expected value.
pub fn read_file(path: &Path) -> Result<Pipeline, Problems> {
    read::pipeline(&Kind::Timing.document(path)?)
}

/// The JSON schema of a timing file.
pub fn schema() -> schemars::Schema {
    schemars::schema_for!(read::File)
}

/// Reads the pipeline that `text` describes; `name` is the file name in messages.
///
/// # Errors
/// As [`read_file`].
pub fn parse(name: &str, text: &str) -> Result<Pipeline, Problems> {
    read::pipeline(&Document::parse(name, text)?)
}

/// Runs `pipeline` over its span, the end included.
///
/// # Errors
/// If the engine refuses the graph or the run fails.
pub fn simulate(pipeline: &Pipeline, seed: u64, threads: usize) -> anyhow::Result<Trace> {
    let mut trace = Trace::default();
    simulate::simulate(pipeline, seed, threads, Some(&mut trace))?;
    Ok(trace)
}

/// As [`simulate`], but keeps only counts and run times.
///
/// # Errors
/// As for [`simulate`].
pub fn tally(pipeline: &Pipeline, seed: u64, threads: usize) -> anyhow::Result<Tally<'_>> {
    simulate::simulate(pipeline, seed, threads, None)
}

/// Formats response times, losses and utilisation as aligned text.
pub fn table(pipeline: &Pipeline, tally: &Tally<'_>) -> String {
    table::table(pipeline, tally)
}

/// Draws a Gantt chart.
pub fn draw(pipeline: &Pipeline, trace: &Trace) -> swerve_draw::Picture {
    gantt::draw(pipeline, trace)
}

/// Formats every publication in commit order as a JSON array of `{operator, stamp_ns, watermark_ns, visible_at_ns,
/// reused_from_ns, reads}`.
pub fn json(pipeline: &Pipeline, trace: &Trace) -> String {
    json::json(pipeline, trace)
}
