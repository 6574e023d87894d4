//! The vehicle: shape, limits and motion models.
//!
//! Shared by simulator, planners and controllers. Three models of the same car, all created from [`VehicleParams`]:
//!
//! - [`Car`]: four corners with suspension, combined-slip tyres, spinning wheels, drivetrain, brakes with ABS and a
//!   steering actuator. It maps the motion of a rigid body and a command to forces; the owner of the body (the
//!   simulator's physics engine) integrates it.
//! - [`SingleTrack`]: the same tyres and masses in the plane, without heave, roll and pitch; integrates its own motion.
//! - [`Kinematic`]: wheels roll without slip, within [`Limits`].
//!
//! SI units, radians; ego frame: x forward, y left, z up, origin at the centre of the rear axle on the ground. The
//! crate has no rapier, engine or messages.

mod actuator;
mod car;
mod kinematic;
mod magic_formula;
mod params;
mod pedals;
mod pitch;
mod shape;
mod single_track;
mod steering;
mod suspension;
mod tyre;

pub use actuator::Controls;
pub use car::{BodyMotion, Car, CarForces, Ground, WheelForce, WheelState};
pub use kinematic::{Kinematic, KinematicState};
pub use magic_formula::MagicFormula;
pub use params::{
    AbsParams, AeroParams, BodyParams, BrakeParams, DrivetrainParams, SuspensionParams, TyreParams,
    VehicleParams, WheelParams,
};
pub use pedals::{Pedals, accel_for_pedals, brake_for_decel, pedals_for_accel};
pub use pitch::Pitch;
pub use shape::{Limits, Shape};
pub use single_track::{SingleTrack, SingleTrackState};
pub use steering::SteeringParams;
pub use tyre::{SlipForce, combined_slip_force};

/// Standard gravity as the simulator uses it, m/s².
pub const GRAVITY_MPS2: f64 = 9.81;
