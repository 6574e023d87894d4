//! Which port reads which stream, and the order of operators that follows.

use std::collections::BTreeSet;

use swerve_flow::{PayloadType, PortInfo};

use super::{Edge, Placed, one_of};
use crate::config::{Config, Reads};
use crate::kind::KeyProblems;

/// Finds what every operator reads, leaves out sensors that nobody reads, and puts the others in an order in which
/// everybody comes behind those whose messages of the same instant it reads.
pub(super) fn link(operators: &mut Vec<Placed>, config: &Config, problems: &mut KeyProblems) {
    let streams = streams(operators);
    let mut wrong: Vec<(String, KeyProblems)> = Vec::new();
    for placed in operators.iter_mut() {
        let mut own = KeyProblems::new();
        let said = said(placed, config, &mut own);
        for input in &mut placed.inputs {
            let named = said.iter().find(|(port, _)| port == input.port.name).map(|(_, reads)| reads);
            match edges(&placed.name, &input.port, named, &streams) {
                Ok(edges) => input.from = edges,
                Err(problem) => own.push(problem),
            }
        }
        wrong.push((placed.name.clone(), own));
    }
    leave_out_unread(operators, config);
    let is_there = |name: &String| operators.iter().any(|placed| placed.name == *name);
    problems.extend(wrong.into_iter().filter(|(name, _)| is_there(name)).flat_map(|(_, own)| own));
    if problems.is_empty() {
        sort(operators, problems);
    }
}

/// A stream, as somebody may read it.
struct Offer {
    operator: String,
    stream: String,
    payload: PayloadType,
    /// The first of its operator, which goes by the operator's name too.
    first: bool,
    silent: bool,
}

fn streams(operators: &[Placed]) -> Vec<Offer> {
    let of = |placed: &Placed| -> Vec<Offer> {
        let outputs = placed.outputs.iter().enumerate();
        let offer = |(k, output): (usize, &super::Output)| Offer {
            operator: placed.name.clone(),
            stream: output.stream.clone(),
            payload: output.port.payload,
            first: k == 0,
            silent: output.silent,
        };
        outputs.map(offer).collect()
    };
    operators.iter().flat_map(of).collect()
}

/// What is said of an operator's ports: in its table, else by its settings.
fn said(placed: &Placed, config: &Config, problems: &mut KeyProblems) -> Vec<(String, Reads)> {
    let ports: Vec<&str> = placed.inputs.iter().map(|input| input.port.name).collect();
    let mut said: Vec<(String, Reads)> = Vec::new();
    for (port, reads) in &placed.own.reads {
        if ports.contains(&port.as_str()) {
            said.push((port.clone(), reads.clone()));
        } else if config.operator.get(&placed.name).is_some_and(|own| own.reads.contains_key(port)) {
            // What the pipeline's own text says is for whichever of its ports a kind has under these settings.
            let (key, kind) = (format!("operator.{}.reads.{port}", placed.name), placed.kind.node().kind);
            problems.push((key, format!("`{kind}` has no port of this name{}", one_of(port, &ports))));
        }
    }
    for (port, stream) in placed.kind.reads(&placed.settings(config)) {
        if !said.iter().any(|(known, _)| known == port) {
            said.push((port.to_owned(), Reads::Stream(stream)));
        }
    }
    said
}

