//! The view from above.

use swerve_core::{Span, Time};
use swerve_geom::{Obb, Point2};
use swerve_msg::ActorKind;

use super::record::{ActorTrace, PlanMark, Shape, Story};
use super::view::View;
use crate::canvas::{At, Canvas, Text, color, multiples, number, round_step};

/// Outlines are drawn at the multiples of this, ns.
const OUTLINE_EVERY_NS: i64 = 500_000_000;
/// A change of mind sooner than this after the one drawn last belongs to it, unless a path was found or lost.
const SETTLED: Span = Span::from_ms(250);
/// More plans than this on top of each other cannot be told apart.
const PLANS_MAX: usize = 9;
/// The ego stands where its outline would come to lie nearer to the last one than this, metres.
const MOVED_M: f64 = 0.3;

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
    let labels = [sight(canvas, story, view), closest(canvas, story, view)];
    plan_numbers(canvas, story, view, labels.into_iter().flatten().collect());
    canvas.end_clip();
    axes(canvas, view);
}

fn polyline(canvas: &mut Canvas, view: &View, points: &[Point2], style: &str) {
    canvas.path(points.iter().map(|p| view.at(*p)), false, style);
}

fn road(canvas: &mut Canvas, story: &Story, view: &View) {
    let route = &story.route;
    let (a, b) = (view.beside(story, |s_m| route.left_m(s_m)), view.beside(story, |s_m| -route.right_m(s_m)));
    let outline: Vec<At> = a.iter().chain(b.iter().rev()).map(|p| view.at(*p)).collect();
    canvas.path(outline, true, &format!("fill=\"{}\"", color::ROAD));
    if let Some(lane_m) = story.lane_width_m.filter(|w| *w > 0.5) {
        let style = format!(
            "fill=\"none\" stroke=\"{}\" stroke-width=\"2\" stroke-dasharray=\"{} {}\"",
            color::LANE,
            number(3.0 * view.scale),
            number(3.0 * view.scale)
        );
        // Only those that are on the road all the way.
        let (left, right) = (route.borders().left().min_m(), route.borders().right().min_m());
        let inside = |d_m: &f64| *d_m < left - 0.3 && *d_m > 0.3 - right;
        let first = ((-right / lane_m) - 0.5).floor() as i64;
        let borders = (first..first + 40).map(|k| (k as f64 + 0.5) * lane_m);
        borders.filter(inside).for_each(|d_m| polyline(canvas, view, &view.beside(story, |_| d_m), &style));
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
    let (left, right) = (view.corner.0 + 15.0, view.corner.0 + view.size.0 - 15.0);
    let mut labelled = f64::NEG_INFINITY;
    let mut drawn: Option<Point2> = None;
    for at in half_seconds(view) {
        let Some(ego) = story.ego_at(at) else { continue };
        let footprint = story.outline.footprint(ego.pose);
        let center = footprint.center.point();
        if drawn.is_some_and(|last| last.distance(center) < MOVED_M) {
            continue;
        }
        drawn = Some(center);
        outline(canvas, view, &footprint, &faint);
        let (x, y) = view.at(center);
        if (x - labelled).abs() > 30.0 && x > left && x < right {
            labelled = x;
            let how = Text { size: 10.0, color: paint, anchor: "middle", rim: true, ..Text::default() };
            // Below the middle, where the ego's way does not run through it.
            canvas.text((x, y + 12.0), &format!("{} s", seconds(at)), how);
        }
    }
    let way: Vec<Point2> = story.ego.iter().map(|e| e.pose.point()).collect();
    polyline(canvas, view, &way, &format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"1.6\""));
}

/// The changes of mind within the view.
pub(super) struct Changes<'a> {
    /// Those that are drawn, in order of time.
    pub(super) shown: Vec<&'a PlanMark>,
    /// How many more there were, each soon after one that is drawn.
    pub(super) left_out: usize,
}

