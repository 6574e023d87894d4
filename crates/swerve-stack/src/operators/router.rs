//! The route of the ego.

use swerve_core::Span;
use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer, every};
use swerve_map::router::Navigator;
use swerve_msg::{Closures, EgoState, Route};
use swerve_scenario::Course;

use crate::kind::{Kind, Node, Settings};
use crate::named::NoKeys;
use crate::site::Site;

/// Time between two checks of the route.
const PERIOD: Span = Span::from_ms(100);

/// Publishes the route to the destination: at the start, and again where it changes.
pub(super) struct Router {
    /// The route, until it is published.
    first: Option<Route>,
    /// Finds other routes; `None` for a road without a map.
    navigator: Option<Navigator>,
}

/// State of the ego, and reports of closed roads.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the checks.
    tick: Every,
    /// Past state of the ego: a localizer reads the route.
    #[port(feedback)]
    ego: Latest<EgoState>,
    /// Places that are closed to traffic.
    closures: Option<Latest<Closures>>,
}

impl Kind for Router {
    const NODE: Node =
        Node::new("router", "route to the destination, and another one if it is closed or left").on_demand();
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let scenario = &site.surroundings().scenario;
        let road = &scenario.road;
        let navigator = match &road.course {
            Course::Map(course) => Some(course.navigator(scenario.ego.target_speed_mps)),
            Course::Strip(_) => None,
        };
        Ok(Self { first: Some(road.route()), navigator })
    }

    fn timer(_: &NoKeys, _: &Settings<'_>) -> Option<Timer> {
        Some(every(PERIOD))
    }
}

impl Operator for Router {
    type In = In;
    type Out = Port<Route>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        if let Some(first) = self.first.take() {
            out.send(first);
        }
        let Some(navigator) = &mut self.navigator else { return };
        if let Some(closures) = input.closures.as_ref().and_then(|closures| closures.get()) {
            navigator.close(&closures.places);
        }
        if let Some(ego) = input.ego.get().filter(|ego| ego.is_plausible())
            && navigator.update(cx.now().as_secs(), ego.pose, ego.speed_mps)
        {
            out.send(navigator.route().clone());
        }
    }
}
