//! Real images for tests.

use std::fs;

use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;

use crate::{Plane, Rgb};

/// Image with owned bytes.
pub(crate) struct Picture {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) bytes: Vec<u8>,
}

impl Picture {
    /// Reads an RGB or greyscale PNG or JPEG file.
    pub(crate) fn read(path: &std::path::Path) -> Self {
        let file = fs::read(path).unwrap();
        let (width, height, bytes) = match path.extension().and_then(|e| e.to_str()) {
            Some("png") => png(&file),
            _ => jpeg(&file),
        };
        match bytes.len() / (width * height) {
            3 => Self { width, height, bytes },
            each => {
                let bytes = bytes.chunks(each).flat_map(|pixel| [pixel[0]; 3]).collect();
                Self { width, height, bytes }
            }
        }
    }

    pub(crate) fn rgb(&self) -> Rgb<'_> {
        Rgb::new(self.width, self.height, &self.bytes).unwrap()
    }

    pub(crate) fn gray(&self) -> Plane<u8> {
        let mut gray = Plane::default();
        self.rgb().gray(&mut gray);
        gray
    }
}

fn png(file: &[u8]) -> (usize, usize, Vec<u8>) {
    let mut reader = png::Decoder::new(std::io::Cursor::new(file)).read_info().unwrap();
    let mut bytes = vec![0; reader.output_buffer_size().unwrap()];
    let info = reader.next_frame(&mut bytes).unwrap();
    (info.width as usize, info.height as usize, bytes)
}

fn jpeg(file: &[u8]) -> (usize, usize, Vec<u8>) {
    let mut decoder = JpegDecoder::new(ZCursor::new(file));
    let bytes = decoder.decode().unwrap();
    let info = decoder.info().unwrap();
    (usize::from(info.width), usize::from(info.height), bytes)
}
