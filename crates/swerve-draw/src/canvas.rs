//! Shapes and texts in drawing order.

use swerve_geom::math;

use crate::style::{Style, Text};

/// A position in the picture, pixels from its top left corner.
pub type At = (f64, f64);

/// A step of an outline.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Step {
    /// Starts a line.
    Move(At),
    /// Straight line to a position.
    Line(At),
    /// Cubic Bézier curve: two control points and the end.
    Curve(At, At, At),
    /// Closes the line.
    Close,
}

/// An element of a picture.
#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Element {
    Path(Vec<Step>, Style),
    Circle(At, f64, Style),
    Rect(At, (f64, f64), Style),
    /// A text with its baseline at a position, rotated clockwise about it by degrees.
    Text(At, f64, String, Text),
    BeginClip(At, (f64, f64)),
    EndClip,
    BeginTitled(String),
    EndTitled,
}

/// A picture under construction.
#[derive(Default)]
pub struct Canvas {
    elements: Vec<Element>,
}

/// A picture.
#[derive(Clone, PartialEq, Debug)]
pub struct Picture {
    pub(crate) size: (f64, f64),
    pub(crate) title: String,
    pub(crate) elements: Vec<Element>,
}

impl Canvas {
    /// Finishes the picture.
    pub fn finish(self, width: f64, height: f64, title: &str) -> Picture {
        Picture { size: (width, height), title: title.to_owned(), elements: self.elements }
    }

    /// Adds an open or closed line through points.
    pub fn path(&mut self, points: impl IntoIterator<Item = At>, closed: bool, style: Style) {
        let mut steps: Vec<Step> = Vec::new();
        for at in points {
            steps.push(if steps.is_empty() { Step::Move(at) } else { Step::Line(at) });
        }
        if closed && !steps.is_empty() {
            steps.push(Step::Close);
        }
        self.outline(steps, style);
    }

    /// Adds a line of straight and curved steps.
    pub fn outline(&mut self, steps: Vec<Step>, style: Style) {
        if !steps.is_empty() {
            self.elements.push(Element::Path(steps, style));
        }
    }

    /// Adds a straight line.
    pub fn line(&mut self, from: At, to: At, style: Style) {
        self.path([from, to], false, style);
    }

    /// Adds an arrow head with its tip at a position, pointing in a direction (radians, clockwise from the right).
    pub fn arrow_head(&mut self, (x, y): At, direction: f64, style: Style) {
        const LENGTH: f64 = 8.0;
        let wing = |turn: f64| {
            let (sin, cos) = math::sin_cos(direction + turn);
            (x - LENGTH * cos, y - LENGTH * sin)
        };
        self.path([wing(0.4), (x, y), wing(-0.4)], true, style);
    }

    /// Adds a circle around a position.
    pub fn circle(&mut self, at: At, radius: f64, style: Style) {
        self.elements.push(Element::Circle(at, radius, style));
    }

    /// Adds a rectangle: top left corner, width and height.
    pub fn rect(&mut self, at: At, size: (f64, f64), style: Style) {
        self.elements.push(Element::Rect(at, size, style));
    }

    /// Adds diagonal hatching over a rectangle, which is distinguishable without colour.
    pub fn hatch(&mut self, (x, y): At, (width, height): (f64, f64), style: Style) {
        const GAP: f64 = 6.0;
        self.begin_clip((x, y), (width, height));
        let lines = ((width + height) / GAP).ceil() as usize;
        for k in 1..=lines {
            let along = GAP * k as f64;
            self.line((x + along, y), (x + along - height, y + height), style);
        }
        self.end_clip();
    }

    /// Adds an eight-pointed star.
    pub fn star(&mut self, (x, y): At, radius: f64, style: Style) {
        let spike = |k: u32| {
            let r = if k.is_multiple_of(2) { radius } else { 0.45 * radius };
            let (sin, cos) = math::sin_cos(f64::from(k) * core::f64::consts::FRAC_PI_8);
            (x + r * cos, y + r * sin)
        };
        self.path((0..16).map(spike), true, style);
    }

    /// Adds a text with its baseline at a position.
    pub fn text(&mut self, at: At, text: &str, how: Text) {
        self.turned_text(at, 0.0, text, how);
    }

    /// Adds a text rotated clockwise about its position.
    pub fn turned_text(&mut self, at: At, turn_deg: f64, text: &str, how: Text) {
        self.elements.push(Element::Text(at, turn_deg, text.to_owned(), how));
    }

    /// Clips everything drawn until [`end_clip`](Self::end_clip) to a rectangle.
    pub fn begin_clip(&mut self, at: At, size: (f64, f64)) {
        self.elements.push(Element::BeginClip(at, size));
    }

    /// Ends the last clip.
    pub fn end_clip(&mut self) {
        self.elements.push(Element::EndClip);
    }

    /// Gives everything drawn until [`end_titled`](Self::end_titled) this tooltip, in SVG.
    pub fn begin_titled(&mut self, title: &str) {
        self.elements.push(Element::BeginTitled(title.to_owned()));
    }

    /// Ends the last title.
    pub fn end_titled(&mut self) {
        self.elements.push(Element::EndTitled);
    }
}

/// Distance of the control points of a quarter circle from its ends, over the radius.
const QUARTER: f64 = 0.552_284_75;

/// Outline of a circle.
pub(crate) fn circle((x, y): At, r: f64) -> Vec<Step> {
    rounded((x - r, y - r), (2.0 * r, 2.0 * r), r)
}

/// Outline of a rectangle.
pub(crate) fn rectangle((x, y): At, (w, h): (f64, f64)) -> Vec<Step> {
    let corners = [(x, y), (x + w, y), (x + w, y + h), (x, y + h)];
    let [first, others @ ..] = corners;
    let others = others.map(Step::Line);
    [Step::Move(first)].into_iter().chain(others).chain([Step::Close]).collect()
}

/// Outline of a rectangle with rounded corners.
pub(crate) fn rounded((x, y): At, (w, h): (f64, f64), radius: f64) -> Vec<Step> {
    let r = radius.min(0.5 * w).min(0.5 * h);
    if r <= 0.0 {
        return rectangle((x, y), (w, h));
    }
    let (right, bottom, k) = (x + w, y + h, r * (1.0 - QUARTER));
    vec![
        Step::Move((x + r, y)),
        Step::Line((right - r, y)),
        Step::Curve((right - k, y), (right, y + k), (right, y + r)),
        Step::Line((right, bottom - r)),
        Step::Curve((right, bottom - k), (right - k, bottom), (right - r, bottom)),
        Step::Line((x + r, bottom)),
        Step::Curve((x + k, bottom), (x, bottom - k), (x, bottom - r)),
        Step::Line((x, y + r)),
        Step::Curve((x, y + k), (x + k, y), (x + r, y)),
        Step::Close,
    ]
}
