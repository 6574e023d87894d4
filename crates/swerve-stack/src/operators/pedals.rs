//! The pedals of the simulated car behind a safety gate.

use swerve_control::safety_gate;
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port};
use swerve_msg::{Command, GateMode, GateOutput, VehicleReport};
use swerve_vehicle::VehicleParams;

use crate::kind::{Kind, NoKeys, Node, Settings};
use crate::site::Site;

/// Works the pedals of the simulated car. While the gate is not engaged the simulated driver holds the wheel where
/// it is, and the speed.
pub(super) struct PedalsOperator {
    vehicle: VehicleParams,
    /// The last speed that was a number, m/s.
    speed_mps: f64,
    /// Where the wheel is held: the angle sent last, or the first that was reported.
    steering_rad: Option<f64>,
}

/// What the gate lets through, and how fast the car is.
#[derive(Inputs)]
pub(super) struct In {
    /// What the gate lets through.
    gate: At<GateOutput>,
    /// What the car says of itself.
    report: Latest<VehicleReport>,
}

impl Kind for PedalsOperator {
    const NODE: Node = Node::new("pedals", "works the pedals of the simulated car as the safety gate says")
        .only_with("gate.enabled = true")
        .stays("it is the vehicle's side of the safety gate");
    type Table = NoKeys;

    fn is_there(settings: &Settings<'_>) -> bool {
        settings.config.gate.enabled
    }

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self { vehicle: site.config().sim.vehicle.clone(), speed_mps: 0.0, steering_rad: None })
    }
}

impl Operator for PedalsOperator {
    type In = In;
    type Out = Port<Command>;

    fn step(&mut self, _: &mut Context<'_>, In { gate, report }: &In, out: &mut Self::Out) {
        let Some(gate) = gate.get() else { return };
        if let Some(report) = report.get().filter(|report| report.speed_mps.is_finite()) {
            self.speed_mps = report.speed_mps;
        }
        if gate.mode == GateMode::Manual {
            // Without any report there is nothing to hold yet.
            let Some(report) = report.get() else { return };
            self.steering_rad = self.steering_rad.or(Some(report.steering_rad).filter(|x| x.is_finite()));
        } else {
            self.steering_rad = Some(gate.command.steering_rad);
        }
        let pedals = safety_gate::pedals(&self.vehicle, gate, self.speed_mps);
        let steering_rad = self.steering_rad.unwrap_or(0.0);
        out.loan().send(Command { steering_rad, throttle: pedals.throttle, brake: pedals.brake });
    }
}
