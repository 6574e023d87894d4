//! Operators written in Python, in a separate process.
//!
//! The coordinator of a run has started this process and calls it for the steps of its operators. Inputs of an operator
//! are plain Python values, with numbers of images and point clouds read in place; outputs are returned in CBOR and
//! checked against the type of their stream.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use swerve_core::Time;
use swerve_drive::process::run_worker_with;
use swerve_flow::{
    AnyInput, AnyMessage, AnyOperator, AnyOutputs, Context, Graph, Header, InputKind, OperatorInfo,
};
use swerve_ipc::WorkerSetup;
use swerve_stack::pipeline::Pipeline;

use crate::convert::{cbor, error};
use crate::map::Lanes;
use crate::numbers;

/// An operator whose steps are taken in Python.
struct PythonOperator {
    /// Called with the facts of a frame and its inputs; returns an output or `None` for each port.
    step: Py<PyAny>,
    /// True for the ports that are timers.
    timers: Vec<bool>,
}

impl AnyOperator for PythonOperator {
    fn step(&mut self, cx: &mut Context<'_>, inputs: Vec<AnyInput>, out: &mut AnyOutputs<'_>) {
        let stepped = Python::attach(|py| {
            let outputs = self.call(py, cx, &inputs).and_then(|answer| send(py, &answer, out));
            outputs.map_err(|error| with_traceback(py, &error))
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
        let sent = py.detach(|| out.send_cbor(port, &bytes));
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

/// Takes steps until the run that started this process ends. `make` is called once for each operator, with its name,
/// inputs (port, mode, stream, Rust type), outputs (port, stream, Rust type) and the lanes of the scenario, and returns
/// the function called for each frame, or `None` for an operator of the stack that calls an algorithm. Ports have names if the configuration
/// declares them. `algorithms` creates those algorithms, by their role.
#[pyfunction]
pub(crate) fn work(py: Python<'_>, make: Py<PyAny>, algorithms: &Bound<'_, PyDict>) -> PyResult<()> {
    let registry = swerve::Registry::standard().with_foreign(&crate::algorithms::foreign(algorithms)?);
    let prepare = |setup: &WorkerSetup, pipeline: Pipeline| {
        let Pipeline { mut graph, assembly, scenario, .. } = pipeline;
        let lanes = Python::attach(|py| Py::new(py, Lanes::from(scenario.road.map())))?;
        let described = graph.describe()?;
        for name in &setup.operators {
            let Some(operator) = described.operators.iter().find(|operator| operator.name == *name) else {
                continue;
            };
            let declared = assembly.operator(name).filter(|placed| placed.kind.node().elsewhere);
            let ports = declared.into_iter().flat_map(|placed| &placed.inputs).map(|input| &input.port);
            let read =
                ports.filter(|port| port.payload.is_some()).map(|port| port.name.to_string()).collect();
            let published = declared.into_iter().flat_map(|placed| &placed.outputs);
            let published = published.map(|output| output.port.name.to_string()).collect();
            let (inputs, outputs) = (inputs(&graph, operator, read), outputs(operator, published));
            let timers = operator.inputs.iter().map(|input| input.stream.is_none()).collect();
            let step = Python::attach(|py| {
                make.call1(py, (name.as_str(), inputs, outputs, &lanes))
                    .map_err(|error| with_traceback(py, &error))
            });
            let step = step.map_err(anyhow::Error::msg)?;
            if Python::attach(|py| step.is_none(py)) {
                continue;
            }
            graph.replace(name, PythonOperator { step, timers })?;
        }
        Ok(graph)
    };
    py.detach(|| run_worker_with(&registry, prepare)).map_err(error)
}
