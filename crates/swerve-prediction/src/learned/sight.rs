//! Input of a net for one actor: its past and the nearby actors, in its own frame and scale.

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Vector2};
use swerve_msg::{ActorKind, Prediction, Sighting};

use super::shape::{Beside, Shape};
use crate::past::Past;
use crate::predictor::{Horizon, Tracked, imm};

/// Number of past positions in the input, the present one included.
pub(crate) const PAST: usize = 8;
/// Largest number of nearby actors, and their largest distance in scaled units.
const NEAR_MAX: usize = 6;
const NEAR_WITHIN: f64 = 8.0;
/// Weight of a step relative to the following one.
const EARLIER: f32 = 0.2;
/// Averaging time of the velocity that is used after the last sighting, seconds.
const LAST_S: f64 = 0.5;
/// Limit of extrapolation speeds, m/s; higher ones are clamped.
const SPEED_MAX_MPS: f64 = 70.0;

/// Frame of an actor: origin at its position, x ahead, scaled.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Frame {
    pub(crate) origin: Point2,
    pub(crate) ahead: Vector2,
    /// Length of one unit, metres.
    pub(crate) scale_m: f64,
}

impl Frame {
    /// Transforms a displacement from the map to the frame.
    pub(crate) fn turned(&self, by: Vector2) -> [f32; 2] {
        [self.ahead.dot(by) / self.scale_m, self.ahead.cross(by) / self.scale_m].map(|one| one as f32)
    }

    /// Transforms a position from the map to the frame.
    pub(crate) fn place(&self, at: Point2) -> [f32; 2] {
        self.turned(at - self.origin)
    }

    /// Transforms a position from the frame to the map.
    pub(crate) fn point(&self, [x, y]: [f32; 2]) -> Point2 {
        self.origin + (self.ahead * f64::from(x) + self.ahead.left() * f64::from(y)) * self.scale_m
    }

    /// Transforms a covariance from the frame to the map, m².
    pub(crate) fn covariance_m2(&self, of: [f32; 3]) -> [f64; 3] {
        let [xx, xy, yy] = of.map(|one| f64::from(one) * self.scale_m * self.scale_m);
        let (c, s) = (self.ahead.x, self.ahead.y);
        [
            c * c * xx - 2.0 * c * s * xy + s * s * yy,
            c * s * (xx - yy) + (c * c - s * s) * xy,
            s * s * xx + 2.0 * c * s * xy + c * c * yy,
        ]
    }
}

/// A nearby actor.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Near {
    /// Index among the observed actors.
    pub(crate) who: usize,
    pub(crate) at: [f32; 2],
    /// Displacement in one step.
    pub(crate) pace: [f32; 2],
    pub(crate) wheels: f32,
}

/// Input of a net for one actor.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Sight {
    /// Steps of the past, oldest first, x before y.
    pub(crate) own: [f32; 2 * (PAST - 1)],
    /// 1 for actors on wheels, else 0.
    pub(crate) wheels: f32,
    /// Nearby actors, the nearest first.
    pub(crate) near: Vec<Near>,
    pub(crate) frame: Frame,
    /// Positions predicted by the filters after each step; empty for a straight baseline.
    pub(crate) expected: Vec<[f32; 2]>,
    /// Identity by which random draws for this actor are keyed.
    pub(crate) id: u32,
}

impl Sight {
    /// Smoothed last step: each step has a fifth of the weight of the following one.
    pub(crate) fn pace(&self) -> [f32; 2] {
        let (mut sum, mut total) = ([0.0_f32; 2], 0.0);
        for step in self.own.chunks_exact(2) {
            sum = [EARLIER * sum[0] + step[0], EARLIER * sum[1] + step[1]];
            total = EARLIER * total + 1.0;
        }
        sum.map(|one| one / total)
    }
}

