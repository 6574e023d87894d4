//! A detector: the nearest of what is seen ahead.

use serde::{Deserialize, Serialize};
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port};
use swerve_msg::{EgoState, ObstacleList};
use swerve_stack::{Kind, Node, Site};

use super::clear_ahead::ClearAhead;

/// Finds the nearest obstacle ahead.
pub struct NearestAhead(Table);

/// Its keys in `[operator.NAME]`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Table {
    /// Half of the width that has to be clear, m.
    half_width_m: f64,
    /// Range, m.
    range_m: f64,
}

impl Default for Table {
    fn default() -> Self {
        Self { half_width_m: 1.8, range_m: 80.0 }
    }
}

/// Input ports; streams are found by type.
#[derive(Inputs)]
pub struct In {
    /// Obstacles of the frame.
    obstacles: At<ObstacleList>,
    /// Where the ego is.
    ego: Latest<EgoState>,
}

impl Kind for NearestAhead {
    const NODE: Node = Node::new("nearest_ahead", "how far the way ahead is clear").on_ladder();
    type Table = Table;

    fn new(table: Table, _: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self(table))
    }
}

impl Operator for NearestAhead {
    type In = In;
    type Out = Port<ClearAhead>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Port<ClearAhead>) {
        let (Some(seen), Some(ego)) = (input.obstacles.get(), input.ego.get()) else { return };
        let ahead = seen.obstacles.iter().map(|obstacle| ego.pose.to_local::<()>(obstacle.pose.point()));
        let in_the_way = ahead.filter(|at| at.x_m > 0.0 && at.y_m.abs() < self.0.half_width_m);
        let distance_m = in_the_way.map(|at| at.x_m).fold(self.0.range_m, f64::min);
        out.send(ClearAhead { stamp: cx.stamp(), distance_m });
    }
}
