//! Picture of a lane map: lanes filled by kind, their centre lines, the elements on them, a route.

use swerve_draw::{Picture, Style, color};
use swerve_map::{LaneKind, Map};

use super::{CONNECTION, begun, fill, finished};
use crate::draft::outline;
use crate::features;
use swerve_map::router::Way;

/// Draws a map in the ground plane, x to the right and y upwards, with a route if there is one.
pub fn draw(map: &Map, [x, y]: [[f64; 2]; 2], title: &str, way: Option<&Way>) -> Picture {
    let (mut canvas, axes) = begun([x, y, [0.0; 2]], title, way.is_some());
    for lane in map.lanes() {
        let style = Style::fill(fill(lane.kind)).outlined(color::PAPER, 0.5);
        canvas.path(outline(lane).iter().map(|p| axes.at(p.x_m, p.y_m)), true, style);
    }
    for lane in map.lanes().iter().filter(|lane| lane.kind == LaneKind::Driving) {
        canvas.path(lane.line.points().iter().map(|p| axes.at(p.x_m, p.y_m)), false, CONNECTION);
    }
    features::draw(&mut canvas, map, &axes);
    finished(canvas, &axes, (map, way), title)
}
