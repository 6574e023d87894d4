//! The whole figure.

use swerve_eval::{Metrics, Verdict};
use swerve_msg::ActorKind;

use super::marks::first_sight;
use super::record::Story;
use super::view::View;
use super::{birds_eye, panels, tracks};
use crate::canvas::{At, Canvas, Text, color, width_of};

const WIDTH: f64 = 1240.0;
const LEFT: f64 = 72.0;
const RIGHT: f64 = 24.0;
const HEADER: f64 = 64.0;

/// The figure as SVG. A run without ego states gives a figure that says so.
pub fn draw(story: &Story) -> String {
    let mut canvas = Canvas::default();
    header(&mut canvas, story);
    let width = WIDTH - LEFT - RIGHT;
    let Some(view) = View::of(story, (LEFT, HEADER), width) else {
        let how = Text { size: 13.0, color: color::SOFT, ..Text::default() };
        canvas.text((LEFT, HEADER + 24.0), "the run ended before the ego moved", how);
        return canvas.finish(WIDTH, HEADER + 48.0, &story.title);
    };
    birds_eye::draw(&mut canvas, story, &view);
    let mut y = HEADER + view.size.1 + 48.0;
    y = legend(&mut canvas, story, &view, (LEFT, y));
    let soft = Text { size: 12.0, color: color::SOFT, ..Text::default() };
    let note = birds_eye::before_sight(story, &view);
    let why = story.why.as_ref().map(|why| format!("Why: {}.", why.sentence));
    for line in note.into_iter().chain(why).flat_map(|text| lines(&text, width, soft)) {
        y += 18.0;
        canvas.text((LEFT, y + 4.0), &line, soft);
    }
    y += 14.0;
    y += panels::draw(&mut canvas, story, &view, (LEFT, y), width);
    canvas.finish(WIDTH, y + 8.0, &story.title)
}

fn header(canvas: &mut Canvas, story: &Story) {
    canvas.text((LEFT, 28.0), &story.title, Text { size: 18.0, bold: true, ..Text::default() });
    let Some(metrics) = &story.metrics else { return };
    let (word, paint) = verdict(metrics.verdict);
    let width = 9.2 * word.len() as f64 + 24.0;
    let corner = (WIDTH - RIGHT - width, 11.0);
    canvas.rect(corner, (width, 24.0), &format!("rx=\"4\" fill=\"{paint}\""));
    let how = Text { size: 14.0, color: "#FFFFFF", anchor: "middle", bold: true, rim: false };
    canvas.text((corner.0 + 0.5 * width, 28.0), word, how);
    let how = Text { size: 12.5, color: color::SOFT, ..Text::default() };
    let mut parts = headline(story, metrics);
    // What there is no room for is in `metrics.json`.
    while width_of(&parts.join("  ·  "), how) > WIDTH - LEFT - RIGHT {
        parts.pop();
    }
    canvas.text((LEFT, 50.0), &parts.join("  ·  "), how);
}

