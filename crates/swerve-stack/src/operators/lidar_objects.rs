//! Object detection in lidar point clouds: a kind of operator for each detector.

use anyhow::Context as _;
use swerve_flow::{At, Context, Inputs, Latest, Operator, Port, Window};
use swerve_geom::{Ego, Lidar, Point, Transform};
use swerve_msg::{Detections, EgoState, PointCloud, Route};
use swerve_perception::lidar::Scan;
use swerve_vehicle::VehicleParams;

use super::camera_objects::pitch_rad;
use crate::detectors::NamedLidarDetector;
use crate::kind::{Heavy, Kind, Node};
use crate::problems::{KeyProblems, problem};
use crate::registry::Registry;
use crate::site::Site;

/// Past poses kept to find the one at a sweep's stamp: up to the age of a sweep, at 100 Hz.
const POSES: usize = 256;

impl Registry {
    /// Adds a lidar detector: a kind of operator with its name, in place of an existing one of the same name.
    #[must_use]
    pub fn with_lidar_detector<D: NamedLidarDetector>(self) -> Self {
        self.with::<Objects<D>>()
    }
}

/// Detects objects in each sweep of a lidar.
pub(crate) struct Objects<D> {
    detector: D,
    ego_from_lidar: Transform<Ego, Lidar>,
    own_m: [f64; 3],
    vehicle: VehicleParams,
}

/// A sweep, and past poses of the ego.
#[derive(Inputs)]
pub(crate) struct In {
    /// Points of the sweep.
    points: At<PointCloud>,
    /// Past poses of the ego.
    poses: Window<EgoState, POSES>,
    /// Route of the ego: the ground on which objects are expected.
    route: Latest<Route>,
}

impl<D: NamedLidarDetector> Kind for Objects<D> {
    const NODE: Node = Node::new(D::NAME, D::DOC).heavy(Heavy::Yes);
    type Table = D::Params;

    fn problems(table: &D::Params) -> KeyProblems {
        D::validate(table).err().map(problem).into_iter().collect()
    }

    fn new(table: D::Params, site: &Site<'_>) -> anyhow::Result<Self> {
        let (name, config) = (site.name(), site.config());
        let from = site.source_of("points").with_context(|| format!("operator.{name}: it reads no lidar"))?;
        let lidar = config.lidar.get(from).with_context(|| {
            format!(
                "operator.{name}: expected points of a [lidar.NAME], whose mounting pose is known, found `{from}`"
            )
        })?;
        let shape = &config.sim.vehicle.shape;
        let rear_m = -shape.rear_overhang_m;
        Ok(Self {
            detector: D::with_params(table)?,
            ego_from_lidar: lidar.ego_from_lidar(shape),
            own_m: [rear_m, rear_m + shape.length_m, 0.5 * shape.width_m],
            vehicle: config.sim.vehicle.clone(),
        })
    }
}

impl<D: NamedLidarDetector> Operator for Objects<D> {
    type In = In;
    type Out = Port<Detections>;

    fn step(&mut self, _: &mut Context<'_>, input: &In, out: &mut Port<Detections>) {
        let (Some(cloud), poses) = (input.points.get(), input.poses.get()) else { return };
        let before = poses.iter().rev().find(|pose| pose.header().stamp <= cloud.stamp);
        let Some(measured) = before.or(poses.first()) else { return };
        let mut ego = **measured;
        ego.pose = measured.pose_after((cloud.stamp - measured.stamp).as_secs());
        let until: Vec<EgoState> =
            poses.iter().map(|pose| **pose).filter(|pose| pose.stamp <= cloud.stamp).collect();
        let pitch_rad = pitch_rad(&until, &self.vehicle);
        let ego_from_body = Transform::from_roll_pitch_yaw(Point::new(0.0, 0.0, 0.0), 0.0, pitch_rad, 0.0);
        let (ego_from_lidar, own_m) = (ego_from_body * self.ego_from_lidar, self.own_m);
        let scan = Scan { cloud, ego_from_lidar, ego, own_m, route: input.route.get().map(|route| &**route) };
        let mut found = Detections::default();
        self.detector.detect(&scan, &mut found);
        out.loan().send(found);
    }
}
