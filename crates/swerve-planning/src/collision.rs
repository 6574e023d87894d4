//! One exact collision check for every planner and every test.
//!
//! Obstacles are oriented boxes, moving along their predictions or standing. A footprint is *free* when it
//! touches none of them and keeps a clearance (Euclidean distance between the two rectangles). Motions
//! between two poses are checked by bisection: a stretch is free once the distance at its middle exceeds
//! what can move within it, so nothing passes through anything however far the samples are apart.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Obb, Point2, Pose2, math};
use swerve_msg::{ActorKind, Prediction};

/// How predicted motion enters the collision check.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum CollisionMode {
    /// An obstacle is where it is predicted to be at the moment in question.
    #[default]
    TimeIndexed,
    /// An obstacle is at all its predicted places at once, all the time (places at least
    /// [`SWEPT_STEP_M`] apart): what Pylot does.
    SweptStatic,
    /// As time-indexed, but a pedestrian may stop on the way: at each moment all that lies between where it is now and
    /// where it is predicted to be by then counts.
    ///
    /// Whoever walks can stand within a step, without notice, and constant velocity says only how far they can have
    /// come. This is the set that they can reach along their way (as the reachable sets of Koschi et al., Set-Based
    /// Prediction of Pedestrians, ITSC 2018, but along one line). What rolls needs a way to stop in and stays
    /// time-indexed. Where this leaves neither a way through nor a stop, planners take pedestrians as predicted.
    MayStop,
}

impl CollisionMode {
    /// What planners try in order: where nothing is found although walkers may stop, they are taken as predicted.
    pub fn in_order(self) -> &'static [Self] {
        match self {
            Self::TimeIndexed => &[Self::TimeIndexed],
            Self::SweptStatic => &[Self::SweptStatic],
            Self::MayStop => &[Self::MayStop, Self::TimeIndexed],
        }
    }
}

/// Smallest distance between two places of one obstacle under [`CollisionMode::SweptStatic`], metres
/// (Pylot's value).
pub const SWEPT_STEP_M: f64 = 1.0;

/// Who is predicted to get no further than this stands, metres.
const STANDS_M: f64 = 0.02;

/// Stretches in which nothing moves further than this are settled by their ends and middle, metres.
const RESOLUTION_M: f64 = 0.02;

/// An oriented rectangle with its direction at hand, so that repeated checks need no trigonometry.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Solid {
    /// Centre, metres.
    pub x_m: f64,
    /// Centre, metres.
    pub y_m: f64,
    /// Cosine of the heading.
    pub cos: f64,
    /// Sine of the heading.
    pub sin: f64,
    /// Half its extent along its heading, metres.
    pub half_length_m: f64,
    /// Half its extent across its heading, metres.
    pub half_width_m: f64,
}

impl From<&Obb> for Solid {
    fn from(obb: &Obb) -> Self {
        let (sin, cos) = math::sin_cos(obb.center.heading_rad);
        Self {
            x_m: obb.center.x_m,
            y_m: obb.center.y_m,
            cos,
            sin,
            half_length_m: obb.half_length_m,
            half_width_m: obb.half_width_m,
        }
    }
}

impl Solid {
    /// Radius of the circle around its centre that holds it, metres.
    pub fn radius_m(&self) -> f64 {
        math::hypot(self.half_length_m, self.half_width_m)
    }

    /// Corners: front left, rear left, rear right, front right.
    pub fn corners(&self) -> [Point2; 4] {
        let (ax, ay) = (self.cos * self.half_length_m, self.sin * self.half_length_m);
        let (lx, ly) = (-self.sin * self.half_width_m, self.cos * self.half_width_m);
        [
            Point2::new(self.x_m + ax + lx, self.y_m + ay + ly),
            Point2::new(self.x_m - ax + lx, self.y_m - ay + ly),
            Point2::new(self.x_m - ax - lx, self.y_m - ay - ly),
            Point2::new(self.x_m + ax - lx, self.y_m + ay - ly),
        ]
    }

    /// Squared distance from `point`, m²; zero inside.
    fn distance_squared_to(&self, point: Point2) -> f64 {
        let (dx, dy) = (point.x_m - self.x_m, point.y_m - self.y_m);
        let along = ((self.cos * dx + self.sin * dy).abs() - self.half_length_m).max(0.0);
        let across = ((self.cos * dy - self.sin * dx).abs() - self.half_width_m).max(0.0);
        along * along + across * across
    }

