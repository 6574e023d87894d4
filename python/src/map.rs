//! The lanes of a road or map.

use std::sync::Arc;

use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};
use swerve_geom::Point2;
use swerve_map::{LaneId, LanePlace, Map, Neighbour};

use crate::convert::error;
use crate::run::{FileOr, load_scenario};

/// Lanes of a scenario's road or map.
#[pyclass(frozen)]
pub(crate) struct Lanes(Arc<Map>);

impl From<Arc<Map>> for Lanes {
    fn from(map: Arc<Map>) -> Self {
        Self(map)
    }
}

/// A lane, and a position along it: arc length and distance to the left, metres.
type Place = (u32, f64, f64);

fn place_of(LanePlace { lane, place }: LanePlace) -> Place {
    (lane.0, place.s_m, place.d_m)
}

#[pymethods]
impl Lanes {
    /// Lanes of a scenario.
    #[new]
    fn new(scenario: FileOr<'_>) -> PyResult<Self> {
        Ok(Self(load_scenario(&scenario)?.0.road.map()))
    }

    /// Identities of all lanes, in order.
    fn ids(&self) -> Vec<u32> {
        self.0.lanes().iter().map(|lane| lane.id.0).collect()
    }

    /// Fields of a lane; arrays are bytes of 64-bit floating-point numbers.
    fn lane<'py>(&self, py: Python<'py>, id: u32) -> PyResult<Bound<'py, PyDict>> {
        let lane = self.0.lane(LaneId(id)).ok_or_else(|| PyKeyError::new_err(id))?;
        let kind = serde_json::to_value(lane.kind).map_err(|why| error(why.into()))?;
        let bends_m = lane.bends_m();
        let array = |number: &dyn Fn(f64) -> f64| {
            let bytes: Vec<u8> = bends_m.iter().flat_map(|s_m| number(*s_m).to_le_bytes()).collect();
            PyBytes::new(py, &bytes)
        };
        let ids = |lanes: &[LaneId]| lanes.iter().map(|lane| lane.0).collect::<Vec<u32>>();
        let beside = |lane: Option<Neighbour>| lane.map(|beside| (beside.lane.0, beside.opposite));
        let fields = PyDict::new(py);
        fields.set_item("kind", kind.as_str())?;
        fields.set_item("s_m", array(&|s_m| s_m))?;
        fields.set_item("x_m", array(&|s_m| lane.line.at(s_m).pose.x_m))?;
        fields.set_item("y_m", array(&|s_m| lane.line.at(s_m).pose.y_m))?;
        fields.set_item("heading_rad", array(&|s_m| lane.line.at(s_m).pose.heading_rad))?;
        fields.set_item("left_m", array(&|s_m| lane.borders.left_m(s_m)))?;
        fields.set_item("right_m", array(&|s_m| lane.borders.right_m(s_m)))?;
        fields.set_item("speed_limit_mps", lane.speed_limit_mps)?;
        fields.set_item("in_junction", self.0.is_in_junction(lane.id))?;
        fields.set_item("left", beside(lane.left))?;
        fields.set_item("right", beside(lane.right))?;
        fields.set_item("successors", ids(&lane.successors))?;
        fields.set_item("predecessors", ids(self.0.predecessors(lane.id)))?;
        Ok(fields)
    }

    /// Lanes that contain a point.
    fn at(&self, x_m: f64, y_m: f64) -> Vec<Place> {
        self.0.at(Point2::new(x_m, y_m)).map(place_of).collect()
    }

    /// Lane with the nearest centre line to a point.
    fn nearest(&self, x_m: f64, y_m: f64) -> Option<Place> {
        self.0.nearest(Point2::new(x_m, y_m)).map(place_of)
    }
}
