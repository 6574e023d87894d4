//! Picture of a lane map: lanes filled by kind, their centre lines, the elements on them, a route.

use swerve_draw::{Canvas, Picture, Style, Text, color, legend};
use swerve_map::{LaneKind, Map};

use super::{BOTTOM, CONNECTION, LEFT, RIGHT, WIDTH, axes, entries, fill};
use crate::draft::outline;
use crate::features;
use crate::route::Way;

/// Draws a map in the ground plane, x to the right and y upwards, with a route if there is one.
pub fn draw(map: &Map, [x, y]: [[f64; 2]; 2], title: &str, way: Option<&Way>) -> Picture {
    let mut canvas = Canvas::default();
    let axes = axes([x, y, [0.0; 2]]);
    canvas.text((LEFT, 28.0), title, Text::TITLE);
    legend(&mut canvas, (LEFT, 50.0), WIDTH - RIGHT, &entries(way.is_some()));
    axes.ground(&mut canvas);
    axes.grid(&mut canvas, (12.0, 8.0));
    canvas.begin_clip(axes.corner, axes.size);
    for lane in map.lanes() {
        let style = Style::fill(fill(lane.kind)).outlined(color::PAPER, 0.5);
        canvas.path(outline(lane).iter().map(|p| axes.at(p.x_m, p.y_m)), true, style);
    }
    for lane in map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving) {
        canvas.path(lane.line.points().iter().map(|p| axes.at(p.x_m, p.y_m)), false, CONNECTION);
    }
    features::draw(&mut canvas, map, &axes);
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
