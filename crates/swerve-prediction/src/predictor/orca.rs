//! Optimal reciprocal collision avoidance (van den Berg, Guy, Lin and Manocha 2011, sections 4 and 5).
//!
//! Each of two agents takes half of the smallest change of their relative velocity that keeps them apart for some
//! time: a half plane of velocities for each neighbour. The new velocity is the one in all half planes that is
//! nearest to the preferred velocity, which is the initial one. If there is none, it is the one that violates the
//! worst half plane least.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2};
use swerve_msg::ActorKind;

use super::drawn::single;
use super::straight::VELOCITY_WINDOW_S;
use super::{Horizon, Modes, Tracked};

/// Time for which collisions are avoided, seconds.
const LOOK_AHEAD_S: f64 = 1.5;
/// Radius of a pedestrian, metres.
pub(crate) const RADIUS_M: f64 = 0.2;
/// Largest speed, as a ratio to the preferred speed.
const SPEED_SHARE_MAX: f64 = 1.3;
/// Largest number of neighbours, and their largest distance, metres.
const NEIGHBOURS_MAX: usize = 10;
const NEIGHBOURS_WITHIN_M: f64 = 10.0;
/// Largest integration step, seconds.
const STEP_S: f64 = 0.2;
/// Threshold for parallel lines.
const EPSILON: f64 = 1e-9;

/// A simulated road user.
#[derive(Clone, Copy)]
pub(crate) struct Agent {
    pub(crate) point: Point2,
    pub(crate) velocity_mps: Vector2,
    pub(crate) wanted_mps: Vector2,
    pub(crate) radius_m: f64,
    /// True if it is not a pedestrian: it moves straight ahead, and pedestrians do all of the avoidance.
    pub(crate) fixed: bool,
}

/// A half plane: velocities to the left of `direction` through `point` are allowed.
#[derive(Clone, Copy)]
struct Line {
    point: Vector2,
    direction: Vector2,
}

/// Predictions with one mode per actor.
pub(super) fn predictions(seen: &[Tracked], stamp: Time, horizon: &Horizon) -> Vec<Modes> {
    let mut agents: Vec<Agent> = seen.iter().map(|seen| Agent::of(seen, stamp)).collect();
    let mut paths: Vec<Vec<Point2>> = agents.iter().map(|agent| vec![agent.point]).collect();
    let steps = (horizon.step.as_secs() / STEP_S).ceil().max(1.0);
    let step_s = horizon.step.as_secs() / steps;
    for _ in 0..horizon.steps {
        for _ in 0..steps as usize {
            let taken: Vec<Vector2> = (0..agents.len()).map(|k| velocity(&agents, k, step_s)).collect();
            for (agent, velocity_mps) in agents.iter_mut().zip(taken) {
                agent.velocity_mps = velocity_mps;
                agent.point = agent.point + velocity_mps * step_s;
            }
        }
        paths.iter_mut().zip(&agents).for_each(|(path, agent)| path.push(agent.point));
    }
    seen.iter().zip(&paths).map(|(seen, path)| single(seen, stamp, horizon, path)).collect()
}

impl Agent {
    fn of(seen: &Tracked, stamp: Time) -> Self {
        let velocity_mps = seen.past.velocity_mps(VELOCITY_WINDOW_S);
        let fixed = seen.past.kind != ActorKind::Pedestrian;
        let extent = seen.track.extent;
        let radius_m = if fixed { 0.5 * extent.length_m.max(extent.width_m) } else { RADIUS_M };
        let point = seen.past.now(stamp, velocity_mps);
        Self { point, velocity_mps, wanted_mps: velocity_mps, radius_m, fixed }
    }
}

/// New velocity of agent `k`.
pub(crate) fn velocity(agents: &[Agent], k: usize, step_s: f64) -> Vector2 {
    let me = &agents[k];
    if me.fixed {
        return me.velocity_mps;
    }
    let mut near: Vec<(f64, usize)> = (0..agents.len())
        .filter(|j| *j != k)
        .map(|j| (me.point.distance(agents[j].point) - agents[j].radius_m, j))
        .filter(|(apart_m, _)| *apart_m < NEIGHBOURS_WITHIN_M)
        .collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    near.truncate(NEIGHBOURS_MAX);
    let lines: Vec<Line> = near.iter().map(|(_, j)| line(me, &agents[*j], step_s)).collect();
    let most_mps = SPEED_SHARE_MAX * me.wanted_mps.norm();
    match nearest(&lines, most_mps, me.wanted_mps) {
        Ok(velocity_mps) => velocity_mps,
        Err((failed, velocity_mps)) => least_bad(&lines, failed, most_mps, velocity_mps),
    }
}

