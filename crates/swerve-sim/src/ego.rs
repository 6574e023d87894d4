//! The ego car as a rigid body of the physics world.
//!
//! The car model ([`swerve_vehicle::Car`]) computes the forces of tyres, springs and air; rapier integrates the body
//! and adds gravity and collisions. The ground is the plane z = 0 of the map, with analytic wheel contact; the box of
//! the chassis does not touch it. rapier computes in `f32`; this module converts its numbers to `f64` and typed frames,
//! and back.

mod convert;

use rapier3d::dynamics::{MassProperties, RigidBodyBuilder, RigidBodyHandle};
use rapier3d::geometry::{ColliderBuilder, ColliderHandle};
use rapier3d::pipeline::PhysicsWorld;
use swerve_core::{Span, Time};
use swerve_geom::{Ego, Map, Point, Point2, Pose2, Transform, Vector, math};
use swerve_msg::truth::EgoTruth;
use swerve_msg::{ActorId, Command, EgoState};
use swerve_vehicle::{BodyMotion, Car, Controls, Ground, VehicleParams};

use convert::{from_vec, pose_from_transform, to_transform, to_vec};

/// Height of the chassis' underside above ground, metres.
const CLEARANCE_M: f64 = 0.16;

/// Motion of the body at `apply`, for differences after the world step.
#[derive(Clone, Copy, Debug)]
struct Before {
    velocity_mps: [f64; 3],
    speed_mps: f64,
    dt_s: f64,
}

/// The ego car: its model and its body in a physics world.
///
/// Call per step: [`EgoCar::apply`], then the world step, then [`EgoCar::truth`].
#[derive(Clone, Debug)]
pub struct EgoCar {
    id: ActorId,
    car: Car,
    body: RigidBodyHandle,
    collider: ColliderHandle,
    stamp: Time,
    before: Option<Before>,
}

impl EgoCar {
    /// Spawns a car with identity `id` in the world: at rest on its springs at `map_from_ego`, moving at `speed_mps`.
    ///
    /// The world's gravity must point along -z.
    pub fn spawn(
        world: &mut PhysicsWorld,
        id: ActorId,
        params: &VehicleParams,
        map_from_ego: Pose2,
        speed_mps: f64,
    ) -> Self {
        let car = Car::new(params, speed_mps);
        let pose = Transform::from_roll_pitch_yaw(
            Point::new(map_from_ego.x_m, map_from_ego.y_m, 0.0),
            0.0,
            0.0,
            map_from_ego.heading_rad,
        );
        let forward = map_from_ego.direction();
        let inertia = Vector::<Ego>::new(
            params.body.roll_inertia_kgm2,
            params.body.pitch_inertia_kgm2,
            params.body.yaw_inertia_kgm2,
        );
        let mass = MassProperties::new(
            to_vec(car.center_of_gravity().coords),
            convert::narrow(params.body.mass_kg),
            to_vec(inertia.coords),
        );
        let body = RigidBodyBuilder::dynamic()
            .pose(pose_from_transform(&pose))
            .linvel(to_vec(Vector::<Map>::new(forward.x * speed_mps, forward.y * speed_mps, 0.0).coords))
            .additional_mass_properties(mass)
            .can_sleep(false)
            .build();
        let (body, collider) = world.insert(body, chassis(params));
        Self { id, car, body, collider, stamp: Time::default(), before: None }
    }

    /// Identity in the run.
    pub fn id(&self) -> ActorId {
        self.id
    }

    /// Handle of the body in the world.
    pub fn handle(&self) -> RigidBodyHandle {
        self.body
    }

    /// Collider of the chassis box; its contacts are collisions of the ego.
    pub fn collider(&self) -> ColliderHandle {
        self.collider
    }

    /// Car model, with wheels and actuators.
    pub fn car(&self) -> &Car {
        &self.car
    }

