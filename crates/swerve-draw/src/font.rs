//! The font: its name in SVG, its glyphs elsewhere.

use std::sync::LazyLock;

use ttf_parser::{Face, GlyphId};

use crate::canvas::{At, Step};
use crate::style::Text;

/// Font families of SVG and pages, of which a viewer uses the first it has; the one before the generic ones is embedded
/// here.
pub const STACK: &str = "Helvetica, Arial, Arimo, 'DejaVu Sans', sans-serif";

const REGULAR: &[u8] = include_bytes!("../fonts/Arimo-Regular.ttf");
const BOLD: &[u8] = include_bytes!("../fonts/Arimo-Bold.ttf");

/// Maximum width of a viewer's font relative to the embedded one.
const WIDER: f64 = 1.12;

/// An embedded font.
pub(crate) struct Font {
    pub(crate) bytes: &'static [u8],
    pub(crate) name: &'static str,
    pub(crate) face: Face<'static>,
    per_em: f64,
}

impl Font {
    fn new(bytes: &'static [u8], name: &'static str) -> Self {
        let face = Face::parse(bytes, 0).expect("the program's own font");
        Self { bytes, name, per_em: f64::from(face.units_per_em()), face }
    }

    /// Regular or bold font.
    pub(crate) fn of(bold: bool) -> &'static Self {
        static FONTS: LazyLock<[Font; 2]> =
            LazyLock::new(|| [Font::new(REGULAR, "Arimo"), Font::new(BOLD, "Arimo-Bold")]);
        &FONTS[usize::from(bold)]
    }

    /// Glyph of a character; an empty box if it is missing.
    pub(crate) fn glyph(&self, letter: char) -> GlyphId {
        let letter = if letter == '\u{a0}' { ' ' } else { letter };
        self.face.glyph_index(letter).unwrap_or_default()
    }

    /// Width of a glyph over the font size.
    pub(crate) fn advance(&self, glyph: GlyphId) -> f64 {
        f64::from(self.face.glyph_hor_advance(glyph).unwrap_or(0)) / self.per_em
    }

    /// Width of a text over the font size.
    pub(crate) fn width(&self, text: &str) -> f64 {
        text.chars().map(|letter| self.advance(self.glyph(letter))).sum()
    }

    /// Outlines of a text from a position on, with its baseline rotated clockwise, given as sine and cosine.
    pub(crate) fn outlines(&self, text: &str, (x, y): At, size: f64, (sin, cos): (f64, f64)) -> Vec<Step> {
        let mut pen = Pen {
            steps: Vec::new(),
            along: 0.0,
            scale: size / self.per_em,
            at: (x, y),
            turn: (sin, cos),
            last: (0.0, 0.0),
        };
        for letter in text.chars() {
            let glyph = self.glyph(letter);
            let _box_of_a_space = self.face.outline_glyph(glyph, &mut pen);
            pen.along += self.advance(glyph) * size;
        }
        pen.steps
    }
}

/// Appends glyph outlines.
struct Pen {
    steps: Vec<Step>,
    along: f64,
    scale: f64,
    at: At,
    turn: (f64, f64),
    /// Last position, in the glyph's units.
    last: (f32, f32),
}

impl Pen {
    fn place(&self, x: f32, y: f32) -> At {
        let (x, y) = (self.along + f64::from(x) * self.scale, -f64::from(y) * self.scale);
        let (sin, cos) = self.turn;
        (self.at.0 + x * cos - y * sin, self.at.1 + x * sin + y * cos)
    }
}

impl ttf_parser::OutlineBuilder for Pen {
    fn move_to(&mut self, x: f32, y: f32) {
        self.last = (x, y);
        self.steps.push(Step::Move(self.place(x, y)));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.last = (x, y);
        self.steps.push(Step::Line(self.place(x, y)));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let third = |a: f32, b: f32| a + (b - a) * (2.0 / 3.0);
        let (from, to) = (self.last, (x, y));
        let pull = |end: (f32, f32)| (third(end.0, x1), third(end.1, y1));
        let (a, b) = (pull(from), pull(to));
        self.curve_to(a.0, a.1, b.0, b.1, x, y);
    }

    fn curve_to(&mut self, x1: f32, y1: f32, x2: f32, y2: f32, x: f32, y: f32) {
        self.last = (x, y);
        self.steps.push(Step::Curve(self.place(x1, y1), self.place(x2, y2), self.place(x, y)));
    }

    fn close(&mut self) {
        self.steps.push(Step::Close);
    }
}

/// Width of a text in the embedded font, pixels. SVG states it with each text (`textLength`), so that it has the same
/// width in another font.
pub(crate) fn drawn_width(text: &str, how: Text) -> f64 {
    how.size * Font::of(how.bold).width(text)
}

/// Space for a text, pixels: its width with a margin for SVG viewers that ignore `textLength`.
pub fn width_of(text: &str, how: Text) -> f64 {
    WIDER * drawn_width(text, how)
}