/// The changes of mind within the view that a reader can tell apart.
pub(super) fn changes<'a>(story: &'a Story, view: &View) -> Changes<'a> {
    let (from, to) = view.span;
    // What the ego set out with is no change.
    let marks = story.plans.iter().skip(1);
    let inside: Vec<&PlanMark> = marks.filter(|mark| mark.at >= from && mark.at <= to).collect();
    let mut gap = SETTLED;
    loop {
        // With a path found and lost many times over, that is left out too.
        let shown = settled(story, &inside, gap, gap == SETTLED);
        if shown.len() <= PLANS_MAX {
            return Changes { left_out: inside.len() - shown.len(), shown };
        }
        gap = gap * 2;
    }
}

fn settled<'a>(story: &Story, marks: &[&'a PlanMark], gap: Span, found_or_lost: bool) -> Vec<&'a PlanMark> {
    let place = |mark: &PlanMark| story.ego_at(mark.at).map(|ego| ego.pose.point());
    let stands = |a, b| place(a).zip(place(b)).is_some_and(|(a, b)| a.distance(b) < MOVED_M);
    let mut shown: Vec<&PlanMark> = Vec::new();
    for mark in marks {
        let is_fallback = |mark: &PlanMark| mark.plan.status.is_fallback();
        let is_next = shown.last().is_none_or(|last| {
            (mark.at - last.at >= gap && !stands(mark, last))
                || (found_or_lost && is_fallback(mark) != is_fallback(last))
        });
        if is_next {
            shown.push(mark);
        }
    }
    shown
}

/// What explains a plan from before the first sight of the actor that the story is about: who else was seen.
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
        .map(|a| kind_name(a.kind))
        .collect();
    let plans = match early {
        0 => return None,
        1 => "plan 1 is".to_owned(),
        n => format!("plans 1 to {n} are"),
    };
    let unseen = kind_name(hero.kind);
    Some(match &others[..] {
        [] => format!("{plans} from before first sight of the {unseen}"),
        [other] => {
            format!("{plans} from before first sight of the {unseen}: only the {other} is in sight then")
        }
        _ => format!(
            "{plans} from before first sight of the {unseen}: {} others are in sight then",
            others.len()
        ),
    })
}

/// Colour of a plan.
pub(super) fn plan_color(plan: &swerve_msg::Plan) -> &'static str {
    if plan.status.is_fallback() { color::FALLBACK } else { color::PLAN }
}

fn plans(canvas: &mut Canvas, story: &Story, view: &View) {
    for mark in changes(story, view).shown {
        let paint = plan_color(&mark.plan);
        let dash = if mark.plan.status.is_fallback() { " stroke-dasharray=\"3 3\"" } else { "" };
        let style =
            format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"2\" stroke-opacity=\"0.8\"{dash}");
        let points: Vec<Point2> = mark.plan.points.iter().map(|p| p.pose.point()).collect();
        polyline(canvas, view, &points, &style);
    }
}

/// Where the ego was when it changed its mind.
fn plan_numbers(canvas: &mut Canvas, story: &Story, view: &View, mut taken: Vec<Taken>) {
    for (number, mark) in (1..).zip(changes(story, view).shown) {
        let Some(ego) = story.ego_at(mark.at) else { continue };
        let (x, _) = view.at(ego.pose.point());
        // Above the outline: within it stands the time.
        let mut y = label_height(view, &story.outline.footprint(ego.pose), false) - 5.0;
        while taken.iter().any(|t| (t.at.0 - x).abs() < t.half_width + 8.5 && (t.at.1 - y).abs() < 17.0) {
            y -= 17.0;
        }
        taken.push(Taken { at: (x, y), half_width: 8.5 });
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

fn sight(canvas: &mut Canvas, story: &Story, view: &View) -> Option<Taken> {
    let at = first_sight(story)?;
    let actor = story.protagonist().and_then(|a| story.actor(a.actor));
    let (ego, actor) = (story.ego_at(at)?, actor?);
    let pose = actor.pose_at(at)?;
    let paint = color::SIGHT;
    let footprint = story.outline.footprint(ego.pose);
    let dashed = format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"2\" stroke-dasharray=\"6 4\"");
    outline(canvas, view, &footprint, &dashed);
    let (from, to) = (view.at(footprint.center.point()), view.at(pose.point()));
    canvas.line(from, to, &dashed);
    shape(canvas, view, &actor.shape(pose), &format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"2\""));
    let (on_ego, on_actor) = actor.shape(pose).nearest(&footprint);
    let away_m = on_ego.distance(on_actor);
    let end = if from.0 < view.corner.0 { ", before this view" } else { "" };
    let label = format!("first sight {:.2} s, {away_m:.1} m away{end}", at.as_secs());
    // On the side away from the actor, where the line of sight does not cross it.
    let place = (from.0, label_height(view, &footprint, to.1 < from.1));
    Some(mark_label(canvas, view, place, &label, "#8A5E00"))
}