/// Half plane of velocities that avoid `other`.
fn line(me: &Agent, other: &Agent, step_s: f64) -> Line {
    let apart: Vector2 = other.point - me.point;
    let relative = me.velocity_mps - other.velocity_mps;
    let radius = me.radius_m + other.radius_m;
    let touching = apart.norm() <= radius;
    // Agents in contact separate within the step; others avoid contact over the look-ahead time.
    let within_s = if touching { step_s } else { LOOK_AHEAD_S };
    let from_centre = relative - apart * (1.0 / within_s);
    let ahead = from_centre.dot(apart);
    let (direction, change) =
        if touching || (ahead < 0.0 && ahead * ahead > radius * radius * from_centre.norm_squared()) {
            // The nearest boundary is the round cap of the velocity cone.
            let size = from_centre.norm();
            let unit = if size > EPSILON { from_centre * (1.0 / size) } else { Vector2::new(0.0, 1.0) };
            (unit.left() * -1.0, unit * (radius / within_s - size))
        } else {
            let leg = (apart.norm_squared() - radius * radius).max(0.0).sqrt();
            let turned = |side: f64| {
                Vector2::new(apart.x * leg - side * apart.y * radius, side * apart.x * radius + apart.y * leg)
                    * (1.0 / apart.norm_squared())
            };
            let direction = if apart.cross(from_centre) > 0.0 { turned(1.0) } else { turned(-1.0) * -1.0 };
            (direction, direction * relative.dot(direction) - relative)
        };
    let share = if other.fixed { 1.0 } else { 0.5 };
    Line { point: me.velocity_mps + change * share, direction }
}

/// Velocity nearest to `wanted`, of at most `most`, within all half planes. On failure, the index of the first half
/// plane that could not be satisfied, and the best velocity before it.
fn nearest(lines: &[Line], most: f64, wanted: Vector2) -> Result<Vector2, (usize, Vector2)> {
    let size = wanted.norm();
    let mut best = if size > most { wanted * (most / size) } else { wanted };
    for (k, line) in lines.iter().enumerate() {
        if line.direction.cross(line.point - best) > 0.0 {
            best = along(lines, k, most, |t| t.clamp_to(line.direction.dot(wanted - line.point)))
                .ok_or((k, best))?;
        }
    }
    Ok(best)
}

/// An interval of a line, by its ends.
#[derive(Clone, Copy)]
struct Stretch(f64, f64);

impl Stretch {
    fn clamp_to(self, t: f64) -> f64 {
        t.max(self.0).min(self.1)
    }
}

/// Point on line `k` within all earlier half planes and the speed limit; `choose` selects it from the feasible
/// interval.
fn along(lines: &[Line], k: usize, most: f64, choose: impl Fn(Stretch) -> f64) -> Option<Vector2> {
    let line = lines[k];
    let middle = line.point.dot(line.direction);
    let within = middle * middle + most * most - line.point.norm_squared();
    if within < 0.0 {
        return None;
    }
    let mut stretch = Stretch(-middle - within.sqrt(), -middle + within.sqrt());
    for other in &lines[..k] {
        let steep = line.direction.cross(other.direction);
        let off = other.direction.cross(line.point - other.point);
        if steep.abs() <= EPSILON {
            if off < 0.0 {
                return None;
            }
            continue;
        }
        let t = off / steep;
        if steep >= 0.0 {
            stretch.1 = stretch.1.min(t);
        } else {
            stretch.0 = stretch.0.max(t);
        }
        if stretch.0 > stretch.1 {
            return None;
        }
    }
    Some(line.point + line.direction * choose(stretch))
}

/// Fallback if no velocity satisfies all half planes: the one with the smallest largest violation, as in the
/// three-dimensional program of the paper, solved line by line.
fn least_bad(lines: &[Line], from: usize, most: f64, mut best: Vector2) -> Vector2 {
    let mut beyond = 0.0;
    for (k, line) in lines.iter().enumerate().skip(from) {
        if line.direction.cross(line.point - best) <= beyond {
            continue;
        }
        let bisected: Vec<Line> = lines[..k].iter().filter_map(|other| bisector(line, other)).collect();
        // As far from the line as the others allow.
        if let Ok(found) = farthest(&bisected, most, line.direction.left()) {
            best = found;
        }
        beyond = line.direction.cross(line.point - best);
    }
    best
}

/// Half plane of velocities that violate `line` no more than `other`.
fn bisector(line: &Line, other: &Line) -> Option<Line> {
    let steep = line.direction.cross(other.direction);
    let point = if steep.abs() <= EPSILON {
        if line.direction.dot(other.direction) > 0.0 {
            return None;
        }
        (line.point + other.point) * 0.5
    } else {
        line.point + line.direction * (other.direction.cross(line.point - other.point) / steep)
    };
    let between = other.direction - line.direction;
    let size = between.norm();
    (size > EPSILON).then(|| Line { point, direction: between * (1.0 / size) })
}

/// Velocity farthest in `direction` within all half planes.
fn farthest(lines: &[Line], most: f64, direction: Vector2) -> Result<Vector2, ()> {
    let mut best = direction * most;
    for (k, line) in lines.iter().enumerate() {
        if line.direction.cross(line.point - best) > 0.0 {
            let end =
                |stretch: Stretch| if direction.dot(line.direction) > 0.0 { stretch.1 } else { stretch.0 };
            best = along(lines, k, most, end).ok_or(())?;
        }
    }
    Ok(best)
}
