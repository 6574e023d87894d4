//! Elements of a map beside its lanes: their counts, and their drawing.

use serde_json::{Map as Object, Value};
use swerve_draw::{Axes, Canvas, Color, Style, color};
use swerve_map::{AreaKind, Map, StopLine, StopSign};

/// Counts by kind with the names of one and of several elements.
fn counts(map: &Map) -> [(usize, &'static str, &'static str); 6] {
    let rights_of_way = map.junctions().iter().map(|junction| junction.rights_of_way.len()).sum();
    [
        (map.junctions().len(), "junction", "junctions"),
        (rights_of_way, "right of way", "rights of way"),
        (map.signals().len(), "signal", "signals"),
        (map.stop_lines().len(), "stop line", "stop lines"),
        (map.crossings().len(), "crossing", "crossings"),
        (map.areas().len(), "area", "areas"),
    ]
}

/// Counts of the kinds that a map has, for the end of a line in a terminal; empty if it has lanes only.
pub(crate) fn text(map: &Map) -> String {
    let present = counts(map).into_iter().filter(|(count, ..)| *count > 0);
    let named = |(count, one, more)| format!("{count} {}", if count == 1 { one } else { more });
    let named: Vec<String> = present.map(named).collect();
    if named.is_empty() { String::new() } else { format!("; {}", named.join(", ")) }
}

/// Counts of all kinds, for programs: `junctions`, `rights_of_way`, ...
pub(crate) fn json(map: &Map) -> Value {
    let entry = |(count, _, name): (usize, &str, &str)| (name.replace(' ', "_"), Value::from(count));
    Value::Object(counts(map).into_iter().map(entry).collect::<Object<String, Value>>())
}

/// Style of stop lines.
pub(crate) const STOP_LINE: Style = Style::line(color::INK, 2.0);

const CROSSING: Style = Style::fill(color::PAPER).filled_by(0.7).outlined(color::INK, 0.8);
const LIGHT: Style = Style::fill(color::ALARM);

/// Draws areas, crossings, stop lines and signals.
pub(crate) fn draw(canvas: &mut Canvas, map: &Map, axes: &Axes) {
    for area in map.areas() {
        canvas.begin_titled(&format!("area {}: {}", area.name, area.kind.name()));
        let style = Style::fill(area_color(area.kind)).filled_by(0.5).outlined(color::VEHICLE, 0.6);
        canvas.path(area.outline.iter().map(|p| axes.at(p.x_m, p.y_m)), true, style);
        canvas.end_titled();
    }
    for crossing in map.crossings() {
        canvas.begin_titled(&format!("crossing {}", crossing.name));
        canvas.path(crossing.outline.iter().map(|p| axes.at(p.x_m, p.y_m)), true, CROSSING);
        canvas.end_titled();
    }
    draw_stop_lines(canvas, map, axes);
    for signal in map.signals() {
        canvas.begin_titled(&format!("signal {}", signal.name));
        canvas.circle(axes.at(signal.position.x_m, signal.position.y_m), 2.5, LIGHT);
        canvas.end_titled();
    }
}

/// Draws stop lines across their lanes.
pub(crate) fn draw_stop_lines(canvas: &mut Canvas, map: &Map, axes: &Axes) {
    for stop in map.stop_lines() {
        let Some(lane) = map.lane(stop.lane) else { continue };
        let pose = lane.line.at(stop.s_m).pose;
        let left = pose.direction().left();
        let end = |d_m: f64| {
            let point = pose.point() + left * d_m;
            axes.at(point.x_m, point.y_m)
        };
        canvas.begin_titled(&title(map, stop));
        let ends = [end(lane.borders.left_m(stop.s_m)), end(-lane.borders.right_m(stop.s_m))];
        canvas.path(ends, false, STOP_LINE);
        canvas.end_titled();
    }
}

fn title(map: &Map, stop: &StopLine) -> String {
    let signals =
        stop.signals.iter().filter_map(|id| map.signal(*id)).map(|signal| format!(" {}", signal.name));
    let sign = match stop.sign {
        Some(StopSign::Stop) => ", stop sign",
        Some(StopSign::Yield) => ", yield sign",
        None => "",
    };
    let signals: String = signals.collect();
    let signals = if signals.is_empty() { signals } else { format!(", signals{signals}") };
    format!("stop line{signals}{sign}")
}

fn area_color(kind: AreaKind) -> Color {
    match kind {
        AreaKind::Parking => Color::hex(0xA9C4DC),
        AreaKind::Walking => Color::hex(0xF0E3C0),
        AreaKind::NoStopping => Color::hex(0xE8B98F),
        AreaKind::NoEntry => Color::hex(0xC9D8BD),
        AreaKind::Other => Color::hex(0xEDEDEA),
    }
}
