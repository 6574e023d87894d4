//! Which part of the road the figure shows, and where.

use swerve_core::{Span, Time};
use swerve_geom::{FrenetPoint, Map, Point2, Pose2, angle_between};

use super::record::{ActorTrace, Story};
use swerve_draw::At;

/// Shown before the first actor, metres along the route.
const BEFORE_M: f64 = 40.0;
/// Shown beyond the last actor that the ego came to, metres along the route.
const BEYOND_M: f64 = 25.0;
/// Shown beside the road, metres.
const BESIDE_M: f64 = 1.6;
/// Shown of the route at most, metres: longer parts make strips in which nothing can be read.
const SHOWN_MAX_M: f64 = 110.0;
/// A stretch of the route bends where its curvature is at least this, 1/m: a junction or a roundabout, no country road.
const BEND_1PM: f64 = 1.0 / 60.0;
/// A bend that ends nearer than this to the part shown belongs to it, metres along the route.
const BEND_NEAR_M: f64 = 15.0;
/// Shown of the road before and beyond such a bend, metres.
const BEND_ENDS_M: f64 = 5.0;
/// Actors that came no nearer than this do not decide what is shown, metres.
const MATTERS_M: f64 = 15.0;
/// Actors are shown up to so far beside the road, metres.
const ACTOR_BESIDE_M: f64 = 8.0;
/// The lowest that the bird's-eye view may become, pixels: labels need room.
const HEIGHT_MIN: f64 = 190.0;
/// The tallest that the bird's-eye view may become, pixels.
const HEIGHT_MAX: f64 = 560.0;

/// From map to figure: equal scales on both axes.
pub(super) struct View {
    /// Top left corner and size of the view, pixels.
    pub(super) corner: At,
    pub(super) size: (f64, f64),
    /// Part of the route that is shown, metres along it.
    pub(super) s_m: (f64, f64),
    /// Time during which the ego is in that part.
    pub(super) span: (Time, Time),
    /// Whether the axes of the figure are those of the map.
    pub(super) is_upright: bool,
    /// Pixels per metre.
    pub(super) scale: f64,
    /// Pose in the map of the figure's axes.
    axes: Pose2,
    /// Smallest x, largest y of the view on these axes, metres.
    low_x_m: f64,
    high_y_m: f64,
}

impl View {
    /// The view of a story, `width` pixels wide with its top left corner at `corner`. None before the ego was
    /// seen twice.
    pub(super) fn of(story: &Story, corner: At, width: f64) -> Option<Self> {
        let s_m = shown(story)?;
        let line = story.route.line();
        let (from, to) = (line.at(s_m.0).pose, line.at(s_m.1).pose);
        let heading_rad = (to.point() - from.point()).heading();
        let is_upright = angle_between(0.0, heading_rad).abs() < 0.02;
        let axes =
            if is_upright { Pose2::new(0.0, 0.0, 0.0) } else { Pose2::new(from.x_m, from.y_m, heading_rad) };
        let mut view = Self {
            corner,
            size: (width, 0.0),
            s_m,
            span: span(story, s_m)?,
            is_upright,
            scale: 1.0,
            axes,
            low_x_m: 0.0,
            high_y_m: 0.0,
        };
        view.fit(story);
        Some(view)
    }

    /// A point of the map in the figure.
    pub(super) fn at(&self, point: Point2) -> At {
        let local: Point2 = self.axes.to_local::<Map>(point);
        (
            self.corner.0 + (local.x_m - self.low_x_m) * self.scale,
            self.corner.1 + (self.high_y_m - local.y_m) * self.scale,
        )
    }

    /// True if a place in the figure is within the view.
    pub(super) fn holds(&self, (x, y): At) -> bool {
        let within = |v: f64, from: f64, size: f64| v >= from && v <= from + size;
        within(x, self.corner.0, self.size.0) && within(y, self.corner.1, self.size.1)
    }

    /// The place within the view that is nearest to one, this far from its left and right edges.
    pub(super) fn nearest(&self, (x, y): At, from_sides: f64) -> At {
        let (left, right) = (self.corner.0 + from_sides, self.corner.0 + self.size.0 - from_sides);
        (x.min(right).max(left), y.min(self.corner.1 + self.size.1).max(self.corner.1))
    }

    /// Range of the axes: left, right, bottom, top, metres.
    pub(super) fn range(&self) -> [f64; 4] {
        let (width, height) = (self.size.0 / self.scale, self.size.1 / self.scale);
        [self.low_x_m, self.low_x_m + width, self.high_y_m - height, self.high_y_m]
    }

