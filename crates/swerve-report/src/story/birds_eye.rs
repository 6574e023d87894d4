//! Bird's-eye view.

use swerve_core::Time;
use swerve_geom::{Obb, Point2, math};
use swerve_msg::ActorKind;

use super::changes::{MOVED_M, changes};
use super::labels::{Importance, Labels};
use super::lights;
use super::marks::{self, label_height};
use super::moments::first_sight;
use super::record::{ActorTrace, Story};
use super::shapes::{outline, shape};
use super::tracks;
use super::view::View;
use swerve_draw::{Anchor, At, Axes, Canvas, Color, Style, Text, color, width_of};

/// Interval between outlines, ns.
const OUTLINE_EVERY_NS: i64 = 500_000_000;
/// Draws the road and the traffic on it.
pub(super) fn draw(canvas: &mut Canvas, story: &Story, view: &View) {
    canvas.rect(view.corner, view.size, Style::fill(color::GROUND));
    canvas.begin_clip(view.corner, view.size);
    let mut labels = Labels::new(view.corner, view.size);
    road(canvas, &mut labels, story, view);
    grid(canvas, view);
    lights::draw(canvas, &mut labels, story, view);
    for actor in story.actors.iter().filter(|actor| view.shows(actor)) {
        actor_trace(canvas, &mut labels, (story, actor), view);
    }
    names(&mut labels, story, view);
    tracks::draw(canvas, &mut labels, story, view);
    plans(canvas, &mut labels, story, view);
    ego_trace(canvas, &mut labels, story, view);
    marks::sight(canvas, &mut labels, story, view);
    marks::closest(canvas, &mut labels, story, view);
    marks::off_road(canvas, &mut labels, story, view);
    plan_numbers(&mut labels, story, view);
    canvas.end_clip();
    axes(canvas, view);
    // Drawn unclipped, since another font may have wider letters.
    labels.draw(canvas);
}

fn polyline(canvas: &mut Canvas, view: &View, points: &[Point2], style: Style) {
    canvas.path(points.iter().map(|p| view.at(*p)), false, style);
}

fn road(canvas: &mut Canvas, labels: &mut Labels, story: &Story, view: &View) {
    let route = &story.route;
    let (a, b) = (view.beside(story, |s_m| route.left_m(s_m)), view.beside(story, |s_m| -route.right_m(s_m)));
    for lane in &story.lanes {
        let outline: Vec<At> = lane.iter().map(|p| view.at(*p)).collect();
        if view.may_show(&outline) {
            canvas.path(outline.iter().copied(), true, Style::fill(color::ROAD));
            canvas.path(outline, true, Style::line(color::ROAD_EDGE, 0.5));
        }
    }
    let outline: Vec<At> = a.iter().chain(b.iter().rev()).map(|p| view.at(*p)).collect();
    canvas.path(outline, true, Style::fill(color::ROAD));
    patches(story, view).for_each(|patch| canvas.path(patch, true, slippery_style()));
    if let Some(lane_m) = story.lane_width_m.filter(|w| *w > 0.5) {
        let style = Style::line(color::LANE, 2.0).dashed(3.0 * view.scale, 3.0 * view.scale);
        // Only lane borders that are on the road all along.
        let (left, right) = (route.borders().left().min_m(), route.borders().right().min_m());
        let inside = |d_m: &f64| *d_m < left - 0.3 && *d_m > 0.3 - right;
        let first = ((-right / lane_m) - 0.5).floor() as i64;
        let borders = (first..first + 40).map(|k| (k as f64 + 0.5) * lane_m);
        borders.filter(inside).for_each(|d_m| polyline(canvas, view, &view.beside(story, |_| d_m), style));
    }
    for edge in [&a, &b] {
        let style = Style::line(color::ROAD_EDGE, 2.0);
        labels.keep_off_line(edge.iter().map(|p| view.at(*p)));
        polyline(canvas, view, edge, style);
    }
}

/// Outlines of the slippery patches that the view may show.
pub(super) fn patches(story: &Story, view: &View) -> impl Iterator<Item = Vec<At>> {
    let outlines = story.slippery.iter().map(|patch| patch.iter().map(|p| view.at(*p)).collect());
    outlines.filter(|outline: &Vec<At>| view.may_show(outline))
}

