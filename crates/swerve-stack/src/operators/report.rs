//! The simulated car's reports.

use swerve_flow::{At, Context, Inputs, Operator, Port};
use swerve_msg::{EgoState, VehicleReport};

use crate::kind::{Kind, NoKeys, Node, Settings};
use crate::site::Site;

/// What the simulated car says of itself. Its driver keeps the hands off.
pub(super) struct Report;

/// What its own sensors measure.
#[derive(Inputs)]
pub(super) struct In {
    /// Speed and steering angle, before the faults that befall localization.
    #[port(raw)]
    pose: At<EgoState>,
}

impl Kind for Report {
    const NODE: Node = Node::new("vehicle_report", "what the simulated car says of itself")
        .only_with("gate.enabled = true")
        .stays("it is the vehicle's side of the safety gate");
    type Table = NoKeys;

    fn is_there(settings: &Settings<'_>) -> bool {
        settings.config.gate.enabled
    }

    fn new(_: NoKeys, _: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self)
    }
}

impl Operator for Report {
    type In = In;
    type Out = Port<VehicleReport>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(ego) = input.pose.get() {
            let EgoState { stamp, speed_mps, steering_rad, .. } = **ego;
            out.loan().send(VehicleReport { stamp, speed_mps, steering_rad, driver_active: false });
        }
    }
}
