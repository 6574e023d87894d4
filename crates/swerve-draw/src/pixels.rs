//! Encoding as pixels.

use swerve_geom::math;
use tiny_skia::{FillRule, LineJoin, Mask, Paint, Path, PathBuilder, Pixmap, Stroke, StrokeDash, Transform};

use crate::canvas::{At, Element, Picture, Step, circle, rectangle, rounded};
use crate::color::{self, Color};
use crate::font::Font;
use crate::format::PictureError;
use crate::style::{RIM, Style, Text};

/// Image pixels per picture pixel, along a side.
const SCALE: f64 = 2.0;
/// Maximum side of an image at that scale; larger pictures are drawn one to one.
const SIDE_MAX: f64 = 16_384.0;
/// Maximum number of pixels of an image, four bytes each.
const PIXELS_MAX: f64 = 128.0 * 1024.0 * 1024.0;

impl Picture {
    /// Encodes as PNG.
    pub(crate) fn png(&self) -> Result<Vec<u8>, PictureError> {
        let (width, height) = self.size;
        let scale = if width.max(height) * SCALE <= SIDE_MAX { SCALE } else { 1.0 };
        let pixels = |side: f64| (side * scale).ceil();
        let (columns, rows) = (pixels(width), pixels(height));
        let fits = columns * rows <= PIXELS_MAX;
        let pixmap = fits.then(|| Pixmap::new(columns as u32, rows as u32)).flatten();
        let pixmap = pixmap.ok_or(PictureError::TooLarge { columns, rows })?;
        let (columns, rows) = (pixmap.width(), pixmap.height());
        let scale = scale as f32;
        let mut sheet = Sheet { pixmap, clips: Vec::new(), transform: Transform::from_scale(scale, scale) };
        sheet.draw(&rectangle((0.0, 0.0), self.size), Style::fill(color::PAPER));
        self.elements.iter().for_each(|element| sheet.element(element));
        // The background is opaque, so alpha is dropped.
        let opaque: Vec<u8> = sheet.pixmap.data().chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect();
        let mut file = Vec::new();
        let mut encoder = png::Encoder::new(&mut file, columns, rows);
        encoder.set_color(png::ColorType::Rgb);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(&opaque)?;
        writer.finish()?;
        Ok(file)
    }
}

/// An image under construction.
struct Sheet {
    pixmap: Pixmap,
    clips: Vec<Option<Mask>>,
    transform: Transform,
}

impl Sheet {
    fn element(&mut self, element: &Element) {
        match element {
            Element::Path(steps, style) => self.draw(steps, *style),
            Element::Circle(at, radius, style) => self.draw(&circle(*at, *radius), *style),
            Element::Rect(at, size, style) => self.draw(&rounded(*at, *size, style.corner), *style),
            Element::Text(at, turn_deg, text, how) => self.text((*at, *turn_deg), text, *how),
            Element::BeginClip(at, size) => self.begin_clip(*at, *size),
            Element::EndClip => _ = self.clips.pop(),
            Element::BeginTitled(_) | Element::EndTitled => {}
        }
    }

    fn text(&mut self, ((x, y), turn_deg): (At, f64), text: &str, how: Text) {
        let font = Font::of(how.bold);
        let (sin, cos) = math::sin_cos(turn_deg.to_radians());
        let before = how.anchor.share() * how.size * font.width(text);
        let outlines = font.outlines(text, (x - before * cos, y - before * sin), how.size, (sin, cos));
        if how.rim {
            self.draw(&outlines, RIM);
        }
        self.draw(&outlines, Style::fill(how.color));
    }

    fn begin_clip(&mut self, at: At, size: (f64, f64)) {
        let mask = path(&rectangle(at, size)).and_then(|path| {
            let mut mask = match self.clips.last() {
                Some(Some(outer)) => outer.clone(),
                _ => {
                    let mut all = Mask::new(self.pixmap.width(), self.pixmap.height())?;
                    all.invert();
                    all
                }
            };
            mask.intersect_path(&path, FillRule::Winding, true, self.transform);
            Some(mask)
        });
        self.clips.push(mask);
    }

    fn draw(&mut self, steps: &[Step], style: Style) {
        let Some(path) = path(steps) else { return };
        let mask = self.clips.last().and_then(Option::as_ref);
        if let Some(fill) = style.fill {
            let paint = paint(fill, style.fill_opacity);
            self.pixmap.fill_path(&path, &paint, FillRule::Winding, self.transform, mask);
        }
        if let Some(color) = style.stroke {
            let dash = style.dash.map(|length| length as f32).to_vec();
            let stroke = Stroke {
                width: style.width as f32,
                dash: style.is_dashed().then(|| StrokeDash::new(dash, 0.0)).flatten(),
                line_join: if style == RIM { LineJoin::Round } else { LineJoin::Miter },
                ..Stroke::default()
            };
            self.pixmap.stroke_path(
                &path,
                &paint(color, style.stroke_opacity),
                &stroke,
                self.transform,
                mask,
            );
        }
    }
}

fn paint(color: Color, opacity: f64) -> Paint<'static> {
    let [r, g, b] = color.0;
    let mut paint = Paint::default();
    paint.set_color_rgba8(r, g, b, (opacity * 255.0).round() as u8);
    paint
}

fn path(steps: &[Step]) -> Option<Path> {
    let mut path = PathBuilder::new();
    for step in steps {
        let f = |(x, y): At| (x as f32, y as f32);
        match *step {
            Step::Move(at) => path.move_to(f(at).0, f(at).1),
            Step::Line(at) => path.line_to(f(at).0, f(at).1),
            Step::Curve(a, b, to) => {
                let (a, b, to) = (f(a), f(b), f(to));
                path.cubic_to(a.0, a.1, b.0, b.1, to.0, to.1);
            }
            Step::Close => path.close(),
        }
    }
    path.finish()
}