/// What a port reads: as it was named, else by its type.
fn edges(
    operator: &str,
    port: &PortInfo,
    named: Option<&Reads>,
    streams: &[Offer],
) -> Result<Vec<Edge>, (String, String)> {
    let Some(payload) = port.payload else { return Ok(Vec::new()) };
    let key = || format!("operator.{operator}.reads.{}", port.name);
    let edge = |stream: &str| Edge { stream: stream.to_owned(), feedback: port.feedback, raw: port.raw };
    if let Some(reads) = named {
        let found = reads.each().into_iter().map(|(name, feedback, raw)| {
            let offer = named_stream(name, payload, streams)?;
            let default = edge(&offer.stream);
            Ok(Edge {
                feedback: feedback.unwrap_or(default.feedback),
                raw: raw.unwrap_or(default.raw),
                ..default
            })
        });
        let found: Result<Vec<Edge>, String> = found.collect();
        let found = found.map_err(|message| (key(), message))?;
        return match found.len() {
            n if n != 1 && !port.many => Err((key(), format!("expected one stream, found {n}"))),
            _ => Ok(found),
        };
    }
    let fits = streams
        .iter()
        .filter(|offer| offer.payload == payload && !offer.silent && offer.operator != operator);
    let fits: Vec<&Offer> = fits.collect();
    match &fits[..] {
        offers if port.many => Ok(offers.iter().map(|offer| edge(&offer.stream)).collect()),
        [offer] => Ok(vec![edge(&offer.stream)]),
        [] if port.optional => Ok(Vec::new()),
        [] => Err((key(), format!("reads `{payload}`, and no operator of the pipeline publishes any"))),
        several => {
            let names: Vec<String> = several.iter().map(|offer| format!("\"{}\"", offer.stream)).collect();
            Err((key(), format!("several streams carry `{payload}`: name one of {}", names.join(", "))))
        }
    }
}

/// The stream of this name, or the first one of the operator of this name.
fn named_stream<'a>(name: &str, payload: PayloadType, streams: &'a [Offer]) -> Result<&'a Offer, String> {
    let exact = streams.iter().find(|offer| offer.stream == name);
    let Some(offer) = exact.or_else(|| streams.iter().find(|offer| offer.first && offer.operator == name))
    else {
        let fitting = streams.iter().filter(|offer| offer.payload == payload);
        let names: Vec<&str> = fitting.map(|offer| offer.stream.as_str()).collect();
        return Err(format!("unknown stream `{name}`{}", one_of(name, &names)));
    };
    if offer.payload != payload {
        return Err(format!(
            "expected a stream of `{payload}`, found `{}` of `{}`",
            offer.stream, offer.payload
        ));
    }
    Ok(offer)
}

/// Leaves out what runs on demand and is not asked for.
fn leave_out_unread(operators: &mut Vec<Placed>, config: &Config) {
    loop {
        let read: BTreeSet<&str> = operators
            .iter()
            .flat_map(|placed| &placed.inputs)
            .flat_map(|input| input.from.iter().map(|edge| edge.stream.as_str()))
            .collect();
        let is_wanted = |placed: &Placed| {
            !placed.kind.node().on_demand
                || config.live.is_some()
                || config.log.sensors.contains(&placed.name)
                || placed.outputs.iter().any(|output| read.contains(output.stream.as_str()))
        };
        let kept: Vec<bool> = operators.iter().map(is_wanted).collect();
        if kept.iter().all(|kept| *kept) {
            return;
        }
        let mut kept = kept.into_iter();
        operators.retain(|_| kept.next().unwrap_or(true));
    }
}

/// Always takes the first one all of whose inputs are there; an order that is right already stays.
fn sort(operators: &mut Vec<Placed>, problems: &mut KeyProblems) {
    let mut rest: Vec<Placed> = core::mem::take(operators);
    let mut there: BTreeSet<String> = BTreeSet::new();
    while !rest.is_empty() {
        let is_ready = |placed: &Placed| {
            let edges = placed.inputs.iter().flat_map(|input| &input.from);
            edges.filter(|edge| !edge.feedback).all(|edge| there.contains(&edge.stream))
        };
        let Some(next) = rest.iter().position(is_ready) else {
            let names: Vec<&str> = rest.iter().map(|placed| placed.name.as_str()).collect();
            let message = format!(
                "a cycle without a feedback edge goes through {}: `reads = {{ PORT = {{ stream = \"...\", feedback = true }} }}` closes one",
                names.join(", ")
            );
            problems.push((format!("operator.{}.reads", rest[0].name), message));
            return operators.append(&mut rest);
        };
        let placed = rest.remove(next);
        there.extend(placed.outputs.iter().map(|output| output.stream.clone()));
        operators.push(placed);
    }
}
