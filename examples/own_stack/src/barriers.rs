//! An operator that reads the map and the route: it reports roads as closed where a barrier is on the route.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port};
use swerve_map::{LaneId, LanePlace, Map, router::Stop};
use swerve_msg::{ActorKind, Closures, ObstacleList, Route};
use swerve_stack::{Kind, Node, Site};

/// Map, and the first barrier on each lane.
pub struct Barriers(Arc<Map>, BTreeMap<LaneId, Stop>);

/// It has no keys.
#[derive(Serialize, Deserialize, Default)]
#[serde(deny_unknown_fields)]
pub struct Table {}

/// Input ports; streams are found by type.
#[derive(Inputs)]
pub struct In {
    seen: At<ObstacleList>,
    route: Latest<Route>,
}

impl Kind for Barriers {
    const NODE: Node = Node::new("barriers", "reports roads as closed where a barrier is on the route");
    type Table = Table;

    fn new(_: Table, site: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self(site.map(), BTreeMap::new()))
    }
}

impl Operator for Barriers {
    type In = In;
    type Out = Port<Closures>;

    fn step(&mut self, cx: &mut Context<'_>, In { seen, route }: &In, out: &mut Self::Out) {
        let (Some(seen), Some(route)) = (seen.get(), route.get()) else { return };
        for barrier in seen.obstacles.iter().filter(|one| one.kind == ActorKind::Static) {
            let Some(LanePlace { lane, place }) = self.0.nearest(barrier.pose.point()) else { continue };
            if place.d_m.abs() < 1.0 && route.stretches().iter().any(|on| on.lane == lane) {
                self.1.entry(lane).or_insert(Stop { lane, s_m: place.s_m });
            }
        }
        out.send(Closures { stamp: cx.stamp(), places: self.1.values().copied().collect() });
    }
}
