//! Legends.

use crate::canvas::{At, Canvas};
use crate::font::width_of;
use crate::style::{Style, Text};

/// Width of a symbol.
const SIGN: f64 = 24.0;
const TO_TEXT: f64 = 6.0;
const BETWEEN: f64 = 20.0;
const LINE: f64 = 20.0;

/// A symbol of a legend.
#[derive(Clone, Copy)]
pub enum Sign {
    /// A line.
    Line(Style),
    /// An area.
    Block(Style),
    /// Drawn around a position.
    Mark(fn(&mut Canvas, At)),
}

/// A symbol and its meaning.
pub type Entry = (Sign, String);

/// Draws lines with their names in a column beside a plot; returns its width.
pub fn names_beside(canvas: &mut Canvas, (left, top): At, lines: &[(Style, String)]) -> f64 {
    const ROW: f64 = 16.0;
    let mut most = 0.0_f64;
    for (k, (style, name)) in lines.iter().enumerate() {
        let y = top + 12.0 + ROW * k as f64;
        canvas.line((left, y - 4.0), (left + SIGN, y - 4.0), *style);
        canvas.text((left + SIGN + TO_TEXT, y), name, Text::PLAIN);
        most = most.max(width_of(name, Text::PLAIN));
    }
    SIGN + TO_TEXT + most
}

/// Draws entries side by side, in as many rows as they need up to the right edge; returns the height of the last row.
pub fn legend(canvas: &mut Canvas, (left, top): At, right: f64, entries: &[Entry]) -> f64 {
    let how = Text::PLAIN;
    let (mut x, mut y) = (left, top);
    for (sign, text) in entries {
        let width = SIGN + TO_TEXT + width_of(text, how) + BETWEEN;
        if x > left && x + width > right {
            (x, y) = (left, y + LINE);
        }
        match sign {
            Sign::Line(style) => canvas.line((x, y), (x + SIGN, y), *style),
            Sign::Block(style) => canvas.rect((x, y - 6.0), (SIGN, 12.0), *style),
            Sign::Mark(draw) => draw(canvas, (x + 0.5 * SIGN, y)),
        }
        canvas.text((x + SIGN + TO_TEXT, y + 4.0), text, how);
        x += width;
    }
    y
}
