use thiserror::Error;

/// Image with one value per pixel, row by row from the top left.
///
/// Owns its memory, which [`Plane::reset`] reuses.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Plane<T> {
    width: usize,
    height: usize,
    pixels: Vec<T>,
}

/// Borrowed image with one byte each of red, green and blue (sRGB), row by row from the top left.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Rgb<'a> {
    width: usize,
    height: usize,
    bytes: &'a [u8],
}

/// Mismatch of an image's size and its number of values.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Error)]
#[error("{found} numbers for an image of {width} x {height} pixels, expected {expected}")]
pub struct ImageError {
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
    /// Number of values required by the size.
    pub expected: usize,
    /// Number of values given.
    pub found: usize,
}

fn sized(width: usize, height: usize, each: usize, found: usize) -> Result<(), ImageError> {
    let expected = width.saturating_mul(height).saturating_mul(each);
    if expected == found { Ok(()) } else { Err(ImageError { width, height, expected, found }) }
}

impl<T: Copy + Default> Plane<T> {
    /// Image of this size, all zero.
    pub fn new(width: usize, height: usize) -> Self {
        Self { width, height, pixels: vec![T::default(); width * height] }
    }

    /// Image of this size from its pixels.
    ///
    /// # Errors
    /// If the number of pixels does not match the size.
    pub fn from_pixels(width: usize, height: usize, pixels: Vec<T>) -> Result<Self, ImageError> {
        sized(width, height, 1, pixels.len())?;
        Ok(Self { width, height, pixels })
    }

    /// Resizes the image and sets it to zero, reusing its memory.
    pub fn reset(&mut self, width: usize, height: usize) {
        (self.width, self.height) = (width, height);
        self.pixels.clear();
        self.pixels.resize(width * height, T::default());
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All pixels.
    pub fn pixels(&self) -> &[T] {
        &self.pixels
    }

    /// All pixels, mutable.
    pub fn pixels_mut(&mut self) -> &mut [T] {
        &mut self.pixels
    }

    /// Pixels of one row.
    ///
    /// # Panics
    /// If the row is out of range.
    pub fn row(&self, row: usize) -> &[T] {
        &self.pixels[row * self.width..][..self.width]
    }

    /// Pixels of one row, mutable.
    ///
    /// # Panics
    /// If the row is out of range.
    pub fn row_mut(&mut self, row: usize) -> &mut [T] {
        &mut self.pixels[row * self.width..][..self.width]
    }
}

impl<'a> Rgb<'a> {
    /// Image of this size over its bytes.
    ///
    /// # Errors
    /// If the number of bytes does not match the size.
    pub fn new(width: usize, height: usize, bytes: &'a [u8]) -> Result<Self, ImageError> {
        sized(width, height, 3, bytes.len())?;
        Ok(Self { width, height, bytes })
    }

    /// Number of columns.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Number of rows.
    pub fn height(&self) -> usize {
        self.height
    }

    /// All bytes.
    pub fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Bytes of one row, three per pixel.
    ///
    /// # Panics
    /// If the row is out of range.
    pub fn row(&self, row: usize) -> &'a [u8] {
        &self.bytes[row * self.width * 3..][..self.width * 3]
    }

    /// Converts to luma (ITU-R BT.601, the weights 0.299, 0.587 and 0.114 in 1/2^14, rounded), like OpenCV's grey.
    pub fn gray(&self, into: &mut Plane<u8>) {
        into.reset(self.width, self.height);
        for (gray, rgb) in into.pixels.iter_mut().zip(self.bytes.chunks_exact(3)) {
            let sum = 4899 * u32::from(rgb[0]) + 9617 * u32::from(rgb[1]) + 1868 * u32::from(rgb[2]);
            *gray = ((sum + (1 << 13)) >> 14) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn image_rejects_a_size_that_does_not_match_its_bytes() {
        let told = Rgb::new(2, 2, &[0; 11]).unwrap_err().to_string();
        assert_eq!(told, "11 numbers for an image of 2 x 2 pixels, expected 12");
        assert!(Plane::from_pixels(usize::MAX, 2, vec![0_u8]).is_err());
    }

    #[test]
    fn gray_matches_bt601_on_primary_colours() {
        let bytes = [255, 255, 255, 255, 0, 0, 0, 255, 0, 0, 0, 255, 0, 0, 0];
        let mut gray = Plane::default();
        Rgb::new(5, 1, &bytes).unwrap().gray(&mut gray);
        assert_eq!(gray.row(0), [255, 76, 150, 29, 0]);
    }
}
