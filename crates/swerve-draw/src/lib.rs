//! The drawing kit of all pictures: one palette, one font, axes and legends; written as SVG, PDF or PNG.
//!
//! A [`Canvas`] takes shapes and texts and becomes a [`Picture`]. Nothing here knows what is drawn.

mod axes;
mod canvas;
pub mod color;
mod font;
mod format;
mod legend;
mod paged;
mod pixels;
mod style;
mod svg;
#[cfg(test)]
mod tests;

pub use axes::{Axes, multiples, number, round_step};
pub use canvas::{At, Canvas, Picture, Step};
pub use color::Color;
pub use font::{STACK, width_of};
pub use format::{Format, PictureError};
pub use legend::{Entry, Sign, legend, names_beside};
pub use style::{Anchor, Style, Text};
pub use svg::escape;
