//! A custom planner: follows the route at the highest speed from which it can still stop before an obstacle ahead.

use serde::{Deserialize, Serialize};
use swerve_core::Span;
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port};
use swerve_msg::{EgoState, ObstacleList, Plan, PlanPoint, PlanStatus, Route};
use swerve_stack::{Kind, Node, Site};

/// Follows the route and slows down where it is not clear.
pub struct SlowDown {
    keys: Keys,
    target_mps: f64,
}

/// Keys in `[operator.NAME]`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Keys {
    /// Half of the width that must be clear of stationary obstacles, m.
    half_width_m: f64,
    /// Half of the width that must be clear of moving obstacles, m.
    half_width_moving_m: f64,
    /// Gap kept to an obstacle, m.
    gap_m: f64,
    /// Braking deceleration, m/s2.
    brake_mps2: f64,
}

impl Default for Keys {
    fn default() -> Self {
        Self { half_width_m: 1.3, half_width_moving_m: 4.0, gap_m: 4.0, brake_mps2: 5.0 }
    }
}

/// Inputs; streams are found by their type.
#[derive(Inputs)]
pub struct In {
    /// Detected obstacles.
    obstacles: At<ObstacleList>,
    /// Ego pose and speed.
    ego: Latest<EgoState>,
    /// Route to follow.
    route: Latest<Route>,
}

impl Kind for SlowDown {
    const NODE: Node = Node::new("slow_down", "follows the route, slowly where it is not clear");
    type Table = Keys;

    fn new(keys: Keys, site: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self { keys, target_mps: site.surroundings().scenario.ego.target_speed_mps })
    }
}

impl Operator for SlowDown {
    type In = In;
    type Out = Port<Plan>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Port<Plan>) {
        let (Some(seen), Some(ego)) = (input.obstacles.get(), input.ego.get()) else { return };
        let Some(route) = input.route.get() else { return };
        let from_m = route.project(ego.pose.point()).s_m;
        let ahead = seen.obstacles.iter().filter_map(|obstacle| {
            let at = route.project(obstacle.pose.point());
            let half_width_m = if obstacle.velocity_mps.norm() > 0.3 {
                self.keys.half_width_moving_m
            } else {
                self.keys.half_width_m
            };
            (at.s_m > from_m && at.d_m.abs() < half_width_m).then_some(at.s_m - from_m)
        });
        let left_m = ahead.fold(f64::INFINITY, f64::min) - self.keys.gap_m;
        let speed_mps = self.target_mps.min((2.0 * self.keys.brake_mps2 * left_m.max(0.0)).sqrt());
        let point = |k: i64| {
            let place = route.line().at(from_m + speed_mps * 0.1 * k as f64);
            PlanPoint {
                at: ego.stamp + Span::from_ms(100) * k,
                pose: place.pose,
                curvature_1pm: place.curvature_1pm,
                speed_mps,
                accel_mps2: 0.0,
            }
        };
        let points = (0..=30).map(point).collect();
        out.send(Plan { stamp: cx.stamp(), status: PlanStatus::Found, points, work: 1 });
    }
}
