//! Driving a vehicle with `swerve live`, `[live]`.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_ros2::convert::SteeringGear;

/// A vehicle connected by ROS 2 topics.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct LiveConfig {
    /// Scenario whose road is followed at the speed of its ego up to its `end_m`, as a path from the folder of the
    /// configuration. Its actors are ignored.
    pub route: String,
    /// Source of the request to enable the stack.
    pub enable: EnableBy,
    /// Time limit for the vehicle to accept commands after it is asked to, seconds.
    #[schemars(range(min = 0.1, max = 60.0))]
    pub enable_timeout_s: f64,
    /// Autoware's service for the control mode, by its ROS name; not called when empty.
    pub control_mode_service: String,
    /// Longitudinal command for a vehicle with Dataspeed's interface.
    pub longitudinal: Longitudinal,
    /// Steering ratio: turns of the steering wheel per turn of the road wheels, for interfaces in terms of the steering
    /// wheel.
    #[schemars(range(min = 1.0, max = 50.0))]
    pub steering_ratio: f64,
    /// Largest steering wheel angle to either side, degrees.
    #[schemars(range(min = 10.0, max = 2000.0))]
    pub steering_wheel_max_deg: f64,
    /// Age above which objects are not used, seconds; after the first objects, the car is stopped when there are no
    /// newer ones.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub objects_timeout_s: f64,
    /// Age above which a plan is not followed, seconds.
    #[schemars(range(min = 0.05, max = 10.0))]
    pub plan_timeout_s: f64,
    /// Time limit for the stop at the end, seconds; afterwards the vehicle is left to its own time-out.
    #[schemars(range(min = 1.0, max = 120.0))]
    pub stop_timeout_s: f64,
    /// Distance by which the origin of reported poses is ahead of the centre of the rear axle, metres.
    #[schemars(range(min = -10.0, max = 10.0))]
    pub pose_ahead_m: f64,
    /// Clock that paces the drive.
    pub clock: LiveClock,
    /// Real time for which simulated time may stand still, seconds; afterwards the drive ends with an error.
    #[schemars(range(min = 0.5, max = 3600.0))]
    pub clock_timeout_s: f64,
    /// Largest time by which a stamp may be ahead of its sensor's clock, ms.
    #[schemars(range(min = 1.0, max = 10_000.0))]
    pub stamp_ahead_max_ms: f64,
    /// Largest time by which a stamp may be behind its sensor's clock, ms.
    #[schemars(range(min = 1.0, max = 60_000.0))]
    pub stamp_behind_max_ms: f64,
}

/// Source of the request to enable the stack.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
pub enum EnableBy {
    /// A person, on the topic of the mapping's `enable`.
    #[default]
    Topic,
    /// The start of the program, as soon as all topics are available: for tests and simulators.
    #[value(name = "at_start", alias = "at-start")]
    AtStart,
}

/// Clock that paces a drive.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum LiveClock {
    /// The real clock, for vehicles.
    #[default]
    Host,
    /// Simulated time on the mapping's topic `clock`, for simulators.
    Topic,
}

/// Form of longitudinal commands where there is a choice.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Longitudinal {
    /// Speed and limits of acceleration, for the vehicle's own controller.
    #[default]
    Speed,
    /// Pedals.
    Pedals,
}

impl Default for LiveConfig {
    fn default() -> Self {
        let gear = SteeringGear::default();
        Self {
            route: String::new(),
            enable: EnableBy::default(),
            enable_timeout_s: 5.0,
            control_mode_service: String::new(),
            longitudinal: Longitudinal::default(),
            steering_ratio: gear.ratio,
            steering_wheel_max_deg: gear.wheel_max_deg,
            objects_timeout_s: 0.5,
            plan_timeout_s: 0.5,
            stop_timeout_s: 20.0,
            pose_ahead_m: 0.0,
            clock: LiveClock::default(),
            clock_timeout_s: 10.0,
            stamp_ahead_max_ms: 50.0,
            stamp_behind_max_ms: 1000.0,
        }
    }
}

impl LiveConfig {
    /// Steering gear between the road wheels and the steering wheel.
    pub fn gear(&self) -> SteeringGear {
        SteeringGear {
            ratio: self.steering_ratio,
            wheel_max_deg: self.steering_wheel_max_deg,
            ..SteeringGear::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_text::Document;

    use crate::Setup;

    fn told(text: &str) -> Vec<String> {
        let document = Document::parse("c.toml", text).unwrap();
        let problems = Setup::from_document(&document, &[]).err().unwrap_or_default();
        problems.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn live_problems_are_reported_with_their_line() {
        let sound = "[live]\nroute = \"r.toml\"\n[control]\ncontroller = \"mpc\"\n";
        assert_eq!(told(sound), [""; 0]);
        let cases = [
            (
                "[live]\n[control]\ncontroller = \"mpc\"\n",
                "c.toml:1: live.route: is missing: expected the scenario",
            ),
            (
                "[live]\nroute = \"r.toml\"\n[control]\ncontroller = \"pid\"\n",
                "c.toml:4: control.controller: expected one of \"pure_pursuit\", \"stanley\", \"mpc\": \"pid\" knows",
            ),
            ("[live]\nrout = \"r.toml\"\n", "c.toml:2: live.rout: unknown key; did you mean `route`?"),
            (
                "[live]\nroute = \"r\"\nsteering_ratio = 0\n",
                "c.toml:3: live.steering_ratio: expected 1 to 50",
            ),
            ("[live]\nroute = \"r\"\nenable = \"now\"\n", "c.toml:3: live.enable: expected one of \"topic\""),
            ("[live]\nroute = \"r\"\n[camera.left]\n", "c.toml:3: camera.left: no topic of `[ros2.topics]`"),
            (
                "[live]\nroute = \"r\"\nenable = \"at_start\"\n[ros2]\nvehicle = \"plain\"\n",
                "c.toml:3: live.enable: a vehicle of the table `plain` receives no commands",
            ),
            (
                "[live]\nroute = \"r\"\n[ros2.topics.odometry]\nenabled = false\n",
                "c.toml:3: ros2.topics: a vehicle that is to be driven needs the topic `odometry`",
            ),
            (
                "[live]\nroute = \"r\"\nclock = \"topic\"\n[ros2.topics.clock]\nenabled = false\n",
                "c.toml:3: live.clock: simulated time is read from the topic `clock` of `[ros2.topics]`",
            ),
        ];
        for (text, expected) in cases {
            let found = told(text);
            assert!(found.iter().any(|told| told.starts_with(expected)), "{expected}\n{found:#?}");
        }
    }
}
