//! Outlines of road users.

use swerve_draw::{Canvas, Style};
use swerve_geom::Obb;

use super::record::Shape;
use super::view::View;

/// Draws a road user at its pose.
pub(super) fn shape(canvas: &mut Canvas, view: &View, shape: &Shape, style: Style) {
    match shape {
        Shape::Circle(center, radius_m) => {
            canvas.circle(view.at(*center), (radius_m * view.scale).max(2.5), style);
        }
        Shape::Box(obb) => outline(canvas, view, obb, style),
    }
}

/// Draws a rectangle.
pub(super) fn outline(canvas: &mut Canvas, view: &View, obb: &Obb, style: Style) {
    canvas.path(obb.corners().map(|corner| view.at(corner)), true, style);
}
