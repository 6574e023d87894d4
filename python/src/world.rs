//! A world in Python: what it answers becomes a state of the world, by the rules of the simulator.

use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::de::DeserializeOwned;
use swerve_core::{Span, Time};
use swerve_drive::Referee;
use swerve_flow::{AnyInput, AnyOperator, AnyOutputs, Context};
use swerve_msg::truth::{EndReason, WorldState};
use swerve_msg::{EgoState, ObstacleList, Route};
use swerve_scenario::Scenario;

use crate::convert::{cbor_value, error};
use crate::numbers;
use crate::worker::with_traceback;

/// A world whose steps are taken in Python.
pub(crate) struct PythonWorld {
    /// Called with the stamp and the newest command; returns the state, or the ego and the obstacles.
    pub(crate) step: Py<PyAny>,
    pub(crate) referee: Referee,
    pub(crate) scenario: Scenario,
    pub(crate) route: Route,
    /// Time from step to step.
    pub(crate) period: Span,
    /// End of the scenario at the latest.
    pub(crate) until: Time,
}

impl AnyOperator for PythonWorld {
    fn step(&mut self, cx: &mut Context<'_>, inputs: Vec<AnyInput>, out: &mut AnyOutputs<'_>) {
        let stamp = cx.stamp();
        let stepped = Python::attach(|py| {
            let state = self.state(py, stamp, &inputs);
            state.map_err(|error| with_traceback(py, &error))
        });
        match stepped {
            Ok(state) => {
                if let Some(reason) = state.ended {
                    cx.stop_run(format!("{reason:?}").to_lowercase());
                }
                out.send(0, state).expect("a world has one output, its state");
            }
            // Reported to the run as this operator's panic, without a panic message here.
            Err(why) => std::panic::resume_unwind(Box::new(why)),
        }
    }
}

impl PythonWorld {
    fn state(&mut self, py: Python<'_>, stamp: Time, inputs: &[AnyInput]) -> PyResult<WorldState> {
        let command = match inputs.get(1) {
            Some(AnyInput::Message(message)) => Some(numbers::plain(py, message)?),
            _ => None,
        };
        let answer = self.step.bind(py).call1((stamp.ns(), command))?.cast_into::<PyDict>()?;
        let mut state = match answer.get_item("state")? {
            Some(state) => read("state", &state)?,
            None => {
                let ego: EgoState = of(&answer, "ego")?;
                let list: ObstacleList = of(&answer, "obstacles")?;
                let judged = self.referee.judge(ego, &list.obstacles, (&self.scenario, &self.route));
                judged.map_err(error)?
            }
        };
        if state.stamp != stamp {
            let found = state.stamp.ns();
            let why = format!("the state of the world has the stamp {found}: expected {}", stamp.ns());
            return Err(PyValueError::new_err(why));
        }
        if state.ended.is_none() && stamp + self.period > self.until {
            state.ended = Some(EndReason::Timeout);
        }
        Ok(state)
    }
}

fn of<T: DeserializeOwned>(answer: &Bound<'_, PyDict>, key: &str) -> PyResult<T> {
    let value = answer.get_item(key)?.ok_or_else(|| PyValueError::new_err(format!("there is no `{key}`")))?;
    read(key, &value)
}

fn read<T: DeserializeOwned>(key: &str, value: &Bound<'_, PyAny>) -> PyResult<T> {
    let read = cbor_value(value)?.deserialized();
    read.map_err(|error| PyValueError::new_err(format!("{key}: {error}")))
}
