//! A world of a few lines in which the stack drives: a lane in fog, and a crate that lies there. The world steps 20 times a second
//! and waits for the stack, whose planner takes its modelled time: `cargo run -p swerve-drive --example guest -- 600`.

#![expect(clippy::print_stdout, reason = "an example")]

use swerve_core::{Span, Time};
use swerve_drive::{Line, Stack, StackOptions};
use swerve_geom::{Point2, Pose2, Vector2, math};
use swerve_msg::{ActorId, ActorKind, Command, EgoState, Extent, Obstacle};
use swerve_stack::Setup;

const STEP: Span = Span::from_ms(50);
const WHEELBASE_M: f64 = 2.85;

/// A kinematic bicycle about its rear axle, without delay.
fn moved(car: &EgoState, command: Command) -> EgoState {
    let dt_s = STEP.as_secs();
    let accel_mps2 = 3.0 * command.throttle - 8.0 * command.brake;
    let speed_mps = (car.speed_mps + accel_mps2 * dt_s).max(0.0);
    let yaw_rate_radps = speed_mps * math::tan(command.steering_rad) / WHEELBASE_M;
    EgoState {
        stamp: car.stamp + STEP,
        pose: EgoState { speed_mps, yaw_rate_radps, ..*car }.pose_after(dt_s),
        speed_mps,
        accel_mps2,
        lateral_accel_mps2: speed_mps * yaw_rate_radps,
        yaw_rate_radps,
        steering_rad: command.steering_rad,
    }
}

/// A crate on the lane, for ten seconds and in sight for the last 20 m.
fn obstacle(car: &EgoState) -> Option<Obstacle> {
    let there = Obstacle {
        id: ActorId(1),
        kind: ActorKind::Static,
        pose: Pose2::new(50.0, 0.0, 0.0),
        extent: Extent { length_m: 1.0, width_m: 1.0, height_m: 1.0 },
        velocity_mps: Vector2::new(0.0, 0.0),
        visible_share: 1.0,
    };
    (50.0 - car.pose.x_m < 20.0 && car.stamp < Time::from_ms(10_000)).then_some(there)
}

fn main() -> anyhow::Result<()> {
    let planner_ms = std::env::args().nth(1).and_then(|ms| ms.parse().ok()).unwrap_or(50.0);
    let runtime = toml::Table::from_iter([("fixed_ms".to_owned(), toml::Value::Float(planner_ms))]);
    let config = Setup::load(None, &[("operator.planner.runtime".into(), runtime.into())])?;
    let street = Line::new(vec![Point2::new(0.0, 0.0), Point2::new(140.0, 0.0)], 10.0);
    let mut stack = Stack::new(&config, &street.scenario()?, &StackOptions::default())?;
    let mut car = EgoState { pose: Pose2::new(2.0, 0.0, 0.0), speed_mps: 10.0, ..EgoState::default() };
    while stack.feed_scene(car, obstacle(&car).into_iter().collect())?.is_none() {
        let newest = stack.advance_to(car.stamp)?.newest;
        car = moved(&car, newest.map(|newest| newest.command).unwrap_or_default());
    }
    let outcome = stack.finish()?;
    println!("{} at {}, {}", outcome.metrics.verdict, car.stamp, outcome.digest);
    Ok(())
}
