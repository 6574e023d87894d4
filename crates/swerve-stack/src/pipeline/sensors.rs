use swerve_flow::{Context, Every, Latest, Operator, Port};
use swerve_msg::truth::{Surroundings, WorldState};
use swerve_msg::{EgoState, Gnss, Imu, ObstacleList, WheelOdometry};
use swerve_sim::sense::{
    self, GnssParams, ImuParams, PoseParams, SensorMount, SensorParams, WheelOdometer, rolling_speeds_radps,
    visible_obstacles,
};
use swerve_vehicle::VehicleParams;

use crate::config::camera::CameraConfig;
use crate::config::{Config, Source};

/// Simulator state cut by what the sensor can see.
pub struct Obstacles {
    mount: SensorMount,
    params: SensorParams,
}

impl Obstacles {
    /// What the obstacle sensor can see or, where `camera` is given, what that camera can.
    pub fn new(config: &Config, camera: Option<&CameraConfig>) -> Self {
        let sensing = &config.sensing;
        let (mut mount, mut fov_deg) = (sensing.mount, sensing.fov_deg);
        if let Some(camera) = camera {
            let ([x_m, y_m, z_m], yaw_rad) = (camera.at_m, camera.yaw_deg.to_radians());
            mount = Some(SensorMount { x_m, y_m, z_m, yaw_rad });
            fov_deg = camera.fov_across_deg();
        }
        Self {
            mount: mount.unwrap_or_else(|| SensorMount::roof(&config.sim.vehicle.shape)),
            params: SensorParams {
                range_m: sensing.range_m,
                range_person_m: sensing.range_person_m,
                fov_rad: fov_deg.to_radians(),
                occlusion: sensing.source == Source::Truth,
            },
        }
    }

    fn seen(&self, world: &WorldState) -> ObstacleList {
        visible_obstacles(world, &self.mount, &self.params)
    }

    /// What is seen, and from where.
    pub fn surroundings(&self, world: &WorldState) -> Surroundings {
        let ObstacleList { stamp, obstacles } = self.seen(world);
        Surroundings { stamp, ego: world.ego.state.pose, obstacles }
    }
}

impl Operator for Obstacles {
    type In = (Every, Latest<WorldState>);
    type Out = Port<ObstacleList>;

    fn step(&mut self, _: &mut Context<'_>, (_, world): &Self::In, out: &mut Self::Out) {
        if let Some(world) = world.get() {
            out.loan().send(self.seen(world));
        }
    }
}

/// The same for an emulated detector: also from where it is seen.
pub(super) struct DetectorSight(pub(super) Obstacles);

impl Operator for DetectorSight {
    type In = (Every, Latest<WorldState>);
    type Out = (Port<ObstacleList>, Port<Surroundings>);

    fn step(&mut self, _: &mut Context<'_>, (_, world): &Self::In, out: &mut Self::Out) {
        if let Some(world) = world.get() {
            let surroundings = self.0.surroundings(world);
            let Surroundings { stamp, ref obstacles, .. } = surroundings;
            out.0.loan().send(ObstacleList { stamp, obstacles: obstacles.clone() });
            out.1.loan().send(surroundings);
        }
    }
}

/// Localization, as good as its errors let it be.
pub(super) struct Pose {
    pub(super) params: PoseParams,
    pub(super) seed: u64,
}

impl Operator for Pose {
    type In = (Every, Latest<WorldState>);
    type Out = Port<EgoState>;

    fn step(&mut self, cx: &mut Context<'_>, (_, world): &Self::In, out: &mut Self::Out) {
        if let Some(world) = world.get() {
            out.loan().send(sense::pose(world, cx.name(), &self.params, self.seed));
        }
    }
}

/// Accelerations and turn rates at the centre of gravity.
pub(super) struct Inertial {
    pub(super) params: ImuParams,
    pub(super) seed: u64,
}

impl Operator for Inertial {
    type In = (Every, Latest<WorldState>);
    type Out = Port<Imu>;

    fn step(&mut self, cx: &mut Context<'_>, (_, world): &Self::In, out: &mut Self::Out) {
        if let Some(world) = world.get() {
            out.loan().send(sense::imu(world, cx.name(), &self.params, self.seed));
        }
    }
}

/// Satellite fixes.
pub(super) struct Satellite {
    pub(super) params: GnssParams,
    pub(super) seed: u64,
}

impl Operator for Satellite {
    type In = (Every, Latest<WorldState>);
    type Out = Port<Gnss>;

    fn step(&mut self, cx: &mut Context<'_>, (_, world): &Self::In, out: &mut Self::Out) {
        if let Some(world) = world.get() {
            out.loan().send(sense::gnss(world, cx.name(), &self.params, self.seed));
        }
    }
}

/// Encoders of the wheels. Of its first tick there is no reading: there is no time yet to count over.
pub(super) struct Odometry {
    pub(super) odometer: WheelOdometer,
    pub(super) vehicle: VehicleParams,
}

impl Operator for Odometry {
    type In = (Every, Latest<WorldState>);
    type Out = Port<WheelOdometry>;

    fn step(&mut self, _: &mut Context<'_>, (_, world): &Self::In, out: &mut Self::Out) {
        let Some(world) = world.get() else { return };
        if let Some(reading) = self.odometer.sense(world, rolling_speeds_radps(&world.ego, &self.vehicle)) {
            out.send(reading);
        }
    }
}
