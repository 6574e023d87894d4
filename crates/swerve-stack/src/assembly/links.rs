//! Streams that each port reads, and the resulting order of operators.

use std::collections::BTreeSet;
use std::sync::Arc;

use swerve_flow::{PayloadType, PortInfo};
use swerve_text::is_within;

use super::{Edge, Placed};
use crate::base;
use crate::config::Reads;
use crate::kind::{OperatorKind, Settings};
use crate::problems::{KeyProblems, one_of};
use crate::setup::Setup;

/// Links every operator to the streams that it reads, leaves out sensors without readers, and sorts the rest so that
/// every operator comes after the publishers of the same-instant messages that it reads.
pub(super) fn link(operators: &mut Vec<Placed>, setup: &Setup, problems: &mut KeyProblems) {
    let streams = streams(operators);
    let is_whole = problems.is_empty();
    let mut wrong: Vec<(String, Vec<Wrong>)> = Vec::new();
    for placed in operators.iter_mut() {
        let mut own = KeyProblems::new();
        let said = said(placed, setup, &mut own);
        let mut own: Vec<Wrong> = own.into_iter().map(Wrong::Said).collect();
        for input in &mut placed.inputs {
            let named = said.iter().find(|(port, _)| *port == input.port.name).map(|(_, reads)| reads);
            if named
                .is_some_and(|reads| reads.each().iter().any(|(stream, ..)| is_reported(stream, problems)))
            {
                continue;
            }
            match edges((&placed.name, setup), &input.port, named, &streams) {
                Ok(edges) => input.from = edges,
                Err(problem) => own.push(problem),
            }
        }
        wrong.push((placed.name.clone(), own));
    }
    leave_out_unread(operators, setup);
    let is_there = |name: &String| operators.iter().any(|placed| placed.name == *name);
    let wrong: Vec<Wrong> =
        wrong.into_iter().filter(|(name, _)| is_there(name)).flat_map(|(_, own)| own).collect();
    report(wrong, is_whole, setup, problems);
    if problems.is_empty() {
        sort(operators, problems);
    }
}

/// Returns true if a problem is already reported for the operator of this stream.
fn is_reported(stream: &str, problems: &KeyProblems) -> bool {
    let operator = stream.split('.').next().unwrap_or_default();
    problems.iter().any(|(key, _)| is_within(key, &format!("operator.{operator}")))
}

/// Operator with `enabled = false` that would publish messages of this type.
fn left_out(payload: PayloadType, setup: &Setup) -> Option<String> {
    let mut entries = base::entries(setup).into_iter().filter(|(_, own)| own.enabled == Some(false));
    let publishes = |(name, own): &(String, crate::config::OperatorConfig)| {
        let settings = Settings { name, setup, offered: &[] };
        let kind = own.kind.as_deref().and_then(|kind| setup.registry.kind(kind));
        kind.is_some_and(|kind| kind.outputs(&settings).iter().any(|port| port.payload == payload))
    };
    entries.find(publishes).map(|(name, _)| name)
}

/// End of an error message about a type that nothing publishes: kinds that would publish it, and the keys that add
/// them.
fn who_would(payload: PayloadType, setup: &Setup) -> String {
    let would = |kind: &Arc<dyn OperatorKind>| {
        let node = kind.node();
        let settings = Settings { name: node.kind, setup, offered: &[] };
        let publishes = kind.outputs(&settings).iter().any(|port| port.payload == payload);
        // A kind that makes them from messages of the same type needs those first.
        if !publishes || kind.inputs(&settings).iter().any(|port| port.payload == Some(payload)) {
            return None;
        }
        let entry = || {
            node.table_of_each().map_or_else(
                || format!("[operator.NAME] kind = \"{}\"", node.kind),
                |table| format!("[{table}.NAME]"),
            )
        };
        match (kind.is_there(&settings), node.only_with) {
            (true, _) => Some(entry()),
            (false, Some(setting)) => Some(setting.to_owned()),
            (false, None) => None,
        }
    };
    let ways: Vec<String> = setup.registry.kinds().filter_map(would).map(|way| format!("`{way}`")).collect();
    match ways.is_empty() {
        true => ": a custom operator can (`swerve operators` lists the available kinds)".to_owned(),
        false => format!(": {} adds one that does, or a custom operator", ways.join(" or ")),
    }
}

