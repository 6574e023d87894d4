//! The exact collision check that all planners and tests share.
//!
//! Obstacles are oriented boxes that stand or move along their predictions, with one standard deviation added on each
//! side if the prediction has covariances. A footprint is *free* when it touches no
//! obstacle and keeps a clearance (Euclidean distance between the two rectangles). Motions between two poses are
//! checked by bisection: an interval is free once the distance at its middle exceeds what can move within it, so
//! nothing tunnels through, however far apart the samples are.

mod motion;
mod risk;
mod size;
mod solid;
mod walked;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Obb, Point2, angle_between, math};
use swerve_msg::{ActorKind, PredictedPose, Prediction};

use size::sizes_m;
use walked::Walked;

pub use motion::between;
pub(crate) use risk::contact_mps;
pub use risk::{plan_within_risk, within_risk};
pub use solid::Solid;

/// Treatment of predicted motion in the collision check.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum CollisionMode {
    /// An obstacle occupies only its predicted place at the instant checked.
    #[default]
    TimeIndexed,
    /// An obstacle occupies all its predicted places at all times (places at least 1 m apart), as in Pylot.
    SweptStatic,
    /// As time-indexed, but a pedestrian may stop on the way: at each instant it occupies everything between its
    /// current and its predicted place.
    ///
    /// A pedestrian can stop within a step and without warning, so constant velocity only bounds the distance
    /// travelled. This is the reachable set along the predicted path (the reachable sets of Koschi et al., Set-Based
    /// Prediction of Pedestrians, ITSC 2018, restricted to one line). Vehicles need a distance to stop and stay
    /// time-indexed. If this leaves neither a way through nor a stop, planners take pedestrians as predicted.
    MayStop,
    /// As `may_stop`, but unlikely modes are not kept clear of: the caller removes the least likely ones, up to a bound
    /// on their total probability ([`within_risk`]).
    Risk,
}

impl CollisionMode {
    /// Modes in the order in which planners try them: if no plan is found with pedestrians that may stop, they are
    /// taken as predicted.
    pub fn in_order(self) -> &'static [Self] {
        match self {
            Self::TimeIndexed => &[Self::TimeIndexed],
            Self::SweptStatic => &[Self::SweptStatic],
            Self::MayStop | Self::Risk => &[Self::MayStop, Self::TimeIndexed],
        }
    }
}

/// Smallest distance between two places of one obstacle under [`CollisionMode::SweptStatic`], metres. Source: Pylot.
pub const SWEPT_STEP_M: f64 = 1.0;

/// One obstacle with all its places.
#[derive(Clone, Debug, Default)]
struct Mover {
    /// Index of its first place in `Obstacles::at` and `Obstacles::places`.
    first: usize,
    /// One past its last place.
    end: usize,
    /// Radius of the largest of its places, metres.
    radius_m: f64,
    /// Bounds of the centres of all places: x_min, y_min, x_max, y_max.
    bounds: [f64; 4],
    /// Fastest motion between two places, m/s.
    speed_mps: f64,
    /// Average number of places per second.
    places_per_s: f64,
    /// True if its instants are those of the obstacle before it.
    same_instants: bool,
}

/// Position of an instant among those of an obstacle.
#[derive(Clone, Copy, Debug)]
enum Instant {
    /// Before the first.
    Before,
    /// At this fraction of the way from the place before this one, counted from the first.
    Between(usize, f64),
    /// At the last or after it.
    After,
}

/// Obstacles of a collision check.
///
/// [`set`](Self::set) reuses the storage, so a planner that holds one does not allocate in steady state.
#[derive(Clone, Debug, Default)]
pub struct Obstacles {
    mode: CollisionMode,
    /// True if some pedestrian may stop.
    walkers: bool,
    movers: Vec<Mover>,
    at: Vec<Time>,
    heading_rad: Vec<f64>,
    places: Vec<Solid>,
}

impl Mover {
    /// Indices of the places around an instant, and the fraction of the way between them; twice the same at the ends.
    fn between(&self, instant: Instant) -> (usize, usize, f64) {
        match instant {
            Instant::Before => (self.first, self.first, 0.0),
            Instant::Between(after, u) => (self.first + after - 1, self.first + after, u),
            Instant::After => (self.end - 1, self.end - 1, 0.0),
        }
    }
}

