//! The forms that pictures are written in.

use core::fmt;
use core::str::FromStr;
use std::path::Path;

use crate::canvas::Picture;

/// A form of a picture's file.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Format {
    /// Scalable Vector Graphics, with titles on what is pointed at.
    #[default]
    Svg,
    /// One page of PDF, its letters embedded.
    Pdf,
    /// Pixels, twice as many as the picture's size either way.
    Png,
}

impl Format {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Svg, Self::Pdf, Self::Png];

    /// Its name, which is also how its files end.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Pdf => "pdf",
            Self::Png => "png",
        }
    }

    /// That of a file by how its name ends; none where it ends otherwise.
    pub fn of(path: &Path) -> Option<Self> {
        let end = path.extension()?.to_str()?.to_ascii_lowercase();
        Self::ALL.into_iter().find(|format| format.name() == end)
    }
}

impl fmt::Display for Format {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Format {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let found = Self::ALL.into_iter().find(|format| format.name() == name);
        found.ok_or_else(|| "expected one of svg, pdf, png".to_owned())
    }
}

/// Why a picture has no file of a form.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// It has more pixels than an image can hold.
    #[error("a picture of {columns} x {rows} pixels is too large for a PNG")]
    TooLarge {
        /// Its width, pixels.
        columns: f64,
        /// Its height, pixels.
        rows: f64,
    },
    /// The pixels could not be written.
    #[error("no PNG: {0}")]
    Png(#[from] png::EncodingError),
}

impl Picture {
    /// The picture's file in a form; the same bytes on every machine.
    ///
    /// # Errors
    /// As [`PictureError`] says.
    pub fn bytes(&self, format: Format) -> Result<Vec<u8>, PictureError> {
        match format {
            Format::Svg => Ok(self.svg().into_bytes()),
            Format::Pdf => Ok(self.pdf()),
            Format::Png => self.png(),
        }
    }

    /// The texts in it, in order.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        self.elements.iter().filter_map(|element| match element {
            crate::canvas::Element::Text(_, _, text, _) => Some(&**text),
            _ => None,
        })
    }
}
