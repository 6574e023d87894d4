//! The safety gate before the vehicle, and what stands around it where the vehicle is a simulated one.
//!
//! ```text
//!  controller --MotionCommand--> gate --GateOutput--> pedals --Command--> world
//!  pose > report --VehicleReport---^  ^--Switch-- switch
//! ```

use swerve_control::safety_gate::{GateInput, GateParams, SafetyGate};
use swerve_core::{Span, Time};
use swerve_flow::{At, Context, Every, Feedback, Graph, Latest, Operator, Port, Source, Stream, every};
use swerve_msg::{Command, EgoState, GateMode, GateOutput, MotionCommand, Switch, VehicleReport};
use swerve_vehicle::{VehicleParams, pedals_for_accel};

use super::faulty::faulty;
use crate::config::Config;
use crate::config::gate::GateConfig;

/// What a gate reads: the newest of each, whenever it takes a step.
pub struct GateInputs {
    /// What the stack asks for.
    pub commands: Stream<MotionCommand>,
    /// What the vehicle says of itself.
    pub report: Stream<VehicleReport>,
    /// Who may enable: all of them have to, and each alone may stop. Without one nothing is ever enabled.
    pub switches: Vec<Source<Switch>>,
}

/// Adds the operator `gate`, around a vehicle of any kind: simulated, or at the other end of a wire.
///
/// # Errors
/// A parameter that makes no gate.
pub fn gate(
    graph: &mut Graph,
    params: GateParams,
    period: Span,
    inputs: GateInputs,
) -> anyhow::Result<Stream<GateOutput>> {
    let operator = GateOperator { gate: SafetyGate::new(params)? };
    let GateInputs { commands, report, switches } = inputs;
    Ok(graph.add("gate", operator, (every(period), commands, report, switches)).out())
}

/// The state machine at its rate, on the newest of all that it reads.
struct GateOperator {
    gate: SafetyGate,
}

impl Operator for GateOperator {
    type In = (Every, Latest<MotionCommand>, Latest<VehicleReport>, Vec<Latest<Switch>>);
    type Out = Port<GateOutput>;

    fn step(&mut self, cx: &mut Context<'_>, input: &Self::In, out: &mut Self::Out) {
        let (_, command, report, switches) = input;
        let switch = |of: fn(&Switch) -> bool| move |s: &Latest<Switch>| s.get().is_some_and(|s| of(s));
        out.loan().send(self.gate.step(&GateInput {
            now: cx.now(),
            command: command.get().map(|command| **command),
            origin: command.get().and_then(|command| command.header().origin),
            report: report.get().map(|report| **report),
            enable: !switches.is_empty() && switches.iter().all(switch(|s| s.enable)),
            emergency: switches.iter().any(switch(|s| s.emergency)),
        }));
    }
}

/// Puts a gate between the controller and the simulated car: what reaches the car's wires.
///
/// The car reports from sensors of its own, not from what localization makes of them: `report` is the pose sensor's
/// speed and steering angle, before the faults that befall `pose`. `switch` is held by somebody outside; where there is
/// none a simulated person holds one.
pub(super) fn before_world(
    graph: &mut Graph,
    config: &Config,
    commands: Stream<MotionCommand>,
    pose: Stream<EgoState>,
    switch: Option<Stream<Switch>>,
) -> anyhow::Result<Stream<Command>> {
    let GateConfig { period_ms, .. } = config.gate;
    let period = super::ms(period_ms);
    let report = graph.add("report", Report, (pose,)).out();
    let report = faulty(graph, config, "report", report)?;
    let mut lamp: Option<Feedback<GateOutput>> = None;
    let switch = switch.unwrap_or_else(|| {
        let lamp = *lamp.insert(graph.feedback("gate_lamp"));
        graph.add("switch", SimulatedPerson::new(&config.gate), (every(period), lamp)).out()
    });
    let params = config.gate_params().map_err(|message| anyhow::anyhow!("gate.params: {message}"))?;
    let inputs = GateInputs { commands, report, switches: vec![switch.into()] };
    let let_through = gate(graph, params, period, inputs)?;
    if let Some(lamp) = lamp {
        graph.connect(lamp, let_through);
    }
    let pedals = PedalsOperator::new(&config.sim.vehicle);
    Ok(graph.add("pedals", pedals, (let_through, report)).out())
}

/// What the simulated car says of itself. Its driver keeps the hands off.
struct Report;

impl Operator for Report {
    type In = (At<EgoState>,);
    type Out = Port<VehicleReport>;

    fn step(&mut self, _: &mut Context<'_>, (pose,): &Self::In, out: &mut Self::Out) {
        if let Some(ego) = pose.get() {
            let EgoState { stamp, speed_mps, steering_rad, .. } = **ego;
            out.loan().send(VehicleReport { stamp, speed_mps, steering_rad, driver_active: false });
        }
    }
}

/// Who holds the switch of a simulated car: presses it once, lets go of it, stops the car, when the configuration
/// says so. Where a press did not take, for want of a command or a report, it is released and pressed again.
struct SimulatedPerson {
    enable_at: Time,
    release_at: Time,
    emergency_at: Time,
    pressed_at: Option<Time>,
    was_engaged: bool,
}

impl SimulatedPerson {
    fn new(config: &GateConfig) -> Self {
        let at = |ms: Option<f64>| ms.map_or(Time::MAX, |ms| Time::ZERO + super::ms(ms));
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
    type In = (Every, Latest<GateOutput>);
    type Out = Port<Switch>;

    fn step(&mut self, cx: &mut Context<'_>, (_, gate): &Self::In, out: &mut Self::Out) {
        let now = cx.now();
        let lamp = gate.get();
        self.was_engaged |= lamp.is_some_and(|gate| gate.engaged);
        // What the gate said of an instant before the press says nothing of the press.
        let waits = |since: Time| lamp.is_none_or(|gate| gate.command.stamp < since);
        // Before the gate has spoken it has not seen the switch released.
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

/// Works the pedals of the simulated car. While the gate is not engaged the simulated driver holds the wheel where
/// it is, and the speed.
struct PedalsOperator {
    vehicle: VehicleParams,
    /// The last speed that was a number, m/s.
    speed_mps: f64,
    /// Where the wheel is held: the angle sent last, or the first that was reported.
    steering_rad: Option<f64>,
}

impl PedalsOperator {
    fn new(vehicle: &VehicleParams) -> Self {
        Self { vehicle: vehicle.clone(), speed_mps: 0.0, steering_rad: None }
    }
}

impl Operator for PedalsOperator {
    type In = (At<GateOutput>, Latest<VehicleReport>);
    type Out = Port<Command>;

    fn step(&mut self, _: &mut Context<'_>, (gate, report): &Self::In, out: &mut Self::Out) {
        let Some(gate) = gate.get() else { return };
        if let Some(report) = report.get().filter(|report| report.speed_mps.is_finite()) {
            self.speed_mps = report.speed_mps;
        }
        let MotionCommand { steering_rad, accel_mps2, .. } = gate.command;
        if gate.mode == GateMode::Manual {
            // Without any report there is nothing to hold yet.
            let Some(report) = report.get() else { return };
            self.steering_rad = self.steering_rad.or(Some(report.steering_rad).filter(|x| x.is_finite()));
        } else {
            self.steering_rad = Some(steering_rad);
        }
        let pedals = pedals_for_accel(&self.vehicle, self.speed_mps, accel_mps2);
        let steering_rad = self.steering_rad.unwrap_or(0.0);
        out.loan().send(Command { steering_rad, throttle: pedals.throttle, brake: pedals.brake });
    }
}
