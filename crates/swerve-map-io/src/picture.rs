//! Picture of a network: lanes filled by type, marks, connections of junctions, signals, objects, stop lines.

pub mod lanes;

use swerve_draw::{Axes, Canvas, Color, Entry, Picture, Sign, Style, Text, color, legend};
use swerve_map::{LaneKind, Map};

use crate::features;
use crate::import::{Imported, kind_of, vertices};
use crate::opendrive::{LaneType, Network, Road, RoadMark};
use swerve_map::router::Way;

const WIDTH: f64 = 1200.0;
const LEFT: f64 = 72.0;
const TOP: f64 = 84.0;
const BOTTOM: f64 = 48.0;
const RIGHT: f64 = 24.0;
const HEIGHT: [f64; 2] = [200.0, 1600.0];

/// Ground around the roads, share of the larger extent.
const AROUND: f64 = 0.03;

/// Fill colours in the order of the legend.
const FILLS: [(&str, Color); 7] = [
    ("driving", Color::hex(0xB9BFC7)),
    ("shoulder", Color::hex(0xD9DDE2)),
    ("cycling", Color::hex(0xE8B98F)),
    ("walking", Color::hex(0xF0E3C0)),
    ("parking", Color::hex(0xA9C4DC)),
    ("border, median", Color::hex(0xC9D8BD)),
    ("other", Color::hex(0xEDEDEA)),
];

fn fill_of(kind: &LaneType) -> Color {
    match (kind_of(kind), kind) {
        (Some(kind), _) => fill(kind),
        (None, LaneType::Border | LaneType::Median | LaneType::Curb) => FILLS[5].1,
        (None, _) => FILLS[6].1,
    }
}

fn fill(kind: LaneKind) -> Color {
    let index = match kind {
        LaneKind::Driving => 0,
        LaneKind::Shoulder => 1,
        LaneKind::Cycling => 2,
        LaneKind::Walking => 3,
        LaneKind::Parking => 4,
    };
    FILLS[index].1
}

/// Draws a network in the ground plane, x to the right and y upwards, with a route if there is one.
pub fn draw(
    network: &Network,
    imported: &Imported,
    extent_m: [[f64; 2]; 3],
    title: &str,
    way: Option<&Way>,
) -> Picture {
    let (mut canvas, axes) = begun(extent_m, title, way.is_some());
    for road in &network.roads {
        sections(&mut canvas, network, road, &axes);
    }
    for road in &network.roads {
        marks(&mut canvas, network, road, &axes);
    }
    connections(&mut canvas, network, imported, &axes);
    furniture(&mut canvas, network, &axes);
    features::draw_stop_lines(&mut canvas, &imported.map, &axes);
    finished(canvas, &axes, (&imported.map, way), title)
}

/// A picture with title, legend and ground, clipped to the axes.
fn begun(extent_m: [[f64; 2]; 3], title: &str, has_way: bool) -> (Canvas, Axes) {
    let mut canvas = Canvas::default();
    let axes = axes(extent_m);
    canvas.text((LEFT, 28.0), title, Text::TITLE);
    legend(&mut canvas, (LEFT, 50.0), WIDTH - RIGHT, &entries(has_way));
    axes.ground(&mut canvas);
    axes.grid(&mut canvas, (12.0, 8.0));
    canvas.begin_clip(axes.corner, axes.size);
    (canvas, axes)
}

/// The picture with a route, if there is one, and numbers at its axes.
fn finished(mut canvas: Canvas, axes: &Axes, (map, way): (&Map, Option<&Way>), title: &str) -> Picture {
    for (way, k) in way.into_iter().flat_map(|way| (0..way.lanes.len()).map(move |k| (way, k))) {
        let points = way.line(map, k);
        canvas.path(points.iter().map(|p| axes.at(p.x_m, p.y_m)), false, Style::line(color::PLAN, 3.0));
    }
    canvas.end_clip();
    axes.frame(&mut canvas);
    axes.numbers_below(&mut canvas, 12.0);
    axes.numbers_left(&mut canvas, 8.0);
    axes.name_below(&mut canvas, "x (m)");
    axes.name_left(&mut canvas, "y", "m");
    canvas.finish(WIDTH, axes.corner.1 + axes.size.1 + BOTTOM, title)
}