    /// Whether the two share a point (separating axis theorem).
    pub fn overlaps(&self, other: &Self) -> bool {
        let (dx, dy) = (other.x_m - self.x_m, other.y_m - self.y_m);
        let c = (self.cos * other.cos + self.sin * other.sin).abs();
        let s = (self.cos * other.sin - self.sin * other.cos).abs();
        let apart = |along: f64, own: f64, l: f64, w: f64| along.abs() > own + l + w;
        let (a, b) = (self, other);
        !(apart(a.cos * dx + a.sin * dy, a.half_length_m, b.half_length_m * c, b.half_width_m * s)
            || apart(a.cos * dy - a.sin * dx, a.half_width_m, b.half_length_m * s, b.half_width_m * c)
            || apart(b.cos * dx + b.sin * dy, b.half_length_m, a.half_length_m * c, a.half_width_m * s)
            || apart(b.cos * dy - b.sin * dx, b.half_width_m, a.half_length_m * s, a.half_width_m * c))
    }

    /// Distance between the two, metres; zero when they share a point.
    pub fn distance_m(&self, other: &Self) -> f64 {
        if self.overlaps(other) {
            return 0.0;
        }
        // Of two convex polygons apart, one of the two nearest points is a corner.
        let nearest = |of: &Self, to: &Self| {
            of.corners().into_iter().map(|c| to.distance_squared_to(c)).fold(f64::INFINITY, f64::min)
        };
        nearest(self, other).min(nearest(other, self)).sqrt()
    }

    fn center_distance_m(&self, other: &Self) -> f64 {
        math::hypot(other.x_m - self.x_m, other.y_m - self.y_m)
    }
}

/// One obstacle with all its places.
#[derive(Clone, Debug, Default)]
struct Mover {
    /// First of its places in `Obstacles::at` and `Obstacles::places`.
    first: usize,
    /// One past its last place.
    end: usize,
    /// Of the largest of its places.
    radius_m: f64,
    /// Bounds of the centres of all places: x_min, y_min, x_max, y_max.
    bounds: [f64; 4],
    /// Fastest motion between two places, m/s.
    speed_mps: f64,
}

/// Everything that must not be touched.
///
/// Storage is kept by [`set`](Self::set), so a planner that holds one does not allocate in steady state.
#[derive(Clone, Debug, Default)]
pub struct Obstacles {
    mode: CollisionMode,
    /// Whether anybody walks who may stop.
    walkers: bool,
    movers: Vec<Mover>,
    at: Vec<Time>,
    heading_rad: Vec<f64>,
    places: Vec<Solid>,
}

impl Obstacles {
    /// From predictions.
    pub fn new(predictions: &[Prediction], mode: CollisionMode) -> Self {
        let mut obstacles = Self::default();
        obstacles.set(predictions, mode);
        obstacles
    }

    /// From boxes that stand still.
    pub fn from_boxes(boxes: &[Obb]) -> Self {
        let mut obstacles = Self::default();
        for obb in boxes {
            obstacles.push(core::iter::once((Time::ZERO, *obb)), CollisionMode::TimeIndexed);
        }
        obstacles
    }

    /// Replaces the content, keeping the storage.
    pub fn set(&mut self, predictions: &[Prediction], mode: CollisionMode) {
        self.mode = mode;
        self.walkers = false;
        self.movers.clear();
        self.at.clear();
        self.heading_rad.clear();
        self.places.clear();
        for prediction in predictions {
            self.push_predicted(prediction, mode);
        }
    }

    /// As [`set`](Self::set), leaving out what is never within `range_m` of `center` (centre to centre).
    pub fn set_near(
        &mut self,
        predictions: &[Prediction],
        mode: CollisionMode,
        center: Point2,
        range_m: f64,
    ) {
        self.set(&[], mode);
        for prediction in predictions {
            if prediction.path.iter().any(|p| p.pose.point().distance(center) <= range_m) {
                self.push_predicted(prediction, mode);
            }
        }
    }

    /// Replaces the content by boxes that stand still, keeping the storage.
    pub fn set_boxes(&mut self, boxes: impl IntoIterator<Item = Obb>) {
        self.set(&[], CollisionMode::TimeIndexed);
        for obb in boxes {
            self.push(core::iter::once((Time::ZERO, obb)), CollisionMode::TimeIndexed);
        }
    }

    fn push_predicted(&mut self, prediction: &Prediction, mode: CollisionMode) {
        if mode == CollisionMode::MayStop
            && prediction.kind == ActorKind::Pedestrian
            && let Some(walked) = Walked::new(prediction)
        {
            self.walkers = true;
            self.push(walked, mode);
            return;
        }
        let boxes = prediction.path.iter().map(|p| (p.at, prediction.extent.footprint(p.pose)));
        self.push(boxes, mode);
    }