fn closest(canvas: &mut Canvas, story: &Story, view: &View) -> Option<Taken> {
    let metrics = story.metrics.as_ref()?;
    let hero = story.protagonist()?;
    let impact = metrics.impact.filter(|i| i.actor == hero.actor);
    let at_s = impact.map_or(hero.min_distance_at_s, |i| i.at_s);
    let at = Time::ZERO + swerve_core::Span::from_secs(at_s);
    let actor = story.actor(hero.actor);
    let (ego, actor) = (story.ego_at(at)?, actor?);
    let pose = actor.pose_at(at)?;
    let footprint = story.outline.footprint(ego.pose);
    let paint = color::ALARM;
    let strong = format!("fill=\"none\" stroke=\"{paint}\" stroke-width=\"1.8\"");
    outline(canvas, view, &footprint, &strong);
    shape(canvas, view, &actor.shape(pose), &strong);
    let (on_ego, on_actor) = actor.shape(pose).nearest(&footprint);
    let (from, to) = (view.at(on_ego), view.at(on_actor));
    let is_shown = (view.corner.0..=view.corner.0 + view.size.0).contains(&to.0);
    let label = match impact {
        Some(i) => {
            canvas.star(to, 9.0, &format!("fill=\"{paint}\" stroke=\"#FFFFFF\" stroke-width=\"1\""));
            format!("collision {:.2} s, at {:.1} m/s", i.at_s, i.ego_speed_mps)
        }
        None if !is_shown => {
            let who = kind_name(hero.kind);
            format!("closest {at_s:.2} s, {:.2} m to the {who} outside this view", hero.min_distance_m)
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
    let x = if is_below || !is_shown { middle.0 } else { to.0 - 12.0 - half_width(&label) };
    let place = (x, label_height(view, &footprint, is_below));
    Some(mark_label(canvas, view, place, &label, paint))
}

/// A place that has a text or a badge in its middle, pixels.
struct Taken {
    at: At,
    half_width: f64,
}

/// Half the width of a bold label, pixels, rather too much than too little.
fn half_width(label: &str) -> f64 {
    3.5 * label.chars().count() as f64
}

/// A label in the middle of a place, or as near to it as the view allows.
fn mark_label(canvas: &mut Canvas, view: &View, (x, y): At, label: &str, paint: &str) -> Taken {
    let half_width = half_width(label);
    let (left, right) = (view.corner.0, view.corner.0 + view.size.0);
    let x = x.min(right - half_width - 4.0).max(left + half_width + 4.0);
    canvas.text((x, y), label, Text { size: 11.0, color: paint, anchor: "middle", bold: true, rim: true });
    Taken { at: (x, y - 4.0), half_width }
}

/// Height of a label just below an outline, or just above it.
fn label_height(view: &View, footprint: &Obb, is_below: bool) -> f64 {
    let ys = footprint.corners().map(|corner| view.at(corner).1);
    let (high, low) = (ys.into_iter().fold(f64::INFINITY, f64::min), ys.into_iter().fold(0.0, f64::max));
    let bottom = view.corner.1 + view.size.1;
    if is_below && low + 13.0 < bottom - 3.0 { low + 13.0 } else { high - 5.0 }
}
