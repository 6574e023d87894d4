//! Cars by name.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use toml::{Table, Value};

/// Car of the ego, with all its parameters.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Car {
    /// A real Lincoln MKZ: the defaults of `sim.vehicle`.
    #[default]
    LincolnMkz,
    /// The same car as CARLA simulates it: `carla_mkz.toml` has its parameters with their sources.
    CarlaMkz,
}

/// Fills in keys that `sim.vehicle` does not set from the car named by `sim.car`. Unknown names are left to the reader
/// of the table.
pub(crate) fn fill_in(table: &mut Table) {
    let Some(sim) = table.get_mut("sim").and_then(Value::as_table_mut) else { return };
    if sim.get("car").and_then(Value::as_str) != Some("carla_mkz") {
        return;
    }
    let car: Table = swerve_text::built_in(include_str!("carla_mkz.toml"));
    if let Value::Table(vehicle) = sim.entry("vehicle").or_insert_with(|| Table::new().into()) {
        put_under(vehicle, &car);
    }
}

fn put_under(table: &mut Table, defaults: &Table) {
    for (key, value) in defaults {
        match (table.get_mut(key), value) {
            (Some(Value::Table(own)), Value::Table(defaults)) => put_under(own, defaults),
            (Some(_), _) => {}
            (None, value) => {
                table.insert(key.clone(), value.clone());
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use crate::Setup;
    use crate::config::Config;

    fn config(text: &str) -> Config {
        Setup::from_document(&Document::parse("c.toml", text).unwrap(), &[]).unwrap().config
    }

    #[test]
    fn named_car_sets_defaults_that_keys_override() {
        let text = "[sim]\ncar = \"carla_mkz\"\n[sim.vehicle.limits]\nsteering_max_rad = 0.5\n";
        let vehicle = config(text).sim.vehicle;
        assert_eq!((vehicle.tyre.friction, vehicle.limits.steering_max_rad), (Some(3.5), 0.5));
        assert_eq!(vehicle.limits.steering_rate_max_radps, 3.05);
        assert_eq!(config("[sim]\ncar = \"lincoln_mkz\"\n"), Config::default());
        // A resolved configuration has every number, and reads back as itself.
        let resolved = config(text);
        assert_eq!(config(&resolved.to_text()), resolved);
    }

    #[test]
    fn unknown_cars_are_reported_with_the_nearest_name() {
        let problems = |text: &str| {
            let document = Document::parse("c.toml", text).unwrap();
            let problems = Setup::from_document(&document, &[]).expect_err("wrong on purpose");
            problems.iter().map(ToString::to_string).collect::<Vec<_>>()
        };
        let unknown = &problems("[sim]\ncar = \"carla_mk\"\n")[0];
        assert!(unknown.starts_with("c.toml:2: sim.car: expected "), "{unknown}");
        assert!(unknown.ends_with("did you mean `carla_mkz`?"), "{unknown}");
        let text = "[sim]\ncar = \"carla_mkz\"\n[sim.vehicle.tyre]\nfriction = 9.0\n";
        assert_eq!(problems(text), ["c.toml:4: sim.vehicle.tyre.friction: expected 0.01 to 4, found 9"]);
    }
}
