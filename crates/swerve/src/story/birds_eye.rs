//! The view from above.

use swerve_core::Time;
use swerve_geom::{Obb, Point2};
use swerve_msg::ActorKind;

use super::canvas::{At, Canvas, Text, color, multiples, number, round_step};
use super::record::{ActorTrace, Shape, Story};
use super::view::View;

/// Outlines are drawn at the multiples of this, ns.
const OUTLINE_EVERY_NS: i64 = 500_000_000;
/// Plans that are numbered; further changes of mind are drawn without.
pub(super) const NUMBERED: usize = 9;

/// Draws the road and all that went on there.
pub(super) fn draw(canvas: &mut Canvas, story: &Story, view: &View) {
    canvas.rect(view.corner, view.size, &format!("fill=\"{}\"", color::GROUND));
    canvas.begin_clip(view.corner, view.size);
    road(canvas, story, view);
    grid(canvas, view);
    for actor in &story.actors {
        actor_trace(canvas, story, actor, view);
    }
    plans(canvas, story, view);
    ego_trace(canvas, story, view);
    plan_numbers(canvas, story, view);
    sight(canvas, story, view);
    closest(canvas, story, view);
    canvas.end_clip();
    axes(canvas, view);
}

fn polyline(canvas: &mut Canvas, view: &View, points: &[Point2], style: &str) {
    canvas.path(points.iter().map(|p| view.at(*p)), false, style);
}

fn road(canvas: &mut Canvas, story: &Story, view: &View) {
    let (left, right) = (story.route.left_m, story.route.right_m);
    let (a, b) = (view.beside(story, left), view.beside(story, -right));
    let outline: Vec<At> = a.iter().chain(b.iter().rev()).map(|p| view.at(*p)).collect();
    canvas.path(outline, true, &format!("fill=\"{}\"", color::ROAD));
    if let Some(lane_m) = story.lane_width_m.filter(|w| *w > 0.5) {
        let style = format!(
            "fill=\"none\" stroke=\"{}\" stroke-width=\"2\" stroke-dasharray=\"{} {}\"",
            color::LANE,
            number(3.0 * view.scale),
            number(3.0 * view.scale)
        );
        let inside = |d_m: &f64| *d_m < left - 0.3 && *d_m > 0.3 - right;
        let first = ((-right / lane_m) - 0.5).floor() as i64;
        let borders = (first..first + 40).map(|k| (k as f64 + 0.5) * lane_m);
        borders.filter(inside).for_each(|d_m| polyline(canvas, view, &view.beside(story, d_m), &style));
    }
    for edge in [&a, &b] {
        let style = format!("fill=\"none\" stroke=\"{}\" stroke-width=\"2\"", color::ROAD_EDGE);
        polyline(canvas, view, edge, &style);
    }
}

fn grid(canvas: &mut Canvas, view: &View) {
    let [left, right, bottom, top] = view.range();
    let style = "stroke=\"#8A929C\" stroke-width=\"0.5\" stroke-opacity=\"0.35\"";
    for x in multiples(left, right, grid_step(view)) {
        canvas.line(view.on_axes(x, bottom), view.on_axes(x, top), style);
    }
    for y in multiples(bottom, top, y_step(view)) {
        canvas.line(view.on_axes(left, y), view.on_axes(right, y), style);
    }
}

fn grid_step(view: &View) -> f64 {
    let [left, right, ..] = view.range();
    round_step(right - left, 12.0)
}

fn y_step(view: &View) -> f64 {
    let [_, _, bottom, top] = view.range();
    round_step(top - bottom, (view.size.1 / 40.0).clamp(2.0, 12.0))
}