/// Axes with the same scale, around the extent.
fn axes([x, y, _]: [[f64; 2]; 3]) -> Axes {
    let around = (AROUND * (x[1] - x[0]).max(y[1] - y[0])).max(5.0);
    let [mut x, mut y] = [x, y].map(|[low, high]| (low - around, high + around));
    let width = WIDTH - LEFT - RIGHT;
    let height = (width * (y.1 - y.0) / (x.1 - x.0)).clamp(HEIGHT[0], HEIGHT[1]);
    // Where the height is limited, the other axis, or the same one, shows more ground.
    let scale = (width / (x.1 - x.0)).min(height / (y.1 - y.0));
    for (range, pixels) in [(&mut x, width), (&mut y, height)] {
        let (middle, half) = (0.5 * (range.0 + range.1), 0.5 * pixels / scale);
        *range = (middle - half, middle + half);
    }
    Axes { corner: (LEFT, TOP), size: (width, height), x, y }
}

fn entries(has_route: bool) -> Vec<Entry> {
    let block = |(name, fill): (&str, Color)| {
        (Sign::Block(Style::fill(fill).outlined(color::GRID, 0.5)), name.to_owned())
    };
    let mut entries: Vec<Entry> = FILLS.into_iter().map(block).collect();
    entries.push((Sign::Line(CONNECTION), "connection".to_owned()));
    entries.push((Sign::Mark(|canvas, at| canvas.circle(at, 3.0, SIGNAL)), "signal".to_owned()));
    entries.push((Sign::Block(OBJECT), "object".to_owned()));
    entries.push((Sign::Line(features::STOP_LINE), "stop line".to_owned()));
    if has_route {
        entries.push((Sign::Line(Style::line(color::PLAN, 3.0)), "route".to_owned()));
    }
    entries
}

const CONNECTION: Style = Style::line(color::EGO, 0.8).lined_by(0.7);
const SIGNAL: Style = Style::fill(color::ALARM);
const OBJECT: Style = Style::fill(color::VEHICLE).filled_by(0.35).outlined(color::VEHICLE, 0.8);

/// Positions of a line beside the road, pixels.
fn beside(
    network: &Network,
    road: &Road,
    axes: &Axes,
    places: impl Iterator<Item = (f64, f64)>,
) -> Vec<(f64, f64)> {
    let at = |(s_m, t_m): (f64, f64)| {
        let [x, y, _] = network.place(road, s_m, t_m).position_m;
        axes.at(x, y)
    };
    places.map(at).collect()
}

fn sections(canvas: &mut Canvas, network: &Network, road: &Road, axes: &Axes) {
    for (index, section) in road.sections.iter().enumerate() {
        let Some(span_m) = road.section_span_m(index) else { continue };
        let stations = vertices::stations(road, section, span_m).unwrap_or_default();
        for is_left in [true, false] {
            let count = if is_left { section.left.len() } else { section.right.len() };
            let mut edges = vec![Vec::with_capacity(stations.len()); count];
            for &s_m in &stations {
                for (edges, (_, at)) in edges.iter_mut().zip(road.edges(section, is_left, s_m)) {
                    edges.push((s_m, at));
                }
            }
            let lanes = if is_left { &section.left } else { &section.right };
            for (lane, edges) in lanes.iter().zip(edges) {
                let inner = edges.iter().map(|(s_m, at)| (*s_m, at.inner.t_m));
                let outer = edges.iter().rev().map(|(s_m, at)| (*s_m, at.outer.t_m));
                let outline = beside(network, road, axes, inner.chain(outer));
                canvas.begin_titled(&format!(
                    "road {} section {index} lane {}: {}",
                    road.id,
                    lane.id,
                    lane.kind.name()
                ));
                canvas.path(outline, true, Style::fill(fill_of(&lane.kind)));
                canvas.end_titled();
            }
        }
    }
}

