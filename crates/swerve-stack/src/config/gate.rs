//! The safety gate, `[gate]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_control::safety_gate::GateParams;
use swerve_core::Ranges;

/// The safety gate between the controller and the vehicle.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct GateConfig {
    /// Enables the gate.
    pub enabled: bool,
    /// Period of the gate, ms.
    #[schemars(range(min = 1.0, max = 100.0))]
    pub period_ms: f64,
    /// Time at which the simulated person presses the switch, ms; the simulated driver holds wheel and speed until
    /// then.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub enable_at_ms: f64,
    /// Time at which that person releases the switch, ms; never when absent.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub release_at_ms: Option<f64>,
    /// Time at which that person triggers an emergency stop, ms; never when absent.
    #[schemars(range(min = 0.0, max = 1e9))]
    pub emergency_at_ms: Option<f64>,
    /// Limits and times that differ from the vehicle's.
    #[schemars(with = "GateParams")]
    pub params: toml::Table,
}

impl Default for GateConfig {
    fn default() -> Self {
        Self {
            enabled: false,
            period_ms: 10.0,
            enable_at_ms: 0.0,
            release_at_ms: None,
            emergency_at_ms: None,
            params: toml::Table::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use crate::Setup;
    use crate::config::Config;

    fn told(text: &str) -> Vec<String> {
        let document = Document::parse("c.toml", text).unwrap();
        let problems = Setup::from_document(&document, &[]).err().unwrap_or_default();
        problems.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn limits_come_from_the_vehicle_and_single_ones_from_the_file() {
        let text =
            "[gate]\nparams = { stop_decel_mps2 = 2.5 }\n[sim.vehicle.limits]\nsteering_max_rad = 0.4\n";
        let document = Document::parse("c.toml", text).unwrap();
        let params = Setup::from_document(&document, &[]).unwrap().gate_params().unwrap();
        assert_eq!((params.stop_decel_mps2, params.steering_max_rad), (2.5, 0.4));
        let of_car = Config::default().gate_params().unwrap();
        assert!(of_car.decel_max_mps2 > 9.81, "full brakes pass: {}", of_car.decel_max_mps2);
    }

    #[test]
    fn repeated_commands_of_another_stack_are_unlimited_by_default() {
        let repeat_max_s = |text: &str| {
            let document = Document::parse("c.toml", text).unwrap();
            Setup::from_document(&document, &[]).unwrap().gate_params().unwrap().repeat_max_s
        };
        let foreign =
            "[clock]\nsource = \"wall\"\n[ego]\ndriver = \"ros2\"\n[ros2]\n[gate]\nenabled = true\n";
        assert_eq!((repeat_max_s(""), repeat_max_s(foreign)), (1.0, 0.0));
        assert_eq!(repeat_max_s(&format!("{foreign}params = {{ repeat_max_s = 2 }}\n")), 2.0);
    }

    #[test]
    fn gate_problems_are_reported_with_their_line() {
        let cases = [
            ("period_ms = 0", "c.toml:2: gate.period_ms: expected 1 to 100, found 0"),
            (
                "enable_at_ms = 500\nrelease_at_ms = 400",
                "c.toml:3: gate.release_at_ms: expected an instant not before",
            ),
            (
                "params = { stop_decel_mps2 = -1 }",
                "c.toml:2: gate.params.stop_decel_mps2: expected 0.1 to 20, found -1",
            ),
            ("params = { stop_decel = 1 }", "c.toml:2: gate.params.stop_decel: unknown key; did you mean"),
            ("enable = true", "c.toml:2: gate.enable: unknown key; did you mean `enabled`?"),
        ];
        for (line, expected) in cases {
            let found = told(&format!("[gate]\n{line}\n"));
            assert!(found.iter().any(|told| told.starts_with(expected)), "{line}: {found:?}");
        }
    }

    #[test]
    fn limits_of_the_vehicle_out_of_range_are_reported_once_and_all_together() {
        let text = "[sim.vehicle.limits]\nsteering_rate_max_radps = 28.6\nbrake_max_mps2 = -5.0\nsteering_max_rad = 31.5\n\
                    [gate]\nparams = { stop_decel_mps2 = -1, steering_max_rad = 9 }\n";
        let keys: Vec<String> = told(text)
            .iter()
            .map(|problem| problem.split(": ").take(2).collect::<Vec<_>>().join(": "))
            .collect();
        assert_eq!(
            keys,
            [
                "c.toml:2: sim.vehicle.limits.steering_rate_max_radps",
                "c.toml:3: sim.vehicle.limits.brake_max_mps2",
                "c.toml:4: sim.vehicle.limits.steering_max_rad",
                "c.toml:6: gate.params.steering_max_rad",
                "c.toml:6: gate.params.stop_decel_mps2",
            ]
        );
        // The value of a key with a wrong name is not reported by another name.
        let found = told("[sim.vehicle.limits]\nsteering_max_deg = 31.5\n");
        assert!(found.len() == 1 && found[0].contains("did you mean `steering_max_rad`?"), "{found:?}");
    }

    #[test]
    fn gate_and_its_neighbours_stay_in_the_coordinator() {
        for operator in ["report", "switch", "gate", "pedals"] {
            let found = told(&format!("[gate]\nenabled = true\n[process.a]\noperators = [\"{operator}\"]\n"));
            assert!(found[0].contains(&format!("`{operator}` stays in the coordinator")), "{found:?}");
        }
        let found = told("[gate]\nenabled = true\n[process.a]\noperators = [\"gate\"]\n");
        assert!(found[0].contains("it is the safety gate"), "{found:?}");
    }
}
