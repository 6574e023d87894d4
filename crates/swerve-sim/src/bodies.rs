//! Actors as rapier bodies: kinematic under their driver, dynamic after a collision.

use glam::{Quat, Vec3};
use rapier3d::prelude::*;
use swerve_geom::{Pose2, Vector2, math};
use swerve_msg::{ActorKind, truth};
use swerve_world::Movement;

/// Rigid body of one actor.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Body {
    pub(crate) handle: RigidBodyHandle,
    pub(crate) collider: ColliderHandle,
    /// Distance from its bottom to its centre, metres.
    half_height_m: f64,
    pub(crate) mode: Mode,
}

/// Motion mode of a body.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(crate) enum Mode {
    /// Never moves.
    Fixed,
    /// Moved by its driver.
    Driven,
    /// Moved by physics for this step only, in which a contact may occur.
    Trial,
    /// Moved by physics from now on: it has been hit.
    Hit,
}

/// Friction of actors with the ground and each other.
const FRICTION: f32 = 0.7;
/// Contact prediction distance; more than any body moves in one step.
const FORESIGHT_M: f32 = 1.0;

/// Adds the ground.
pub(crate) fn ground(world: &mut PhysicsWorld, friction: f64) {
    let plane = ColliderBuilder::cuboid(10_000.0, 10_000.0, 10.0)
        .translation(Vec3::new(0.0, 0.0, -10.0))
        .friction(friction as f32);
    world.insert_collider(plane, None);
}

/// Solves contacts of this body with others in the step in which they meet, not one step later.
pub(crate) fn foresee_contacts(world: &mut PhysicsWorld, body: RigidBodyHandle) {
    world.bodies[body].set_soft_ccd_prediction(FORESIGHT_M);
}

/// A movement on the ground.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Placed {
    pub(crate) movement: Movement,
    /// Height of the ground, metres.
    pub(crate) z_m: f64,
    /// Position along the road, metres.
    pub(crate) s_m: f64,
}

impl Body {
    pub(crate) fn insert(world: &mut PhysicsWorld, actor: &truth::Actor, mass_kg: f64) -> Self {
        let half = |m: f64| 0.5 * m as f32;
        let collider = if actor.is_round() {
            // rapier's cylinders have their axis along y.
            let upright = core::f32::consts::FRAC_PI_2;
            ColliderBuilder::cylinder(half(actor.extent.height_m), half(actor.extent.width_m))
                .rotation(Vec3::new(upright, 0.0, 0.0))
        } else {
            let extent = actor.extent;
            ColliderBuilder::cuboid(half(extent.length_m), half(extent.width_m), half(extent.height_m))
        };
        let fixed = actor.kind == ActorKind::Static;
        let builder =
            if fixed { RigidBodyBuilder::fixed() } else { RigidBodyBuilder::kinematic_position_based() };
        let half_height_m = 0.5 * actor.extent.height_m;
        let (handle, collider) = world.insert(
            builder.pose(pose3(actor.pose, actor.z_m + half_height_m)).soft_ccd_prediction(FORESIGHT_M),
            collider.mass(mass_kg as f32).friction(FRICTION),
        );
        Self { handle, collider, half_height_m, mode: if fixed { Mode::Fixed } else { Mode::Driven } }
    }

    /// Takes the body out of the physics, or puts it back at a pose.
    pub(crate) fn set_away(&self, world: &mut PhysicsWorld, is_away: bool, now: &Placed) {
        let pose = self.pose(now);
        let body = &mut world.bodies[self.handle];
        body.set_enabled(!is_away);
        body.set_position(pose, true);
    }

    /// Moves the body to its pose at the end of the coming step.
    pub(crate) fn follow(&self, world: &mut PhysicsWorld, next: &Placed) {
        world.bodies[self.handle].set_next_kinematic_position(self.pose(next));
    }

    /// Makes the body dynamic for the coming step, at its present pose and velocity.
    pub(crate) fn try_physics(&mut self, world: &mut PhysicsWorld, now: &Placed) {
        let (pose, velocity_mps) = (self.pose(now), now.movement.velocity_mps);
        let body = &mut world.bodies[self.handle];
        body.set_body_type(RigidBodyType::Dynamic, true);
        body.set_position(pose, true);
        body.set_linvel(Vec3::new(velocity_mps.x as f32, velocity_mps.y as f32, 0.0), true);
        body.set_angvel(Vec3::ZERO, true);
        self.mode = Mode::Trial;
    }

    /// Makes the body kinematic again, at the pose that its driver gives.
    pub(crate) fn restore(&mut self, world: &mut PhysicsWorld, now: &Placed) {
        let pose = self.pose(now);
        let body = &mut world.bodies[self.handle];
        body.set_body_type(RigidBodyType::KinematicPositionBased, true);
        body.set_position(pose, true);
        self.mode = Mode::Driven;
    }

    /// Pose of the body's centre for a pose on the ground.
    fn pose(&self, at: &Placed) -> Pose {
        pose3(at.movement.pose, at.z_m + self.half_height_m)
    }

    /// Reads pose and velocity of a dynamic body.
    pub(crate) fn read(&self, world: &PhysicsWorld, actor: &mut truth::Actor) {
        let body = &world.bodies[self.handle];
        let (at, velocity) = (body.translation(), body.linvel());
        let ahead = body.rotation() * Vec3::X;
        let heading_rad = math::atan2(f64::from(ahead.y), f64::from(ahead.x));
        actor.pose = Pose2::new(f64::from(at.x), f64::from(at.y), heading_rad);
        actor.z_m = f64::from(at.z) - self.half_height_m;
        actor.velocity_mps = Vector2::new(f64::from(velocity.x), f64::from(velocity.y));
    }
}

/// Magnitude of the impulse between two colliders in the last step, N s.
pub(crate) fn impulse_n_s(world: &PhysicsWorld, a: ColliderHandle, b: ColliderHandle) -> f64 {
    world.contact_pair(a, b).map_or(0.0, |pair| f64::from(pair.total_impulse().length()))
}

fn pose3(pose: Pose2, z_m: f64) -> Pose {
    let (sin, cos) = math::sin_cos(0.5 * pose.heading_rad);
    Pose::from_parts(
        Vec3::new(pose.x_m as f32, pose.y_m as f32, z_m as f32),
        Quat::from_xyzw(0.0, 0.0, sin as f32, cos as f32),
    )
}
