//! Encoding as one page of PDF.

use std::collections::BTreeMap;

use miniz_oxide::deflate::compress_to_vec_zlib;
use pdf_writer::types::{CidFontType, FontFlags, LineJoinStyle, SystemInfo, TextRenderingMode, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};
use swerve_geom::math;

use crate::canvas::{At, Element, Picture, Step, circle, rectangle, rounded};
use crate::color::{self, Color};
use crate::font::Font;
use crate::style::{RIM, Style, Text};

/// PDF points (1/72 inch) per pixel (1/96 inch).
const POINT: f64 = 0.75;
const LEVEL: u8 = 9;

const CATALOG: Ref = Ref::new(1);
const PAGES: Ref = Ref::new(2);
const PAGE: Ref = Ref::new(3);
const CONTENT: Ref = Ref::new(4);
const INFO: Ref = Ref::new(5);
/// First of the five objects of each font.
const FONTS: [i32; 2] = [10, 20];
const STATES: i32 = 30;

impl Picture {
    /// Encodes as PDF.
    pub(crate) fn pdf(&self) -> Vec<u8> {
        let (width, height) = (self.size.0 * POINT, self.size.1 * POINT);
        let mut sheet = Sheet { content: Content::new(), states: BTreeMap::new() };
        // Downwards, in pixels.
        sheet.content.transform([POINT, 0.0, 0.0, -POINT, 0.0, height].map(|x| x as f32));
        sheet.draw(&rectangle((0.0, 0.0), self.size), Style::fill(color::PAPER));
        self.elements.iter().for_each(|element| sheet.element(element));
        let Sheet { content, states } = sheet;
        let mut pdf = Pdf::new();
        pdf.catalog(CATALOG).pages(PAGES);
        pdf.pages(PAGES).kids([PAGE]).count(1);
        pdf.document_info(INFO).title(TextStr(&self.title));
        let mut page = pdf.page(PAGE);
        page.media_box(Rect::new(0.0, 0.0, width as f32, height as f32)).parent(PAGES).contents(CONTENT);
        let mut resources = page.resources();
        let mut fonts = resources.fonts();
        fonts.pair(font_name(false), Ref::new(FONTS[0])).pair(font_name(true), Ref::new(FONTS[1]));
        fonts.finish();
        let mut all = resources.ext_g_states();
        for &number in states.values() {
            all.pair(Name(state_name(number).as_bytes()), Ref::new(STATES + number));
        }
        all.finish();
        resources.finish();
        page.finish();
        let content = compress_to_vec_zlib(&content.finish(), LEVEL);
        pdf.stream(CONTENT, &content).filter(Filter::FlateDecode);
        for ((fill, stroke), number) in states {
            let mut state = pdf.ext_graphics(Ref::new(STATES + number));
            state.non_stroking_alpha(f32::from(fill) / 1000.0).stroking_alpha(f32::from(stroke) / 1000.0);
        }
        embed(&mut pdf, Font::of(false), FONTS[0]);
        embed(&mut pdf, Font::of(true), FONTS[1]);
        pdf.finish()
    }
}

fn font_name(bold: bool) -> Name<'static> {
    Name(if bold { b"Bold" } else { b"Regular" })
}

fn state_name(number: i32) -> String {
    format!("Alpha{number}")
}

/// A page under construction.
struct Sheet {
    content: Content,
    /// Opacities of areas and lines, in thousandths, with their numbers.
    states: BTreeMap<(u16, u16), i32>,
}

impl Sheet {
    fn element(&mut self, element: &Element) {
        match element {
            Element::Path(steps, style) => self.draw(steps, *style),
            Element::Circle(at, radius, style) => self.draw(&circle(*at, *radius), *style),
            Element::Rect(at, size, style) => self.draw(&rounded(*at, *size, style.corner), *style),
            Element::Text(at, turn_deg, text, how) => self.text((*at, *turn_deg), text, *how),
            Element::BeginClip(at, size) => {
                self.content.save_state();
                self.steps(&rectangle(*at, *size));
                self.content.clip_nonzero().end_path();
            }
            Element::EndClip => _ = self.content.restore_state(),
            Element::BeginTitled(_) | Element::EndTitled => {}
        }
    }

    fn opacity(&mut self, fill: f64, stroke: f64) {
        let thousandths = |opacity: f64| (opacity * 1000.0).round() as u16;
        let next = self.states.len() as i32;
        let number = *self.states.entry((thousandths(fill), thousandths(stroke))).or_insert(next);
        self.content.set_parameters(Name(state_name(number).as_bytes()));
    }

    fn steps(&mut self, steps: &[Step]) {
        let f = |(x, y): At| (x as f32, y as f32);
        for step in steps {
            match *step {
                Step::Move(at) => self.content.move_to(f(at).0, f(at).1),
                Step::Line(at) => self.content.line_to(f(at).0, f(at).1),
                Step::Curve(a, b, to) => {
                    let (a, b, to) = (f(a), f(b), f(to));
                    self.content.cubic_to(a.0, a.1, b.0, b.1, to.0, to.1)
                }
                Step::Close => self.content.close_path(),
            };
        }
    }