/// Inputs of all observed actors at `stamp`, for a net of this shape.
pub(crate) fn sights(seen: &[Tracked], stamp: Time, shape: &Shape) -> Vec<Sight> {
    let step = Span::from_ms(i64::from(shape.step_ms));
    let expected = match shape.beside {
        Beside::Straight => Vec::new(),
        Beside::Imm => filtered(seen, stamp, &Horizon { steps: shape.steps, step }),
    };
    let places: Vec<[Point2; PAST]> = seen.iter().map(|one| places(&one.past, stamp, step)).collect();
    let paces: Vec<Vector2> = places.iter().map(|places| places[PAST - 1] - places[PAST - 2]).collect();
    let wheels = |seen: &Tracked| !matches!(seen.past.kind, ActorKind::Pedestrian | ActorKind::Static);
    let of_one = |(k, one): (usize, &Tracked)| {
        let places_of = &places[k];
        let scale_m = if wheels(one) { 5.0 } else { 1.0 };
        let now = places_of[PAST - 1];
        let whole = now - places_of[0];
        let hardly_m = 0.05 * scale_m;
        let ahead = [paces[k], whole].into_iter().find(|way| way.norm() > hardly_m);
        let ahead = ahead.map_or_else(
            || Vector2::from_heading(one.track.pose.heading_rad),
            |way| way * (1.0 / way.norm()),
        );
        let frame = Frame { origin: now, ahead, scale_m };
        let mut own = [0.0; 2 * (PAST - 1)];
        for (step, to) in places_of.windows(2).zip(own.chunks_exact_mut(2)) {
            to.copy_from_slice(&frame.turned(step[1] - step[0]));
        }
        let mut near: Vec<(f64, usize)> = (0..seen.len())
            .filter(|j| *j != k)
            .map(|j| (now.distance(places[j][PAST - 1]), j))
            .filter(|(far_m, _)| *far_m < NEAR_WITHIN * scale_m)
            .collect();
        near.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        near.truncate(NEAR_MAX);
        let near = near.into_iter().map(|(_, who)| Near {
            who,
            at: frame.place(places[who][PAST - 1]),
            pace: frame.turned(paces[who]),
            wheels: f32::from(u8::from(wheels(&seen[who]))),
        });
        let wheels = f32::from(u8::from(wheels(one)));
        let places = expected.get(k).into_iter().flatten();
        let expected = places.map(|at| frame.place(*at)).collect();
        Sight { own, wheels, near: near.collect(), frame, expected, id: one.track.id.0 }
    };
    seen.iter().enumerate().map(of_one).collect()
}

/// Past positions at intervals of `step` up to now: interpolated between sightings, extrapolated before the first and
/// after the last.
fn places(past: &Past, stamp: Time, step: Span) -> [Point2; PAST] {
    let slow = |velocity: Vector2| {
        let speed_mps = velocity.norm();
        if speed_mps > SPEED_MAX_MPS { velocity * (SPEED_MAX_MPS / speed_mps) } else { velocity }
    };
    let all = &past.sightings;
    let (first, last) = (all[0], past.last());
    let on_mps = slow(past.velocity_mps(LAST_S));
    let early = |one: &&Sighting| (one.at - first.at) >= step;
    let early = all.iter().find(early).or(all.last().filter(|one| one.at > first.at));
    let from_mps =
        early.map_or(on_mps, |one| slow((one.point - first.point) * (1.0 / (one.at - first.at).as_secs())));
    let at = |instant: Time| {
        if instant >= last.at {
            return last.point + on_mps * (instant - last.at).as_secs();
        }
        if instant <= first.at {
            return first.point + from_mps * (instant - first.at).as_secs();
        }
        let after = all.partition_point(|one| one.at <= instant);
        let (a, b) = (all[after - 1], all[after]);
        let share = (instant - a.at).as_secs() / (b.at - a.at).as_secs();
        a.point + (b.point - a.point) * share
    };
    core::array::from_fn(|k| at(stamp - step * (PAST - 1 - k) as i64))
}

/// Positions of the filters' likeliest mode after each step.
fn filtered(seen: &[Tracked], stamp: Time, horizon: &Horizon) -> Vec<Vec<Point2>> {
    let likeliest = |modes: &Vec<Prediction>| -> Vec<Point2> {
        let path = Prediction::likeliest(modes).map_or(&[][..], |mode| &mode.path[1..]);
        path.iter().map(|at| at.pose.point()).collect()
    };
    imm(seen, stamp, horizon).iter().map(likeliest).collect()
}
