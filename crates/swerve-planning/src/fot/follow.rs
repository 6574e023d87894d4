//! Target places behind the obstacle in the way (Werling 2010, section V: stopping and following).

use swerve_core::Span;

use super::lattice::Aim;
use super::task::Task;

/// Interval over which the speed of the obstacle ahead is measured, seconds.
const SPEED_OVER_S: f64 = 0.5;

/// Target place of the ego origin `t_s` after the start, with its speed; `None` if nothing is in the way then.
pub(crate) fn aim(task: &Task<'_>, t_s: f64) -> Option<Aim> {
    let shape = task.checks.shape;
    let rear_m = nearest_ahead_m(task, t_s)?;
    let later_m = nearest_ahead_m(task, t_s + SPEED_OVER_S).unwrap_or(rear_m);
    // An obstacle that steps in between, or approaches, is not followed but waited for.
    let v_mps = ((later_m - rear_m) / SPEED_OVER_S).clamp(0.0, task.params.max_speed_mps);
    let gap_m = task.params.follow_gap_m + task.params.follow_time_s * v_mps;
    Some(Aim { s_m: rear_m - gap_m - (shape.length_m - shape.rear_overhang_m), v_mps })
}

/// Arc length of the nearest obstacle corner ahead of the start in the strip that the ego sweeps on its way back to the
/// line, metres.
fn nearest_ahead_m(task: &Task<'_>, t_s: f64) -> Option<f64> {
    let [start_m, ..] = task.start.s;
    let half_m = 0.5 * task.checks.shape.width_m + task.checks.clearance_m;
    let (right_m, left_m) = (task.start.d[0].min(0.0) - half_m, task.start.d[0].max(0.0) + half_m);
    let mut nearest_m = f64::INFINITY;
    task.checks.obstacles.for_each_at(task.checks.at + Span::from_secs(t_s), |solid| {
        let node = task.line.at(start_m);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        let mut rear_m = f64::INFINITY;
        for corner in solid.corners() {
            let guess_m = start_m + node.cos * (corner.x_m - node.x_m) + node.sin * (corner.y_m - node.y_m);
            let (s_m, d_m) = task.line.project(corner, guess_m);
            (low, high) = (low.min(d_m), high.max(d_m));
            rear_m = rear_m.min(s_m);
        }
        if low < left_m && high > right_m && rear_m > start_m {
            nearest_m = nearest_m.min(rear_m);
        }
    });
    nearest_m.is_finite().then_some(nearest_m)
}