/// A problem of an operator's port.
enum Wrong {
    /// A problem of a given setting.
    Said((String, String)),
    /// The input of a port is not given, and none or several streams would fit: their operators and names.
    Unsaid { operator: String, port: String, payload: PayloadType, fits: Vec<(String, String)> },
}

/// Reports the problems of ports. A missing input is not reported where operators are missing for another reason. A
/// stream that the configuration adds to one already there is reported once rather than for every reader.
fn report(wrong: Vec<Wrong>, is_whole: bool, setup: &Setup, problems: &mut KeyProblems) {
    let mut added: Vec<(String, PayloadType, Vec<String>, Vec<String>)> = Vec::new();
    for wrong in wrong {
        let (operator, port, payload, fits) = match wrong {
            Wrong::Said(problem) => {
                problems.push(problem);
                continue;
            }
            Wrong::Unsaid { operator, port, payload, fits } if is_whole => (operator, port, payload, fits),
            Wrong::Unsaid { .. } => continue,
        };
        let names: Vec<String> = fits.iter().map(|(_, stream)| format!("\"{stream}\"")).collect();
        let is_new = |name: &str| setup.operator.get(name).is_some_and(|own| own.kind.is_some());
        let reader = format!("[operator.{operator}] reads = {{ {port} = \"...\" }}");
        if fits.is_empty() {
            problems.push(match left_out(payload, setup) {
                Some(name) => {
                    let message =
                        format!("`{operator}` reads `{payload}`, which no other operator publishes");
                    (format!("operator.{name}.enabled"), message)
                }
                None => {
                    let message = format!(
                        "reads `{payload}`, which no operator publishes{}",
                        who_would(payload, setup)
                    );
                    (format!("operator.{operator}.reads.{port}"), message)
                }
            });
        } else if let Some((new, _)) = fits.iter().find(|(name, _)| is_new(name)) {
            match added.iter_mut().find(|(by, of, ..)| by == new && *of == payload) {
                Some((.., readers)) => readers.push(reader),
                None => added.push((new.clone(), payload, names, vec![reader])),
            }
        } else {
            let message = format!("several streams carry `{payload}`: name one of {}", names.join(", "));
            problems.push((format!("operator.{operator}.reads.{port}"), message));
        }
    }
    problems.extend(added.into_iter().map(|(new, payload, names, readers)| {
        let message = format!(
            "several streams carry `{payload}`: name one of {} in {}",
            names.join(", "),
            readers.join(", ")
        );
        (format!("operator.{new}"), message)
    }));
}

/// A stream that ports may read.
struct Offer {
    operator: String,
    stream: String,
    payload: PayloadType,
    /// True for the first stream of its operator, which can also be named by the operator.
    first: bool,
    silent: bool,
    /// Reason that it never carries data; `None` if it does.
    empty: Option<String>,
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
            empty: output.empty.clone(),
        };
        outputs.map(offer).collect()
    };
    operators.iter().flat_map(of).collect()
}

/// Inputs given for an operator's ports: by its table, else by its settings.
fn said(placed: &Placed, setup: &Setup, problems: &mut KeyProblems) -> Vec<(String, Reads)> {
    let ports: Vec<&str> = placed.inputs.iter().map(|input| &*input.port.name).collect();
    let mut said: Vec<(String, Reads)> = Vec::new();
    for (port, reads) in &placed.own.reads {
        if ports.contains(&port.as_str()) {
            said.push((port.clone(), reads.clone()));
        } else if setup.operator.get(&placed.name).is_some_and(|own| own.reads.contains_key(port)) {
            // The pipeline's own text names ports that a kind may lack under these settings.
            let key = format!("operator.{}.reads.{port}", placed.name);
            problems.push((key, no_port(placed, port, setup)));
        }
    }
    for (port, stream) in placed.kind.reads(&placed.settings(setup)) {
        if !said.iter().any(|(known, _)| known == port) {
            said.push((port.to_owned(), Reads::Stream(stream)));
        }
    }
    said
}

/// Error message for the name of a port: it does not exist, or exists only where something publishes its type.
fn no_port(placed: &Placed, port: &str, setup: &Setup) -> String {
    let kind = placed.kind.node().kind;
    let offered = setup.registry.messages();
    let with_all = placed.kind.inputs(&Settings { offered: &offered, ..placed.settings(setup) });
    match with_all.iter().find(|info| info.name == port).and_then(|info| info.payload) {
        Some(payload) => {
            let ways = who_would(payload, setup);
            format!(
                "`{kind}` has this port where `{payload}` are published, and no operator publishes any{ways}"
            )
        }
        None => {
            let ports: Vec<&str> = placed.inputs.iter().map(|input| &*input.port.name).collect();
            format!("`{kind}` has no port of this name{}", one_of(port, &ports))
        }
    }
}

