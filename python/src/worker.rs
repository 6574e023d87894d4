//! Operators written in Python, in a separate process.
//!
//! The coordinator of a run has started this process and calls it for the steps of its operators. Inputs of an operator
//! are plain Python values, with numbers of images and point clouds read in place; outputs are returned in CBOR and
//! checked against the type of their stream.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use swerve_core::{Span, Time};
use swerve_drive::Referee;
use swerve_drive::process::run_worker_with;
use swerve_flow::{
    AnyInput, AnyMessage, AnyOperator, AnyOutputs, Context, Graph, Header, InputKind, OperatorInfo,
};
use swerve_ipc::WorkerSetup;
use swerve_msg::block::reading_plainly;
use swerve_stack::Setup;
use swerve_stack::pipeline::Pipeline;

use crate::convert::{cbor, error};
use crate::map::Lanes;
use crate::numbers;
use crate::start::facts;
use crate::world::PythonWorld;

/// An operator whose steps are taken in Python.
struct PythonOperator {
    /// Called with the facts of a frame and its inputs; returns the units of work, and an output or `None` for each port.
    step: Py<PyAny>,
    /// True for the ports that are timers.
    timers: Vec<bool>,
}

impl AnyOperator for PythonOperator {
    fn step(&mut self, cx: &mut Context<'_>, inputs: Vec<AnyInput>, out: &mut AnyOutputs<'_>) {
        let stepped = Python::attach(|py| {
            let answer = self.call(py, cx, &inputs).and_then(|answer| {
                let (units, outputs): (u64, Bound<'_, PyAny>) = answer.extract()?;
                cx.spend(units);
                send(py, &outputs, out)
            });
            answer.map_err(|error| with_traceback(py, &error))
        });
        if let Err(why) = stepped {
            // Reported to the run as this operator's panic, without a panic message here.
            std::panic::resume_unwind(Box::new(why));
        }
    }
}

impl PythonOperator {
    fn call<'py>(
        &self,
        py: Python<'py>,
        cx: &Context<'_>,
        inputs: &[AnyInput],
    ) -> PyResult<Bound<'py, PyAny>> {
        let facts = PyDict::new(py);
        facts.set_item("operator", cx.name())?;
        facts.set_item("now", cx.now().ns())?;
        facts.set_item("stamp", cx.stamp().ns())?;
        facts.set_item("deadline", cx.deadline().map(Time::ns))?;
        let ports = PyList::empty(py);
        for (input, _) in inputs.iter().zip(&self.timers).filter(|(_, timer)| !**timer) {
            let messages: &[AnyMessage] = match input {
                AnyInput::Tick | AnyInput::Nothing => &[],
                AnyInput::Message(message) => core::slice::from_ref(message),
                AnyInput::Window(messages) => messages,
            };
            let list = PyList::empty(py);
            for message in messages {
                list.append((header(py, &message.header)?, numbers::plain(py, message)?))?;
            }
            ports.append(list)?;
        }
        self.step.bind(py).call1((facts, ports))
    }
}

fn header<'py>(py: Python<'py>, header: &Header) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    dict.set_item("stamp", header.stamp.ns())?;
    dict.set_item("visible_at", header.visible_at.ns())?;
    dict.set_item("seq", header.seq)?;
    dict.set_item("watermark", header.watermark.ns())?;
    dict.set_item("reused_from", header.reused_from.map(Time::ns))?;
    dict.set_item("origin", header.origin.map(Time::ns))?;
    Ok(dict)
}

/// Publishes the result of a step: a list with a plain value or `None` for each port.
fn send(py: Python<'_>, answer: &Bound<'_, PyAny>, out: &mut AnyOutputs<'_>) -> PyResult<()> {
    for (port, value) in answer.try_iter()?.enumerate() {
        let value = value?;
        if value.is_none() {
            continue;
        }
        let bytes = cbor(&value)?;
        // The values are plain, also of images and point clouds, although the step's inputs are not.
        let sent = py.detach(|| reading_plainly(|| out.send_cbor(port, &bytes)));
        sent.map_err(|error| PyValueError::new_err(error.to_string()))?;
    }
    Ok(())
}

/// An exception with its traceback.
pub(crate) fn with_traceback(py: Python<'_>, error: &PyErr) -> String {
    let trace = error.traceback(py).and_then(|trace| trace.format().ok()).unwrap_or_default();
    format!("{error}\n{trace}").trim_end().to_owned()
}

/// Name of a port if declared in the configuration, its mode, its stream, the type of its messages.
type Read = (Option<String>, String, String, String);