impl Obstacles {
    /// Creates obstacles from predictions.
    pub fn new(predictions: &[Prediction], mode: CollisionMode) -> Self {
        let mut obstacles = Self::default();
        obstacles.set(predictions, mode);
        obstacles
    }

    /// Creates static obstacles from boxes.
    pub fn from_boxes(boxes: &[Obb]) -> Self {
        let mut obstacles = Self::default();
        for obb in boxes {
            obstacles.push(core::iter::once((Time::ZERO, *obb)), CollisionMode::TimeIndexed);
        }
        obstacles
    }

    /// Replaces the obstacles, reusing the storage.
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

    /// As [`set`](Self::set), without obstacles that never come within `range_m` of `center` (centre to centre).
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

    /// Replaces the obstacles by static boxes, reusing the storage.
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
        let outline = |(k, p): (usize, &PredictedPose)| {
            let [length_m, width_m] = sizes_m(prediction, k);
            (p.at, Obb::new(p.pose, length_m, width_m))
        };
        let boxes = prediction.path.iter().enumerate().map(outline);
        self.push(boxes, mode);
    }

    /// Adds one obstacle.
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
                let turned = angle_between(self.heading_rad[index], obb.center.heading_rad).abs();
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
        let before = self.movers.last().map(|before| &self.at[before.first..before.end]);
        mover.same_instants = before == Some(&self.at[first..]);
        if let [from, .., to] = self.at[first..] {
            mover.places_per_s = (mover.end - first - 1) as f64 / (to - from).as_secs();
        }
        if mover.end > first {
            self.movers.push(mover);
        }
    }

    /// True if there are no obstacles.
    pub fn is_empty(&self) -> bool {
        self.movers.is_empty()
    }

    /// True if some pedestrian may stop: only then does [`CollisionMode::MayStop`] differ from time-indexed.
    pub fn any_may_stop(&self) -> bool {
        self.walkers
    }

    /// Treatment of predicted motion.
    pub fn mode(&self) -> CollisionMode {
        self.mode
    }

    /// Calls `visit` with every box that counts at `at`: one per obstacle, or all its places under
    /// [`CollisionMode::SweptStatic`].
    pub fn for_each_at(&self, at: Time, mut visit: impl FnMut(&Solid)) {
        for mover in &self.movers {
            match self.mode {
                CollisionMode::TimeIndexed | CollisionMode::MayStop | CollisionMode::Risk => {
                    visit(&self.place_at(mover, at))
                }
                CollisionMode::SweptStatic => self.places[mover.first..mover.end].iter().for_each(&mut visit),
            }
        }
    }

    /// Returns true if `footprint` at `at` touches no obstacle and keeps `clearance_m` to all.
    pub fn free(&self, footprint: &Obb, at: Time, clearance_m: f64) -> bool {
        self.solid_free(&Solid::from(footprint), at, clearance_m)
    }

    /// As [`free`](Self::free), for a footprint with a known direction.
    pub fn solid_free(&self, footprint: &Solid, at: Time, clearance_m: f64) -> bool {
        let limit = clearance_m.max(f64::MIN_POSITIVE);
        self.distance_below(footprint, at, limit) >= limit
    }

    /// Distance of `footprint` at `at` to the nearest obstacle, metres; zero when it touches one,
    /// infinite without obstacles.
    pub fn clearance_m(&self, footprint: &Obb, at: Time) -> f64 {
        self.distance_below(&Solid::from(footprint), at, f64::INFINITY)
    }

    /// Distance to the nearest obstacle, metres, capped at `cap_m`.
    pub fn distance_below(&self, footprint: &Solid, at: Time, cap_m: f64) -> f64 {
        let own_m = footprint.radius_m();
        let mut nearest_m = cap_m;
        // Obstacles of one prediction have the same instants.
        let mut known = None;
        for mover in &self.movers {
            if !mover.same_instants {
                known = None;
            }
            let b = &mover.bounds;
            let dx = (b[0] - footprint.x_m).max(footprint.x_m - b[2]).max(0.0);
            let dy = (b[1] - footprint.y_m).max(footprint.y_m - b[3]).max(0.0);
            let reach_m = own_m + mover.radius_m + nearest_m;
            if dx * dx + dy * dy >= reach_m * reach_m {
                continue;
            }
            match self.mode {
                CollisionMode::TimeIndexed | CollisionMode::MayStop | CollisionMode::Risk => {
                    let instant = *known.get_or_insert_with(|| self.instant(mover, at));
                    let (x_m, y_m) = self.center(mover, instant);
                    let reach_m = own_m + mover.radius_m + nearest_m;
                    if is_within(footprint, x_m, y_m, reach_m) {
                        nearest_m = footprint.distance_below(&self.solid(mover, instant), nearest_m);
                    }
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

    /// Place of `mover` at `at`: linear between its places, constant before the first and after the last.
    fn place_at(&self, mover: &Mover, at: Time) -> Solid {
        self.solid(mover, self.instant(mover, at))
    }

    fn instant(&self, mover: &Mover, at: Time) -> Instant {
        let times = &self.at[mover.first..mover.end];
        let (Some(&from), Some(&to)) = (times.first(), times.last()) else { return Instant::Before };
        if at < from {
            return Instant::Before;
        }
        if at >= to {
            return Instant::After;
        }
        // Instants are usually equidistant.
        let mut after = (((at - from).as_secs() * mover.places_per_s) as usize).min(times.len() - 1);
        while times[after] > at {
            after -= 1;
        }
        while times[after] <= at {
            after += 1;
        }
        let share = (at - times[after - 1]).as_secs() / (times[after] - times[after - 1]).as_secs();
        Instant::Between(after, share)
    }

    /// Centre of `mover`: x and y, metres.
    fn center(&self, mover: &Mover, instant: Instant) -> (f64, f64) {
        let (i, j, u) = mover.between(instant);
        let (a, b) = (&self.places[i], &self.places[j]);
        (mix(a.x_m, b.x_m, u), mix(a.y_m, b.y_m, u))
    }

    /// Outline of `mover`.
    fn solid(&self, mover: &Mover, instant: Instant) -> Solid {
        let (i, j, u) = mover.between(instant);
        if i == j {
            return self.places[i];
        }
        let (a, b) = (&self.places[i], &self.places[j]);
        let turn = angle_between(self.heading_rad[i], self.heading_rad[j]);
        let (sin, cos) =
            if turn == 0.0 { (a.sin, a.cos) } else { math::sin_cos(self.heading_rad[i] + turn * u) };
        Solid {
            x_m: mix(a.x_m, b.x_m, u),
            y_m: mix(a.y_m, b.y_m, u),
            cos,
            sin,
            half_length_m: mix(a.half_length_m, b.half_length_m, u),
            half_width_m: mix(a.half_width_m, b.half_width_m, u),
        }
    }

    /// Fastest predicted motion of any point, m/s.
    pub(crate) fn fastest_mps(&self) -> f64 {
        match self.mode {
            CollisionMode::SweptStatic => 0.0,
            CollisionMode::TimeIndexed | CollisionMode::MayStop | CollisionMode::Risk => {
                self.movers.iter().map(|m| m.speed_mps).fold(0.0, f64::max)
            }
        }
    }
}

/// True if a point is nearer than `reach_m` to the centre of a footprint.
fn is_within(footprint: &Solid, x_m: f64, y_m: f64, reach_m: f64) -> bool {
    let (dx, dy) = (x_m - footprint.x_m, y_m - footprint.y_m);
    let is_far = dx * dx + dy * dy >= reach_m * reach_m;
    !is_far
}

fn mix(from: f64, to: f64, u: f64) -> f64 {
    from + (to - from) * u
}

fn nearer(footprint: &Solid, solid: &Solid, radii_m: f64, nearest_m: f64) -> f64 {
    match is_within(footprint, solid.x_m, solid.y_m, radii_m + nearest_m) {
        true => footprint.distance_below(solid, nearest_m),
        false => nearest_m,
    }
}

#[cfg(test)]
mod tests;
