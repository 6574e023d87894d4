//! A small SVG writer: shapes and text, every text escaped, every number rounded.

use std::fmt::Write;

use swerve_geom::math;

/// Okabe and Ito's colours, which the colour-blind can tell apart, and greys.
#[expect(missing_docs, reason = "their names say it")]
pub mod color {
    pub const EGO: &str = "#0072B2";
    pub const PERSON: &str = "#D55E00";
    pub const VEHICLE: &str = "#6F7781";
    pub const PLAN: &str = "#009E73";
    pub const FALLBACK: &str = "#CC79A7";
    pub const SIGHT: &str = "#C98A00";
    pub const ALARM: &str = "#B00020";
    pub const STOPPED: &str = "#6A4FA3";
    pub const STOPPED_LIGHT: &str = "#C3B1E1";
    pub const LEFT_ROAD: &str = "#A14A00";
    pub const TRACK: &str = "#7B3FA0";
    pub const INK: &str = "#1F2328";
    pub const SOFT: &str = "#5B636D";
    pub const GRID: &str = "#D9DDE2";
    pub const GROUND: &str = "#F4F3EF";
    pub const ROAD: &str = "#E6E8EB";
    pub const ROAD_EDGE: &str = "#7A828C";
    pub const LANE: &str = "#FFFFFF";
}

/// A place in the figure, pixels from its top left corner.
pub type At = (f64, f64);

/// How a text stands.
#[derive(Clone, Copy)]
pub struct Text<'a> {
    /// Height, pixels.
    pub size: f64,
    /// Its colour.
    pub color: &'a str,
    /// `start`, `middle` or `end`.
    pub anchor: &'a str,
    /// Whether in bold letters.
    pub bold: bool,
    /// Whether a light rim sets it off from what is below.
    pub rim: bool,
}

impl Default for Text<'_> {
    fn default() -> Self {
        Self { size: 12.0, color: color::INK, anchor: "start", bold: false, rim: false }
    }
}

/// The figure under construction.
#[derive(Default)]
pub struct Canvas {
    body: String,
    clips: usize,
}

