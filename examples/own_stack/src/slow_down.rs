//! A planner: along the route, as fast as it can still stop before what is ahead.

use serde::{Deserialize, Serialize};
use swerve_core::Span;
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port};
use swerve_msg::{EgoState, Plan, PlanPoint, PlanStatus, Route};
use swerve_stack::{Kind, Node, Site};

use super::clear_ahead::ClearAhead;

/// Plans from how far the way is clear.
pub struct SlowDown {
    table: Table,
    target_mps: f64,
}

/// Its keys in `[operator.NAME]`.
#[derive(Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
pub struct Table {
    /// Distance kept to an obstacle, m.
    gap_m: f64,
}

/// Input ports; streams are found by type.
#[derive(Inputs)]
pub struct In {
    clear: At<ClearAhead>,
    ego: Latest<EgoState>,
    route: Latest<Route>,
}

impl Kind for SlowDown {
    const NODE: Node = Node::new("slow_down", "follows the route, slowly where it is not clear");
    type Table = Table;

    fn new(table: Table, site: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self { table, target_mps: site.surroundings().scenario.ego.target_speed_mps })
    }
}

impl Operator for SlowDown {
    type In = In;
    type Out = Port<Plan>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Port<Plan>) {
        let (Some(clear), Some(ego)) = (input.clear.get(), input.ego.get()) else { return };
        let Some(route) = input.route.get() else { return };
        let left_m = (clear.distance_m - self.table.gap_m).max(0.0);
        let speed_mps = self.target_mps.min((2.0 * 3.0 * left_m).sqrt()); // stops at 3 m/s2
        let from_m = route.project(ego.pose.point()).s_m;
        let point = |k: i64| {
            let at = ego.stamp + Span::from_ms(100) * k;
            let place = route.line().at(from_m + speed_mps * 0.1 * k as f64);
            PlanPoint { at, pose: place.pose, curvature_1pm: place.curvature_1pm, speed_mps, accel_mps2: 0.0 }
        };
        let points = (0..=30).map(point).collect();
        out.send(Plan { stamp: cx.stamp(), status: PlanStatus::Found, points, work: 1 });
    }
}