    /// Points of a line beside the route over the shown part; `d_m` is how far to its left at an arc length.
    pub(super) fn beside(&self, story: &Story, d_m: impl Fn(f64) -> f64) -> Vec<Point2> {
        let (from, to) = (self.s_m.0 - 30.0, self.s_m.1 + 30.0);
        let n = (to - from).ceil().max(1.0) as usize;
        let s_at = |k| from + (to - from) * k as f64 / n as f64;
        let place = |s_m| FrenetPoint { s_m, d_m: d_m(s_m) };
        (0..=n).map(|k| story.route.unproject(place(s_at(k)))).collect()
    }

    /// Whether any of an actor's way comes into the view, or as near as its outline reaches.
    pub(super) fn shows(&self, actor: &ActorTrace) -> bool {
        let reach = actor.extent.length_m.max(actor.extent.width_m) * self.scale;
        let within = |v: f64, from: f64, size: f64| v >= from - reach && v <= from + size + reach;
        actor.poses.iter().any(|(_, pose)| {
            let (x, y) = self.at(pose.point());
            within(x, self.corner.0, self.size.0) && within(y, self.corner.1, self.size.1)
        })
    }

    /// Takes in what has to be seen, and finds the scale.
    fn fit(&mut self, story: &Story) {
        let axes = self.axes;
        let local = |p: Point2| -> Point2 { axes.to_local::<Map>(p) };
        let mut low: Point2 = Point2::new(f64::INFINITY, f64::INFINITY);
        let mut high: Point2 = Point2::new(f64::NEG_INFINITY, f64::NEG_INFINITY);
        let mut hold = |p: Point2, margin_m: f64| {
            let p = local(p);
            low = Point2::new(low.x_m.min(p.x_m), low.y_m.min(p.y_m - margin_m));
            high = Point2::new(high.x_m.max(p.x_m), high.y_m.max(p.y_m + margin_m));
        };
        let (route, (from, to)) = (&story.route, self.s_m);
        for k in 0..=200 {
            let s_m = from + (to - from) * f64::from(k) / 200.0;
            hold(route.unproject(FrenetPoint { s_m, d_m: route.left_m(s_m) }), BESIDE_M);
            hold(route.unproject(FrenetPoint { s_m, d_m: -route.right_m(s_m) }), BESIDE_M);
        }
        let span = self.span;
        for ego in story.ego.iter().filter(|e| e.stamp >= span.0 && e.stamp <= span.1) {
            // The outline at both ends of the view may be cut, but not beside the road.
            let (x, inside) = (ego.pose, story.outline.footprint(ego.pose));
            let s = route.project(x.point()).s_m;
            if s > from + 5.0 && s < to - 5.0 {
                inside.corners().into_iter().for_each(|corner| hold(corner, 0.8));
            }
        }
        for actor in story.actors.iter().filter(|actor| matters(story, actor)) {
            for (at, pose) in &actor.poses {
                let place = route.project(pose.point());
                let beside_m =
                    (place.d_m - route.left_m(place.s_m)).max(-route.right_m(place.s_m) - place.d_m);
                let is_near = place.s_m > from && place.s_m < to && beside_m < ACTOR_BESIDE_M;
                if is_near && *at <= span.1 {
                    actor.extent.footprint(*pose).corners().into_iter().for_each(|corner| hold(corner, 0.8));
                }
            }
        }
        self.scale = (self.size.0 / (high.x_m - low.x_m)).min(HEIGHT_MAX / (high.y_m - low.y_m));
        let spare_m = self.size.0 / self.scale - (high.x_m - low.x_m);
        self.low_x_m = low.x_m - 0.5 * spare_m;
        let spare_m = (HEIGHT_MIN / self.scale - (high.y_m - low.y_m)).max(0.0);
        self.high_y_m = high.y_m + 0.5 * spare_m;
        self.size.1 = (high.y_m - low.y_m + spare_m) * self.scale;
    }
}

/// Whether an actor came near, or decided how the run ended; before the run is measured, each does.
fn matters(story: &Story, actor: &ActorTrace) -> bool {
    let Some(metrics) = &story.metrics else { return true };
    let is_hero = story.protagonist().is_some_and(|hero| hero.actor == actor.id);
    is_hero || metrics.actors.iter().any(|a| a.actor == actor.id && a.min_distance_m <= MATTERS_M)
}