impl Canvas {
    /// The finished figure.
    pub fn finish(self, width: f64, height: f64, title: &str) -> String {
        format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"Helvetica, Arial, 'DejaVu Sans', sans-serif\">\n<title>{title}</title>\n\
             <rect width=\"{w}\" height=\"{h}\" fill=\"#FFFFFF\"/>\n{body}</svg>\n",
            w = number(width),
            h = number(height),
            title = escape(title),
            body = self.body,
        )
    }

    /// An open or closed line; `style` is SVG attributes of our own making.
    pub fn path(&mut self, points: impl IntoIterator<Item = At>, closed: bool, style: &str) {
        let mut d = String::new();
        for (k, (x, y)) in points.into_iter().enumerate() {
            let command = if k == 0 { 'M' } else { 'L' };
            let _infallible = write!(d, "{command}{} {}", number(x), number(y));
        }
        if !d.is_empty() {
            let close = if closed { "Z" } else { "" };
            self.push(format_args!("<path d=\"{d}{close}\" {style}/>"));
        }
    }

    /// A straight line.
    pub fn line(&mut self, from: At, to: At, style: &str) {
        self.path([from, to], false, style);
    }

    /// A circle about a place.
    pub fn circle(&mut self, (x, y): At, radius: f64, style: &str) {
        let (x, y, r) = (number(x), number(y), number(radius));
        self.push(format_args!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" {style}/>"));
    }

    /// A rectangle: its top left corner, its width and height.
    pub fn rect(&mut self, (x, y): At, (width, height): (f64, f64), style: &str) {
        let (x, y, w, h) = (number(x), number(y), number(width), number(height));
        self.push(format_args!("<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" {style}/>"));
    }

    /// A star with eight points.
    pub fn star(&mut self, (x, y): At, radius: f64, style: &str) {
        let spike = |k: u32| {
            let r = if k.is_multiple_of(2) { radius } else { 0.45 * radius };
            let (sin, cos) = math::sin_cos(f64::from(k) * core::f64::consts::FRAC_PI_8);
            (x + r * cos, y + r * sin)
        };
        self.path((0..16).map(spike), true, style);
    }

    /// A text, its base line at a place.
    pub fn text(&mut self, at: At, text: &str, how: Text<'_>) {
        self.turned_text(at, 0.0, text, how);
    }

    /// A text that is turned about its place, clockwise.
    pub fn turned_text(&mut self, (x, y): At, turn_deg: f64, text: &str, how: Text<'_>) {
        let weight = if how.bold { " font-weight=\"bold\"" } else { "" };
        let turn = if turn_deg == 0.0 {
            String::new()
        } else {
            format!(" transform=\"rotate({} {} {})\"", number(turn_deg), number(x), number(y))
        };
        let head = format!(
            "<text x=\"{}\" y=\"{}\" font-size=\"{}\" text-anchor=\"{}\"{weight}{turn}",
            number(x),
            number(y),
            number(how.size),
            how.anchor
        );
        let text = escape(text);
        if how.rim {
            let rim = "fill=\"#FFFFFF\" stroke=\"#FFFFFF\" stroke-width=\"3\" stroke-linejoin=\"round\" \
                       stroke-opacity=\"0.85\"";
            self.push(format_args!("{head} {rim}>{text}</text>"));
        }
        self.push(format_args!("{head} fill=\"{}\">{text}</text>", how.color));
    }

    /// Whatever is drawn until [`end_clip`](Self::end_clip) shows only inside a rectangle.
    pub fn begin_clip(&mut self, at: At, size: (f64, f64)) {
        self.clips += 1;
        let id = self.clips;
        self.push(format_args!("<clipPath id=\"clip{id}\">"));
        self.rect(at, size, "");
        self.push(format_args!("</clipPath>\n<g clip-path=\"url(#clip{id})\">"));
    }

    /// Ends the clip that was begun last.
    pub fn end_clip(&mut self) {
        self.push(format_args!("</g>"));
    }

    /// Whatever is drawn until [`end_titled`](Self::end_titled) tells this when it is pointed at.
    pub fn begin_titled(&mut self, title: &str) {
        self.push(format_args!("<g><title>{}</title>", escape(title)));
    }

    /// Ends what was begun last.
    pub fn end_titled(&mut self) {
        self.push(format_args!("</g>"));
    }

    fn push(&mut self, element: core::fmt::Arguments<'_>) {
        let _infallible = writeln!(self.body, "{element}");
    }
}

/// A number with at most two decimals, and none where none are needed.
pub fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let short = text.trim_end_matches('0').trim_end_matches('.');
    if short == "-0" { "0".into() } else { short.into() }
}

/// Width of a text, pixels, rather too much than too little.
pub fn width_of(text: &str, how: Text<'_>) -> f64 {
    let each = if how.bold { 0.6 } else { 0.55 };
    each * how.size * text.chars().count() as f64
}

/// A text as it stands in XML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// A round step (1, 2 or 5 times a power of ten) that divides `range` into about `parts`.
pub fn round_step(range: f64, parts: f64) -> f64 {
    let raw = (range / parts).max(1e-9);
    let mut step = 1e-9;
    while step * 10.0 <= raw {
        step *= 10.0;
    }
    [1.0, 2.0, 5.0, 10.0].map(|m| m * step).into_iter().find(|s| *s >= raw * 0.999).unwrap_or(10.0 * step)
}

/// The multiples of `step` within a range.
pub fn multiples(low: f64, high: f64, step: f64) -> impl Iterator<Item = f64> {
    let (first, last) = ((low / step - 1e-9).ceil() as i64, (high / step + 1e-9).floor() as i64);
    (first..=last).map(move |k| k as f64 * step)
}
