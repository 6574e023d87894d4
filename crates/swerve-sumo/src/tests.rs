//! The recorded transcript of SUMO 1.28.0 byte for byte; a peer that answers, lies, hangs and dies; SUMO itself.

mod live;
mod peer;
mod transcript;

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Point, Pose2, Transform, Vector};
use swerve_msg::truth::EgoTruth;
use swerve_msg::{ActorId, EgoState};

use crate::Settings;

/// Truth and outline of an ego of 4.5 by 1.8 m whose centre is at a pose.
fn ego(center: Pose2, speed_mps: f64) -> (EgoTruth, Obb) {
    let velocity = center.direction() * speed_mps;
    let truth = EgoTruth {
        id: ActorId::EGO,
        map_from_ego: Transform::from_roll_pitch_yaw(
            Point::new(center.x_m, center.y_m, 0.0),
            0.0,
            0.0,
            center.heading_rad,
        ),
        state: EgoState {
            stamp: Time::ZERO,
            pose: center,
            speed_mps,
            accel_mps2: 0.0,
            lateral_accel_mps2: 0.0,
            yaw_rate_radps: 0.0,
            steering_rad: 0.0,
        },
        velocity_mps: Vector::new(velocity.x, velocity.y, 0.0),
        specific_force_mps2: Vector::new(0.0, 0.0, 9.81),
        angular_velocity_radps: Vector::new(0.0, 0.0, 0.0),
    };
    (truth, Obb::new(center, 4.5, 1.8))
}

fn settings(config: &std::path::Path, stops: &[Pose2]) -> Settings {
    Settings {
        config: config.to_owned(),
        step: Span::from_ms(100),
        begin_s: 0.0,
        warmup_s: 10.0,
        range_m: 150.0,
        timeout_s: 20.0,
        offset_m: [0.0; 2],
        seed: 7,
        first: ActorId(1),
        stops: stops.to_vec(),
        lights: Vec::new(),
    }
}