/// The part of the route worth showing: from before the first actor that matters to beyond the last, each where it was
/// when the ego was nearest, around the one that the story is about if that is too much.
fn shown(story: &Story) -> Option<(f64, f64)> {
    let line = story.route.line();
    let (first, last) = (story.ego.first()?, story.ego.last()?);
    let front_m = story.outline.center_ahead_m + 0.5 * story.outline.length_m;
    let driven = (line.project(first.pose.point()).s_m, line.project(last.pose.point()).s_m + front_m + 2.0);
    let place = |actor: &ActorTrace| {
        let known = story.metrics.iter().flat_map(|m| &m.actors).find(|a| a.actor == actor.id);
        let at = known.map_or(last.stamp, |a| Time::ZERO + Span::from_secs(a.min_distance_at_s));
        Some(line.project(actor.pose_at(at)?.point()).s_m)
    };
    let hero = story.protagonist().and_then(|hero| story.actor(hero.actor)).and_then(place);
    let mut places: Vec<f64> =
        story.actors.iter().filter(|actor| matters(story, actor)).filter_map(place).collect();
    places.retain(|s| *s >= driven.0 - 10.0 && *s <= driven.1 + 10.0);
    let lines = story.lights.iter().map(|light| light.stop_s_m);
    places.extend(lines.filter(|s| *s >= driven.0 && *s <= driven.1 + 10.0));
    // Where the ego left the road is what a reader looks for, too.
    let left = super::marks::left_road(story).map(|ego| line.project(ego.pose.point()).s_m);
    let focus = [hero, left].into_iter().flatten().reduce(f64::max);
    places.extend(hero.into_iter().chain(left));
    let least = places.iter().copied().fold(f64::INFINITY, f64::min);
    let most = places.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let from = if least.is_finite() { (least - BEFORE_M).max(driven.0) } else { driven.0 };
    // What the ego came to stand before is beyond what it drove.
    let to = if most.is_finite() {
        (most + BEYOND_M).min(driven.1.max(hero.map_or(0.0, |s| s + 8.0)))
    } else {
        driven.1
    };
    let to = to.max(from + 20.0);
    let Some(focus) = focus else { return Some((from, to)) };
    let (from, to) = if to - from > SHOWN_MAX_M {
        let from = (focus - 0.65 * SHOWN_MAX_M).clamp(from, to - SHOWN_MAX_M);
        (from, from + SHOWN_MAX_M)
    } else {
        (from, to)
    };
    // However far apart: the ego where it came nearest is in view.
    let nearest = super::marks::closest_at(story).and_then(|at| story.ego_at(at));
    let ego_m = nearest.map_or(from, |ego| line.project(ego.pose.point()).s_m);
    Some(with_bends(story, (from.min(ego_m - 3.0), to.max(ego_m + front_m + 3.0)), driven))
}

/// The part shown with the whole of the bends at its ends, as far as the ego drove through them: of a roundabout all is
/// shown or nothing. Bends too large for one view stay outside.
fn with_bends(story: &Story, (from, to): (f64, f64), driven: (f64, f64)) -> (f64, f64) {
    let line = story.route.line();
    let heading = |s_m: f64| line.at(s_m).pose.heading_rad;
    let is_bent = |s_m: f64| angle_between(heading(s_m - 2.0), heading(s_m + 2.0)).abs() >= 4.0 * BEND_1PM;
    // From an end of the view on to the far end of the bend that is there, in steps of one metre.
    let end = |start: f64, step: f64| {
        let (mut far, mut s_m) = (start, start);
        while (s_m - far).abs() <= BEND_NEAR_M && s_m >= driven.0 && s_m <= driven.1 {
            far = if is_bent(s_m) { s_m } else { far };
            s_m += step;
        }
        if far == start { start } else { (far + step * BEND_ENDS_M).max(driven.0).min(driven.1) }
    };
    let wide = (end(from, -1.0).min(from), end(to, 1.0).max(to));
    let n = 64;
    let points =
        (0..=n).map(|k| line.at(wide.0 + (wide.1 - wide.0) * f64::from(k) / f64::from(n)).pose.point());
    let middle = line.at(0.5 * (from + to)).pose.point();
    let reach_m = points.map(|p| p.distance(middle)).fold(0.0, f64::max);
    if reach_m <= SHOWN_MAX_M { wide } else { (from, to) }
}

/// When the ego is within the part shown; all of the run where it never is.
fn span(story: &Story, (from, to): (f64, f64)) -> Option<(Time, Time)> {
    let inside = |e: &&swerve_msg::EgoState| {
        let s_m = story.route.project(e.pose.point()).s_m;
        s_m >= from - 2.0 && s_m <= to
    };
    let first = story.ego.iter().find(inside).or(story.ego.first())?.stamp;
    let last = story.ego.iter().rev().find(inside).or(story.ego.last())?.stamp;
    (last > first).then_some((first, last))
}
