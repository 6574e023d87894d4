//! Part of the road that the figure shows, and its projection.

use swerve_core::{Span, Time};
use swerve_geom::{FrenetPoint, Map, Point2, Pose2, angle_between};

use super::record::{ActorTrace, Story};
use swerve_draw::At;

/// Length shown before the first actor, metres along the route.
const BEFORE_M: f64 = 40.0;
/// Length shown beyond the last actor that the ego reached, metres along the route.
const BEYOND_M: f64 = 25.0;
/// Width shown beside the road, metres.
const BESIDE_M: f64 = 1.6;
/// Maximum length shown of the route, metres: longer parts make unreadably narrow strips.
const SHOWN_MAX_M: f64 = 110.0;
/// Minimum curvature of a bend, 1/m: a junction or a roundabout rather than a country road.
const BEND_1PM: f64 = 1.0 / 60.0;
/// Distance to the shown part below which a bend is included, metres along the route.
const BEND_NEAR_M: f64 = 15.0;
/// Length of road shown before and beyond such a bend, metres.
const BEND_ENDS_M: f64 = 5.0;
/// Actors that came no nearer than this do not affect the view, metres.
const MATTERS_M: f64 = 15.0;
/// Maximum distance of an actor beside the road for the view to include it, metres.
const ACTOR_BESIDE_M: f64 = 8.0;
/// Minimum height of the bird's-eye view, pixels: labels need room.
const HEIGHT_MIN: f64 = 190.0;
/// Maximum height of the bird's-eye view, pixels.
const HEIGHT_MAX: f64 = 560.0;

/// Projection from the map to the figure, with equal scales on both axes.
pub(super) struct View {
    /// Top left corner and size of the view, pixels.
    pub(super) corner: At,
    pub(super) size: (f64, f64),
    /// Part of the route shown, metres along it.
    pub(super) s_m: (f64, f64),
    /// Time during which the ego is in that part.
    pub(super) span: (Time, Time),
    /// True if the figure's axes are those of the map.
    pub(super) is_upright: bool,
    /// Pixels per metre.
    pub(super) scale: f64,
    /// Pose of the figure's axes in the map.
    axes: Pose2,
    /// Smallest x and largest y of the view on these axes, metres.
    low_x_m: f64,
    high_y_m: f64,
}

impl View {
    /// View of a story, `width` pixels wide, with its top left corner at `corner`. `None` if fewer than two ego states
    /// are known.
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

    /// Projects a point of the map to the figure.
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

    /// Returns false if all places are beyond one side of the view.
    pub(super) fn may_show(&self, places: &[At]) -> bool {
        let [right, bottom] = [self.corner.0 + self.size.0, self.corner.1 + self.size.1];
        let sides: [&dyn Fn(&At) -> bool; 4] =
            [&|at| at.0 < self.corner.0, &|at| at.0 > right, &|at| at.1 < self.corner.1, &|at| at.1 > bottom];
        !sides.iter().any(|is_beyond| places.iter().all(is_beyond))
    }

    /// Nearest point within the view, at least `from_sides` from its left and right edges.
    pub(super) fn nearest(&self, (x, y): At, from_sides: f64) -> At {
        let (left, right) = (self.corner.0 + from_sides, self.corner.0 + self.size.0 - from_sides);
        (x.min(right).max(left), y.min(self.corner.1 + self.size.1).max(self.corner.1))
    }

    /// Axis ranges: left, right, bottom, top, metres.
    pub(super) fn range(&self) -> [f64; 4] {
        let (width, height) = (self.size.0 / self.scale, self.size.1 / self.scale);
        [self.low_x_m, self.low_x_m + width, self.high_y_m - height, self.high_y_m]
    }

    /// Points of a line beside the route over the shown part; `d_m` is its offset to the left at an arc length.
    pub(super) fn beside(&self, story: &Story, d_m: impl Fn(f64) -> f64) -> Vec<Point2> {
        let (from, to) = (self.s_m.0 - 30.0, self.s_m.1 + 30.0);
        let n = (to - from).ceil().max(1.0) as usize;
        let s_at = |k| from + (to - from) * k as f64 / n as f64;
        let place = |s_m| FrenetPoint { s_m, d_m: d_m(s_m) };
        (0..=n).map(|k| story.route.unproject(place(s_at(k)))).collect()
    }

    /// True if an actor's path comes into the view, or as near to it as its outline reaches.
    pub(super) fn shows(&self, actor: &ActorTrace) -> bool {
        let reach = actor.extent.length_m.max(actor.extent.width_m) * self.scale;
        let within = |v: f64, from: f64, size: f64| v >= from - reach && v <= from + size + reach;
        actor.poses.iter().any(|(_, pose)| {
            let (x, y) = self.at(pose.point());
            within(x, self.corner.0, self.size.0) && within(y, self.corner.1, self.size.1)
        })
    }

    /// Sets scale and height so that road, ego and relevant actors fit.
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
            // The outline may be cut at both ends of the view, but not at its sides.
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

/// True if an actor came near or decided how the run ended; always true before the run is evaluated.
fn matters(story: &Story, actor: &ActorTrace) -> bool {
    let Some(metrics) = &story.metrics else { return true };
    let is_hero = story.protagonist().is_some_and(|hero| hero.actor == actor.id);
    is_hero || metrics.actors.iter().any(|a| a.actor == actor.id && a.min_distance_m <= MATTERS_M)
}

/// Part of the route to show: from before the first relevant actor to beyond the last, each at its position when the
/// ego was nearest. If that is too long, a part around the protagonist.
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
    // The place where the ego left the road is shown, too.
    let left = super::moments::left_road(story).map(|ego| line.project(ego.pose.point()).s_m);
    let focus = [hero, left].into_iter().flatten().reduce(f64::max);
    places.extend(hero.into_iter().chain(left));
    let least = places.iter().copied().fold(f64::INFINITY, f64::min);
    let most = places.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let from = if least.is_finite() { (least - BEFORE_M).max(driven.0) } else { driven.0 };
    // An obstacle that the ego stopped for is beyond the driven part.
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
    // The ego at the closest approach is always in view.
    let nearest = super::moments::closest_at(story).and_then(|at| story.ego_at(at));
    let ego_m = nearest.map_or(from, |ego| line.project(ego.pose.point()).s_m);
    Some(with_bends(story, (from.min(ego_m - 3.0), to.max(ego_m + front_m + 3.0)), driven))
}

/// Extends the shown part to include the whole of the bends at its ends, as far as the ego drove them: a roundabout is
/// shown in full or not at all. Bends too large for one view are not included.
fn with_bends(story: &Story, (from, to): (f64, f64), driven: (f64, f64)) -> (f64, f64) {
    let line = story.route.line();
    let heading = |s_m: f64| line.at(s_m).pose.heading_rad;
    let is_bent = |s_m: f64| angle_between(heading(s_m - 2.0), heading(s_m + 2.0)).abs() >= 4.0 * BEND_1PM;
    // Searches from an end of the view for the far end of the bend there, in steps of one metre.
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

/// Time during which the ego is within the shown part; the whole run if it never is. `None` if that time is empty.
fn span(story: &Story, (from, to): (f64, f64)) -> Option<(Time, Time)> {
    let inside = |e: &&swerve_msg::EgoState| {
        let s_m = story.route.project(e.pose.point()).s_m;
        s_m >= from - 2.0 && s_m <= to
    };
    let first = story.ego.iter().find(inside).or(story.ego.first())?.stamp;
    let last = story.ego.iter().rev().find(inside).or(story.ego.last())?.stamp;
    (last > first).then_some((first, last))
}