    fn stroke_as(&mut self, color: Color, style: &Style) {
        let [r, g, b] = parts(color);
        self.content.set_stroke_rgb(r, g, b).set_line_width(style.width as f32);
        let dash: &[f64] = if style.is_dashed() { &style.dash } else { &[] };
        self.content.set_dash_pattern(dash.iter().map(|length| *length as f32), 0.0);
    }

    fn draw(&mut self, steps: &[Step], style: Style) {
        self.opacity(style.fill_opacity, style.stroke_opacity);
        if let Some(fill) = style.fill {
            let [r, g, b] = parts(fill);
            self.content.set_fill_rgb(r, g, b);
        }
        if let Some(color) = style.stroke {
            self.stroke_as(color, &style);
        }
        self.steps(steps);
        match (style.fill, style.stroke) {
            (Some(_), Some(_)) => self.content.fill_nonzero_and_stroke(),
            (Some(_), None) => self.content.fill_nonzero(),
            (None, Some(_)) => self.content.stroke(),
            (None, None) => self.content.end_path(),
        };
    }

    fn text(&mut self, ((x, y), turn_deg): (At, f64), text: &str, how: Text) {
        let font = Font::of(how.bold);
        let (sin, cos) = math::sin_cos(turn_deg.to_radians());
        let before = how.anchor.share() * how.size * font.width(text);
        let glyphs: Vec<u8> = text.chars().flat_map(|letter| font.glyph(letter).0.to_be_bytes()).collect();
        // The page is flipped vertically; letters are flipped back.
        let matrix = [cos, sin, sin, -cos, x - before * cos, y - before * sin].map(|x| x as f32);
        let [r, g, b] = parts(how.color);
        for is_rim in [true, false] {
            if is_rim && !how.rim {
                continue;
            }
            if is_rim {
                self.opacity(1.0, RIM.stroke_opacity);
                self.stroke_as(color::PAPER, &RIM);
                self.content.set_line_join(LineJoinStyle::RoundJoin);
            } else {
                self.opacity(1.0, 1.0);
                self.content.set_fill_rgb(r, g, b);
            }
            let mode = if is_rim { TextRenderingMode::Stroke } else { TextRenderingMode::Fill };
            self.content.begin_text().set_text_rendering_mode(mode);
            self.content.set_font(font_name(how.bold), how.size as f32).set_text_matrix(matrix);
            self.content.show(Str(&glyphs)).end_text();
            if is_rim {
                self.content.set_line_join(LineJoinStyle::MiterJoin);
            }
        }
    }
}

fn parts(color: Color) -> [f32; 3] {
    color.0.map(|part| f32::from(part) / 255.0)
}

/// Embeds a font: five objects from `first` on.
fn embed(pdf: &mut Pdf, font: &Font, first: i32) {
    let [whole, letters, descriptor, meanings, data] = [0, 1, 2, 3, 4].map(|k| Ref::new(first + k));
    let name = Name(font.name.as_bytes());
    let info = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };
    let mut type0 = pdf.type0_font(whole);
    type0.base_font(name).encoding_predefined(Name(b"Identity-H"));
    type0.descendant_font(letters).to_unicode(meanings);
    type0.finish();
    let mut cid = pdf.cid_font(letters);
    cid.subtype(CidFontType::Type2).base_font(name).system_info(info);
    cid.font_descriptor(descriptor).cid_to_gid_map_predefined(Name(b"Identity"));
    let widths = (0..font.face.number_of_glyphs())
        .map(|glyph| (1000.0 * font.advance(ttf_parser::GlyphId(glyph))) as f32);
    cid.widths().consecutive(0, widths);
    cid.finish();
    let thousandths = |units: i16| f32::from(units) * 1000.0 / f32::from(font.face.units_per_em());
    let bounds = font.face.global_bounding_box();
    let [left, bottom, right, top] =
        [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(thousandths);
    let mut about = pdf.font_descriptor(descriptor);
    about.name(name).flags(FontFlags::NON_SYMBOLIC).bbox(Rect::new(left, bottom, right, top));
    about.italic_angle(0.0).ascent(thousandths(font.face.ascender()));
    about.descent(thousandths(font.face.descender()));
    about.cap_height(thousandths(font.face.capital_height().unwrap_or(font.face.ascender())));
    about.stem_v(80.0).font_file2(data);
    about.finish();
    let mut cmap = UnicodeCmap::new(Name(b"Letters"), info);
    for (glyph, letter) in meanings_of(font) {
        cmap.pair(glyph, letter);
    }
    pdf.cmap(meanings, &cmap.finish());
    let packed = compress_to_vec_zlib(font.bytes, LEVEL);
    pdf.stream(data, &packed).filter(Filter::FlateDecode).pair(Name(b"Length1"), font.bytes.len() as i32);
}

/// Character of each glyph, so that texts can be searched and copied; of several the first.
fn meanings_of(font: &Font) -> BTreeMap<u16, char> {
    let mut meanings = BTreeMap::new();
    for letter in ('\u{20}'..='\u{2265}').filter(|letter| font.face.glyph_index(*letter).is_some()) {
        meanings.entry(font.glyph(letter).0).or_insert(letter);
    }
    meanings
}
