//! Drawing library of all pictures: one palette, one font, axes and legends; output as SVG, PDF or PNG.
//!
//! A [`Canvas`] collects shapes and texts and is finished to a [`Picture`]. The library is independent of the contents
//! of pictures.

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
