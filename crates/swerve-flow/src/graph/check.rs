//! Check of a whole graph before its first step, and the ranks that result from it.

use std::collections::BTreeSet;

use swerve_core::Span;

use super::{BodySpec, Graph, OperatorSpec};
use crate::deadline::Length;
use crate::error::GraphError;
use crate::input::PortSpec;
use crate::policy::Policy;
use crate::stream::Edge;

/// Checks the graph; returns its operators in rank order.
pub(crate) fn ranks(graph: &Graph) -> Result<Vec<usize>, GraphError> {
    if let Some(problem) = graph.problems.first() {
        return Err(problem.clone());
    }
    check_names(graph)?;
    check_feedback(graph)?;
    check_resources(graph)?;
    graph.operators.iter().try_for_each(|operator| check_operator(graph, operator))?;
    order(graph)
}

fn check_names(graph: &Graph) -> Result<(), GraphError> {
    let mut operators = BTreeSet::new();
    let mut streams = BTreeSet::new();
    let twice = graph
        .operators
        .iter()
        .map(|operator| &operator.name)
        .find(|name| !operators.insert((*name).clone()))
        .or_else(|| {
            graph.streams.iter().map(|stream| &stream.name).find(|name| !streams.insert((*name).clone()))
        });
    match twice {
        Some(name) => Err(GraphError::DuplicateName { name: name.to_string() }),
        None => Ok(()),
    }
}

fn check_feedback(graph: &Graph) -> Result<(), GraphError> {
    let readers_of = |id| {
        let reads = move |operator: &&OperatorSpec| {
            let reads = |port: &PortSpec| matches!(port, PortSpec::Latest { edge, .. } if *edge == Edge::Feedback(id));
            operator.ports.iter().any(reads) || operator.policy_edge() == Some(Edge::Feedback(id))
        };
        graph.operators.iter().filter(reads).map(|operator| operator.name.to_string()).collect::<Vec<_>>()
    };
    for (id, edge) in graph.feedbacks.iter().enumerate() {
        let readers = readers_of(id);
        if edge.stream.is_none() && !readers.is_empty() {
            return Err(GraphError::Unconnected { feedback: edge.name.clone(), readers });
        }
    }
    Ok(())
}

fn check_resources(graph: &Graph) -> Result<(), GraphError> {
    for (id, resource) in graph.resources.iter().enumerate() {
        if resource.slots == 0 {
            let users = graph.operators.iter().filter(|operator| operator.uses == Some(id));
            let users = users.map(|operator| operator.name.to_string()).collect();
            return Err(GraphError::NoSlots { resource: resource.name.clone(), users });
        }
    }
    Ok(())
}

fn check_operator(graph: &Graph, operator: &OperatorSpec) -> Result<(), GraphError> {
    let name = || operator.name.to_string();
    let handles = operator.ports.iter().all(|port| match *port {
        PortSpec::At(id) => id < graph.streams.len(),
        PortSpec::Latest { edge, .. } => graph.stream_of(edge).is_some_and(|id| id < graph.streams.len()),
        PortSpec::Timer(_) => true,
    });
    let policy = operator
        .policy_edge()
        .is_none_or(|edge| graph.stream_of(edge).is_some_and(|id| id < graph.streams.len()));
    if !handles || !policy || operator.uses.is_some_and(|id| id >= graph.resources.len()) {
        return Err(GraphError::ForeignHandle { operator: name() });
    }
    if matches!(operator.body, BodySpec::Feed(_)) {
        return Ok(());
    }
    if !operator.ports.iter().any(|port| matches!(port, PortSpec::At(_) | PortSpec::Timer(_))) {
        return Err(GraphError::NeverFires { operator: name() });
    }
    match problem_of(operator) {
        Some(reason) => Err(GraphError::Value { operator: name(), reason }),
        None => Ok(()),
    }
}

impl OperatorSpec {
    /// Edge from which the length of the deadline is read, if any.
    fn policy_edge(&self) -> Option<Edge> {
        match self.deadline?.length {
            Length::Policy(edge, _) => Some(edge),
            Length::Static(_) => None,
        }
    }
}

fn problem_of(operator: &OperatorSpec) -> Option<&'static str> {
    for port in &operator.ports {
        match port {
            PortSpec::Timer(timer) if timer.period <= Span::ZERO => {
                return Some("the period of a timer has to be above zero");
            }
            PortSpec::Timer(timer) if timer.phase < Span::ZERO => {
                return Some("the phase of a timer must not be below zero");
            }
            PortSpec::Latest { depth: 0, .. } => return Some("a window has to hold at least one message"),
            _ => {}
        }
    }
    match operator.policy {
        Policy::Queue { capacity: 0, .. } => return Some("a queue has to hold at least one frame"),
        Policy::Pipelined { places: 0, .. } => return Some("a pipeline has to have at least one place"),
        _ => {}
    }
    if operator.delay < Span::ZERO {
        return Some("a communication delay must not be below zero");
    }
    if let Some(Length::Static(length)) = operator.deadline.map(|deadline| deadline.length)
        && length <= Span::ZERO
    {
        return Some("a deadline has to be above zero");
    }
    operator.runtime.problem()
}

/// Ranks are given one by one, each time to the operator added first whose inputs all have one.
fn order(graph: &Graph) -> Result<Vec<usize>, GraphError> {
    let n = graph.operators.len();
    let mut ranked = vec![false; n];
    let mut order = Vec::with_capacity(n);
    while order.len() < n {
        let ready = |i: &usize| !ranked[*i] && graph.upstream(&graph.operators[*i]).all(|up| ranked[up]);
        let Some(next) = (0..n).find(ready) else { return Err(cycle(graph, &ranked)) };
        ranked[next] = true;
        order.push(next);
    }
    Ok(order)
}

/// Walks upstream among the operators without a rank until one repeats.
fn cycle(graph: &Graph, ranked: &[bool]) -> GraphError {
    let mut path = Vec::new();
    let mut at = ranked.iter().position(|ranked| !ranked).expect("called when some operator has no rank");
    while !path.contains(&at) {
        path.push(at);
        at = graph
            .upstream(&graph.operators[at])
            .find(|up| !ranked[*up])
            .expect("an operator without rank waits for another one");
    }
    let start = path.iter().position(|i| *i == at).expect("the walk ended on its own path");
    let circle = path[start..].iter().rev().chain(path.last());
    GraphError::Cycle { operators: circle.map(|i| graph.operators[*i].name.to_string()).collect() }
}
