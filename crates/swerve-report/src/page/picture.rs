//! Camera images as small pictures within a page.

use std::fmt::Write as _;

use swerve_msg::{Encoding, Image};

/// Maximum width of a picture, pixels.
const WIDTH_PX: usize = 200;

/// An RGB image, downsampled, as a data URI with a PNG. `None` for other encodings, or if the log has only a
/// fingerprint of the image.
pub fn photo(image: &Image) -> Option<String> {
    let size = [image.width_px, image.height_px].map(|px| px as usize);
    (image.encoding() == Encoding::Rgb8).then(|| photo_of(size, image.pixels.bytes())).flatten()
}

/// [`photo`] for `columns` × `rows` pixels of three bytes each; `None` if there are none or the number of bytes
/// differs.
pub fn photo_of([columns, rows]: [usize; 2], bytes: &[u8]) -> Option<String> {
    if columns == 0 || rows == 0 || bytes.len() != 3 * columns * rows {
        return None;
    }
    let step = columns.div_ceil(WIDTH_PX);
    let (width, height) = (columns / step, rows.div_ceil(step));
    let mut small = Vec::with_capacity(3 * width * height);
    for y in (0..rows).step_by(step) {
        for k in 0..width {
            let at = 3 * (y * columns + k * step);
            small.extend_from_slice(&bytes[at..at + 3]);
        }
    }
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_compression(png::Compression::Balanced);
    encoder.write_header().ok()?.write_image_data(&small).ok()?;
    Some(format!("data:image/png;base64,{}", base64(&file)))
}

/// Base64, RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for three in bytes.chunks(3) {
        let bits = three.iter().chain([0; 2].iter()).take(3).fold(0_u32, |bits, b| bits << 8 | u32::from(*b));
        for k in 0..4 {
            let digit = DIGITS[(bits >> (18 - 6 * k)) as usize & 63];
            let _infallible = write!(text, "{}", if k > three.len() { '=' } else { char::from(digit) });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    #[test]
    fn base64_is_that_of_the_standard() {
        // Test vectors of RFC 4648, section 10.
        let vectors = [("", ""), ("f", "Zg=="), ("fo", "Zm8="), ("foo", "Zm9v"), ("foob", "Zm9vYg==")];
        for (plain, encoded) in vectors {
            assert_eq!(super::base64(plain.as_bytes()), encoded);
        }
    }
}
