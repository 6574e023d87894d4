//! Construction of an engine from a checked graph.

use std::collections::VecDeque;

use swerve_core::{Span, Time, digest_of};

use super::commits::Commits;
use super::due::{Due, Ready};
use super::node::{AtPort, LatestPort, Node, PortRef, Reader, ResourceState, StreamState, TimerPort};
use super::pool::{Doorbell, Pool};
use super::{Engine, Replay};
use crate::alarm::Pace;
use crate::deadline::Length;
use crate::graph::{BodySpec, Graph, OperatorSpec, ranks};
use crate::input::{PortSpec, Slot};
use crate::observer::{Observer, Watcher};
use crate::options::RunOptions;
use crate::policy::{Late, Policy};
use crate::report::{OperatorReport, RunError};
use crate::runtime::RuntimeModel;
use crate::stream::Edge;

impl<'o> Engine<'o> {
    pub(crate) fn new(
        graph: Graph,
        options: &RunOptions,
        replay: Option<Replay>,
        observers: Vec<&'o mut dyn Observer>,
        wall: Option<(Pace, Doorbell)>,
    ) -> Result<Self, RunError> {
        let order = ranks(&graph)?;
        let mut streams = streams(&graph);
        let mut rank_of = vec![0; order.len()];
        for (rank, index) in order.iter().enumerate() {
            rank_of[*index] = rank;
        }
        wire(&graph, &rank_of, &mut streams);
        let heavy = graph.operators.iter().any(|operator| operator.heavy);
        // In virtual time this thread is one of them; under wall clock it has to keep time.
        let threads = match (&wall, options.threads) {
            (None, threads) if threads > 1 => threads,
            (Some(_), threads) if heavy => threads.max(1),
            _ => 0,
        };
        let (wall, doorbell) = wall.unzip();
        let mut resources: Vec<ResourceState> = graph
            .resources
            .iter()
            .map(|resource| ResourceState { slots: resource.slots, users: Vec::new(), touched: false })
            .collect();
        for (rank, index) in order.iter().enumerate() {
            if let Some(id) = graph.operators[*index].uses {
                resources[id].users.push(rank);
            }
        }
        let names: Vec<_> = graph.streams.iter().map(|stream| stream.name.clone()).collect();
        let feedbacks: Vec<_> = graph.feedbacks.iter().map(|edge| edge.stream).collect();
        let stream_of = |edge: Edge| match edge {
            Edge::Stream(id) => id,
            Edge::Feedback(id) => {
                feedbacks[id].expect("the check saw that every edge that is read is connected")
            }
        };
        let mut specs: Vec<Option<OperatorSpec>> = graph.operators.into_iter().map(Some).collect();
        let specs = order.iter().map(|index| specs[*index].take().expect("each operator has one rank"));
        let mut nodes: Vec<Node> = specs.map(|spec| node(spec, &stream_of, &names)).collect();
        if replay.is_some() {
            // The records determine the duration of steps.
            nodes.iter_mut().for_each(|node| node.at_once = false);
        }
        let (due, ready) = (Due::new(nodes.len()), Ready::new(nodes.len()));
        let mut engine = Self {
            nodes,
            streams,
            resources,
            sources: graph.sources.iter().map(|index| rank_of[*index]).collect(),
            rank_of,
            due,
            ready,
            now: Time::ZERO,
            pass: 0,
            pool: (threads > 0).then(|| Pool::new(threads, doorbell)).transpose()?,
            one_worker: wall.is_some() || replay.as_ref().is_some_and(Replay::of_wall_clock),
            wall,
            seed: options.seed,
            replay,
            digest: Commits::new(),
            instants: 0,
            host_time: observers.iter().any(|observer| observer.wants_host_time()),
            observers: observers.into_iter().map(Watcher::Lent).collect(),
            stop: None,
            failure: None,
        };
        if engine.wall.is_some() {
            for node in engine.nodes.iter_mut().filter(|node| !node.timers.is_empty()) {
                node.lateness = Some(Box::default());
            }
        }
        (0..engine.nodes.len()).for_each(|rank| engine.rearm(rank));
        Ok(engine)
    }
}