/// A text in lines of this width at most.
fn lines(text: &str, width: f64, how: Text<'_>) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if width_of(&format!("{line} {word}"), how) <= width => *line += &format!(" {word}"),
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn verdict(verdict: Verdict) -> (&'static str, &'static str) {
    match verdict {
        Verdict::Avoided => ("AVOIDED", "#00704F"),
        Verdict::Completed => ("COMPLETED", "#00704F"),
        Verdict::Collision => ("COLLISION", color::ALARM),
        Verdict::LeftRoad => ("LEFT THE ROAD", color::LEFT_ROAD),
        Verdict::Stopped => ("STOPPED", color::STOPPED),
        Verdict::Timeout => ("TIMEOUT", color::SOFT),
        Verdict::Unfinished => ("UNFINISHED", color::SOFT),
    }
}

fn headline(story: &Story, metrics: &Metrics) -> Vec<String> {
    let mut parts = Vec::new();
    if let Some(i) = metrics.impact {
        parts.push(format!(
            "impact at {:.1} m/s (closing at {:.1} m/s)",
            i.ego_speed_mps, i.closing_speed_mps
        ));
    } else if let Some(distance_m) = metrics.min_distance_m {
        let nearest = metrics.actors.iter().find(|a| Some(a.actor) == metrics.min_distance_actor);
        let to = nearest.map_or("", |a| a.name.as_str());
        let hero = story.protagonist().filter(|hero| Some(hero.actor) != metrics.min_distance_actor);
        let hero = hero.map_or_else(String::new, |a| format!(", {:.2} m ({})", a.min_distance_m, a.name));
        parts.push(format!("smallest distance {distance_m:.2} m ({to}){hero}"));
    }
    if let Some(at_s) = metrics.left_road_at_s {
        parts.push(format!("left the road at {at_s:.2} s"));
    }
    if let Some(jerk) = metrics.lateral_jerk.smooth_max_mps3 {
        parts.push(format!("lateral jerk {jerk:.0} m/s³"));
    }
    if let Some(response) = metrics.response {
        parts.push(format!("response time {:.0} ms (p99 {:.0} ms)", response.p50_ms, response.p99_ms));
    }
    parts.push(format!("deceleration {:.1} m/s²", metrics.drive.deceleration_max_mps2));
    parts.push(format!("lateral acceleration {:.1} m/s²", metrics.drive.lateral_accel_max_mps2));
    parts
}

/// What the signs mean; only those that occur. Gives the height of its last line.
fn legend(canvas: &mut Canvas, story: &Story, view: &View, (mut x, mut y): At) -> f64 {
    let how = Text { size: 12.0, ..Text::default() };
    let mut entry = |canvas: &mut Canvas, sign: &dyn Fn(&mut Canvas, At), text: &str| {
        let width = 30.0 + width_of(text, how) + 20.0;
        if x + width > WIDTH - RIGHT {
            (x, y) = (LEFT, y + 20.0);
        }
        sign(canvas, (x, y));
        canvas.text((x + 30.0, y + 4.0), text, how);
        x += width;
    };
    let line = |paint: &str, more: &str| {
        let style = format!("stroke=\"{paint}\" {more}");
        move |canvas: &mut Canvas, (x, y): At| canvas.line((x, y), (x + 24.0, y), &style)
    };
    let block = |paint: &str| {
        let style = format!("fill=\"{paint}\" fill-opacity=\"0.15\" stroke=\"{paint}\" stroke-width=\"1.2\"");
        move |canvas: &mut Canvas, (x, y): At| canvas.rect((x, y - 6.0), (24.0, 12.0), &style)
    };
    entry(canvas, &block(color::EGO), "ego every 0.5 s");
    let has = |people: bool| story.actors.iter().any(|a| a.kind.is_person() == people);
    if has(true) {
        let dot = |canvas: &mut Canvas, (x, y): At| {
            canvas.circle((x + 12.0, y), 5.0, &format!("fill=\"{}\" fill-opacity=\"0.75\"", color::PERSON));
        };
        let cyclists = story.actors.iter().any(|a| a.kind == ActorKind::Cyclist);
        entry(canvas, &dot, if cyclists { "person, cyclist (s)" } else { "person (s)" });
    }
    if has(false) {
        entry(canvas, &block(color::VEHICLE), "other vehicle");
    }
    let birds_eye::Changes { shown, left_out } = birds_eye::changes(story, view);
    let changes: Vec<_> = shown.iter().map(|mark| &mark.plan).collect();
    if changes.iter().any(|plan| !plan.status.is_fallback()) {
        let text = match left_out {
            0 => "plan at a change of mind".to_owned(),
            more => format!("plan at a change of mind ({more} more soon after)"),
        };
        entry(canvas, &line(color::PLAN, "stroke-width=\"2\""), &text);
    }
    if changes.iter().any(|plan| plan.status.is_fallback()) {
        let style = "stroke-width=\"1.5\" stroke-dasharray=\"2 3\"";
        entry(canvas, &line(color::FALLBACK, style), "no path found: fallback");
    }
    if story.tracks.iter().any(|track| !track.is_stale) {
        entry(canvas, &|canvas, (x, y)| tracks::sign(canvas, (x + 12.0, y), false), "track");
    }
    if tracks::has_stale(story, view) {
        entry(
            canvas,
            &|canvas, (x, y)| tracks::sign(canvas, (x + 12.0, y), true),
            "track of nobody who is there",
        );
    }
    if tracks::has_predictions(story, view) {
        entry(
            canvas,
            &line(color::TRACK, "stroke-width=\"1\" stroke-dasharray=\"1 3\""),
            "predicted at a plan shown",
        );
    }
    if story.why.is_some() {
        let style = "stroke-width=\"1.2\" stroke-dasharray=\"1 2\"";
        entry(canvas, &line(color::TRACK, style), "tracked, planned, commanded, effect");
    }
    entry(canvas, &line(color::ALARM, "stroke-width=\"1\" stroke-dasharray=\"2 3\""), "limit of comfort");
    if first_sight(story).is_some() {
        entry(canvas, &line(color::SIGHT, "stroke-width=\"2\" stroke-dasharray=\"6 4\""), "first sight");
    }
    if let Some(metrics) = story.metrics.as_ref().filter(|m| !m.actors.is_empty()) {
        let what = if metrics.impact.is_some() { "collision" } else { "closest approach" };
        entry(canvas, &line(color::ALARM, "stroke-width=\"2\""), what);
    }
    y
}