    /// Takes one obstacle in.
    fn push(&mut self, places: impl Iterator<Item = (Time, Obb)>, mode: CollisionMode) {
        let first = self.places.len();
        let mut mover = Mover {
            first,
            bounds: [f64::INFINITY, f64::INFINITY, -f64::INFINITY, -f64::INFINITY],
            ..Mover::default()
        };
        for (at, obb) in places {
            let solid = Solid::from(&obb);
            if let Some(last) = self.places[first..].last() {
                let moved_m = last.center_distance_m(&solid);
                if mode == CollisionMode::SweptStatic && moved_m < SWEPT_STEP_M {
                    continue;
                }
                let index = self.at.len() - 1;
                let turned =
                    swerve_geom::angle_between(self.heading_rad[index], obb.center.heading_rad).abs();
                let took_s = (at - self.at[index]).as_secs().max(1e-9);
                let grown_m = (solid.half_length_m - last.half_length_m).abs()
                    + (solid.half_width_m - last.half_width_m).abs();
                let edge_m = moved_m + turned * solid.radius_m() + grown_m;
                mover.speed_mps = mover.speed_mps.max(edge_m / took_s);
            }
            mover.radius_m = mover.radius_m.max(solid.radius_m());
            let b = &mut mover.bounds;
            *b = [b[0].min(solid.x_m), b[1].min(solid.y_m), b[2].max(solid.x_m), b[3].max(solid.y_m)];
            self.at.push(at);
            self.heading_rad.push(obb.center.heading_rad);
            self.places.push(solid);
        }
        mover.end = self.places.len();
        if mover.end > first {
            self.movers.push(mover);
        }
    }

    /// Whether there is nothing to hit.
    pub fn is_empty(&self) -> bool {
        self.movers.is_empty()
    }

    /// Whether somebody walks who may stop: under [`CollisionMode::MayStop`], whether it differs from time-indexed.
    pub fn any_may_stop(&self) -> bool {
        self.walkers
    }

    /// How predicted motion is taken.
    pub fn mode(&self) -> CollisionMode {
        self.mode
    }

    /// Calls `visit` with every box that counts at `at`: one for each obstacle, or all places at once
    /// under [`CollisionMode::SweptStatic`].
    pub fn for_each_at(&self, at: Time, mut visit: impl FnMut(&Solid)) {
        for mover in &self.movers {
            match self.mode {
                CollisionMode::TimeIndexed | CollisionMode::MayStop => visit(&self.place_at(mover, at)),
                CollisionMode::SweptStatic => self.places[mover.first..mover.end].iter().for_each(&mut visit),
            }
        }
    }

    /// Whether `footprint` at `at` touches nothing and keeps `clearance_m` to everything.
    pub fn free(&self, footprint: &Obb, at: Time, clearance_m: f64) -> bool {
        self.solid_free(&Solid::from(footprint), at, clearance_m)
    }

    /// As [`free`](Self::free), for a footprint whose direction is at hand.
    pub fn solid_free(&self, footprint: &Solid, at: Time, clearance_m: f64) -> bool {
        let limit = clearance_m.max(f64::MIN_POSITIVE);
        self.distance_below(footprint, at, limit) >= limit
    }

    /// Distance of `footprint` at `at` to the nearest obstacle, metres; zero when it touches one,
    /// infinite without obstacles.
    pub fn clearance_m(&self, footprint: &Obb, at: Time) -> f64 {
        self.distance_below(&Solid::from(footprint), at, f64::INFINITY)
    }

    /// Distance to the nearest obstacle that is nearer than `cap_m`, else `cap_m`.
    pub fn distance_below(&self, footprint: &Solid, at: Time, cap_m: f64) -> f64 {
        let own_m = footprint.radius_m();
        let mut nearest_m = cap_m;
        for mover in &self.movers {
            let b = &mover.bounds;
            let dx = (b[0] - footprint.x_m).max(footprint.x_m - b[2]).max(0.0);
            let dy = (b[1] - footprint.y_m).max(footprint.y_m - b[3]).max(0.0);
            let reach_m = own_m + mover.radius_m + nearest_m;
            if dx * dx + dy * dy >= reach_m * reach_m {
                continue;
            }
            match self.mode {
                CollisionMode::TimeIndexed | CollisionMode::MayStop => {
                    let solid = self.place_at(mover, at);
                    nearest_m = nearer(footprint, &solid, own_m + mover.radius_m, nearest_m);
                }
                CollisionMode::SweptStatic => {
                    for solid in &self.places[mover.first..mover.end] {
                        nearest_m = nearer(footprint, solid, own_m + mover.radius_m, nearest_m);
                    }
                }
            }
        }
        nearest_m
    }

