//! Page of a pipeline of black boxes: operators over time, and their run times.

use std::path::Path;

use swerve_report::output::quoted;
use swerve_report::page::{Collector, Input, Message, Page, RunPage, Table};

use super::pipeline::{BlackBox, Pipeline};
use super::table::Row;
use super::tally::Tally;
use super::trace::Trace;

/// Builds the page of a run of `pipeline`, read from `file`.
pub(crate) fn page(
    file: &Path,
    seed: u64,
    pipeline: &Pipeline,
    (trace, tally): (&Trace, &Tally<'_>),
) -> Page<RunPage> {
    let name = |k: usize| pipeline.operators[k].name.as_str();
    let mut collector = Collector::new();
    for operator in &pipeline.operators {
        collector.set_inputs(&operator.name, inputs(pipeline, operator));
    }
    for step in &trace.steps {
        // A step cut off by the end of the run has no run time.
        let Some(end) = step.end else { continue };
        collector.step(name(step.operator), step.stamp, step.start, end, step.late);
    }
    for publication in &trace.publications {
        let Some(stamp) = publication.stamp else { continue };
        let operator = name(publication.operator);
        let (at, origin) = (publication.visible_at, publication.origin);
        collector.message(Message { stream: operator, operator, stamp, at, origin }, None);
    }
    for miss in &trace.misses {
        collector.miss(name(miss.operator), miss.stamp, miss.at, "");
    }
    for drop in &trace.drops {
        collector.dropped(name(drop.operator), drop.stamp, drop.at, "");
    }
    let text = file.display().to_string();
    let stem = file.file_stem().map_or_else(|| text.clone(), |stem| stem.to_string_lossy().into_owned());
    let digest = trace.report.as_ref().map_or_else(String::new, |report| report.digest.to_string());
    let command = format!("swerve timing {} --seed {seed}", quoted(&text));
    Page::new(
        "run",
        stem,
        RunPage { command, seed, digest, tables: tables(pipeline, tally), ..collector.finish() },
    )
}

/// Tables of the terminal output.
fn tables(pipeline: &Pipeline, tally: &Tally<'_>) -> Vec<Table> {
    let table = |(title, mut rows): (&str, Vec<Row>)| {
        let columns = rows.remove(0);
        Table { title: title.into(), columns, rows }
    };
    super::table::tables(pipeline, tally).into_iter().map(table).collect()
}

fn inputs(pipeline: &Pipeline, operator: &BlackBox) -> Vec<Input> {
    let input =
        |feedback: bool| move |&k: &usize| Input { stream: pipeline.operators[k].name.clone(), feedback };
    let forward = operator.at.iter().chain(&operator.latest).map(input(false));
    forward.chain(operator.feedback.iter().map(input(true))).collect()
}