/// Edges of a port: from the streams named for it, else by its type.
fn edges(
    (operator, setup): (&str, &Setup),
    port: &PortInfo,
    named: Option<&Reads>,
    streams: &[Offer],
) -> Result<Vec<Edge>, Wrong> {
    let key = || format!("operator.{operator}.reads.{}", port.name);
    let Some(payload) = port.payload else {
        let timer = |_| Wrong::Said((key(), "a timer reads no stream".to_owned()));
        return named.map(timer).map_or(Ok(Vec::new()), Err);
    };
    if let Some(reads) = named {
        if !streams.iter().any(|offer| offer.payload == payload) {
            let message = format!(
                "expected a stream of `{payload}`, which no operator publishes{}",
                who_would(payload, setup)
            );
            return Err(Wrong::Said((key(), message)));
        }
        let edges = named_edges(port, payload, reads, streams)
            .map_err(|(last, message)| Wrong::Said((key() + last, message)))?;
        // Inputs set by another key are reported by the check of that key.
        let is_own = setup.operator.get(operator).is_some_and(|own| own.reads.contains_key(&*port.name));
        let is_read = |offer: &&Offer| edges.iter().any(|edge| edge.stream == offer.stream);
        return match streams.iter().filter(is_read).find_map(|offer| Some((offer, offer.empty.as_ref()?))) {
            Some((offer, why)) if is_own => {
                Err(Wrong::Said((key(), format!("`{}` holds nothing: {why}", offer.stream))))
            }
            _ => Ok(edges),
        };
    }
    let edge = |offer: &Offer| Edge { stream: offer.stream.clone(), feedback: port.feedback, raw: port.raw };
    let fits = streams
        .iter()
        .filter(|offer| offer.payload == payload && !offer.silent && offer.operator != operator);
    let fits: Vec<&Offer> = fits.collect();
    match &fits[..] {
        offers if port.many => Ok(offers.iter().map(|offer| edge(offer)).collect()),
        [offer] => Ok(vec![edge(offer)]),
        [] if port.optional => Ok(Vec::new()),
        several => {
            let fits = several.iter().map(|offer| (offer.operator.clone(), offer.stream.clone())).collect();
            Err(Wrong::Unsaid { operator: operator.to_owned(), port: port.name.to_string(), payload, fits })
        }
    }
}

/// Edges from the streams named for a port, or the problem with the end of its key.
fn named_edges(
    port: &PortInfo,
    payload: PayloadType,
    reads: &Reads,
    streams: &[Offer],
) -> Result<Vec<Edge>, (&'static str, String)> {
    let mut found = Vec::new();
    for (name, feedback, raw) in reads.each() {
        let offer = named_stream(name, payload, streams).map_err(|message| ("", message))?;
        let feedback = feedback.unwrap_or(port.feedback);
        if feedback && !port.mode.reads_feedback() {
            let message = format!(
                "expected false: `{}` reads the message of its frame's stamp; a port that reads the newest one closes a loop",
                port.name
            );
            return Err((".feedback", message));
        }
        found.push(Edge { stream: offer.stream.clone(), feedback, raw: raw.unwrap_or(port.raw) });
    }
    match found.len() {
        n if n != 1 && !port.many => Err(("", format!("expected one stream, found {n}"))),
        _ => Ok(found),
    }
}

/// Stream of this name, or the first stream of the operator of this name.
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

/// Leaves out on-demand operators that nothing reads or asks for.
fn leave_out_unread(operators: &mut Vec<Placed>, setup: &Setup) {
    loop {
        let read: BTreeSet<&str> = operators
            .iter()
            .flat_map(|placed| &placed.inputs)
            .flat_map(|input| input.from.iter().map(|edge| edge.stream.as_str()))
            .collect();
        let is_wanted = |placed: &Placed| {
            !placed.kind.node().on_demand
                || setup.live.is_some()
                || setup.log.sensors.contains(&placed.name)
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

/// Repeatedly takes the first operator whose inputs are all available; an order that is already right is kept.
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