/// Inputs of an operator, without timers.
fn inputs(graph: &Graph, operator: &OperatorInfo, names: Vec<String>) -> Vec<Read> {
    let mut names = names.into_iter();
    let mut of = |input: &swerve_flow::InputInfo| {
        let stream = input.stream.clone()?;
        let kind = match input.kind {
            InputKind::At => "at".to_owned(),
            InputKind::Latest { depth: 1, .. } => "latest".to_owned(),
            InputKind::Latest { depth, .. } => format!("window({depth})"),
            InputKind::Every { .. } => return None,
        };
        let type_name = graph.stream(&stream)?.payload().full_name.to_owned();
        Some((names.next(), kind, stream, type_name))
    };
    operator.inputs.iter().filter_map(&mut of).collect()
}

/// Outputs of an operator: name of the port if declared in the configuration, stream, type of its messages.
fn outputs(operator: &OperatorInfo, names: Vec<String>) -> Vec<(Option<String>, String, String)> {
    let mut names = names.into_iter();
    let of = |(stream, type_name): &(String, String)| (names.next(), stream.clone(), type_name.clone());
    operator.outputs.iter().map(of).collect()
}

/// Period of the timer of an operator, nanoseconds; zero without a timer.
fn period_ns(operator: &OperatorInfo) -> i64 {
    let period = |input: &swerve_flow::InputInfo| match input.kind {
        InputKind::Every { period_ns, .. } => Some(period_ns),
        _ => None,
    };
    operator.inputs.iter().find_map(period).unwrap_or(0)
}

/// A process of a run.
struct Process<'a> {
    setup: &'a WorkerSetup,
    config: &'a Setup,
    /// Creates the step of an operator.
    make: &'a Py<PyAny>,
}

impl Process<'_> {
    /// Puts the steps of the process's operators into its graph.
    fn prepare(&self, pipeline: Pipeline) -> anyhow::Result<Graph> {
        let Pipeline { mut graph, assembly, scenario, route, vehicle, until, .. } = pipeline;
        let (lanes, start) = Python::attach(|py| {
            let lanes = Py::new(py, Lanes::from(scenario.road.map()))?;
            let of = (self.config, &*self.setup.process);
            let start = facts(py, of, (&scenario, &route, &vehicle))?;
            Ok::<_, PyErr>((lanes, start.unbind()))
        })?;
        let described = graph.describe()?;
        for name in &self.setup.operators {
            let Some(operator) = described.operators.iter().find(|operator| operator.name == *name) else {
                continue;
            };
            let declared = assembly.operator(name).filter(|placed| placed.kind.node().elsewhere);
            let kind = declared.map_or("", |placed| placed.kind.node().kind);
            let ports = declared.into_iter().flat_map(|placed| &placed.inputs).map(|input| &input.port);
            let read =
                ports.filter(|port| port.payload.is_some()).map(|port| port.name.to_string()).collect();
            let published = declared.into_iter().flat_map(|placed| &placed.outputs);
            let published = published.map(|output| output.port.name.to_string()).collect();
            let (inputs, outputs) = (inputs(&graph, operator, read), outputs(operator, published));
            let timers = operator.inputs.iter().map(|input| input.stream.is_none()).collect();
            let step = Python::attach(|py| {
                let about = (kind, period_ns(operator), &lanes, &start);
                self.make
                    .call1(py, (name.as_str(), inputs, outputs, about))
                    .map_err(|error| with_traceback(py, &error))
            });
            let step = step.map_err(anyhow::Error::msg)?;
            if Python::attach(|py| step.is_none(py)) {
                continue;
            }
            if kind == "python_world" {
                let period = Span::from_ns(period_ns(operator));
                let (scenario, route) = (scenario.clone(), route.clone());
                let referee = Referee::new(vehicle.shape);
                graph.replace(name, PythonWorld { step, referee, scenario, route, period, until })?;
                continue;
            }
            graph.replace(name, PythonOperator { step, timers })?;
        }
        Ok(graph)
    }
}

/// Takes steps until the run that started this process ends. `make` is called once for each operator, with its name,
/// inputs (port, mode, stream, Rust type), outputs (port, stream, Rust type), and its kind, period in nanoseconds, the lanes
/// of the scenario and the facts of the drive. It returns the function called for each frame, or `None` for an operator of
/// the stack that calls an algorithm. Ports have names if the configuration declares them, and so has the kind.
/// `algorithms` creates those algorithms, by their role.
#[pyfunction]
pub(crate) fn work(py: Python<'_>, make: Py<PyAny>, algorithms: &Bound<'_, PyDict>) -> PyResult<()> {
    let registry = swerve::Registry::standard().with_foreign(&crate::algorithms::foreign(algorithms)?);
    let prepare = |setup: &WorkerSetup, config: &Setup, pipeline: Pipeline| {
        Process { setup, config, make: &make }.prepare(pipeline)
    };
    py.detach(|| run_worker_with(&registry, prepare)).map_err(error)
}
