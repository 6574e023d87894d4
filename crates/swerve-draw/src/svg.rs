//! Encoding as SVG: texts are escaped, numbers rounded.

use core::fmt::Write;

use crate::axes::number;
use crate::canvas::{Element, Picture, Step};
use crate::color;
use crate::font::{STACK, drawn_width};
use crate::style::{Anchor, RIM, Style, Text};

impl Picture {
    /// Encodes as SVG.
    pub fn svg(&self) -> String {
        let (w, h) = (number(self.size.0), number(self.size.1));
        let mut out = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}\" height=\"{h}\" viewBox=\"0 0 {w} {h}\" \
             font-family=\"{STACK}\">\n<title>{}</title>\n<rect width=\"{w}\" height=\"{h}\" fill=\"{}\"/>\n",
            escape(&self.title),
            color::PAPER,
        );
        let mut clips = 0;
        for element in &self.elements {
            out += &as_svg(element, &mut clips);
            out.push('\n');
        }
        out + "</svg>\n"
    }
}

fn as_svg(element: &Element, clips: &mut usize) -> String {
    match element {
        Element::Path(steps, style) => format!("<path d=\"{}\" {}/>", path(steps), attributes(style)),
        Element::Circle((x, y), r, style) => {
            let (x, y, r) = (number(*x), number(*y), number(*r));
            format!("<circle cx=\"{x}\" cy=\"{y}\" r=\"{r}\" {}/>", attributes(style))
        }
        Element::Rect((x, y), (w, h), style) => {
            let (x, y, w, h) = (number(*x), number(*y), number(*w), number(*h));
            format!("<rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\" {}/>", attributes(style))
        }
        Element::Text(at, turn_deg, text, how) => self::text((*at, *turn_deg), text, *how),
        Element::BeginClip((x, y), (w, h)) => {
            *clips += 1;
            let (x, y, w, h) = (number(*x), number(*y), number(*w), number(*h));
            format!(
                "<clipPath id=\"clip{clips}\"><rect x=\"{x}\" y=\"{y}\" width=\"{w}\" height=\"{h}\"/></clipPath>\n\
                 <g clip-path=\"url(#clip{clips})\">"
            )
        }
        Element::BeginTitled(title) => format!("<g><title>{}</title>", escape(title)),
        Element::EndClip | Element::EndTitled => "</g>".to_owned(),
    }
}

fn path(steps: &[Step]) -> String {
    let mut d = String::new();
    let at = |(x, y): (f64, f64)| format!("{} {}", number(x), number(y));
    for step in steps {
        let _infallible = match *step {
            Step::Move(to) => write!(d, "M{}", at(to)),
            Step::Line(to) => write!(d, "L{}", at(to)),
            Step::Curve(a, b, to) => write!(d, "C{} {} {}", at(a), at(b), at(to)),
            Step::Close => write!(d, "Z"),
        };
    }
    d
}

fn attributes(style: &Style) -> String {
    let mut out = Vec::new();
    if style.corner > 0.0 {
        out.push(format!("rx=\"{}\"", number(style.corner)));
    }
    match style.fill {
        Some(fill) => out.push(format!("fill=\"{fill}\"")),
        None => out.push("fill=\"none\"".to_owned()),
    }
    if style.fill.is_some() && style.fill_opacity < 1.0 {
        out.push(format!("fill-opacity=\"{}\"", number(style.fill_opacity)));
    }
    if let Some(stroke) = style.stroke {
        out.push(format!("stroke=\"{stroke}\" stroke-width=\"{}\"", number(style.width)));
        if style.stroke_opacity < 1.0 {
            out.push(format!("stroke-opacity=\"{}\"", number(style.stroke_opacity)));
        }
        if style.is_dashed() {
            let [a, b, c, d] = style.dash;
            let shown = if (a, b) == (c, d) { &style.dash[..2] } else { &style.dash[..] };
            let shown: Vec<String> = shown.iter().map(|length| number(*length)).collect();
            out.push(format!("stroke-dasharray=\"{}\"", shown.join(" ")));
        }
    }
    out.join(" ")
}

fn text(((x, y), turn_deg): ((f64, f64), f64), text: &str, how: Text) -> String {
    let anchor = match how.anchor {
        Anchor::Start => "start",
        Anchor::Middle => "middle",
        Anchor::End => "end",
    };
    let length = number(drawn_width(text, how));
    let (x, y, size) = (number(x), number(y), number(how.size));
    let weight = if how.bold { " font-weight=\"bold\"" } else { "" };
    let turn = match turn_deg {
        0.0 => String::new(),
        turn_deg => format!(" transform=\"rotate({} {x} {y})\"", number(turn_deg)),
    };
    // The width assumed by the layout, in any font.
    let head = format!(
        "<text x=\"{x}\" y=\"{y}\" font-size=\"{size}\" text-anchor=\"{anchor}\"{weight}{turn} \
         textLength=\"{length}\" lengthAdjust=\"spacingAndGlyphs\""
    );
    let text = escape(text);
    let written = format!("{head} fill=\"{}\">{text}</text>", how.color);
    if !how.rim {
        return written;
    }
    format!("{head} {} stroke-linejoin=\"round\">{text}</text>\n{written}", attributes(&RIM))
}

/// Escapes a text for XML. Characters that XML cannot represent become U+FFFD (XML 1.0, section 2.2).
pub fn escape(text: &str) -> String {
    let is_refused =
        |c: char| c.is_ascii_control() && !"\t\n\r".contains(c) || matches!(c, '\u{fffe}' | '\u{ffff}');
    text.replace(is_refused, "\u{fffd}")
        .replace('&', "&amp;")
        .replace('<', "&lt;")
        .replace('>', "&gt;")
        .replace('"', "&quot;")
}