/// Look of a slippery patch.
pub(super) fn slippery_style() -> Style {
    Style::fill(color::SLIPPERY).filled_by(0.5)
}

fn grid(canvas: &mut Canvas, view: &View) {
    frame_of(view).grid_in(canvas, about(view), Style::line(color::ROAD_EDGE, 0.5).lined_by(0.35));
}

/// The view's axes, metres.
fn frame_of(view: &View) -> Axes {
    let [left, right, bottom, top] = view.range();
    Axes { corner: view.corner, size: view.size, x: (left, right), y: (bottom, top) }
}

/// Approximate number of ticks for each axis.
fn about(view: &View) -> (f64, f64) {
    (12.0, (view.size.1 / 40.0).clamp(2.0, 12.0))
}

fn axes(canvas: &mut Canvas, view: &View) {
    let (axes, (across, upwards)) = (frame_of(view), about(view));
    axes.frame(canvas);
    axes.numbers_below(canvas, across);
    axes.numbers_left(canvas, upwards);
    let names = if view.is_upright { ["x", "y"] } else { ["along", "across"] };
    axes.name_below(canvas, &format!("{} (m)", names[0]));
    axes.name_left(canvas, names[1], "m");
}

/// Colour of an actor.
pub(super) fn actor_color(kind: ActorKind) -> Color {
    if kind.is_person() { color::PERSON } else { color::VEHICLE }
}

/// Multiples of half a second within the view.
fn half_seconds(view: &View) -> impl Iterator<Item = Time> {
    let (from, to) = (view.span.0.ns(), view.span.1.ns());
    let first = from.div_euclid(OUTLINE_EVERY_NS) + i64::from(from.rem_euclid(OUTLINE_EVERY_NS) > 0);
    (first..=to.div_euclid(OUTLINE_EVERY_NS)).map(|k| Time::from_ns(k * OUTLINE_EVERY_NS))
}

fn seconds(at: Time) -> String {
    format!("{:.1}", at.as_secs())
}

/// Requests time labels for outlines, round times first: within or beside the outline, off all lines.
fn ask_times(labels: &mut Labels, view: &View, mut times: Vec<(Time, Obb)>, (paint, unit): (Color, &str)) {
    let how = Text { size: 10.0, color: paint, anchor: Anchor::Middle, rim: true, ..Text::default() };
    for (_, footprint) in &times {
        let corners = footprint.corners().map(|corner| view.at(corner));
        labels.keep_off_line(corners.into_iter().chain([corners[0]]));
    }
    let fineness = |at: Time| [10, 2].iter().position(|n| at.ns() % (n * OUTLINE_EVERY_NS) == 0).unwrap_or(2);
    times.sort_by_key(|(at, _)| fineness(*at));
    for (at, footprint) in times {
        let text = format!("{}{unit}", seconds(at));
        let places = beside(view, &footprint, width_of(&text, how));
        labels.ask(Importance::Time, places, text, how);
    }
}

/// Candidate positions of a text: in the lower half of an outline, then beside it, right side first.
fn beside(view: &View, footprint: &Obb, width: f64) -> Vec<At> {
    let [front_left, _, _, front_right] = footprint.corners().map(|corner| view.at(corner));
    let (x, y) = view.at(footprint.center.point());
    let across = (front_right.0 - front_left.0, front_right.1 - front_left.1);
    let size = math::hypot(across.0, across.1).max(1e-6);
    let (nx, ny) = (across.0 / size, across.1 / size);
    let away = 0.5 * size + 4.0 + 0.5 * width * nx.abs() + 5.0 * ny.abs();
    let outside = [0.0, 12.0, 24.0]
        .into_iter()
        .flat_map(move |more| [away + more, -away - more].map(|r| (x + nx * r, y + ny * r + 3.0)));
    [(x, y + 12.0)].into_iter().chain(outside).collect()
}

