//! One candidate in full: its motion in the map frame, and its checks.

use swerve_core::{Span, Time};
use swerve_geom::math;
use swerve_vehicle::Shape;

use super::lateral::{FrenetState, Lateral};
use super::line::{Line, Node};
use super::poly::Quintic;
use crate::collision::{Obstacles, Solid};
use crate::road::Road;

/// A motion between two Frenet states; after its end it continues along the line.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Motion {
    lateral: Lateral,
    longitudinal: Quintic,
    end_s: f64,
}

/// The ego origin at one instant of a motion.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct MotionState {
    /// X coordinate, metres.
    pub x_m: f64,
    /// Y coordinate, metres.
    pub y_m: f64,
    /// Cosine of the heading.
    pub cos: f64,
    /// Sine of the heading.
    pub sin: f64,
    /// Arc length of the line, metres.
    pub s_m: f64,
    /// Offset to the left of the line, metres.
    pub d_m: f64,
    /// Speed, m/s.
    pub speed_mps: f64,
    /// Acceleration along the heading, m/s².
    pub accel_mps2: f64,
    /// Curvature, 1/m.
    pub curvature_1pm: f64,
    /// `1 - κ d`: length of the parallel through here relative to the line.
    pub stretch: f64,
    /// Speed along the line, m/s.
    pub along_mps: f64,
}

/// Below this speed a motion's direction and curvature are undefined, m/s.
const STANDSTILL_MPS: f64 = 1e-3;

impl Motion {
    /// Motion to offset `d_m` at `t_s`, the end time of `longitudinal`.
    pub(crate) fn new(start: &FrenetState, longitudinal: Quintic, d_m: f64, t_s: f64) -> Self {
        Self { lateral: start.lateral(&longitudinal, d_m, t_s), longitudinal, end_s: t_s }
    }

    /// Motion in the map frame at `t_s`; `still` is the direction used at standstill (cosine, sine).
    pub fn at(&self, line: &Line, t_s: f64, still: (f64, f64)) -> MotionState {
        self.place::<true>(line, t_s, still)
    }

    /// As [`at`](Self::at), with acceleration and curvature set to zero.
    pub fn pose_at(&self, line: &Line, t_s: f64, still: (f64, f64)) -> MotionState {
        self.place::<false>(line, t_s, still)
    }

    #[inline(always)]
    fn place<const WHOLE: bool>(&self, line: &Line, t_s: f64, still: (f64, f64)) -> MotionState {
        let inside_s = t_s.min(self.end_s);
        let mut s = self.longitudinal.at(inside_s);
        s.x += s.v * (t_s - inside_s);
        let d = self.lateral.at(inside_s, &s);
        let node = line.at(s.x);
        // With the line's tangent and normal, t' = κ s' n and n' = -κ s' t, differentiating p = r(s) + d n twice gives
        // velocity and acceleration along and across the line.
        let (k, kp) = (node.curvature_1pm, node.bend_1pm2);
        let stretch = 1.0 - k * d.x;
        let (along, across) = (s.v * stretch, d.v);
        let accel_along = s.a * stretch - s.v * (kp * s.v * d.x + 2.0 * k * d.v);
        let accel_across = d.a + k * s.v * s.v * stretch;
        let speed = math::hypot(along, across);
        let mut place = MotionState {
            x_m: node.x_m - node.sin * d.x,
            y_m: node.y_m + node.cos * d.x,
            s_m: s.x,
            d_m: d.x,
            speed_mps: speed,
            stretch,
            along_mps: s.v,
            ..MotionState::default()
        };
        if let Lateral::OverArc { .. } = self.lateral {
            // Direction and curvature of the path, defined at standstill too: derivatives by arc length, as above.
            let by_s = self.lateral.by_arc(s.x);
            let length = math::hypot(stretch, by_s.v);
            let (cos, sin) = (stretch / length, by_s.v / length);
            (place.cos, place.sin) = turned(&node, cos, sin);
            place.accel_mps2 = cos * accel_along + sin * accel_across;
            let (along, across) = (-(kp * d.x + 2.0 * k * by_s.v), by_s.a + k * stretch);
            place.curvature_1pm = (cos * across - sin * along) / (length * length);
            return place;
        }
        if speed < STANDSTILL_MPS {
            (place.cos, place.sin) = still;
            place.accel_mps2 = accel_along;
            return place;
        }
        (place.cos, place.sin) = turned(&node, along / speed, across / speed);
        if !WHOLE {
            return place;
        }
        place.accel_mps2 = (along * accel_along + across * accel_across) / speed;
        place.curvature_1pm = (along * accel_across - across * accel_along) / (speed * speed * speed);
        place
    }
}

