//! Time to collision: time until outlines touch at constant velocities.

use swerve_core::{Span, Time};
use swerve_geom::{Pose2, Vector2};

use super::record::{ActorTrace, Shape, Story};

/// Prediction horizon, seconds.
pub(super) const HORIZON_S: f64 = 6.0;
/// Sampling interval, also used to estimate an actor's velocity.
const EVERY: Span = Span::from_ms(100);
const STEP_S: f64 = 0.1;

/// Smallest time to collision with any actor, seconds, by instant; `None` if no collision occurs within [`HORIZON_S`].
pub(super) fn series(story: &Story, (from, to): (Time, Time)) -> Vec<(Time, Option<f64>)> {
    let mut series = Vec::new();
    let mut at = from;
    while at <= to {
        if let Some(ego) = story.ego_at(at) {
            let moving = ego.pose.direction() * ego.speed_mps;
            let times =
                story.actors.iter().filter_map(|actor| until_touch(story, actor, (at, ego.pose, moving)));
            series.push((at, times.reduce(f64::min)));
        }
        at += EVERY;
    }
    series
}

fn until_touch(story: &Story, actor: &ActorTrace, (at, ego, moving): (Time, Pose2, Vector2)) -> Option<f64> {
    let (before, pose) = (actor.pose_at(at - EVERY)?, actor.pose_at(at)?);
    let theirs = (pose.point() - before.point()) * (1.0 / EVERY.as_secs());
    let relative: Vector2 = moving - theirs;
    let away = pose.point() - ego.point();
    // Skips the search if circles around both outlines never meet.
    let reach_m = story.outline.length_m + 0.5 * (actor.extent.length_m + actor.extent.width_m);
    let speed_mps = relative.norm();
    let nearest_s = if speed_mps > 1e-6 {
        (away.dot(relative) / (speed_mps * speed_mps)).clamp(0.0, HORIZON_S)
    } else {
        0.0
    };
    if (away - relative * nearest_s).norm() > reach_m {
        return None;
    }
    (0..=(HORIZON_S / STEP_S) as u32).map(|k| f64::from(k) * STEP_S).find(|time_s| {
        let point = ego.point() + relative * *time_s;
        let outline = story.outline.footprint(Pose2::new(point.x_m, point.y_m, ego.heading_rad));
        match actor.shape(pose) {
            Shape::Circle(center, radius_m) => outline.distance_to_point(center) <= radius_m,
            Shape::Box(other) => outline.distance(&other) <= 0.0,
        }
    })
}
