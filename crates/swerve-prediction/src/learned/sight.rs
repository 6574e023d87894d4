//! What a net is told of an actor: its past and who is near, in its own frame and scale.

use swerve_core::{Span, Time};
use swerve_geom::{Point2, Vector2};
use swerve_msg::{ActorKind, Forecast, Sighting};

use super::{Beside, Shape};
use crate::past::Past;
use crate::predictor::{Horizon, Seen, imm};

/// Places of the past that a net is told, the present one included.
pub(crate) const PAST: usize = 8;
/// Most others that an actor minds, and how near they have to be, in the scale.
const NEAR_MAX: usize = 6;
const NEAR_WITHIN: f64 = 8.0;
/// What a step counts beside the one after.
const EARLIER: f32 = 0.2;
/// Over how long the last velocity is taken where sightings end before the present, seconds.
const LAST_S: f64 = 0.5;
/// Nobody is so fast; who is, is told to be, m/s.
const SPEED_MAX_MPS: f64 = 70.0;

/// An actor's own frame: where it is, ahead along x, in metres of its scale.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Frame {
    pub(crate) origin: Point2,
    pub(crate) ahead: Vector2,
    /// Metres in a unit.
    pub(crate) scale_m: f64,
}

impl Frame {
    /// A difference on the map, in the frame.
    pub(crate) fn turned(&self, by: Vector2) -> [f32; 2] {
        [self.ahead.dot(by) / self.scale_m, self.ahead.cross(by) / self.scale_m].map(|one| one as f32)
    }

    /// A place on the map, in the frame.
    pub(crate) fn place(&self, at: Point2) -> [f32; 2] {
        self.turned(at - self.origin)
    }

    /// A place in the frame, on the map.
    pub(crate) fn point(&self, [x, y]: [f32; 2]) -> Point2 {
        self.origin + (self.ahead * f64::from(x) + self.ahead.left() * f64::from(y)) * self.scale_m
    }

    /// A covariance in the frame, on the map, m².
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

/// Somebody near.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Near {
    /// Number in the list of all who are seen.
    pub(crate) who: usize,
    pub(crate) at: [f32; 2],
    /// In one step.
    pub(crate) pace: [f32; 2],
    pub(crate) wheels: f32,
}

/// What a net is told.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Sight {
    /// Steps of the past, oldest first, x before y.
    pub(crate) own: [f32; 2 * (PAST - 1)],
    /// 1 for who is on wheels.
    pub(crate) wheels: f32,
    /// Nearest first.
    pub(crate) near: Vec<Near>,
    pub(crate) frame: Frame,
    /// Where filters expect it after each step; empty where going straight on is expected.
    pub(crate) expected: Vec<[f32; 2]>,
    /// What draws of this actor are keyed by.
    pub(crate) id: u32,
}

impl Sight {
    /// The last step, as far as it can be told: earlier ones count a fifth of the one after.
    pub(crate) fn pace(&self) -> [f32; 2] {
        let (mut sum, mut total) = ([0.0_f32; 2], 0.0);
        for step in self.own.chunks_exact(2) {
            sum = [EARLIER * sum[0] + step[0], EARLIER * sum[1] + step[1]];
            total = EARLIER * total + 1.0;
        }
        sum.map(|one| one / total)
    }
}

/// Everybody as seen by themselves, at `stamp`, for a net of this shape.
pub(crate) fn sights(seen: &[Seen], stamp: Time, shape: &Shape) -> Vec<Sight> {
    let step = Span::from_ms(i64::from(shape.step_ms));
    let expected = match shape.beside {
        Beside::Straight => Vec::new(),
        Beside::Imm => filtered(seen, stamp, &Horizon { steps: shape.steps, step }),
    };
    let places: Vec<[Point2; PAST]> = seen.iter().map(|one| places(&one.past, stamp, step)).collect();
    let paces: Vec<Vector2> = places.iter().map(|places| places[PAST - 1] - places[PAST - 2]).collect();
    let wheels = |seen: &Seen| !matches!(seen.past.kind, ActorKind::Pedestrian | ActorKind::Static);
    let of_one = |(k, one): (usize, &Seen)| {
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

/// Where it was, a step apart, up to now: between sightings on a straight line, before the first and after the last
/// straight on.
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

/// Places of the filters' likeliest mode, after each step.
fn filtered(seen: &[Seen], stamp: Time, horizon: &Horizon) -> Vec<Vec<Point2>> {
    let likeliest = |one: &Forecast| -> Vec<Point2> {
        one.likeliest().map_or(&[][..], |mode| &mode.path[1..]).iter().map(|at| at.pose.point()).collect()
    };
    imm(seen, stamp, horizon).iter().map(likeliest).collect()
}
