//! Layout of the figure.

use swerve_eval::{Metrics, OthersImpact, Verdict};
use swerve_msg::ActorKind;

use super::changes::{Changes, changes};
use super::moments::{closest_at, first_sight};
use super::record::Story;
use super::view::View;
use super::{birds_eye, panels, tracks};
use swerve_draw::{Anchor, At, Canvas, Color, Entry, Picture, Sign, Style, Text, color, width_of};

const WIDTH: f64 = 1240.0;
const LEFT: f64 = 72.0;
const RIGHT: f64 = 24.0;
const HEADER: f64 = 64.0;

/// Draws the story. Without ego states the figure contains only a note.
pub fn draw(story: &Story) -> Picture {
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
    canvas.rect(corner, (width, 24.0), Style::fill(paint).rounded(4.0));
    let how = Text { size: 14.0, color: color::PAPER, anchor: Anchor::Middle, bold: true, rim: false };
    canvas.text((corner.0 + 0.5 * width, 28.0), word, how);
    let how = Text { size: 12.5, color: color::SOFT, ..Text::default() };
    let mut parts = headline(story, metrics);
    // Parts that do not fit are in `metrics.json`.
    while width_of(&parts.join("  ·  "), how) > WIDTH - LEFT - RIGHT {
        parts.pop();
    }
    canvas.text((LEFT, 50.0), &parts.join("  ·  "), how);
}

/// Text wrapped to a width.
fn lines(text: &str, width: f64, how: Text) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split(' ') {
        match lines.last_mut() {
            Some(line) if width_of(&format!("{line} {word}"), how) <= width => *line += &format!(" {word}"),
            _ => lines.push(word.to_owned()),
        }
    }
    lines
}

fn verdict(verdict: Verdict) -> (&'static str, Color) {
    match verdict {
        Verdict::Avoided => ("AVOIDED", color::GOOD),
        Verdict::Completed => ("COMPLETED", color::GOOD),
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
    parts.extend(metrics.first_collision_of_others.as_ref().map(OthersImpact::words));
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

/// Draws the legend of the signs that occur. Returns the height of its last line.
fn legend(canvas: &mut Canvas, story: &Story, view: &View, at: At) -> f64 {
    let mut entries: Vec<Entry> = Vec::new();
    let mut add = |is_there: bool, sign: Sign, text: &str| {
        if is_there {
            entries.push((sign, text.to_owned()));
        }
    };
    let block = |paint: Color| Sign::Block(Style::fill(paint).filled_by(0.15).outlined(paint, 1.2));
    let line = |paint: Color, width: f64| Sign::Line(Style::line(paint, width));
    let dashed = |paint: Color, width: f64, [dash, gap]: [f64; 2]| {
        Sign::Line(Style::line(paint, width).dashed(dash, gap))
    };
    add(true, block(color::EGO), "ego every 0.5 s");
    let has = |people: bool| story.actors.iter().any(|a| a.kind.is_person() == people);
    let cyclists = story.actors.iter().any(|a| a.kind == ActorKind::Cyclist);
    let person = Sign::Mark(|canvas, at| {
        canvas.circle(at, 5.0, Style::fill(color::PERSON).filled_by(0.75));
    });
    add(has(true), person, if cyclists { "person, cyclist (s)" } else { "person (s)" });
    add(has(false), block(color::VEHICLE), "other vehicle");
    let Changes { shown, left_out } = changes(story, view);
    let has = |fallback: bool| shown.iter().any(|mark| mark.plan.status.is_fallback() == fallback);
    let changed = match left_out {
        0 => "changed plan".to_owned(),
        more => format!("changed plan ({more} more soon after)"),
    };
    add(has(false), line(color::PLAN, 2.0), &changed);
    add(has(true), dashed(color::FALLBACK, 1.5, [2.0, 3.0]), "no path found: fallback");
    let is_tracked = story.tracks.iter().any(|track| !track.is_stale);
    add(is_tracked, Sign::Mark(|canvas, at| tracks::sign(canvas, at, false)), "track");
    let stale = Sign::Mark(|canvas, at| tracks::sign(canvas, at, true));
    add(tracks::has_stale(story, view), stale, "track without a road user");
    let predicted = dashed(color::TRACK, 1.0, [1.0, 3.0]);
    add(tracks::has_predictions(story, view), predicted, "predicted at a plan shown");
    let chain = dashed(color::TRACK, 1.2, [1.0, 2.0]);
    add(panels::has_chain(story, view), chain, "step of why, named below");
    let lamp = Sign::Mark(|canvas, at| {
        canvas.circle(at, 5.0, Style::fill(color::ROAD).outlined(color::INK, 1.5));
    });
    add(super::lights::are_there(story, view), lamp, "traffic light, behind its stop line");
    let has_patches = birds_eye::patches(story, view).next().is_some();
    add(has_patches, Sign::Block(birds_eye::slippery_style()), "slippery patch");
    add(true, dashed(color::ALARM, 1.0, [2.0, 3.0]), "limit of comfort");
    let without_comfort = Sign::Block(panels::without_comfort_style());
    add(!story.without_comfort().is_empty(), without_comfort, "no comfortable plan was free");
    add(first_sight(story).is_some(), dashed(color::SIGHT, 2.0, [6.0, 4.0]), "first visible");
    if let Some(metrics) = story.metrics.as_ref().filter(|_| closest_at(story).is_some()) {
        let what = if metrics.impact.is_some() { "collision" } else { "closest approach" };
        add(true, line(color::ALARM, 2.0), what);
    }
    entries.extend(super::states::legend(story, view));
    swerve_draw::legend(canvas, at, WIDTH - RIGHT, &entries)
}