fn actor_trace(canvas: &mut Canvas, labels: &mut Labels, (story, actor): (&Story, &ActorTrace), view: &View) {
    let (paint, person) = (actor_color(actor.kind), actor.kind.is_person());
    let solid = Style::fill(paint).filled_by(0.75).outlined(paint, 1.0);
    if !actor.moves() {
        let Some(pose) = actor.pose_at(view.span.0) else { return };
        shape(canvas, view, &actor.shape(pose), solid);
        return;
    }
    let way = actor.poses.iter().filter(|(at, _)| *at <= view.span.1).map(|(_, pose)| view.at(pose.point()));
    labels.keep_off_line(way.clone());
    canvas.path(way, false, Style::line(paint, 1.5));
    let faint = Style::fill(paint).filled_by(0.18).outlined(paint, 1.0);
    let mut last: Option<At> = None;
    let mut times: Vec<(Time, Obb)> = Vec::new();
    let is_hero = story.protagonist().is_some_and(|hero| hero.actor == actor.id);
    // For actors other than the protagonist, one outline per second is enough.
    for at in half_seconds(view).filter(|at| is_hero || at.ns() % (2 * OUTLINE_EVERY_NS) == 0) {
        let Some(pose) = actor.pose_at(at) else { continue };
        let place = view.at(pose.point());
        if !last.is_none_or(|last| (last.0 - place.0).abs() + (last.1 - place.1).abs() > 11.0) {
            continue;
        }
        last = Some(place);
        shape(canvas, view, &actor.shape(pose), if person { solid } else { faint });
        times.push((at, actor.extent.footprint(pose)));
    }
    ask_times(labels, view, times, (paint, ""));
    let end = story.ego.last().map_or(view.span.1, |e| e.stamp).min(view.span.1);
    if let Some(pose) = actor.pose_at(end) {
        let last = Style::line(paint, 1.5);
        shape(canvas, view, &actor.shape(pose), last);
    }
}

/// Labels the actors in view, those that came nearest to the ego first. Before the run is evaluated, the label is the
/// actor's type.
fn names(labels: &mut Labels, story: &Story, view: &View) {
    let known =
        |actor: &ActorTrace| story.metrics.iter().flat_map(|m| &m.actors).find(|a| a.actor == actor.id);
    let near_m = |actor: &ActorTrace| known(actor).map_or(f64::INFINITY, |a| a.min_distance_m);
    let mut actors: Vec<&ActorTrace> = story.actors.iter().filter(|actor| view.shows(actor)).collect();
    actors.sort_by(|a, b| near_m(a).total_cmp(&near_m(b)));
    for actor in actors {
        let name = known(actor).map_or_else(|| kind_name(actor.kind).to_owned(), |a| a.name.clone());
        let how =
            Text { size: 11.0, color: color::INK, anchor: Anchor::Middle, rim: true, ..Text::default() };
        let at = |time: Time| actor.pose_at(time).map(|pose| view.at(pose.point()));
        // Candidates follow the actor's path from its start in this view; an actor with only part of its outline in
        // view is labelled at the edge.
        let times: Vec<Time> = half_seconds(view).chain([view.span.1]).collect();
        let times = if actor.moves() { times } else { vec![view.span.0] };
        let half = 0.5 * width_of(&name, how) + 4.0;
        let reach = actor.extent.length_m.max(actor.extent.width_m) * view.scale;
        let inside = |place: At| {
            let near = view.nearest(place, half);
            let (dx, dy) = ((near.0 - place.0).abs(), (near.1 - place.1).abs());
            (dx <= half + reach && dy <= reach).then_some(near)
        };
        let along: Vec<At> = times.into_iter().filter_map(at).filter_map(inside).collect();
        // Within the outline if it is large enough.
        let is_roomy = !actor.moves() && actor.extent.length_m * view.scale > width_of(&name, how);
        let first = if is_roomy { 4.0 } else { -12.0 };
        let heights = [first, 20.0, -26.0, 34.0, -40.0, 48.0, 4.0, -54.0, 62.0];
        // Above or below the outline, else to its side.
        let aside = 0.5 * width_of(&name, how) + 8.0;
        let offsets = [0.0, aside, -aside].into_iter().flat_map(|dx| heights.map(|dy| (dx, dy)));
        let places = offsets.flat_map(|(dx, dy)| along.iter().map(move |(x, y)| (x + dx, y + dy)));
        labels.ask(Importance::Name, places.collect(), name, how);
    }
}

