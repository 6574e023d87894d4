//! Traffic lights: stop lines and lamps in the bird's-eye view, and their signals over time.

use swerve_core::Time;
use swerve_eval::LightCourse;
use swerve_geom::FrenetPoint;
use swerve_msg::Signal;

use super::labels::{Importance, Labels};
use super::record::Story;
use super::view::View;
use swerve_draw::{Anchor, Axes, Canvas, Color, Style, Text, color, width_of};

/// Height of the signal strip of one light, and row height including the gap, pixels.
const STRIP: f64 = 13.0;
const ROW: f64 = 17.0;
/// Maximum distance of a lamp from the drivable area, metres: farther ones would be outside the view.
const BESIDE_M: f64 = 1.2;

/// Colour of a signal.
fn paint(signal: Signal) -> Color {
    let [r, g, b] = signal.rgb().map(u32::from);
    Color::hex(r << 16 | g << 8 | b)
}

/// Instant at which the ego's front crossed the stop line; `None` if it did not.
fn crossed(story: &Story, light: &LightCourse) -> Option<Time> {
    let is_over = |pair: &[swerve_msg::EgoState]| {
        story.front_s_m(&pair[0]) < light.stop_s_m && story.front_s_m(&pair[1]) >= light.stop_s_m
    };
    story.ego.windows(2).find(|pair| is_over(pair)).map(|pair| pair[1].stamp)
}

/// Lights whose stop lines are in the view.
fn shown<'a>(story: &'a Story, view: &View) -> impl Iterator<Item = &'a LightCourse> {
    let (from, to) = view.s_m;
    story.lights.iter().filter(move |light| light.stop_s_m >= from && light.stop_s_m <= to)
}

/// Draws stop lines, and lamps in the colour at the ego's crossing, or at the end if it did not cross.
pub(super) fn draw(canvas: &mut Canvas, labels: &mut Labels, story: &Story, view: &View) {
    for light in shown(story, view) {
        let route = &story.route;
        let (left_m, right_m) = (route.left_m(light.stop_s_m), route.right_m(light.stop_s_m));
        let place = |s_m, d_m| view.at(route.unproject(FrenetPoint { s_m, d_m }));
        let (left, right) = (place(light.stop_s_m, left_m), place(light.stop_s_m, -right_m));
        canvas.line(left, right, Style::line(color::INK, 3.0));
        labels.keep_off_line([left, right]);
        let end = story.ego.last().map_or(view.span.1, |ego| ego.stamp);
        let crossing = crossed(story, light);
        let at = crossing.unwrap_or(end);
        let Some(signal) = light.signal(at) else { continue };
        let (lamp_s_m, lamp_d_m) =
            (light.s_m.min(view.s_m.1 - 1.0), light.d_m.clamp(-right_m - BESIDE_M, left_m + BESIDE_M));
        let lamp = place(lamp_s_m, lamp_d_m);
        let beside = place(light.stop_s_m, lamp_d_m);
        canvas.line(beside, lamp, Style::line(color::INK, 1.0).dashed(2.0, 2.0));
        canvas.circle(lamp, 6.0, Style::fill(paint(signal)).outlined(color::INK, 1.5));
        labels.keep_off([lamp.0 - 7.0, lamp.1 - 7.0, lamp.0 + 7.0, lamp.1 + 7.0]);
        let when = if crossing.is_some() { "as the ego crossed" } else { "at the end" };
        let text = format!("light {}: {} {when}, {:.2} s", light.name, signal.name(), at.as_secs());
        let how = Text { size: 11.0, bold: true, rim: true, ..Text::default() };
        let (right, before) = (lamp.0 + 11.0, lamp.0 - 11.0 - width_of(&text, how));
        let places = [4.0, -12.0, 20.0].iter().flat_map(|dy| [right, before].map(|x| (x, lamp.1 + dy)));
        labels.ask(Importance::Event, places.collect(), text, how);
    }
}

/// Draws the signals of each light in view over a time axis, from `top` down. Returns the height used.
pub(super) fn strips(canvas: &mut Canvas, story: &Story, view: &View, frame: &Axes, top: f64) -> f64 {
    let mut y = top;
    for light in shown(story, view) {
        let named = Text { size: 11.0, color: color::INK, anchor: Anchor::End, ..Text::default() };
        canvas.text((frame.corner.0 - 8.0, y + 10.0), &short(&light.name, named), named);
        let ends = light.shows.iter().skip(1).map(|(at, _)| *at).chain([Time::MAX]);
        for ((from, signal), until) in light.shows.iter().zip(ends) {
            let within = |at: Time| frame.at(at.as_secs().clamp(frame.x.0, frame.x.1), 0.0).0;
            let (left, right) = (within(*from), within(until));
            if right <= left {
                continue;
            }
            let ground = paint(*signal);
            canvas.rect((left, y), (right - left, STRIP), Style::fill(ground).outlined(color::INK, 0.6));
            let how =
                Text { size: 10.0, anchor: Anchor::Middle, color: color::ink_on(ground), ..Text::default() };
            if width_of(signal.name(), how) + 6.0 < right - left {
                canvas.text((0.5 * (left + right), y + 10.0), signal.name(), how);
            }
        }
        y += ROW;
    }
    y - top
}

/// Name shortened to fit left of a panel.
fn short(name: &str, how: Text) -> String {
    const ROOM: f64 = 60.0;
    let mut text = name.to_owned();
    while width_of(&text, how) > ROOM && text.pop().is_some() {}
    if text == name { text } else { format!("{}…", text.trim_end()) }
}

/// True if a light is in the view.
pub(super) fn are_there(story: &Story, view: &View) -> bool {
    shown(story, view).next().is_some()
}
