//! Bodies around a sensor indexed by direction, so that a line of sight is compared only with those in its direction.

use std::f64::consts::{PI, TAU};

use swerve_geom::{Map, Point, Point2, Vector2, math};
use swerve_msg::truth::{Actor, WorldState};

/// Number of actors below which all are compared, which is faster than sorting them.
const SORTED_MIN: usize = 64;
/// Number of sectors around the sensor.
const SECTORS: usize = 512;
/// Margin for rounding errors of a direction, rad, and of a distance, m.
const MARGIN: f64 = 1e-6;

/// Actors that can occlude the view of a sensor.
pub(super) struct Occluders<'w> {
    actors: &'w [Actor],
    eye: Point<Map>,
    /// Indices of the actors that extend into each sector, counter-clockwise from -pi; without sectors, all count.
    sectors: Vec<Vec<usize>>,
}

impl<'w> Occluders<'w> {
    pub(super) fn new(world: &'w WorldState, eye: Point<Map>) -> Self {
        let actors = &world.actors[..];
        let mut sectors = Vec::new();
        if actors.len() >= SORTED_MIN {
            sectors.resize(SECTORS, Vec::new());
            for (i, actor) in actors.iter().enumerate() {
                let off = actor.pose.point() - on_ground(eye);
                let (from, to) = reach(off, actor.footprint().radius());
                (from..=to).for_each(|sector| sectors[sector.rem_euclid(SECTORS as i64) as usize].push(i));
            }
        }
        Self { actors, eye, sectors }
    }

    /// True if an actor other than `target` occludes this position.
    pub(super) fn hide(&self, place: Point<Map>, target: Option<usize>) -> bool {
        let hides = |i: usize| target != Some(i) && blocks(&self.actors[i], self.eye, place);
        if self.sectors.is_empty() {
            return (0..self.actors.len()).any(hides);
        }
        let sector = sector((on_ground(place) - on_ground(self.eye)).heading());
        self.sectors[sector.rem_euclid(SECTORS as i64) as usize].iter().copied().any(hides)
    }
}

fn on_ground(place: Point<Map>) -> Point2<Map> {
    Point2::new(place.coords.x, place.coords.y)
}

/// Sector of a direction; directions beyond one turn have larger numbers.
fn sector(direction_rad: f64) -> i64 {
    ((direction_rad + PI) / TAU * SECTORS as f64).floor() as i64
}

/// First and last sector covered by a circle at `off` from the sensor.
fn reach(off: Vector2, radius_m: f64) -> (i64, i64) {
    let distance_m = off.norm();
    if distance_m <= radius_m + MARGIN {
        return (0, SECTORS as i64 - 1);
    }
    let (middle, half) = (off.heading(), math::asin(radius_m / distance_m) + MARGIN);
    (sector(middle - half), sector(middle + half))
}

/// True if the segment from `from` to `to`, without its ends, passes through the body of `actor`.
fn blocks(actor: &Actor, from: Point<Map>, to: Point<Map>) -> bool {
    let ground = |p: Point<Map>| Point2::<Map>::new(p.coords.x, p.coords.y);
    if !comes_near(actor, ground(from), ground(to)) {
        return false;
    }
    // The part of the segment, as fractions of its length, inside all limits so far.
    let (mut enter, mut leave) = (0.0_f64, 1.0_f64);
    let mut between = |start: f64, end: f64, low: f64, high: f64| {
        let way = end - start;
        if way == 0.0 {
            if start <= low || start >= high {
                leave = -1.0;
            }
            return;
        }
        let (a, b) = ((low - start) / way, (high - start) / way);
        enter = enter.max(a.min(b));
        leave = leave.min(a.max(b));
    };
    between(from.coords.z, to.coords.z, actor.z_m, actor.z_m + actor.extent.height_m);
    if actor.is_round() {
        match inside_circle(actor.pose.point(), 0.5 * actor.extent.width_m, ground(from), ground(to)) {
            Some((a, b)) => (enter, leave) = (enter.max(a), leave.min(b)),
            None => return false,
        }
    } else {
        let a: Point2<Map> = actor.pose.to_local(ground(from));
        let b: Point2<Map> = actor.pose.to_local(ground(to));
        let (l, w) = (0.5 * actor.extent.length_m, 0.5 * actor.extent.width_m);
        between(a.x_m, b.x_m, -l, l);
        between(a.y_m, b.y_m, -w, w);
    }
    // A point that merely touches the body, as with two adjacent boxes, stays visible.
    leave - enter > 1e-9
}

