//! Turns of a lidar in a drive, with the true place of each point.

use swerve_core::{Span, Time};
use swerve_flow::{Event, Observer};
use swerve_geom::{Ego, Lidar, Map, Point, Transform};
use swerve_localization::dead_reckoning::{LidarMotion, Reading, Turned};
use swerve_localization::ndt::{Isometry3, Vector3};
use swerve_msg::truth::{PointInstances, WorldState};
use swerve_msg::{Imu, PointCloud, WheelOdometry};

use crate::worlds::Worlds;

/// One turn of the lidar.
pub(super) struct Turn {
    /// Pose at the end of the turn.
    pub(super) map_from_lidar: Isometry3<f64>,
    /// Points in the map frame, by the true motion, and the actor hit by each, 0 for none.
    pub(super) points: Vec<(Vector3<f64>, u32)>,
    /// Points as measured, and their times as a share of the turn relative to its end, -1 to 0.
    pub(super) measured: Vec<(Vector3<f64>, f64)>,
    /// Motion of the lidar from wheels and gyroscopes.
    pub(super) motion: Turned,
}

/// Passes on the turns of a drive.
pub(super) struct Turns<'a> {
    lidar: String,
    ego_from_lidar: Transform<Ego, Lidar>,
    worlds: Worlds,
    cloud: Option<PointCloud>,
    motion: LidarMotion,
    each: &'a mut (dyn FnMut(&Turn) + Send),
}

impl<'a> Turns<'a> {
    pub(super) fn new(
        lidar: &str,
        ego_from_lidar: Transform<Ego, Lidar>,
        each: &'a mut (dyn FnMut(&Turn) + Send),
    ) -> Self {
        Self {
            lidar: lidar.to_owned(),
            ego_from_lidar,
            worlds: Worlds::default(),
            cloud: None,
            motion: LidarMotion::new(ego_from_lidar.isometry()),
            each,
        }
    }

    fn turn(&mut self, truth: &PointInstances) -> Option<Turn> {
        let cloud = self.cloud.take().filter(|cloud| cloud.stamp == truth.stamp)?;
        let end = self.map_from_lidar(cloud.stamp)?;
        let motion = self.motion.turn(cloud.stamp)?;
        let period_s = motion.period_s;
        let (points, measured) = (Vec::new(), Vec::new());
        let mut turn = Turn { map_from_lidar: end.isometry(), points, measured, motion };
        for k in 0..cloud.len() {
            let offset_s = f64::from(cloud.time_offset_s[k]);
            let then = self.map_from_lidar(cloud.stamp + Span::from_secs(offset_s))?;
            let [x, y, z] = [cloud.x_m[k], cloud.y_m[k], cloud.z_m[k]].map(f64::from);
            let at = (then * Point::new(x, y, z)).coords;
            let instance = *truth.instance.get(k)?;
            turn.points.push((Vector3::new(at.x, at.y, at.z), instance));
            turn.measured.push((Vector3::new(x, y, z), offset_s / period_s));
        }
        Some(turn)
    }

    /// Pose of the lidar at an instant, extrapolated from the previous step at its velocity.
    fn map_from_lidar(&self, at: Time) -> Option<Transform<Map, Lidar>> {
        let world = self.worlds.near(at)?;
        let moved = world.ego.velocity_mps.coords * (at - world.stamp).as_secs();
        let pose = world.ego.map_from_ego * self.ego_from_lidar;
        let at = pose.origin().coords + moved;
        Some(Transform::new(Point::new(at.x, at.y, at.z), pose.rotation()))
    }
}

impl Observer for Turns<'_> {
    fn event(&mut self, event: &Event<'_>) {
        let Event::Publication(publication) = event else { return };
        let Some(payload) = publication.payload else { return };
        if let Some(world) = payload.downcast_ref::<WorldState>() {
            self.worlds.take(world);
        } else if let Some(wheels) = payload.downcast_ref::<WheelOdometry>() {
            self.motion.car.take(wheels.stamp, Reading::Wheels(wheels.speed_mps));
        } else if let Some(imu) = payload.downcast_ref::<Imu>() {
            self.motion.car.take(imu.stamp, Reading::Gyro(imu.gyro_radps));
        } else if publication.operator != self.lidar {
        } else if let Some(cloud) = payload.downcast_ref::<PointCloud>() {
            self.cloud = Some(cloud.clone());
        } else if let Some(truth) = payload.downcast_ref::<PointInstances>()
            && let Some(turn) = self.turn(truth)
        {
            (self.each)(&turn);
        }
    }
}