fn axes(canvas: &mut Canvas, view: &View) {
    let frame = format!("fill=\"none\" stroke=\"{}\" stroke-width=\"1\"", color::SOFT);
    canvas.rect(view.corner, view.size, &frame);
    let [left, right, bottom, top] = view.range();
    let how = Text { size: 11.0, color: color::SOFT, anchor: "middle", ..Text::default() };
    for x in multiples(left, right, grid_step(view)) {
        let (px, py) = view.on_axes(x, bottom);
        canvas.line((px, py), (px, py + 4.0), "stroke=\"#5B636D\"");
        canvas.text((px, py + 16.0), &number(x), how);
    }
    for y in multiples(bottom, top, y_step(view)) {
        let (px, py) = view.on_axes(left, y);
        canvas.line((px - 4.0, py), (px, py), "stroke=\"#5B636D\"");
        canvas.text((px - 7.0, py + 4.0), &number(y), Text { anchor: "end", ..how });
    }
    let (x, y) = view.corner;
    let name = if view.is_upright { ["x (m)", "y (m)"] } else { ["along (m)", "across (m)"] };
    canvas.text(
        (x + view.size.0, y + view.size.1 + 30.0),
        name[0],
        Text { anchor: "end", size: 12.0, ..how },
    );
    let middle = y + 0.5 * view.size.1;
    canvas.turned_text((x - 40.0, middle), -90.0, name[1], Text { size: 12.0, ..how });
}

/// Colour of an actor.
pub(super) fn actor_color(kind: ActorKind) -> &'static str {
    if kind.is_person() { color::PERSON } else { color::VEHICLE }
}

fn shape(canvas: &mut Canvas, view: &View, shape: &Shape, style: &str) {
    match shape {
        Shape::Circle(center, radius_m) => {
            canvas.circle(view.at(*center), (radius_m * view.scale).max(2.5), style);
        }
        Shape::Box(obb) => outline(canvas, view, obb, style),
    }
}

fn outline(canvas: &mut Canvas, view: &View, obb: &Obb, style: &str) {
    canvas.path(obb.corners().map(|corner| view.at(corner)), true, style);
}

/// The half seconds within the view.
fn half_seconds(view: &View) -> impl Iterator<Item = Time> {
    let (from, to) = (view.span.0.ns(), view.span.1.ns());
    let first = from.div_euclid(OUTLINE_EVERY_NS) + i64::from(from.rem_euclid(OUTLINE_EVERY_NS) > 0);
    (first..=to.div_euclid(OUTLINE_EVERY_NS)).map(|k| Time::from_ns(k * OUTLINE_EVERY_NS))
}

fn seconds(at: Time) -> String {
    format!("{:.1}", at.as_secs())
}

fn actor_trace(canvas: &mut Canvas, story: &Story, actor: &ActorTrace, view: &View) {
    let (paint, person) = (actor_color(actor.kind), actor.kind.is_person());
    let solid = format!("fill=\"{paint}\" fill-opacity=\"0.75\" stroke=\"{paint}\" stroke-width=\"1\"");
    if !actor.moves() {
        let Some(pose) = actor.pose_at(view.span.0) else { return };
        shape(canvas, view, &actor.shape(pose), &solid);
        if !person {
            let (x, y) = view.at(pose.point());
            let how = Text { size: 11.0, color: "#FFFFFF", anchor: "middle", ..Text::default() };
            canvas.text((x, y + 4.0), kind_name(actor.kind), how);
        }
        return;
    }
    let way = actor.poses.iter().filter(|(at, _)| *at <= view.span.1).map(|(_, pose)| view.at(pose.point()));
    canvas.path(way, false, &format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"1.5\""));
    let faint = format!("fill=\"{paint}\" fill-opacity=\"0.18\" stroke=\"{paint}\" stroke-width=\"1\"");
    let mut labelled: Option<At> = None;
    for at in half_seconds(view) {
        let Some(pose) = actor.pose_at(at) else { continue };
        let place = view.at(pose.point());
        let far = labelled.is_none_or(|last| (last.0 - place.0).abs() + (last.1 - place.1).abs() > 11.0);
        if !far {
            continue;
        }
        labelled = Some(place);
        shape(canvas, view, &actor.shape(pose), if person { &solid } else { &faint });
        let how = Text { size: 10.0, color: paint, anchor: "start", rim: true, ..Text::default() };
        let beside = 0.5 * actor.extent.width_m.min(1.0) * view.scale + 5.0;
        canvas.text((place.0 + beside, place.1 + 3.5), &seconds(at), how);
    }
    let end = story.ego.last().map_or(view.span.1, |e| e.stamp).min(view.span.1);
    if let Some(pose) = actor.pose_at(end) {
        shape(
            canvas,
            view,
            &actor.shape(pose),
            &format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"1.5\""),
        );
    }
}