fn turned(node: &Node, along: f64, across: f64) -> (f64, f64) {
    (node.cos * along - node.sin * across, node.sin * along + node.cos * across)
}

/// Outline with the ego origin at `place`.
pub fn outline(shape: &Shape, place: &MotionState) -> Solid {
    let ahead_m = shape.center_ahead_m();
    Solid {
        x_m: place.x_m + place.cos * ahead_m,
        y_m: place.y_m + place.sin * ahead_m,
        cos: place.cos,
        sin: place.sin,
        half_length_m: 0.5 * shape.length_m,
        half_width_m: 0.5 * shape.width_m,
    }
}

/// Conditions on a motion, in addition to the longitudinal limits.
#[derive(Clone, Copy, Debug)]
pub struct Checks<'a> {
    /// Obstacles, which must not be touched.
    pub obstacles: &'a Obstacles,
    /// Outline of the ego.
    pub shape: &'a Shape,
    /// Start instant.
    pub at: Time,
    /// Distance to keep from the obstacles, metres.
    pub clearance_m: f64,
    /// True if the clearance to static obstacles is exact to a fraction of a millimetre.
    pub exact: bool,
    /// Largest curvature, 1/m.
    pub curvature_max_1pm: f64,
    /// Largest speed in the map, m/s; if infinite, only the speed along the line is limited.
    pub speed_max_mps: f64,
    /// Largest total acceleration in the map, m/s²; if infinite, only that along the line is limited.
    pub accel_max_mps2: f64,
    /// Range of the ego origin's offset, metres; not checked if infinite.
    pub offset_m: (f64, f64),
    /// True if the heading must continue from the ego's without a kink.
    pub smooth: bool,
    /// Additional limits for drivable motions.
    pub drivable: Option<Drivable<'a>>,
    /// Heading of the ego at the start (cosine, sine).
    pub heading: (f64, f64),
    /// Time for which the motion is checked beyond its end, seconds.
    pub tail_s: f64,
}

/// Limits of the vehicle and the road.
#[derive(Clone, Copy, Debug)]
pub struct Drivable<'a> {
    /// Largest lateral acceleration, m/s².
    pub lateral_accel_max_mps2: f64,
    /// Largest acceleration, m/s².
    pub accel_max_mps2: f64,
    /// Largest deceleration, m/s².
    pub brake_max_mps2: f64,
    /// Largest steering rate of the road wheels, rad/s.
    pub steering_rate_max_radps: f64,
    /// Ground that must contain the whole outline.
    pub road: &'a Road,
    /// Distance to keep from its edge, metres.
    pub road_margin_m: f64,
    /// Largest offset at which a motion may end at rest, metres: further left is the lane of oncoming traffic.
    pub rest_left_m: f64,
}

/// Largest time step of the limit checks, seconds.
const LOOK_S: f64 = 0.1;

/// A start that violates a limit may continue to do so, less and less, for this long, seconds.
const GRACE_S: f64 = 1.0;

/// A start above the largest speed may exceed its own speed by this factor before it slows: its acceleration fades.
pub(super) const OVERSPEED: f64 = 1.02;

/// Relative tolerance on limits, for rounding.
const ROUNDING: f64 = 1e-6;

/// Heading may change by this much more than the curvature limit allows between two steps, radians: discretisation
/// error of the step.
const HEADING_SLACK_RAD: f64 = 0.03;

/// Precision of the exact clearance, metres.
const EXACT_M: f64 = 2e-4;

/// Below this speed the steering rate and lateral acceleration of a motion are not checked, m/s.
const CRAWL_MPS: f64 = 0.3;

/// A motion that ends slower than this ends at rest, m/s.
const RESTS_MPS: f64 = 1.0;

/// Obstacles nearer than the clearance by this much at any instant are detected wherever the samples are: at least the
/// motion between two samples (`RESOLUTION_M` of motions), metres.
const BETWEEN_LOOKS_M: f64 = 0.02;

/// Results shared by the motions of one task, from one start. They speed up the checks without changing their results.
#[derive(Clone, Copy, Debug, Default)]
pub struct Hints {
    grace: Option<Grace>,
    /// Latest instants at which motions came too near to an obstacle, newest first, seconds: similar motions tend to
    /// fail there too.
    near_s: [Option<f64>; 2],
}

