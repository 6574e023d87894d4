//! Speed and steering angle of a vehicle's report, in the form of wheel odometry for localization.

use swerve_flow::{At, Context, Inputs, Operator, Port};
use swerve_msg::{VehicleReport, WheelOdometry};

use crate::kind::{Kind, Node, Settings};
use crate::named::NoKeys;
use crate::site::Site;

/// Takes speed and steering angle from a vehicle's report.
pub(super) struct ReportedOdometry;

/// Report of the vehicle.
#[derive(Inputs)]
pub(super) struct In {
    /// Report of the vehicle.
    report: At<VehicleReport>,
}

impl Kind for ReportedOdometry {
    const NODE: Node =
        Node::new("reported_odometry", "speed and steering angle of a vehicle's report, for localization")
            .only_with("localization.localizer");
    type Table = NoKeys;

    fn is_there(settings: &Settings<'_>) -> bool {
        settings.setup.localization.estimates()
    }

    fn new(_: NoKeys, _: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self)
    }
}

impl Operator for ReportedOdometry {
    type In = In;
    type Out = Port<WheelOdometry>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(report) = input.report.get() {
            let VehicleReport { stamp, speed_mps, steering_rad, .. } = **report;
            out.send(WheelOdometry { stamp, speed_mps, steering_rad, ..WheelOdometry::default() });
        }
    }
}