/// What to call an actor.
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

fn ego_trace(canvas: &mut Canvas, story: &Story, view: &View) {
    let paint = color::EGO;
    let faint = format!("fill=\"{paint}\" fill-opacity=\"0.10\" stroke=\"{paint}\" stroke-width=\"1.2\"");
    let mut labelled = f64::NEG_INFINITY;
    for at in half_seconds(view) {
        let Some(ego) = story.ego_at(at) else { continue };
        let footprint = story.outline.footprint(ego.pose);
        outline(canvas, view, &footprint, &faint);
        let center = footprint.center.point();
        let (x, y) = view.at(center);
        if (x - labelled).abs() > 30.0 {
            labelled = x;
            let how = Text { size: 10.0, color: paint, anchor: "middle", rim: true, ..Text::default() };
            // Below the middle, where the ego's way does not run through it.
            canvas.text((x, y + 12.0), &format!("{} s", seconds(at)), how);
        }
    }
    let way: Vec<Point2> = story.ego.iter().map(|e| e.pose.point()).collect();
    polyline(canvas, view, &way, &format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"1.6\""));
}

/// The changes of mind within the view, numbered from 1.
pub(super) fn changes<'a>(
    story: &'a Story,
    view: &View,
) -> impl Iterator<Item = (usize, &'a super::record::PlanMark)> {
    let (from, to) = view.span;
    // What the ego set out with is no change.
    let inside = story.plans.iter().skip(1).filter(move |mark| mark.at >= from && mark.at <= to);
    (1..).zip(inside)
}

/// Colour of a plan.
pub(super) fn plan_color(plan: &swerve_msg::Plan) -> &'static str {
    if plan.status.is_fallback() { color::FALLBACK } else { color::PLAN }
}

fn plans(canvas: &mut Canvas, story: &Story, view: &View) {
    for (_, mark) in changes(story, view) {
        let paint = plan_color(&mark.plan);
        let dash = if mark.plan.status.is_fallback() { " stroke-dasharray=\"3 3\"" } else { "" };
        let style =
            format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"2\" stroke-opacity=\"0.8\"{dash}");
        let points: Vec<Point2> = mark.plan.points.iter().map(|p| p.pose.point()).collect();
        polyline(canvas, view, &points, &style);
    }
}

/// Where the ego was when it changed its mind.
fn plan_numbers(canvas: &mut Canvas, story: &Story, view: &View) {
    let mut taken: Vec<At> = Vec::new();
    for (number, mark) in changes(story, view).take(NUMBERED) {
        let Some(ego) = story.ego_at(mark.at) else { continue };
        let (x, mut y) = view.at(ego.pose.point());
        y -= 9.0;
        while taken.iter().any(|t| (t.0 - x).abs() < 15.0 && (t.1 - y).abs() < 15.0) {
            y -= 15.0;
        }
        taken.push((x, y));
        badge(canvas, (x, y), number, plan_color(&mark.plan));
    }
}

/// A number in a circle.
pub(super) fn badge(canvas: &mut Canvas, (x, y): At, number: usize, paint: &str) {
    canvas.circle((x, y), 7.0, &format!("fill=\"{paint}\" stroke=\"#FFFFFF\" stroke-width=\"1\""));
    let how = Text { size: 10.0, color: "#FFFFFF", anchor: "middle", bold: true, ..Text::default() };
    canvas.text((x, y + 3.6), &number.to_string(), how);
}

/// The instant of the first sight of the actor that the story is about, if it came while the ego drove.
pub(super) fn first_sight(story: &Story) -> Option<Time> {
    let start = story.ego.first()?.stamp;
    let at = Time::ZERO + swerve_core::Span::from_secs(story.protagonist()?.first_sight_s?);
    (at > start).then_some(at)
}

