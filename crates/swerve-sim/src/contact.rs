//! Geometry of contacts of two bodies, in `f64` on the ground plane.

use swerve_geom::{Obb, Point2, Pose2, Vector2};
use swerve_msg::Extent;
use swerve_msg::truth::Actor;

/// Closest points of two bodies, both in the map frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Nearest {
    pub(crate) gap_m: f64,
    pub(crate) on_ego: Point2,
    pub(crate) on_actor: Point2,
}

/// Planar motion of a rigid body, which gives the velocity of any of its points.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Motion2 {
    /// Reference point of `velocity_mps`.
    pub(crate) at: Point2,
    pub(crate) velocity_mps: Vector2,
    pub(crate) yaw_rate_radps: f64,
}

impl Motion2 {
    pub(crate) fn velocity_of(&self, point: Point2) -> Vector2 {
        self.velocity_mps + (point - self.at).left() * self.yaw_rate_radps
    }

    /// A pose fixed to the body, `after_s` seconds later at constant velocity.
    fn moved(&self, pose: Pose2, after_s: f64) -> Pose2 {
        let by = self.velocity_of(pose.point()) * after_s;
        Pose2::new(pose.x_m + by.x, pose.y_m + by.y, pose.heading_rad + self.yaw_rate_radps * after_s)
    }
}

/// Closest points of the ego's outline and an actor; `None` if they overlap.
pub(crate) fn nearest(ego: &Obb, actor: &Actor) -> Option<Nearest> {
    if actor.is_round() {
        let center = actor.pose.point();
        let on_ego = nearest_on(ego, center);
        let apart = on_ego.distance(center);
        let radius_m = 0.5 * actor.extent.width_m;
        if apart <= radius_m {
            return None;
        }
        let on_actor = center + (on_ego - center) * (radius_m / apart);
        return Some(Nearest { gap_m: apart - radius_m, on_ego, on_actor });
    }
    let other = actor.footprint();
    if ego.overlaps(&other) {
        return None;
    }
    let mut best = Nearest { gap_m: f64::INFINITY, on_ego: Point2::default(), on_actor: Point2::default() };
    let mut offer = |on_ego: Point2, on_actor: Point2| {
        let gap_m = on_ego.distance(on_actor);
        if gap_m < best.gap_m {
            best = Nearest { gap_m, on_ego, on_actor };
        }
    };
    for corner in ego.corners() {
        offer(corner, nearest_on(&other, corner));
    }
    for corner in other.corners() {
        offer(nearest_on(ego, corner), corner);
    }
    (best.gap_m > 0.0).then_some(best)
}

/// Point of a rectangle closest to `point`.
fn nearest_on(rectangle: &Obb, point: Point2) -> Point2 {
    let local: Point2 = rectangle.center.to_local(point);
    let (l, w) = (rectangle.half_length_m, rectangle.half_width_m);
    rectangle
        .center
        .from_local(Point2::<swerve_geom::Map>::new(local.x_m.clamp(-l, l), local.y_m.clamp(-w, w)))
}

/// Closing speed along the contact normal just before contact, m/s, never negative.
///
/// Both bodies are extrapolated from states shortly before the contact at constant velocities. The normal is the line
/// between their closest points at the last instant apart (to 0.1 mm or `horizon_s` ahead).
pub(crate) fn closing_speed(ego: &Obb, ego_motion: &Motion2, actor: &Actor, horizon_s: f64) -> f64 {
    let at = |after_s: f64| {
        let outline = Obb { center: ego_motion.moved(ego.center, after_s), ..*ego };
        let by = actor.velocity_mps * after_s;
        let pose = Pose2::new(actor.pose.x_m + by.x, actor.pose.y_m + by.y, actor.pose.heading_rad);
        nearest(&outline, &Actor { pose, ..actor.clone() })
    };
    let Some(mut last_apart) = at(0.0) else {
        let between = actor.pose.point() - ego.center.point();
        return along(ego_motion, actor, ego.center.point(), between);
    };
    const SAMPLES: u32 = 32;
    let (mut apart_s, mut touching_s) = (0.0, None);
    for k in 1..=SAMPLES {
        let after_s = horizon_s * f64::from(k) / f64::from(SAMPLES);
        match at(after_s) {
            Some(near) if near.gap_m <= last_apart.gap_m => (apart_s, last_apart) = (after_s, near),
            Some(_) => break,
            None => {
                touching_s = Some(after_s);
                break;
            }
        }
    }
    if let Some(mut touching_s) = touching_s {
        for _ in 0..60 {
            if last_apart.gap_m < 1e-4 {
                break;
            }
            let middle = 0.5 * (apart_s + touching_s);
            match at(middle) {
                Some(near) => (apart_s, last_apart) = (middle, near),
                None => touching_s = middle,
            }
        }
    }
    let normal = last_apart.on_actor - last_apart.on_ego;
    // The point on the ego was found on its extrapolated outline; its velocity is that of the unmoved body's point.
    let shift = ego_motion.velocity_of(ego.center.point()) * apart_s;
    along(ego_motion, actor, last_apart.on_ego - shift, normal)
}