impl Hints {
    fn add(&mut self, t_s: f64) {
        if self.near_s[0] != Some(t_s) {
            self.near_s = [Some(t_s), self.near_s[0]];
        }
    }
}

impl Checks<'_> {
    /// Returns true if `motion` may be driven from 0 to `last_s`; `hints` come from earlier motions.
    pub fn hold(&self, line: &Line, motion: &Motion, last_s: f64, hints: &mut Hints) -> bool {
        if self.rests_among_oncoming(motion) || self.fails_too(line, motion, last_s, hints) {
            return false;
        }
        let end_s = last_s + self.tail_s;
        // Motions that end within a second are sampled more densely: their braking could fall between the usual
        // samples.
        let steps = (end_s / LOOK_S.min(0.1 * last_s)).ceil().max(1.0);
        let step_s = end_s / steps;
        let mut places = self.places(line, motion, step_s);
        let first = places.next().expect("places do not end");
        let grace = *hints.grace.get_or_insert_with(|| Grace::new(self, &first.1));
        let mut before = MotionState { cos: self.heading.0, sin: self.heading.1, ..first.1 };
        let (mut peaks, mut total) = (Peaks::default(), Total::default());
        // Most motions fail another check than that of a bent road, which takes longest.
        let is_late = self.drivable.is_some_and(|limits| limits.road.is_bent());
        for (t_s, place) in core::iter::once(first).chain(places).take(steps as usize + 1) {
            if !self.limits_hold((&before, &place), (t_s, step_s), &grace)
                || !(is_late || self.keeps_road(&place, t_s, &grace))
                || !self.total_holds(&place, t_s, &mut total, &grace)
            {
                return false;
            }
            // Most collisions are found at a sample; the finer check below is more expensive.
            let body = outline(self.shape, &place);
            if !self.obstacles.solid_free(&body, self.at + Span::from_secs(t_s), grace.clearance_m) {
                hints.add(t_s);
                return false;
            }
            peaks.speed_mps = peaks.speed_mps.max(place.speed_mps);
            peaks.yaw_rate_radps = peaks.yaw_rate_radps.max(place.speed_mps * place.curvature_1pm.abs());
            before = place;
        }
        let mut places = self.places(line, motion, step_s).take(steps as usize + 1);
        if is_late && !places.all(|(t_s, place)| self.keeps_road(&place, t_s, &grace)) {
            return false;
        }
        let near_s = self.first_near(line, motion, end_s, &peaks, grace.clearance_m);
        near_s.into_iter().for_each(|t_s| hints.add(t_s));
        near_s.is_none()
    }

    /// Instants and places of `motion` every `step_s`, without end.
    fn places<'a>(
        &'a self,
        line: &'a Line,
        motion: &'a Motion,
        step_s: f64,
    ) -> impl Iterator<Item = (f64, MotionState)> + 'a {
        let mut still = self.heading;
        (0_usize..).map(move |k| {
            let t_s = k as f64 * step_s;
            let place = motion.at(line, t_s, still);
            still = (place.cos, place.sin);
            (t_s, place)
        })
    }

    /// Returns true if `motion` ends at rest in the lane of oncoming traffic.
    fn rests_among_oncoming(&self, motion: &Motion) -> bool {
        let Some(drivable) = &self.drivable else { return false };
        let end = motion.longitudinal.at(motion.end_s);
        end.v < RESTS_MPS && motion.lateral.at(motion.end_s, &end).x > drivable.rest_left_m
    }

    /// Returns true if `motion` certainly fails at an instant where earlier ones came too near to an obstacle.
    pub(crate) fn fails_too(&self, line: &Line, motion: &Motion, last_s: f64, hints: &Hints) -> bool {
        let Some(grace) = &hints.grace else { return false };
        let between_m = if self.exact { 0.0 } else { BETWEEN_LOOKS_M };
        let needed_m = (grace.clearance_m - between_m).max(0.0);
        let within = |t_s: &f64| *t_s <= last_s + self.tail_s;
        let mut known = hints.near_s.into_iter().flatten().filter(within);
        known.any(|t_s| !self.clear_at(line, motion, t_s, needed_m))
    }

    /// Returns true if the clearance is kept at one instant; standstill counts as clear, as its heading is undefined
    /// here.
    fn clear_at(&self, line: &Line, motion: &Motion, t_s: f64, clearance_m: f64) -> bool {
        let place = motion.pose_at(line, t_s, self.heading);
        let at = self.at + Span::from_secs(t_s);
        place.speed_mps < STANDSTILL_MPS
            || self.obstacles.solid_free(&outline(self.shape, &place), at, clearance_m)
    }

    fn limits_hold(
        &self,
        (before, place): (&MotionState, &MotionState),
        (t_s, step_s): (f64, f64),
        grace: &Grace,
    ) -> bool {
        let share = (1.0 - t_s / GRACE_S).max(0.0);
        if place.stretch < 0.1 || place.along_mps < -1e-3 {
            return false;
        }
        let slack_m = 1e-6 + grace.offset_m;
        if place.d_m < self.offset_m.0 - slack_m || place.d_m > self.offset_m.1 + slack_m {
            return false;
        }
        if place.curvature_1pm.abs() > self.curvature_max_1pm.max(grace.curvature_1pm * share) {
            return false;
        }
        if self.smooth && !self.goes_on(before, place) {
            return false;
        }
        let look = Look { before, place, share, step_s };
        self.drivable.is_none_or(|limits| self.drivable_holds(&limits, &look, grace))
    }

    /// Returns true if speed and acceleration in the map keep their limits at `place`, `t_s` after the start.
    fn total_holds(&self, place: &MotionState, t_s: f64, total: &mut Total, grace: &Grace) -> bool {
        if place.speed_mps > self.speed_max_mps.max(grace.speed_mps) * (1.0 + ROUNDING) {
            return false;
        }
        // As along the line, the acceleration of the start itself is not checked.
        if t_s == 0.0 || self.accel_max_mps2 == f64::INFINITY {
            return true;
        }
        let lateral = place.curvature_1pm * place.speed_mps * place.speed_mps;
        let share = (1.0 - t_s / GRACE_S).max(0.0);
        let peak = total.peak(math::hypot(place.accel_mps2, lateral));
        peak <= self.accel_max_mps2.max(grace.total_mps2 * share) * (1.0 + ROUNDING)
    }

    /// Returns true if the heading changes between two samples no more than the curvature limit allows.
    fn goes_on(&self, before: &MotionState, place: &MotionState) -> bool {
        let moved_m = math::hypot(place.x_m - before.x_m, place.y_m - before.y_m);
        let turn = (before.cos * place.sin - before.sin * place.cos).abs();
        let forward = before.cos * place.cos + before.sin * place.sin > 0.0;
        forward && turn <= self.curvature_max_1pm * moved_m * 1.2 + HEADING_SLACK_RAD
    }

    fn drivable_holds(&self, limits: &Drivable<'_>, look: &Look<'_>, grace: &Grace) -> bool {
        let Look { before, place, share, step_s } = *look;
        let lateral = place.curvature_1pm.abs() * place.speed_mps * place.speed_mps;
        let accel = place.accel_mps2;
        if lateral > limits.lateral_accel_max_mps2.max(grace.lateral_mps2 * share)
            || accel > limits.accel_max_mps2.max(grace.accel_mps2 * share)
            || accel < -limits.brake_max_mps2.max(-grace.accel_mps2 * share)
        {
            return false;
        }
        if share < 1.0 && before.speed_mps > CRAWL_MPS && place.speed_mps > CRAWL_MPS {
            // Front wheels: δ = atan(L κ), so δ' is at most L κ'.
            let change = self.shape.wheelbase_m * (place.curvature_1pm - before.curvature_1pm).abs();
            if change > limits.steering_rate_max_radps * step_s * 1.05 {
                return false;
            }
        }
        true
    }

    /// Returns true if the outline is on the drivable ground, with its margin, `t_s` after the start.
    fn keeps_road(&self, place: &MotionState, t_s: f64, grace: &Grace) -> bool {
        self.drivable.is_none_or(|limits| {
            let share = (1.0 - t_s / GRACE_S).max(0.0);
            let margin_m = limits.road_margin_m;
            let needed_m = margin_m.min(margin_m + (grace.margin_m - margin_m) * share);
            limits.road.keeps(&outline(self.shape, place), needed_m)
        })
    }

    /// An instant from 0 to `end_s` at which the clearance is violated, if any.
    fn first_near(
        &self,
        line: &Line,
        motion: &Motion,
        end_s: f64,
        peaks: &Peaks,
        clearance_m: f64,
    ) -> Option<f64> {
        let mut place = |u: f64| {
            let t_s = u * end_s;
            let at = self.at + Span::from_secs(t_s);
            (outline(self.shape, &motion.pose_at(line, t_s, self.heading)), at)
        };
        let lever_m =
            self.shape.center_ahead_m().abs() + 0.5 * math::hypot(self.shape.length_m, self.shape.width_m);
        // The samples may miss a little of the peak between them.
        let travel_m = 1.05 * end_s * (peaks.speed_mps + 0.1 + lever_m * peaks.yaw_rate_radps);
        let near = self.obstacles.first_near(&mut place, travel_m, clearance_m);
        let exactly = |place| self.closely_near(place, 0.0, 1.0, travel_m, clearance_m + EXACT_M);
        let near = if self.exact { near.or_else(|| exactly(&mut place)) } else { near };
        near.map(|u| u * end_s)
    }

    /// A place in the interval that does not keep `limit_m` to static obstacles: as [`Obstacles::first_near`], with
    /// finer sampling near obstacles.
    fn closely_near(
        &self,
        place: &mut dyn FnMut(f64) -> (Solid, Time),
        low: f64,
        high: f64,
        travel_m: f64,
        limit_m: f64,
    ) -> Option<f64> {
        let middle = 0.5 * (low + high);
        let (solid, at) = place(middle);
        let enough_m = limit_m + 0.5 * travel_m;
        let distance_m = self.obstacles.distance_below(&solid, at, enough_m);
        if distance_m < limit_m || distance_m >= enough_m || travel_m <= EXACT_M {
            let keeps = distance_m >= limit_m;
            return (!keeps).then_some(middle);
        }
        self.closely_near(place, low, middle, 0.5 * travel_m, limit_m)
            .or_else(|| self.closely_near(place, middle, high, 0.5 * travel_m, limit_m))
    }
}