    /// Where `mover` is at `at`: linear between its places, held before the first and after the last.
    fn place_at(&self, mover: &Mover, at: Time) -> Solid {
        let times = &self.at[mover.first..mover.end];
        let after = times.partition_point(|&t| t <= at);
        if after == 0 || after == times.len() {
            return self.places[mover.first + after.saturating_sub(1)];
        }
        let (i, j) = (mover.first + after - 1, mover.first + after);
        let u = (at - self.at[i]).as_secs() / (self.at[j] - self.at[i]).as_secs();
        let (a, b) = (self.places[i], self.places[j]);
        let turn = swerve_geom::angle_between(self.heading_rad[i], self.heading_rad[j]);
        let (sin, cos) =
            if turn == 0.0 { (a.sin, a.cos) } else { math::sin_cos(self.heading_rad[i] + turn * u) };
        let mix = |from: f64, to: f64| from + (to - from) * u;
        Solid {
            x_m: mix(a.x_m, b.x_m),
            y_m: mix(a.y_m, b.y_m),
            cos,
            sin,
            half_length_m: mix(a.half_length_m, b.half_length_m),
            half_width_m: mix(a.half_width_m, b.half_width_m),
        }
    }

    /// Fastest predicted motion of any point, m/s.
    pub(crate) fn fastest_mps(&self) -> f64 {
        match self.mode {
            CollisionMode::SweptStatic => 0.0,
            CollisionMode::TimeIndexed | CollisionMode::MayStop => {
                self.movers.iter().map(|m| m.speed_mps).fold(0.0, f64::max)
            }
        }
    }

    /// Whether a motion keeps `clearance_m` to everything throughout.
    ///
    /// `place` gives footprint and instant for `u` in `[0, 1]`, moving on steadily between; no point of
    /// the footprint travels further than `travel_m` over the whole motion, at most in proportion to `u`.
    pub fn motion_free(
        &self,
        place: &mut dyn FnMut(f64) -> (Solid, Time),
        travel_m: f64,
        clearance_m: f64,
    ) -> bool {
        if self.is_empty() {
            return true;
        }
        let (first, from) = place(0.0);
        let (last, to) = place(1.0);
        let moves_m = travel_m + self.fastest_mps() * (to - from).as_secs().max(0.0);
        self.solid_free(&first, from, clearance_m)
            && self.solid_free(&last, to, clearance_m)
            && self.stretch_free(place, (0.0, 1.0), moves_m, clearance_m)
    }

    /// `moves_m`: how far anything moves relative to the footprint over the stretch.
    fn stretch_free(
        &self,
        place: &mut dyn FnMut(f64) -> (Solid, Time),
        (low, high): (f64, f64),
        moves_m: f64,
        clearance_m: f64,
    ) -> bool {
        let limit = clearance_m.max(f64::MIN_POSITIVE);
        let middle = 0.5 * (low + high);
        let (solid, at) = place(middle);
        let enough_m = limit + 0.5 * moves_m;
        let distance_m = self.distance_below(&solid, at, enough_m);
        if distance_m < limit {
            return false;
        }
        if distance_m >= enough_m || moves_m <= RESOLUTION_M {
            return true;
        }
        self.stretch_free(place, (low, middle), 0.5 * moves_m, clearance_m)
            && self.stretch_free(place, (middle, high), 0.5 * moves_m, clearance_m)
    }

    /// Whether the footprint, carried straight from one pose to the next (headings turn steadily the short
    /// way), keeps `clearance_m`; `footprint` gives the outline at a pose.
    pub fn path_free(
        &self,
        footprint: impl Fn(Pose2) -> Obb,
        path: &[(Pose2, Time)],
        clearance_m: f64,
    ) -> bool {
        if let [(pose, at)] = path {
            return self.free(&footprint(*pose), *at, clearance_m);
        }
        path.windows(2).all(|pair| {
            let ((a, from), (b, to)) = (pair[0], pair[1]);
            let turn = swerve_geom::angle_between(a.heading_rad, b.heading_rad);
            let mut place = |u: f64| {
                let pose = between(a, b, u);
                let ns = (to - from).as_secs() * u;
                (Solid::from(&footprint(pose)), from + swerve_core::Span::from_secs(ns))
            };
            // Any corner travels at most as far as the reference point plus the turn times its lever.
            let obb = footprint(a);
            let lever_m = obb.center.point().distance(a.point()) + obb.radius();
            let travel_m = a.point().distance(b.point()) + turn.abs() * lever_m;
            self.motion_free(&mut place, travel_m, clearance_m)
        })
    }

