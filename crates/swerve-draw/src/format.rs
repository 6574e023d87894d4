//! File formats of pictures.

use core::fmt;
use core::str::FromStr;
use std::path::Path;

use crate::canvas::Picture;

/// File format of a picture.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default)]
pub enum Format {
    /// Scalable Vector Graphics, with tooltips.
    #[default]
    Svg,
    /// One page of PDF with embedded fonts.
    Pdf,
    /// PNG with twice the picture's size in pixels along each side.
    Png,
}

impl Format {
    /// All formats.
    pub const ALL: [Self; 3] = [Self::Svg, Self::Pdf, Self::Png];

    /// Name, which is also the file extension.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Svg => "svg",
            Self::Pdf => "pdf",
            Self::Png => "png",
        }
    }

    /// Format by file extension; `None` for other extensions.
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

/// Error while encoding a picture.
#[derive(Debug, thiserror::Error)]
pub enum PictureError {
    /// The picture has more pixels than an image can hold.
    #[error("a picture of {columns} x {rows} pixels is too large for a PNG")]
    TooLarge {
        /// Width, pixels.
        columns: f64,
        /// Height, pixels.
        rows: f64,
    },
    /// The PNG could not be encoded.
    #[error("no PNG: {0}")]
    Png(#[from] png::EncodingError),
}

impl Picture {
    /// Encodes the picture; the bytes are identical on every machine.
    ///
    /// # Errors
    /// See [`PictureError`].
    pub fn bytes(&self, format: Format) -> Result<Vec<u8>, PictureError> {
        match format {
            Format::Svg => Ok(self.svg().into_bytes()),
            Format::Pdf => Ok(self.pdf()),
            Format::Png => self.png(),
        }
    }

    /// Texts in the picture, in order.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        self.elements.iter().filter_map(|element| match element {
            crate::canvas::Element::Text(_, _, text, _) => Some(&**text),
            _ => None,
        })
    }
}
