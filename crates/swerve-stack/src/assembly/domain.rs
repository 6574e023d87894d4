//! Models for camera images that are used outside the domain in which they hold their figures.

use swerve_flow::PayloadType;
use swerve_msg::{Detections, PointCloud};

use super::{Assembly, Placed};
use crate::problems::KeyProblems;
use crate::setup::Setup;

impl Setup {
    /// Warnings about operators whose model is used in rendered images outside its domain, one per operator: the
    /// operator's key, and the weather, the figures and the remedy. Empty with a vehicle: its cameras are not rendered.
    pub fn beyond_domain(&self) -> Vec<String> {
        if self.live.is_some() {
            return Vec::new();
        }
        let assembly = Assembly::with_problems(self, &mut KeyProblems::new());
        let has_lidar = assembly.operators().iter().any(|placed| finds(placed) && reads_a_lidar(placed));
        let warning = |placed: &Placed| {
            let settings = placed.settings(self);
            let doubt = placed.kind.domain(&settings)?.doubt(settings.setup.render.weather)?;
            let remedy = match (finds(placed), has_lidar) {
                (true, true) => "the lidar does not depend on the camera: objects rest on it",
                (true, false) => {
                    "a lidar does not depend on the camera: `-c configs/fused_objects.toml` adds one"
                }
                (false, _) => "docs/seeing.md lists the weathers of the domain",
            };
            Some(format!("operator.{}: {doubt}; {remedy}", placed.name))
        };
        assembly.operators().iter().filter_map(warning).collect()
    }
}

/// Returns true if an operator publishes objects.
fn finds(placed: &Placed) -> bool {
    let payload = PayloadType::of::<Detections>();
    placed.outputs.iter().any(|output| output.port.payload == payload)
}

fn reads_a_lidar(placed: &Placed) -> bool {
    let payload = PayloadType::of::<PointCloud>();
    placed.inputs.iter().any(|input| input.port.payload == Some(payload))
}