    /// Applies the forces of this step to the body; must be called before each world step, with the same `dt_s`.
    ///
    /// `friction` is the peak friction of the car's tyres at a point of the ground. A command that is not finite is
    /// refused (the previous one stays in force); one out of range is clamped.
    pub fn apply(
        &mut self,
        world: &mut PhysicsWorld,
        command: &Command,
        friction: impl Fn(Point2) -> f64,
        dt_s: f64,
    ) {
        let motion = self.motion(world);
        let controls =
            Controls { steering_rad: command.steering_rad, throttle: command.throttle, brake: command.brake };
        let ground = self.car.contact_points().map(|point| {
            let at = (motion.map_from_ego * point).coords;
            Ground { height_m: 0.0, friction: friction(Point2::new(at.x, at.y)) }
        });
        let forces = self.car.step(&motion, &ground, controls, dt_s);
        self.before = Some(Before {
            velocity_mps: motion.velocity_mps.coords.into(),
            speed_mps: origin_motion(&self.car, &motion).0,
            dt_s,
        });
        self.stamp += Span::from_secs(dt_s);
        // Summed here, in double precision about the true centre of gravity, which rapier knows for a new body only
        // after its first step.
        let cg = motion.map_from_ego * self.car.center_of_gravity();
        let (mut force_n, mut torque_nm) = (forces.drag_n.coords, Vector::<Map>::default().coords);
        for wheel in &forces.wheels {
            force_n += wheel.force_n.coords;
            torque_nm += (wheel.point - cg).coords.cross(&wheel.force_n.coords);
        }
        let body = &mut world.bodies[self.body];
        body.reset_forces(false);
        body.reset_torques(false);
        body.add_force(to_vec(force_n), true);
        body.add_torque(to_vec(torque_nm), true);
    }

    /// State of the car after the world step. Accelerations are the mean over that step, including collisions; the
    /// stamp counts from zero at the spawn.
    pub fn truth(&self, world: &PhysicsWorld) -> EgoTruth {
        let motion = self.motion(world);
        let pose = motion.map_from_ego;
        let (_, _, yaw_rad) = pose.roll_pitch_yaw();
        let heading_pose = Pose2::new(pose.origin().coords.x, pose.origin().coords.y, yaw_rad);
        let (speed_mps, sideways_mps) = origin_motion(&self.car, &motion);
        let yaw_rate_radps = motion.angular_velocity_radps.coords.z;
        let (acceleration, accel_mps2) = match self.before {
            None => (Vector::default(), 0.0),
            Some(before) => {
                let [vx, vy, vz] = before.velocity_mps;
                let gained = motion.velocity_mps - Vector::new(vx, vy, vz);
                let along = (speed_mps - before.speed_mps) / before.dt_s - sideways_mps * yaw_rate_radps;
                (gained * (1.0 / before.dt_s), along)
            }
        };
        let (sin, cos) = math::sin_cos(yaw_rad);
        let from_map = pose.inverse();
        EgoTruth {
            id: self.id,
            map_from_ego: pose,
            state: EgoState {
                stamp: self.stamp,
                pose: heading_pose,
                speed_mps,
                accel_mps2,
                lateral_accel_mps2: acceleration.coords.y * cos - acceleration.coords.x * sin,
                yaw_rate_radps,
                steering_rad: self.car.steering_rad(),
            },
            velocity_mps: motion.velocity_mps,
            specific_force_mps2: from_map * (acceleration - from_vec(world.gravity)),
            angular_velocity_radps: from_map * motion.angular_velocity_radps,
        }
    }

    fn motion(&self, world: &PhysicsWorld) -> BodyMotion {
        let body = &world.bodies[self.body];
        BodyMotion {
            map_from_ego: to_transform(body.position()),
            velocity_mps: from_vec(body.linvel()),
            angular_velocity_radps: from_vec(body.angvel()),
        }
    }
}

/// Massless box of the chassis.
fn chassis(params: &VehicleParams) -> ColliderBuilder {
    let shape = &params.shape;
    let half_height = 0.5 * (shape.height_m - CLEARANCE_M).max(0.1);
    let half = Vector::<Ego>::new(0.5 * shape.length_m, 0.5 * shape.width_m, half_height)
        .coords
        .map(convert::narrow);
    let center = Vector::<Ego>::new(shape.center_ahead_m(), 0.0, CLEARANCE_M + half_height);
    ColliderBuilder::cuboid(half.x, half.y, half.z)
        .translation(to_vec(center.coords))
        .density(0.0)
        .friction(0.4)
}

/// Velocity of the ego origin in the ground plane, forward and to the left, m/s.
fn origin_motion(car: &Car, motion: &BodyMotion) -> (f64, f64) {
    let pose = motion.map_from_ego;
    let lever = (pose.origin() - pose * car.center_of_gravity()).coords;
    let velocity = motion.velocity_mps.coords + motion.angular_velocity_radps.coords.cross(&lever);
    let ahead = (pose * Vector::<Ego>::new(1.0, 0.0, 0.0)).coords;
    let flat = math::hypot(ahead.x, ahead.y).max(1e-9);
    let (cos, sin) = (ahead.x / flat, ahead.y / flat);
    (velocity.x * cos + velocity.y * sin, velocity.y * cos - velocity.x * sin)
}

#[cfg(test)]
mod tests;
