//! Everybody takes half of the care that nobody touches anybody: optimal reciprocal collision avoidance (van den Berg,
//! Guy, Lin and Manocha 2011, sections 4 and 5).
//!
//! Each of two takes up half of the smallest change of their relative velocity that keeps them apart for a while: a half
//! plane of velocities for each neighbour. Taken is the velocity in all of them that is nearest to the wanted one, the
//! present; where there is none, the one that goes least far into the worst half plane.

use swerve_core::Time;
use swerve_geom::{Point2, Vector2};
use swerve_msg::{ActorKind, Forecast};

use super::drawn::single;
use super::straight::VELOCITY_WINDOW_S;
use super::{Horizon, Seen};

/// For how long nobody is to touch anybody, seconds.
const LOOK_AHEAD_S: f64 = 1.5;
/// Of a person, metres.
pub(crate) const RADIUS_M: f64 = 0.2;
/// Nobody gets faster than this much of the present speed.
const SPEED_SHARE_MAX: f64 = 1.3;
/// Nearest others that are minded, and how near they have to be, metres.
const NEIGHBOURS_MAX: usize = 10;
const NEIGHBOURS_WITHIN_M: f64 = 10.0;
/// Steps of the roll-out are no longer than this, seconds.
const STEP_S: f64 = 0.2;
/// What is parallel.
const EPSILON: f64 = 1e-9;

/// Somebody on the way.
#[derive(Clone, Copy)]
pub(crate) struct Agent {
    pub(crate) point: Point2,
    pub(crate) velocity_mps: Vector2,
    pub(crate) wanted_mps: Vector2,
    pub(crate) radius_m: f64,
    /// Whether the way is given: what is no person goes straight on, and is given way in full.
    pub(crate) fixed: bool,
}

/// Velocities to the left of `direction` through `point` are allowed.
#[derive(Clone, Copy)]
struct Line {
    point: Vector2,
    direction: Vector2,
}

/// One mode each.
pub(super) fn forecasts(seen: &[Seen], stamp: Time, horizon: &Horizon) -> Vec<Forecast> {
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
    fn of(seen: &Seen, stamp: Time) -> Self {
        let velocity_mps = seen.past.velocity_mps(VELOCITY_WINDOW_S);
        let fixed = seen.past.kind != ActorKind::Pedestrian;
        let extent = seen.track.extent;
        let radius_m = if fixed { 0.5 * extent.length_m.max(extent.width_m) } else { RADIUS_M };
        let point = seen.past.now(stamp, velocity_mps);
        Self { point, velocity_mps, wanted_mps: velocity_mps, radius_m, fixed }
    }
}

/// The velocity that agent `k` takes up.
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

/// The half plane of velocities that keep clear of `other`.
fn line(me: &Agent, other: &Agent, step_s: f64) -> Line {
    let apart: Vector2 = other.point - me.point;
    let relative = me.velocity_mps - other.velocity_mps;
    let radius = me.radius_m + other.radius_m;
    let touching = apart.norm() <= radius;
    // Who touches gets apart within the step, everybody else stays so for a while.
    let within_s = if touching { step_s } else { LOOK_AHEAD_S };
    let from_centre = relative - apart * (1.0 / within_s);
    let ahead = from_centre.dot(apart);
    let (direction, change) =
        if touching || (ahead < 0.0 && ahead * ahead > radius * radius * from_centre.norm_squared()) {
            // Nearest to the round end of the cone.
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

/// The velocity nearest to `wanted`, no faster than `most`, within all half planes; else the first that could not be kept,
/// and what was best before it.
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

/// A stretch of a line, from and to.
#[derive(Clone, Copy)]
struct Stretch(f64, f64);

impl Stretch {
    fn clamp_to(self, t: f64) -> f64 {
        t.max(self.0).min(self.1)
    }
}

/// A point on line `k` that keeps all lines before it and the largest speed; `choose` takes one of the stretch that does.
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

/// Where no velocity keeps all half planes: the one that goes least far beyond the worst, as the paper's three-dimensional
/// program, solved line by line.
fn least_bad(lines: &[Line], from: usize, most: f64, mut best: Vector2) -> Vector2 {
    let mut beyond = 0.0;
    for (k, line) in lines.iter().enumerate().skip(from) {
        if line.direction.cross(line.point - best) <= beyond {
            continue;
        }
        let bisected: Vec<Line> = lines[..k].iter().filter_map(|other| bisector(line, other)).collect();
        // Straight away from the line, as far as the others let.
        if let Ok(found) = farthest(&bisected, most, line.direction.left()) {
            best = found;
        }
        beyond = line.direction.cross(line.point - best);
    }
    best
}

/// Velocities beyond `line` no further than beyond `other`.
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

/// The velocity farthest in `direction` within all half planes.
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