/// One sample of a motion.
#[derive(Clone, Copy)]
struct Look<'a> {
    before: &'a MotionState,
    place: &'a MotionState,
    /// Fraction of the start's limit violation that is still tolerated.
    share: f64,
    /// Time since the previous sample, seconds.
    step_s: f64,
}

/// Accelerations in the map at the last two samples, m/s².
#[derive(Default)]
struct Total([Option<f64>; 2]);

impl Total {
    /// Peak acceleration up to this sample: the vertex of the parabola through the last three samples if the middle one
    /// is the largest, otherwise `now`.
    fn peak(&mut self, now: f64) -> f64 {
        let [before, last] = self.0;
        self.0 = [last, Some(now)];
        let (Some(a), Some(b)) = (before, last) else { return now };
        if b < a || b < now || 2.0 * b - a - now < 1e-12 {
            return now;
        }
        b + (now - a) * (now - a) / (8.0 * (2.0 * b - a - now))
    }
}

/// Peaks over the samples of a motion.
#[derive(Default)]
struct Peaks {
    speed_mps: f64,
    yaw_rate_radps: f64,
}

/// Limit violations of the start itself, which are tolerated in motions from it.
#[derive(Clone, Copy, Debug)]
struct Grace {
    curvature_1pm: f64,
    lateral_mps2: f64,
    accel_mps2: f64,
    total_mps2: f64,
    speed_mps: f64,
    offset_m: f64,
    margin_m: f64,
    clearance_m: f64,
}

