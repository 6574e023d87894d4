//! Switch with which a person enables the stack.

use swerve_core::Time;
use swerve_flow::{
    Context, Every, Inputs, Latest, NamedInputs, NamedOutputs, Operator, OutputInfo, Port, PortInfo, every,
};
use swerve_msg::{GateOutput, Switch};

use crate::config::execution::span_of_ms;
use crate::config::gate::GateConfig;
use crate::kind::{Node, OperatorKind, Settings};
use crate::site::Site;

/// Switch of a simulated car: held by a simulated person or, where another stack drives, from outside.
pub(super) struct EnableSwitch;

/// Output of the gate, at each tick.
#[derive(Inputs)]
struct In {
    /// Period of the person's checks.
    tick: Every,
    /// Output of the gate.
    #[port(feedback)]
    gate: Latest<GateOutput>,
}

impl OperatorKind for EnableSwitch {
    fn node(&self) -> Node {
        Node::new("enable_switch", "the person who enables the safety gate, and may stop the car")
            .section(&GateConfig::SECTION)
            .only_with("gate.enabled = true")
            .stays("it is the vehicle's side of the safety gate")
    }

    fn is_there(&self, settings: &Settings<'_>) -> bool {
        settings.setup.gate.enabled
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        <Port<Switch> as NamedOutputs>::ports()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        if settings.setup.is_driven_over_ros2() { Vec::new() } else { In::ports() }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        let config = site.config();
        if config.is_driven_over_ros2() {
            site.add_source::<Switch>();
            return Ok(());
        }
        let (person, timer) = (SimulatedPerson::new(&config.gate), every(span_of_ms(config.gate.period_ms)));
        site.add(person, Some(timer))
    }
}

/// Simulated person with the switch: presses it once, releases it and stops the car at the configured times. A press
/// without effect, for lack of a command or a report, is released and repeated.
struct SimulatedPerson {
    enable_at: Time,
    release_at: Time,
    emergency_at: Time,
    pressed_at: Option<Time>,
    was_engaged: bool,
}

impl SimulatedPerson {
    fn new(config: &GateConfig) -> Self {
        let at = |ms: Option<f64>| ms.map_or(Time::MAX, |ms| Time::ZERO + span_of_ms(ms));
        Self {
            enable_at: at(Some(config.enable_at_ms)),
            release_at: at(config.release_at_ms),
            emergency_at: at(config.emergency_at_ms),
            pressed_at: None,
            was_engaged: false,
        }
    }
}

impl Operator for SimulatedPerson {
    type In = In;
    type Out = Port<Switch>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let now = cx.now();
        let lamp = input.gate.get();
        self.was_engaged |= lamp.is_some_and(|gate| gate.engaged);
        // Gate outputs of an instant before the press do not reflect it.
        let waits = |since: Time| lamp.is_none_or(|gate| gate.command.stamp < since);
        // Before its first output the gate has not seen the switch released.
        let may_press = lamp.is_some() && now >= self.enable_at;
        self.pressed_at = match self.pressed_at {
            _ if now >= self.release_at => None,
            Some(since) => (self.was_engaged || waits(since)).then_some(since),
            None => may_press.then_some(now),
        };
        let enable = self.pressed_at.is_some();
        out.loan().send(Switch { enable, emergency: now >= self.emergency_at });
    }
}
