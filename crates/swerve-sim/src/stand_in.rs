//! A box that obeys steering and pedals without tyres.

use glam::{Quat, Vec3};
use rapier3d::prelude::*;
use swerve_geom::{Ego, Map, Point, Pose2, Transform, Vector, math};
use swerve_msg::{Command, EgoState, truth::EgoTruth};
use swerve_vehicle::Shape;

#[derive(Clone, Copy, PartialEq, Debug, Default, serde::Serialize, serde::Deserialize)]
pub struct VehicleParams {
    pub shape: Shape,
}

pub(crate) struct EgoCar {
    shape: Shape,
    body: RigidBodyHandle,
    steering: f64,
    accel: f64,
    lateral: f64,
}

impl EgoCar {
    pub(crate) fn spawn(
        world: &mut PhysicsWorld,
        params: &VehicleParams,
        pose: Pose2,
        speed_mps: f64,
    ) -> Self {
        let shape = params.shape;
        let center = pose.ahead(shape.center_ahead_m());
        let (s, c) = math::sin_cos(0.5 * pose.heading_rad);
        let dir = pose.direction() * speed_mps;
        let at = Pose::from_parts(
            Vec3::new(center.x_m as f32, center.y_m as f32, 0.2 + 0.5 * shape.height_m as f32),
            Quat::from_xyzw(0.0, 0.0, s as f32, c as f32),
        );
        let body = RigidBodyBuilder::dynamic()
            .pose(at)
            .linvel(Vec3::new(dir.x as f32, dir.y as f32, 0.0))
            .gravity_scale(0.0)
            .can_sleep(false)
            .enabled_rotations(false, false, true);
        let collider = ColliderBuilder::cuboid(
            0.5 * shape.length_m as f32,
            0.5 * shape.width_m as f32,
            0.5 * shape.height_m as f32,
        )
        .mass(1800.0)
        .friction(0.3);
        let (body, _) = world.insert(body, collider);
        Self { shape, body, steering: 0.0, accel: 0.0, lateral: 0.0 }
    }

    pub(crate) fn body(&self) -> RigidBodyHandle {
        self.body
    }

    pub(crate) fn apply(&mut self, world: &mut PhysicsWorld, command: &Command, friction: f64, dt_s: f64) {
        let body = &mut world.bodies[self.body];
        let ahead = body.rotation() * Vec3::X;
        let v = f64::from(body.linvel().dot(ahead));
        let limit = friction * 9.81;
        self.accel = (3.0 * command.throttle - 9.0 * command.brake).clamp(-limit, limit);
        let v = if v > 0.0 { (v + self.accel * dt_s).max(0.0) } else { v + self.accel.max(0.0) * dt_s };
        self.steering = command.steering_rad;
        let rate = v * math::tan(self.steering) / self.shape.wheelbase_m;
        self.lateral = v * rate;
        let left = body.rotation() * Vec3::Y;
        let side = (rate * (self.shape.center_ahead_m())) as f32;
        body.set_linvel(ahead * v as f32 + left * side, true);
        body.set_angvel(Vec3::Z * rate as f32, true);
    }

    pub(crate) fn truth(&self, world: &PhysicsWorld) -> EgoTruth {
        let body = &world.bodies[self.body];
        let (p, q) = (body.translation(), body.rotation());
        let yaw = 2.0 * math::atan2(f64::from(q.z), f64::from(q.w));
        let center = Pose2::new(f64::from(p.x), f64::from(p.y), yaw);
        let pose = center.ahead(-self.shape.center_ahead_m());
        let ahead = q * Vec3::X;
        let v = body.linvel();
        let omega = f64::from(body.angvel().z);
        EgoTruth {
            map_from_ego: Transform::<Map, Ego>::from_roll_pitch_yaw(
                Point::new(pose.x_m, pose.y_m, 0.0),
                0.0,
                0.0,
                yaw,
            ),
            state: EgoState {
                pose,
                speed_mps: f64::from(v.dot(ahead)),
                accel_mps2: self.accel,
                lateral_accel_mps2: self.lateral,
                yaw_rate_radps: omega,
                steering_rad: self.steering,
                ..EgoState::default()
            },
            velocity_mps: Vector::new(f64::from(v.x), f64::from(v.y), f64::from(v.z)),
            specific_force_mps2: Vector::new(self.accel, self.lateral, 9.81),
            angular_velocity_radps: Vector::new(0.0, 0.0, omega),
        }
    }
}
