//! A localizer: dead reckoning by the wheels from the first satellite fix, pulled towards the next ones.

use serde::{Deserialize, Serialize};
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port};
use swerve_geom::Pose2;
use swerve_msg::{EgoState, Gnss, Route, WheelOdometry};
use swerve_stack::{Kind, NamedLocalizer, Node, Site};

/// Keys, origin of the map, and the newest state.
pub struct Pulled(Table, swerve_localization::flat::Origin, Option<EgoState>);

/// Its keys in `[operator.localizer]`.
#[derive(Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub struct Table {
    /// Share of the distance to the newest fix that each step corrects.
    pull: f64,
}

/// Input ports; streams are found by type.
#[derive(Inputs)]
pub struct In {
    wheels: At<WheelOdometry>,
    fix: Latest<Gnss>,
    route: Latest<Route>,
}

impl Kind for Pulled {
    const NODE: Node = Node::new("pulled", "dead reckoning, pulled towards satellite fixes");
    type Table = Table;

    fn new(table: Table, site: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self(table, site.config().sensing.map_origin(), None))
    }
}

impl Operator for Pulled {
    type In = In;
    type Out = Port<EgoState>;

    fn step(&mut self, _: &mut Context<'_>, In { wheels, fix, route }: &In, out: &mut Self::Out) {
        let (Some(wheels), Some(fix), Some(route)) = (wheels.get(), fix.get(), route.get()) else { return };
        let place = self.1.east_north_up_m(fix.latitude_deg, fix.longitude_deg, fix.altitude_m);
        let Some([x_m, y_m, _]) = place else { return };
        let &WheelOdometry { stamp, speed_mps, yaw_rate_radps, steering_rad, .. } = &**wheels;
        let mut pose = Pose2::new(x_m, y_m, route.line().at(0.0).pose.heading_rad);
        if let Some(before) = self.2 {
            let off = pose.point() - before.pose_after((fix.stamp - before.stamp).as_secs()).point();
            pose = before.pose_after((stamp - before.stamp).as_secs());
            (pose.x_m, pose.y_m) = (pose.x_m + self.0.pull * off.x, pose.y_m + self.0.pull * off.y);
        }
        let state = EgoState { stamp, pose, speed_mps, yaw_rate_radps, steering_rad, ..EgoState::default() };
        out.send(*self.2.insert(state));
    }
}

impl NamedLocalizer for Pulled {
    const NAME: &'static str = "pulled";
    type Operator = Self;
}
