//! Objects around a real vehicle.

use swerve_core::Span;
use swerve_flow::{Context, Every, Inputs, Latest, Operator, Port, Timer, every};
use swerve_msg::{Obstacle, ObstacleList};

use crate::config::execution::span_of_ms;
use crate::kind::{Kind, Node, Settings};
use crate::named::NoKeys;
use crate::site::Site;

/// Publishes objects around the ego at regular instants: those reported from outside, moved on by their velocities.
///
/// The list is empty until the first report. Later, missing reports do not mean an empty road: nothing is published, so
/// that no plan is made, and without plans the gate stops the car.
pub(super) struct ObjectsNow {
    timeout: Span,
}

/// Newest objects, at each tick.
#[derive(Inputs)]
pub(super) struct In {
    /// Period of the operator.
    tick: Every,
    /// Objects reported from outside.
    objects: Latest<ObstacleList>,
}

impl Kind for ObjectsNow {
    const NODE: Node = Node::new("objects_now", "objects that others see, moved on to regular instants")
        .stays("it is the vehicle's side of the stack")
        .follows_from_world();
    type Table = NoKeys;

    fn is_there(settings: &Settings<'_>) -> bool {
        settings.setup.live.is_some()
    }

    fn new(_: NoKeys, site: &Site<'_>) -> anyhow::Result<Self> {
        let live = site.config().live.clone().unwrap_or_default();
        Ok(Self { timeout: Span::from_secs(live.objects_timeout_s) })
    }

    fn timer(_: &NoKeys, settings: &Settings<'_>) -> Option<Timer> {
        Some(every(span_of_ms(settings.setup.sensing.period_ms)))
    }
}

impl Operator for ObjectsNow {
    type In = In;
    type Out = Port<ObstacleList>;

    fn step(&mut self, cx: &mut Context<'_>, input: &In, out: &mut Self::Out) {
        let stamp = cx.stamp();
        let Some(objects) = input.objects.get() else {
            return out.send(ObstacleList { stamp, obstacles: Vec::new() });
        };
        let age = stamp - objects.stamp;
        if age > self.timeout {
            return;
        }
        let moved = |obstacle: &Obstacle| {
            let point = obstacle.pose.point() + obstacle.velocity_mps * age.as_secs();
            let mut obstacle = obstacle.clone();
            (obstacle.pose.x_m, obstacle.pose.y_m) = (point.x_m, point.y_m);
            obstacle
        };
        out.send(ObstacleList { stamp, obstacles: objects.obstacles.iter().map(moved).collect() });
    }
}