impl Grace {
    fn new(checks: &Checks<'_>, first: &MotionState) -> Self {
        let (low, high) = checks.offset_m;
        let offset_m = (low - first.d_m).max(first.d_m - high).max(0.0);
        let mut grace = Self {
            curvature_1pm: 0.0,
            lateral_mps2: 0.0,
            accel_mps2: 0.0,
            total_mps2: 0.0,
            speed_mps: 0.0,
            offset_m: 1.1 * offset_m,
            margin_m: f64::INFINITY,
            clearance_m: checks.clearance_m,
        };
        if let Some(drivable) = &checks.drivable {
            let body = outline(checks.shape, first);
            grace.curvature_1pm = 1.1 * first.curvature_1pm.abs();
            grace.lateral_mps2 = 1.1 * first.curvature_1pm.abs() * first.speed_mps * first.speed_mps;
            grace.accel_mps2 = 1.1 * first.accel_mps2;
            grace.total_mps2 = math::hypot(grace.accel_mps2, grace.lateral_mps2);
            grace.speed_mps = OVERSPEED * first.speed_mps;
            grace.margin_m = drivable.road.margin_m(&body) - 0.02;
            let now_m = checks.obstacles.distance_below(&body, checks.at, checks.clearance_m);
            grace.clearance_m = checks.clearance_m.min(0.95 * now_m);
        }
        grace
    }
}