/// True if the segment comes within the body's bounding circle; avoids the exact test for most actors.
fn comes_near(actor: &Actor, from: Point2, to: Point2) -> bool {
    let radius = actor.footprint().radius();
    let (along, off) = (to - from, actor.pose.point() - from);
    let length_squared = along.norm_squared();
    let t = if length_squared > 0.0 { (off.dot(along) / length_squared).clamp(0.0, 1.0) } else { 0.0 };
    (off - along * t).norm_squared() <= radius * radius
}

/// Range of the segment inside a circle, as fractions of its length; `None` if outside.
fn inside_circle(center: Point2, radius_m: f64, from: Point2, to: Point2) -> Option<(f64, f64)> {
    let (along, off) = (to - from, from - center);
    let (a, half_b) = (along.norm_squared(), off.dot(along));
    let c = off.norm_squared() - radius_m * radius_m;
    if a == 0.0 {
        return (c < 0.0).then_some((0.0, 1.0));
    }
    let discriminant = half_b * half_b - a * c;
    if discriminant <= 0.0 {
        return None;
    }
    let root = discriminant.sqrt();
    Some(((-half_b - root) / a, (-half_b + root) / a))
}

#[cfg(test)]
mod tests {
    use super::super::tests::{actor, person, world};
    use super::*;
    use swerve_msg::ActorKind;

    /// Bodies of all sizes around the sensor, one of them over it, from a fixed congruential sequence.
    fn crowd(count: u32) -> WorldState {
        let mut state = 7_u64;
        let mut next = |most: f64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            most * (state >> 33) as f64 / (1_u64 << 31) as f64
        };
        let mut actors: Vec<Actor> = (0..count)
            .map(|id| {
                let (x, y) = (next(120.0) - 60.0, next(120.0) - 60.0);
                if id % 3 == 0 {
                    person(id, x, y)
                } else {
                    actor(id, ActorKind::Car, x, y, [next(12.0), 2.0, 3.0])
                }
            })
            .collect();
        actors.push(actor(count, ActorKind::Truck, 1.0, 0.0, [8.0, 2.0, 1.0]));
        world(actors)
    }

    #[test]
    fn sectors_occlude_exactly_as_all_actors() {
        let world = crowd(300);
        let eye = Point::new(0.5, -0.25, 1.9);
        let sorted = Occluders::new(&world, eye);
        assert!(!sorted.sectors.is_empty());
        let all = Occluders { sectors: Vec::new(), ..Occluders::new(&world, eye) };
        let mut hidden = 0;
        for i in 0..4000 {
            let (sin, cos) = math::sin_cos(0.001_571 * f64::from(i));
            let range_m = 0.02 * f64::from(i % 3500);
            let place = Point::new(eye.coords.x + cos * range_m, eye.coords.y + sin * range_m, 0.7);
            for target in [None, Some(i as usize % 300)] {
                assert_eq!(sorted.hide(place, target), all.hide(place, target), "{place:?}");
                hidden += u32::from(all.hide(place, target));
            }
        }
        assert!((1000..7000).contains(&hidden), "{hidden} of 8000 are hidden");
    }

    #[test]
    fn only_few_of_many_actors_are_compared() {
        let world = crowd(3000);
        let sorted = Occluders::new(&world, Point::new(0.0, 0.0, 1.9));
        let most = sorted.sectors.iter().map(Vec::len).max().unwrap();
        assert!(most < 300, "{most} of 3001 actors in one direction");
    }
}
