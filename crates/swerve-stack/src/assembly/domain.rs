//! Models for camera images that are used outside the domain in which they hold their figures.

use swerve_flow::PayloadType;
use swerve_msg::{Detections, PointCloud};

use super::{Assembly, Placed};
use crate::problems::KeyProblems;
use crate::setup::Setup;

impl Setup {
    /// Warnings about operators whose model is used in rendered images outside its domain, one per operator: the
    /// operator's key, and the weather, the figures and the remedy. With a vehicle, whose cameras are not rendered:
    /// warnings about settings of vehicle, gate and speed that do not fit each other.
    pub fn beyond_domain(&self) -> Vec<String> {
        if self.live.is_some() {
            return self.beyond_vehicle();
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

    /// Warnings about values of different tables for a vehicle that do not fit each other, each with both keys.
    fn beyond_vehicle(&self) -> Vec<String> {
        let (shape, limits) = (&self.sim.vehicle.shape, &self.sim.vehicle.limits);
        let Ok(gate) = self.gate_params() else { return Vec::new() };
        let pairs = [
            ("ego.speed_mps", self.ego.speed_mps, "gate.params.speed_max_mps", gate.speed_max_mps),
            (
                "gate.params.emergency_decel_mps2",
                Some(gate.emergency_decel_mps2),
                "sim.vehicle.limits.brake_max_mps2",
                limits.brake_max_mps2,
            ),
            (
                "gate.params.steering_max_rad",
                Some(gate.steering_max_rad),
                "sim.vehicle.limits.steering_max_rad",
                limits.steering_max_rad,
            ),
            (
                "sim.vehicle.shape.wheelbase_m",
                Some(shape.wheelbase_m),
                "sim.vehicle.shape.length_m",
                shape.length_m,
            ),
        ];
        let warning = |(key, value, limit_key, limit): (&str, Option<f64>, &str, f64)| {
            let value = value.filter(|value| *value > limit)?;
            Some(format!("{key}: {value} is more than {limit_key}, which is {limit}"))
        };
        pairs.into_iter().filter_map(warning).collect()
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

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use crate::setup::Setup;

    #[test]
    fn settings_of_a_vehicle_that_do_not_fit_each_other_are_warned_of() {
        let warnings = |text: &str| {
            let document =
                Document::parse("c.toml", format!("live = {{ route = 'r.toml' }}\n{text}")).unwrap();
            Setup::from_document(&document, &[]).unwrap_or_else(|found| panic!("{found}")).beyond_domain()
        };
        assert_eq!(warnings(""), Vec::<String>::new());
        let found = warnings(
            "[ego]\nspeed_mps = 12\n[gate.params]\nspeed_max_mps = 8\nemergency_decel_mps2 = 9\nsteering_max_rad = 0.9\n\
             [sim.vehicle.limits]\nbrake_max_mps2 = 5\nsteering_max_rad = 0.55\n\
             [sim.vehicle.shape]\nwheelbase_m = 4.5\nlength_m = 4\n",
        );
        assert_eq!(
            found,
            [
                "ego.speed_mps: 12 is more than gate.params.speed_max_mps, which is 8",
                "gate.params.emergency_decel_mps2: 9 is more than sim.vehicle.limits.brake_max_mps2, which is 5",
                "gate.params.steering_max_rad: 0.9 is more than sim.vehicle.limits.steering_max_rad, which is 0.55",
                "sim.vehicle.shape.wheelbase_m: 4.5 is more than sim.vehicle.shape.length_m, which is 4",
            ]
        );
    }
}