    /// Smallest clearance along a path, sampled so that nothing moves more than `step_m` between two looks;
    /// infinite without obstacles.
    pub fn path_clearance_m(
        &self,
        footprint: impl Fn(Pose2) -> Obb,
        path: &[(Pose2, Time)],
        step_m: f64,
    ) -> f64 {
        let mut least_m = f64::INFINITY;
        for (i, &(a, from)) in path.iter().enumerate() {
            let (b, to) = path.get(i + 1).copied().unwrap_or((a, from));
            let moved_m = a.point().distance(b.point())
                + swerve_geom::angle_between(a.heading_rad, b.heading_rad).abs() * footprint(a).radius()
                + self.fastest_mps() * (to - from).as_secs().max(0.0);
            let steps = (moved_m / step_m).ceil().clamp(1.0, 10_000.0) as usize;
            for k in 0..steps {
                let u = k as f64 / steps as f64;
                let at = from + swerve_core::Span::from_secs((to - from).as_secs() * u);
                let solid = Solid::from(&footprint(between(a, b, u)));
                least_m = least_m.min(self.distance_below(&solid, at, least_m));
            }
        }
        least_m
    }
}

/// The frame along somebody's way.
#[derive(Clone, Copy, PartialEq, Debug)]
struct Walk;

/// The ground that somebody covers who walks as predicted and may stop on the way: per instant of the prediction the box
/// along the way that holds all places up to then.
struct Walked<'a> {
    prediction: &'a Prediction,
    /// Directed along the way, at its first place.
    frame: Pose2,
    next: usize,
    /// Ahead from, ahead to, left from, left to, metres.
    reach_m: [f64; 4],
}

impl<'a> Walked<'a> {
    /// `None` for who stands.
    fn new(prediction: &'a Prediction) -> Option<Self> {
        let (first, last) = (prediction.path.first()?.pose, prediction.path.last()?.pose);
        let way = last.point() - first.point();
        let frame = Pose2::new(first.x_m, first.y_m, way.heading());
        let reach_m = [f64::INFINITY, f64::NEG_INFINITY, f64::INFINITY, f64::NEG_INFINITY];
        (way.norm() > STANDS_M).then_some(Self { prediction, frame, next: 0, reach_m })
    }
}

impl Iterator for Walked<'_> {
    type Item = (Time, Obb);

    fn next(&mut self) -> Option<Self::Item> {
        let place = self.prediction.path.get(self.next)?;
        self.next += 1;
        let at: Point2<Walk> = self.frame.to_local(place.pose.point());
        let (sin, cos) = math::sin_cos(place.pose.heading_rad - self.frame.heading_rad);
        let (length_m, width_m) = (self.prediction.extent.length_m, self.prediction.extent.width_m);
        let ahead_m = 0.5 * (length_m * cos.abs() + width_m * sin.abs());
        let left_m = 0.5 * (length_m * sin.abs() + width_m * cos.abs());
        let r = &mut self.reach_m;
        *r = [
            r[0].min(at.x_m - ahead_m),
            r[1].max(at.x_m + ahead_m),
            r[2].min(at.y_m - left_m),
            r[3].max(at.y_m + left_m),
        ];
        let middle = self.frame.from_local(Point2::<Walk>::new(0.5 * (r[0] + r[1]), 0.5 * (r[2] + r[3])));
        let center = Pose2::new(middle.x_m, middle.y_m, self.frame.heading_rad);
        Some((place.at, Obb::new(center, r[1] - r[0], r[3] - r[2])))
    }
}

/// The pose at share `u` of the way from `a` to `b`: straight, turning steadily the short way.
pub fn between(a: Pose2, b: Pose2, u: f64) -> Pose2 {
    let turn = swerve_geom::angle_between(a.heading_rad, b.heading_rad);
    Pose2::new(a.x_m + (b.x_m - a.x_m) * u, a.y_m + (b.y_m - a.y_m) * u, a.heading_rad + turn * u)
}

fn nearer(footprint: &Solid, solid: &Solid, radii_m: f64, nearest_m: f64) -> f64 {
    let (dx, dy) = (solid.x_m - footprint.x_m, solid.y_m - footprint.y_m);
    let reach_m = radii_m + nearest_m;
    if dx * dx + dy * dy >= reach_m * reach_m {
        return nearest_m;
    }
    nearest_m.min(footprint.distance_m(solid))
}

#[cfg(test)]
mod tests;