fn marks(canvas: &mut Canvas, network: &Network, road: &Road, axes: &Axes) {
    for (index, section) in road.sections.iter().enumerate() {
        let Some(span_m) = road.section_span_m(index) else { continue };
        let stations = vertices::stations(road, section, span_m).unwrap_or_default();
        let center = stations.iter().map(|s_m| (*s_m, road.lane_offset.value(*s_m))).collect::<Vec<_>>();
        mark(canvas, network, road, axes, (&section.center_marks, &center));
        for is_left in [true, false] {
            let lanes = if is_left { &section.left } else { &section.right };
            for (k, lane) in lanes.iter().enumerate().filter(|(_, lane)| !lane.marks.is_empty()) {
                let outer = |s_m: &f64| Some((*s_m, road.edges(section, is_left, *s_m).nth(k)?.1.outer.t_m));
                let edge: Vec<(f64, f64)> = stations.iter().filter_map(outer).collect();
                mark(canvas, network, road, axes, (&lane.marks, &edge));
            }
        }
    }
}

/// Draws marks along an edge of stations.
fn mark(
    canvas: &mut Canvas,
    network: &Network,
    road: &Road,
    axes: &Axes,
    (marks, edge): (&[RoadMark], &[(f64, f64)]),
) {
    for (k, mark) in marks.iter().enumerate().filter(|(_, mark)| !matches!(&*mark.kind, "none" | "")) {
        let until_m = marks.get(k + 1).map_or(f64::INFINITY, |next| next.s_m);
        let within = edge.iter().copied().filter(|(s_m, _)| mark.s_m - 1e-6 <= *s_m && *s_m <= until_m);
        let line = match &*mark.color {
            "yellow" => color::SIGHT,
            "red" => color::ALARM,
            "blue" => color::EGO,
            "green" => color::GOOD,
            "orange" => color::PERSON,
            _ => color::PAPER,
        };
        let style = Style::line(line, 1.2);
        let style = if mark.kind.starts_with("broken") { style.dashed(4.0, 4.0) } else { style };
        canvas.path(beside(network, road, axes, within), false, style);
    }
}

/// Centre lines of driving lanes in junctions, with their direction.
fn connections(canvas: &mut Canvas, network: &Network, imported: &Imported, axes: &Axes) {
    for (lane, source) in imported.map.lanes().iter().zip(&imported.lanes) {
        let road = &network.roads[source.road];
        if road.junction.is_none() || lane.kind != LaneKind::Driving {
            continue;
        }
        canvas.path(lane.line.points().iter().map(|p| axes.at(p.x_m, p.y_m)), false, CONNECTION);
    }
}

fn furniture(canvas: &mut Canvas, network: &Network, axes: &Axes) {
    for road in &network.roads {
        for object in &road.objects {
            let place = network.place(road, object.s_m, object.t_m);
            let heading_rad = place.reference_heading_rad + object.heading_rad;
            let (sin, cos) = swerve_geom::math::sin_cos(heading_rad);
            let local = |u: f64, v: f64| {
                let [x, y, _] = place.position_m;
                axes.at(x + u * cos - v * sin, y + u * sin + v * cos)
            };
            let at = |corner: &crate::opendrive::Corner| match *corner {
                crate::opendrive::Corner::Local { u_m, v_m } => local(u_m, v_m),
                crate::opendrive::Corner::Road { s_m, t_m } => {
                    let [x, y, _] = network.place(road, s_m, t_m).position_m;
                    axes.at(x, y)
                }
            };
            canvas.begin_titled(&format!("{} {}", object.kind, object.name));
            for outline in &object.outlines {
                canvas.path(outline.corners.iter().map(at), outline.closed, OBJECT);
            }
            let [u, v] = [0.5 * object.size_m[0], 0.5 * object.size_m[1]];
            if object.outlines.is_empty() && u * v > 0.0 {
                canvas.path([local(u, v), local(-u, v), local(-u, -v), local(u, -v)], true, OBJECT);
            }
            canvas.end_titled();
        }
        for signal in &road.signals {
            let [x, y, _] = network.place(road, signal.s_m, signal.t_m).position_m;
            canvas.begin_titled(&format!("signal {} {} {}", signal.country, signal.kind, signal.name));
            canvas.circle(axes.at(x, y), 2.5, SIGNAL);
            canvas.end_titled();
        }
    }
}
