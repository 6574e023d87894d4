//! Reports of closed roads, as a traffic service broadcasts them.

use swerve_core::{Span, Time};
use swerve_flow::{Context, Every, Inputs, Operator, Port, Timer, every};
use swerve_msg::Closures;
use swerve_scenario::{Closure, Course};

use crate::kind::{Kind, Node, Settings};
use crate::named::NoKeys;
use crate::site::Site;

/// Time between two reports.
const PERIOD: Span = Span::from_ms(500);

/// Publishes the closures of the scenario that are known by then.
pub(super) struct ClosureReport(Vec<Closure>);

/// Trigger of the reports.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the reports.
    tick: Every,
}

impl Kind for ClosureReport {
    const NODE: Node =
        Node::sensor("closure_report", "places on the map that are closed to traffic").on_demand();
    type Table = NoKeys;

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        Ok(Self(match &site.surroundings().scenario.road.course {
            Course::Map(course) => course.closures.clone(),
            Course::Strip(_) => Vec::new(),
        }))
    }

    fn timer(_: &NoKeys, _: &Settings<'_>) -> Option<Timer> {
        Some(every(PERIOD))
    }
}

impl Operator for ClosureReport {
    type In = In;
    type Out = Port<Closures>;

    fn step(&mut self, cx: &mut Context<'_>, _: &In, out: &mut Self::Out) {
        let stamp = cx.stamp();
        let is_known = |closure: &&Closure| Time::ZERO + Span::from_secs(closure.reported_s) <= stamp;
        out.send(Closures {
            stamp,
            places: self.0.iter().filter(is_known).map(|closure| closure.at).collect(),
        });
    }
}