fn streams(graph: &Graph) -> Vec<StreamState> {
    let state = |spec: &crate::graph::StreamSpec| StreamState {
        name: spec.name.clone(),
        key: digest_of(&*spec.name).0,
        payload: spec.payload,
        decode: spec.decode,
        watermark: Time::MIN,
        seq: 0,
        delay: graph.operators[spec.producer].delay,
        readers: Vec::new(),
        history: VecDeque::new(),
        depth: 0,
    };
    graph.streams.iter().map(state).collect()
}

/// Sets the joining readers of every stream, and the number of messages that other readers need.
fn wire(graph: &Graph, rank_of: &[usize], streams: &mut [StreamState]) {
    for (operator, rank) in graph.operators.iter().zip(rank_of) {
        let mut joins = 0;
        for port in &operator.ports {
            match *port {
                PortSpec::At(id) => {
                    streams[id].readers.push(Reader { rank: *rank, port: joins });
                    joins += 1;
                }
                PortSpec::Latest { edge, depth, .. } => {
                    let id = graph
                        .stream_of(edge)
                        .expect("the check saw that every edge that is read is connected");
                    streams[id].depth = streams[id].depth.max(depth);
                }
                PortSpec::Timer(_) => {}
            }
        }
        if let Some(Length::Policy(edge, _)) = operator.deadline.map(|deadline| deadline.length) {
            let id = graph.stream_of(edge).expect("the check saw that every edge that is read is connected");
            streams[id].depth = streams[id].depth.max(1);
        }
    }
}

fn node(spec: OperatorSpec, stream_of: &impl Fn(Edge) -> usize, names: &[std::sync::Arc<str>]) -> Node {
    let (mut at, mut timers, mut latest) = (Vec::new(), Vec::new(), Vec::new());
    let (mut order, mut reads) = (Vec::new(), Vec::new());
    for port in &spec.ports {
        match *port {
            PortSpec::At(id) => {
                order.push(PortRef::At(at.len()));
                reads.push(names[id].clone());
                let (queue, pending) = (VecDeque::new(), VecDeque::new());
                at.push(AtPort { watermark: Time::MIN, queue, fresh: 0, pending });
            }
            PortSpec::Timer(timer) => {
                order.push(PortRef::Timer(timers.len()));
                let next = Time::ZERO + timer.phase;
                let watermark = next.saturating_add(Span::from_ns(-1));
                timers.push(TimerPort { timer, next, ticking: false, watermark });
            }
            PortSpec::Latest { edge, depth, show } => {
                order.push(PortRef::Latest(latest.len()));
                let stream = stream_of(edge);
                reads.push(names[stream].clone());
                latest.push(LatestPort {
                    stream,
                    depth,
                    show,
                    read: None,
                    feedback: matches!(edge, Edge::Feedback(_)),
                });
            }
        }
    }
    let (body, on_deadline, feed) = match spec.body {
        BodySpec::Operator(body, on_deadline) => (Some(body), Some(on_deadline), None),
        BodySpec::Feed(records) => (None, None, Some(records.into())),
    };
    let is_plain = spec.deadline.is_none() && spec.uses.is_none() && !spec.heavy && feed.is_none();
    let puts_off = matches!(spec.policy, Policy::Pipelined { late: Late::PutOff(_), .. });
    Node {
        at_once: is_plain && !puts_off && matches!(spec.runtime, RuntimeModel::Zero) && timers.is_empty(),
        slots: order.iter().map(|_| Slot::Empty).collect(),
        tally: OperatorReport { name: spec.name.to_string(), ..OperatorReport::default() },
        name: spec.name,
        body,
        on_deadline,
        spares: spec.spares.into(),
        feed,
        held: spec.held.into(),
        at,
        timers,
        latest,
        order,
        reads: reads.into(),
        streams: spec.streams,
        runtime: spec.runtime,
        policy: spec.policy,
        deadline: spec.deadline,
        next_deadline: Time::MAX,
        policy_stream: match spec.deadline.map(|deadline| deadline.length) {
            Some(Length::Policy(edge, _)) => Some(stream_of(edge)),
            _ => None,
        },
        uses: spec.uses,
        origin: spec.origin,
        heavy: spec.heavy,
        spare_reads: Vec::new(),
        open: VecDeque::new(),
        complete: 0,
        running: VecDeque::new(),
        floor: Time::MIN,
        came_out: None,
        last: None,
        promised: VecDeque::new(),
        since: None,
        unsettled: false,
        lateness: None,
    }
}
