//! Algorithms written in Python. Their operators are those of the stack, which call them as they call algorithms in Rust.

use std::sync::Arc;

use ciborium::Value;
use pyo3::prelude::*;
use pyo3::types::PyDict;
use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::Time;
use swerve_geom::{Map, Pose2};
use swerve_msg::{ActorId, Detections, EgoState, Plan, Prediction, PredictionList, Route, TrackList};
use swerve_perception::GroundTracker;
use swerve_planning::{Budget, Planner, Request};
use swerve_prediction::{Ground, Horizon, Predictor};
use swerve_stack::Foreign;
use swerve_vehicle::{Limits, Shape};

use crate::convert::{cbor_of, cbor_value, plain};

/// Spacing of the points of a route in Python, metres.
const ROUTE_STEP_M: f64 = 1.0;

/// A Python algorithm, which is created at its first call: a configuration's check creates it, too.
struct Algorithm {
    /// Creates the function that is called with the fields of a request.
    make: Arc<Py<PyAny>>,
    function: Option<Py<PyAny>>,
}

impl Algorithm {
    fn new(make: &Arc<Py<PyAny>>) -> Self {
        Self { make: make.clone(), function: None }
    }

    /// Calls the algorithm. An exception ends the run as the panic of the operator.
    fn call<R: DeserializeOwned>(&mut self, fields: &impl Serialize) -> R {
        let answer = Python::attach(|py| {
            self.answer(py, fields).map_err(|error| crate::worker::with_traceback(py, &error))
        });
        let read = answer.and_then(|value| value.deserialized().map_err(|error| error.to_string()));
        read.unwrap_or_else(|why: String| std::panic::resume_unwind(Box::new(why)))
    }

    fn answer(&mut self, py: Python<'_>, fields: &impl Serialize) -> PyResult<Value> {
        let function = match &self.function {
            Some(function) => function.clone_ref(py),
            None => self.function.insert(self.make.call0(py)?).clone_ref(py),
        };
        let fields = cbor_of(fields)?;
        cbor_value(function.call1(py, (plain(py, &fields)?,))?.bind(py))
    }
}

/// A route in Python: points along its line, with the distances to its borders.
#[derive(Serialize)]
pub(crate) struct RouteFields {
    s_m: Vec<f64>,
    x_m: Vec<f64>,
    y_m: Vec<f64>,
    heading_rad: Vec<f64>,
    curvature_1pm: Vec<f64>,
    left_m: Vec<f64>,
    right_m: Vec<f64>,
}

impl RouteFields {
    pub(crate) fn of(route: &Route) -> Self {
        let length_m = route.line().length();
        let steps = (length_m / ROUTE_STEP_M).ceil().max(1.0);
        let s_m: Vec<f64> = (0..=steps as usize).map(|k| length_m * k as f64 / steps).collect();
        let points: Vec<_> = s_m.iter().map(|s_m| route.line().at(*s_m)).collect();
        Self {
            x_m: points.iter().map(|point| point.pose.x_m).collect(),
            y_m: points.iter().map(|point| point.pose.y_m).collect(),
            heading_rad: points.iter().map(|point| point.pose.heading_rad).collect(),
            curvature_1pm: points.iter().map(|point| point.curvature_1pm).collect(),
            left_m: s_m.iter().map(|s_m| route.left_m(*s_m)).collect(),
            right_m: s_m.iter().map(|s_m| route.right_m(*s_m)).collect(),
            s_m,
        }
    }
}

/// The route that Python has; it gets another one only if that differs.
#[derive(Default)]
struct Known(Option<Route>);

impl Known {
    fn news(&mut self, route: &Route) -> Option<RouteFields> {
        if self.0.as_ref() == Some(route) {
            return None;
        }
        self.0 = Some(route.clone());
        Some(RouteFields::of(route))
    }
}

struct PythonPlanner(Algorithm, Known);

#[derive(Serialize)]
struct RequestFields<'a> {
    stamp: Time,
    start: EgoState,
    route: Option<RouteFields>,
    along_m: f64,
    target_speed_mps: f64,
    overtake_max_m: f64,
    predictions: &'a [Prediction],
    changed_lately: &'a [ActorId],
    shape: &'a Shape,
    limits: &'a Limits,
    previous: Option<&'a Plan>,
    seed: u64,
}

impl Planner for PythonPlanner {
    fn plan(&mut self, request: &Request<'_>, budget: &mut dyn Budget) -> Plan {
        let Self(algorithm, known) = self;
        let fields = RequestFields {
            stamp: request.stamp,
            start: request.start,
            route: known.news(request.route),
            along_m: request.place().s_m,
            target_speed_mps: request.target_speed_mps,
            overtake_max_m: request.overtake_max_m,
            predictions: request.predictions,
            changed_lately: request.changed_lately,
            shape: request.shape,
            limits: request.limits,
            previous: request.previous,
            seed: request.seed,
        };
        let plan: Plan = algorithm.call(&fields);
        budget.spend(plan.work);
        Plan { stamp: request.stamp, ..plan }
    }
}

struct PythonPredictor(Algorithm, Known);

#[derive(Serialize)]
struct PredictFields<'a> {
    tracks: &'a TrackList,
    /// Predicted instants, the stamp first.
    instants: Vec<Time>,
    /// The road that is predicted along; missing if it is the last one, or if there is none.
    route: Option<RouteFields>,
    has_route: bool,
}

impl Predictor for PythonPredictor {
    fn predict(&mut self, tracks: &TrackList, horizon: &Horizon, ground: Ground<'_>) -> PredictionList {
        let Self(algorithm, known) = self;
        let road = match ground {
            Ground::Road(route) => Some(route),
            Ground::Open | Ground::Lanes(_) => None,
        };
        let instants = (0..=horizon.steps as i64).map(|k| tracks.stamp + horizon.step * k).collect();
        let route = road.and_then(|road| known.news(road));
        algorithm.call(&PredictFields { tracks, instants, route, has_route: road.is_some() })
    }
}

struct PythonTracker(Algorithm);

#[derive(Serialize)]
struct TrackFields<'a> {
    boxes: &'a Detections,
    ego: Pose2<Map>,
}

impl GroundTracker for PythonTracker {
    fn update(&mut self, found: &Detections, ego: Pose2<Map>) -> TrackList {
        self.0.call(&TrackFields { boxes: found, ego })
    }
}

/// Algorithms of Python by their role: a function each that creates the function to call.
pub(crate) fn foreign(algorithms: &Bound<'_, PyDict>) -> PyResult<Foreign> {
    let make = |role: &str| -> PyResult<Option<Arc<Py<PyAny>>>> {
        Ok(algorithms.get_item(role)?.map(|make| Arc::new(make.unbind())))
    };
    let mut foreign = Foreign::default();
    if let Some(make) = make("planner")? {
        let planner = move || Box::new(PythonPlanner(Algorithm::new(&make), Known::default())) as _;
        foreign.planner = Some(Arc::new(planner));
    }
    if let Some(make) = make("predictor")? {
        let predictor = move || Box::new(PythonPredictor(Algorithm::new(&make), Known::default())) as _;
        foreign.predictor = Some(Arc::new(predictor));
    }
    if let Some(make) = make("tracker")? {
        foreign.tracker = Some(Arc::new(move || Box::new(PythonTracker(Algorithm::new(&make))) as _));
    }
    Ok(foreign)
}
