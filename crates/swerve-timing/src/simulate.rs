//! Builds the engine's graph of a pipeline of black boxes, and runs it in virtual time.

use swerve_core::Time;
use swerve_flow::{
    At, Context, Event, Every, Feedback, Graph, Latest, Observer, Operator, Port, RunOptions, Source, Stream,
    every, run_virtual,
};

use super::pipeline::{BlackBox, Names, Pipeline};
use super::tally::Tally;
use super::trace::Trace;

/// Operator that computes nothing and only takes its run time.
struct Blank;

impl Operator for Blank {
    type In = (Vec<Every>, Vec<At<()>>, Vec<Latest<()>>);
    type Out = Port<()>;

    fn step(&mut self, _: &mut Context<'_>, _: &Self::In, out: &mut Self::Out) {
        out.send(());
    }
}

/// Builds the engine's graph of a pipeline. Operators are added in the order of the ranks that the file gives them; the
/// engine ranks by order of addition and so assigns the same ranks.
fn graph(pipeline: &Pipeline) -> Graph {
    let mut graph = Graph::new();
    let resources: Vec<_> = pipeline
        .resources
        .iter()
        .map(|resource| graph.resource(resource.name.as_str(), resource.slots))
        .collect();
    let mut streams: Vec<Option<Stream<()>>> = vec![None; pipeline.operators.len()];
    let mut loops: Vec<(Feedback<()>, usize)> = Vec::new();
    let ready = |op: &BlackBox, streams: &[Option<Stream<()>>]| {
        op.at.iter().chain(&op.latest).all(|&i| streams[i].is_some())
    };
    while let Some(i) =
        (0..streams.len()).find(|&i| streams[i].is_none() && ready(&pipeline.operators[i], &streams))
    {
        let op = &pipeline.operators[i];
        let stream = |i: &usize| streams[*i].expect("inputs are added first");
        let timers: Vec<_> = op.timer.iter().map(|timer| every(timer.period).phase(timer.phase)).collect();
        let at: Vec<Stream<()>> = op.at.iter().map(stream).collect();
        let mut latest: Vec<Source<()>> = op.latest.iter().map(|i| stream(i).into()).collect();
        for &read in &op.feedback {
            let edge = graph.feedback(format!("{} to {}", pipeline.operators[read].name, op.name));
            loops.push((edge, read));
            latest.push(edge.into());
        }
        let mut added = graph
            .add(op.name.as_str(), Blank, (timers, at, latest))
            .runtime(op.runtime.clone())
            .policy(op.policy);
        if let Some(deadline) = op.deadline {
            added = added.deadline(deadline);
        }
        if let Some(resource) = op.uses {
            added = added.uses(resources[resource]);
        }
        if op.timer.is_some() && op.at.is_empty() && op.latest.is_empty() {
            added = added.origin();
        }
        streams[i] = Some(added.out());
    }
    for (edge, read) in loops {
        graph
            .connect(edge, streams[read].expect("the file was checked for cycles: every operator was added"));
    }
    graph
}

/// Runs the pipeline; `trace`, if given, records all events.
pub(crate) fn simulate<'a>(
    pipeline: &'a Pipeline,
    seed: u64,
    threads: usize,
    trace: Option<&mut Trace>,
) -> anyhow::Result<Tally<'a>> {
    let mut tally = Tally::new(pipeline);
    let options = RunOptions::until(Time::ZERO + pipeline.span).seed(seed).threads(threads);
    let mut names = Names::new(pipeline);
    let mut traced = trace.map(|trace| move |event: &Event<'_>| trace.note(&mut names, event));
    let mut observers: Vec<&mut dyn Observer> = vec![&mut tally];
    observers.extend(traced.as_mut().map(|traced| traced as &mut dyn Observer));
    run_virtual(graph(pipeline), &options, observers)?;
    Ok(tally)
}