fn sight(canvas: &mut Canvas, story: &Story, view: &View) {
    let Some(at) = first_sight(story) else { return };
    let actor = story.protagonist().and_then(|a| story.actor(a.actor));
    let (Some(ego), Some((actor, pose))) = (story.ego_at(at), actor.and_then(|a| Some((a, a.pose_at(at)?))))
    else {
        return;
    };
    let paint = color::SIGHT;
    let footprint = story.outline.footprint(ego.pose);
    let dashed = format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"2\" stroke-dasharray=\"6 4\"");
    outline(canvas, view, &footprint, &dashed);
    let (from, to) = (view.at(footprint.center.point()), view.at(pose.point()));
    canvas.line(from, to, &dashed);
    shape(canvas, view, &actor.shape(pose), &format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"2\""));
    let (on_ego, on_actor) = actor.shape(pose).nearest(&footprint);
    let label = format!("first sight {:.2} s, {:.1} m away", at.as_secs(), on_ego.distance(on_actor));
    // On the side away from the actor, where the line of sight does not cross it.
    let place = (from.0, label_height(view, &footprint, to.1 < from.1));
    let how = Text { size: 11.0, color: "#8A5E00", anchor: "middle", bold: true, rim: true };
    canvas.text(place, &label, how);
}

fn closest(canvas: &mut Canvas, story: &Story, view: &View) {
    let Some(metrics) = &story.metrics else { return };
    let Some(hero) = story.protagonist() else { return };
    let impact = metrics.impact.filter(|i| i.actor == hero.actor);
    let at_s = impact.map_or(hero.min_distance_at_s, |i| i.at_s);
    let at = Time::ZERO + swerve_core::Span::from_secs(at_s);
    let actor = story.actor(hero.actor);
    let (Some(ego), Some((actor, pose))) = (story.ego_at(at), actor.and_then(|a| Some((a, a.pose_at(at)?))))
    else {
        return;
    };
    let footprint = story.outline.footprint(ego.pose);
    let paint = color::ALARM;
    let strong = format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"1.8\"");
    outline(canvas, view, &footprint, &strong);
    shape(canvas, view, &actor.shape(pose), &strong);
    let (on_ego, on_actor) = actor.shape(pose).nearest(&footprint);
    let (from, to) = (view.at(on_ego), view.at(on_actor));
    let label = match impact {
        Some(i) => {
            canvas.star(to, 9.0, &format!("fill=\"{paint}\" stroke=\"#FFFFFF\" stroke-width=\"1\""));
            format!("collision {:.2} s, at {:.1} m/s", i.at_s, i.ego_speed_mps)
        }
        None => {
            canvas.line(from, to, &format!("stroke=\"{paint}\" stroke-width=\"3\""));
            [from, to].into_iter().for_each(|end| canvas.circle(end, 2.5, &format!("fill=\"{paint}\"")));
            format!("closest {:.2} s, {:.2} m", at_s, hero.min_distance_m)
        }
    };
    let middle = view.at(footprint.center.point());
    let is_below = to.1 < middle.1;
    // Above the outline is where the actor came from, with its own labels to the right.
    let (x, anchor) = if is_below { (middle.0, "middle") } else { (to.0 - 12.0, "end") };
    let how = Text { size: 11.0, color: paint, anchor, bold: true, rim: true };
    canvas.text((x, label_height(view, &footprint, is_below)), &label, how);
}

/// Height of a label just below an outline, or just above it.
fn label_height(view: &View, footprint: &Obb, is_below: bool) -> f64 {
    let ys = footprint.corners().map(|corner| view.at(corner).1);
    let (high, low) = (ys.into_iter().fold(f64::INFINITY, f64::min), ys.into_iter().fold(0.0, f64::max));
    let bottom = view.corner.1 + view.size.1;
    if is_below && low + 13.0 < bottom - 3.0 { low + 13.0 } else { high - 5.0 }
}