/// Two actors as a rectangle with its motion and an actor, with the same distances. One of them gives the rectangle; of
/// two round ones it is the centre of the first, and the second is larger by the radius of the first.
fn as_rectangle(a: &Actor, b: &Actor) -> (Obb, Motion2, Actor) {
    let (first, second) = if a.is_round() { (b, a) } else { (a, b) };
    let motion = Motion2 { at: first.pose.point(), velocity_mps: first.velocity_mps, yaw_rate_radps: 0.0 };
    if !first.is_round() {
        return (first.footprint(), motion, second.clone());
    }
    let width_m = second.extent.width_m + first.extent.width_m;
    let larger = Actor { extent: Extent { width_m, ..second.extent }, ..second.clone() };
    (Obb::new(first.pose, 0.0, 0.0), motion, larger)
}

/// Pairs of actors whose bounding circles are at most `within_m` apart, as ordered indices, in order.
pub(crate) fn near_pairs(actors: &[Actor], within_m: f64) -> Vec<[usize; 2]> {
    let circle = |(i, actor): (usize, &Actor)| (actor.pose.point(), actor.footprint().radius(), i);
    let mut circles: Vec<_> = actors.iter().enumerate().map(circle).collect();
    circles.sort_by(|(a, of_a, i), (b, of_b, j)| (a.x_m - of_a).total_cmp(&(b.x_m - of_b)).then(i.cmp(j)));
    let mut pairs = Vec::new();
    for (k, &(a, of_a, i)) in circles.iter().enumerate() {
        let right_m = a.x_m + of_a + within_m;
        for &(b, of_b, j) in circles[k + 1..].iter().take_while(|(b, of_b, _)| b.x_m - of_b <= right_m) {
            if are_within(a, b, [of_a, of_b], within_m) {
                pairs.push([i.min(j), i.max(j)]);
            }
        }
    }
    pairs.sort_unstable();
    pairs
}

/// True if the bounding circles of two actors are at most `within_m` apart.
pub(crate) fn are_near(a: &Actor, b: &Actor, within_m: f64) -> bool {
    let radii_m = [a, b].map(|actor| actor.footprint().radius());
    are_within(a.pose.point(), b.pose.point(), radii_m, within_m)
}

fn are_within(a: Point2, b: Point2, [of_a, of_b]: [f64; 2], within_m: f64) -> bool {
    a.distance(b) <= of_a + of_b + within_m
}

/// Gap between two actors, metres; zero if they touch.
pub(crate) fn gap_of_actors_m(a: &Actor, b: &Actor) -> f64 {
    let (rectangle, _, other) = as_rectangle(a, b);
    other.gap_m(&rectangle)
}

/// [`closing_speed`] of two actors; their rotation is neglected.
pub(crate) fn closing_speed_of_actors(a: &Actor, b: &Actor, horizon_s: f64) -> f64 {
    let (rectangle, motion, other) = as_rectangle(a, b);
    closing_speed(&rectangle, &motion, &other, horizon_s)
}

fn along(ego_motion: &Motion2, actor: &Actor, on_ego: Point2, normal: Vector2) -> f64 {
    let length = normal.norm();
    if length == 0.0 {
        return 0.0;
    }
    let relative = ego_motion.velocity_of(on_ego) - actor.velocity_mps;
    (relative.dot(normal) / length).max(0.0)
}

#[cfg(test)]
mod tests;
