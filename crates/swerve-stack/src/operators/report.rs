//! Reports of the simulated car: speed and steering angle from its own sensors, never from localization.

use std::collections::VecDeque;

use swerve_flow::{At, Context, Inputs, NamedInputs, NamedOutputs, Operator, OutputInfo, Port, PortInfo};
use swerve_msg::{EgoState, VehicleReport, WheelOdometry};

use crate::kind::{Node, OperatorKind, Settings};
use crate::site::Site;

/// Encoder readings averaged into a reported speed: 0.1 s at the default period. One reading of 96 counts per turn has
/// steps of half a metre per second.
const MEAN_OF: usize = 5;

/// Publishes reports of the simulated car. Its driver never intervenes.
pub(super) struct Reports;

impl OperatorKind for Reports {
    fn node(&self) -> Node {
        Node::new("vehicle_report", "the simulated car's report on itself")
            .only_with("gate.enabled = true")
            .stays("it is the vehicle's side of the safety gate")
    }

    fn is_there(&self, settings: &Settings<'_>) -> bool {
        settings.setup.gate.enabled
    }

    fn outputs(&self, _: &Settings<'_>) -> Vec<OutputInfo> {
        <Port<VehicleReport> as NamedOutputs>::ports()
    }

    fn inputs(&self, settings: &Settings<'_>) -> Vec<PortInfo> {
        // The state of a localizer does not qualify as a vehicle report: it may be wrong or missing.
        if settings.setup.localization.estimates() { ByWheels::ports() } else { ByPose::ports() }
    }

    fn add(&self, site: &mut Site<'_>) -> anyhow::Result<()> {
        if site.config().localization.estimates() {
            site.add(WheelReport::default(), None)
        } else {
            site.add(PoseReport, None)
        }
    }
}

/// Speed and steering angle measured by the simulator's pose sensor.
#[derive(Inputs)]
struct ByPose {
    /// Speed and steering angle, before faults on localization.
    #[port(raw)]
    pose: At<EgoState>,
}

/// Speed and steering angle measured at the wheels.
#[derive(Inputs)]
struct ByWheels {
    /// Speed and steering angle, before faults on localization.
    #[port(raw)]
    wheels: At<WheelOdometry>,
}

/// Publishes reports from the pose sensor.
struct PoseReport;

impl Operator for PoseReport {
    type In = ByPose;
    type Out = Port<VehicleReport>;

    fn step(&mut self, _: &mut Context<'_>, input: &ByPose, out: &mut Self::Out) {
        if let Some(ego) = input.pose.get() {
            let EgoState { stamp, speed_mps, steering_rad, .. } = **ego;
            out.loan().send(VehicleReport { stamp, speed_mps, steering_rad, driver_active: false });
        }
    }
}

/// Publishes reports from the wheel encoders.
#[derive(Default)]
struct WheelReport {
    /// Newest speeds, m/s.
    speeds_mps: VecDeque<f64>,
}

impl Operator for WheelReport {
    type In = ByWheels;
    type Out = Port<VehicleReport>;

    fn step(&mut self, _: &mut Context<'_>, input: &ByWheels, out: &mut Self::Out) {
        let Some(wheels) = input.wheels.get() else { return };
        let WheelOdometry { stamp, speed_mps, steering_rad, .. } = **wheels;
        self.speeds_mps.push_back(speed_mps);
        if self.speeds_mps.len() > MEAN_OF {
            self.speeds_mps.pop_front();
        }
        let speed_mps = self.speeds_mps.iter().sum::<f64>() / self.speeds_mps.len() as f64;
        out.loan().send(VehicleReport { stamp, speed_mps, steering_rad, driver_active: false });
    }
}