/// Name of an actor type.
pub(super) fn kind_name(kind: ActorKind) -> &'static str {
    match kind {
        ActorKind::Car => "car",
        ActorKind::Truck => "truck",
        ActorKind::Motorcycle => "motorcycle",
        ActorKind::Cyclist => "cyclist",
        ActorKind::Pedestrian => "person",
        ActorKind::Static => "obstacle",
    }
}

fn ego_trace(canvas: &mut Canvas, labels: &mut Labels, story: &Story, view: &View) {
    let paint = color::EGO;
    let faint = Style::fill(paint).filled_by(0.10).outlined(paint, 1.2);
    let mut times: Vec<(Time, Obb)> = Vec::new();
    for at in half_seconds(view) {
        let Some(ego) = story.ego_at(at) else { continue };
        let footprint = story.outline.footprint(ego.pose);
        let place = footprint.center.point();
        if times.last().is_some_and(|(_, last)| last.center.point().distance(place) < MOVED_M) {
            continue;
        }
        outline(canvas, view, &footprint, faint);
        times.push((at, footprint));
    }
    ask_times(labels, view, times, (paint, " s"));
    let way: Vec<Point2> = story.ego.iter().map(|e| e.pose.point()).collect();
    labels.keep_off_line(way.iter().map(|p| view.at(*p)));
    polyline(canvas, view, &way, Style::line(paint, 1.6));
}

/// Note on plans from before the first sight of the protagonist: the other actors visible by then.
pub(super) fn before_sight(story: &Story, view: &View) -> Option<String> {
    let at = first_sight(story)?;
    let early = changes(story, view).shown.iter().filter(|mark| mark.at < at).count();
    let hero = story.protagonist()?;
    let seen_s = |a: &&swerve_eval::ActorMetrics| a.first_sight_s.is_some_and(|s| s < at.as_secs());
    let others: Vec<&str> = story
        .metrics
        .iter()
        .flat_map(|m| m.actors.iter().filter(seen_s))
        .filter(|a| a.actor != hero.actor)
        .map(|a| a.name.as_str())
        .collect();
    let plans = match early {
        0 => return None,
        1 => "plan 1 is".to_owned(),
        n => format!("plans 1 to {n} are"),
    };
    let unseen = &hero.name;
    Some(match &others[..] {
        [] => format!("{plans} from before {unseen} was visible"),
        [other] => {
            format!("{plans} from before {unseen} was visible: only {other} is visible then")
        }
        _ => {
            format!("{plans} from before {unseen} was visible: {} others are visible then", others.len())
        }
    })
}

/// Colour of a plan by its status.
pub(super) fn plan_color(plan: &swerve_msg::Plan) -> Color {
    if plan.status.is_fallback() { color::FALLBACK } else { color::PLAN }
}

fn plans(canvas: &mut Canvas, labels: &mut Labels, story: &Story, view: &View) {
    for mark in changes(story, view).shown {
        let paint = plan_color(&mark.plan);
        let style = Style::line(paint, 2.0).lined_by(0.8);
        let style = if mark.plan.status.is_fallback() { style.dashed(3.0, 3.0) } else { style };
        let points: Vec<Point2> = mark.plan.points.iter().map(|p| p.pose.point()).collect();
        labels.keep_off_line(points.iter().map(|p| view.at(*p)));
        polyline(canvas, view, &points, style);
    }
}

/// Labels the ego's position at each plan change with its number.
fn plan_numbers(labels: &mut Labels, story: &Story, view: &View) {
    for (number, mark) in (1..).zip(changes(story, view).shown) {
        let Some(ego) = story.ego_at(mark.at) else { continue };
        let (x, _) = view.at(ego.pose.point());
        // Above the outline, which contains the time.
        let y = label_height(view, &story.outline.footprint(ego.pose), false) - 5.0;
        labels.badge((x, y), number, plan_color(&mark.plan));
    }
}
