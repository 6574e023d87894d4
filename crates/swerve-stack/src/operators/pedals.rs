//! Pedals of the simulated car after a safety gate.

use swerve_control::safety_gate;
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port};
use swerve_msg::{Command, GateMode, GateOutput, VehicleReport};
use swerve_vehicle::VehicleParams;

use crate::kind::{Kind, Node, Settings};
use crate::named::NoKeys;
use crate::site::Site;

/// Operates the pedals of the simulated car. While the gate is not engaged the simulated driver holds steering angle
/// and speed.
pub(super) struct PedalsOperator {
    vehicle: VehicleParams,
    /// Last finite speed, m/s.
    speed_mps: f64,
    /// Steering angle to hold: the last one sent, or the first one reported.
    steering_rad: Option<f64>,
}

/// Output of the gate, and speed of the car.
#[derive(Inputs)]
pub(super) struct In {
    /// Output of the gate.
    gate: At<GateOutput>,
    /// Report of the car.
    report: Latest<VehicleReport>,
}

impl Kind for PedalsOperator {
    const NODE: Node =
        Node::new("pedals", "actuates the simulated car's pedals from the safety gate's command")
            .only_with("gate.enabled = true")
            .stays("it is the vehicle's side of the safety gate");
    type Table = NoKeys;

    fn is_there(settings: &Settings<'_>) -> bool {
        settings.setup.gate.enabled
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
            // There is nothing to hold before the first report.
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
