//! Sweeps of drives with their ground truth.

use std::collections::BTreeMap;

use swerve_core::{Span, Time};
use swerve_drive::drive_observed;
use swerve_flow::{Event, Observer};
use swerve_geom::{Ego, Point2, Pose2};
use swerve_msg::truth::{Actor, PointInstances, WorldState};
use swerve_msg::{DetectedBox, EgoState, PointCloud};
use swerve_scenario::Scenario;
use swerve_stack::Setup;

/// One sweep with its ground truth.
pub(super) struct Frame<'a> {
    /// Points.
    pub(super) cloud: &'a PointCloud,
    /// Newest measured state of the ego, up to the sweep's stamp.
    pub(super) ego: EgoState,
    /// The actors.
    pub(super) there: Vec<There>,
}

/// Actor with its visibility.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct There {
    /// True box in the ego frame.
    pub(super) truth: DetectedBox,
    /// Number of the sweep's points on it.
    pub(super) points: usize,
}

/// Drives a scenario and passes on every sweep of the one lidar that is at least `every` after the previous one.
pub(super) fn sweeps(
    config: &Setup,
    scenario: &Scenario,
    every: Span,
    show: &mut (dyn FnMut(&Frame<'_>) + Send),
) -> anyhow::Result<()> {
    let mut watch =
        Watch { every, next: Time::ZERO, world: None, ego: EgoState::default(), cloud: None, show };
    drive_observed(config, scenario, 1, &mut [&mut watch])?;
    Ok(())
}

struct Watch<'a> {
    every: Span,
    next: Time,
    world: Option<WorldState>,
    ego: EgoState,
    cloud: Option<PointCloud>,
    show: &'a mut (dyn FnMut(&Frame<'_>) + Send),
}

impl Observer for Watch<'_> {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.world = Some(world.clone());
        } else if let Some(ego) = payload.downcast_ref::<EgoState>() {
            self.ego = *ego;
        } else if let Some(cloud) = payload.downcast_ref::<PointCloud>() {
            self.cloud = (cloud.stamp >= self.next).then(|| cloud.clone());
        } else if let Some(instances) = payload.downcast_ref::<PointInstances>() {
            self.sweep(instances);
        }
    }
}

impl Watch<'_> {
    /// Takes in the instances of the previously published sweep's points, which completes the frame.
    fn sweep(&mut self, instances: &PointInstances) {
        let (Some(cloud), Some(world)) = (self.cloud.take(), &self.world) else { return };
        if cloud.stamp != instances.stamp || world.stamp != cloud.stamp {
            return;
        }
        self.next = cloud.stamp + self.every;
        let mut points: BTreeMap<u32, usize> = BTreeMap::new();
        for id in instances.instance.iter() {
            *points.entry(*id).or_default() += 1;
        }
        let there = |actor: &Actor| There {
            truth: true_box(actor, world.ego.state.pose),
            points: points.get(&actor.id.0).copied().unwrap_or(0),
        };
        let there = world.actors.iter().map(there).collect();
        (self.show)(&Frame { cloud: &cloud, ego: self.ego, there });
    }
}

/// Box that a perfect detector would report.
fn true_box(actor: &Actor, ego: Pose2) -> DetectedBox {
    let at: Point2<Ego> = ego.to_local(actor.pose.point());
    let pose = Pose2::new(at.x_m, at.y_m, actor.pose.heading_rad - ego.heading_rad);
    DetectedBox {
        kind: actor.kind,
        score: 1.0,
        pose,
        bottom_m: 0.0,
        extent: actor.extent,
        image_px: None,
        covariance_m2: None,
        radial_speed_mps: None,
    }
}
