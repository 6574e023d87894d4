//! Images in files: PNG and JPEG are read, PNG is written.

use std::path::Path;

use anyhow::Context as _;
use swerve_report::files::write_png;
use swerve_vision::{ImageError, Rgb};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use crate::train::read_png;

/// An image in colours.
pub struct Picture {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Three bytes a pixel.
    pub bytes: Vec<u8>,
}

impl Picture {
    /// Reads a file, JPEG by what it begins with, else PNG.
    ///
    /// # Errors
    /// It cannot be read, or is no such image.
    pub fn read(path: &Path) -> anyhow::Result<Self> {
        let file = std::fs::read(path).with_context(|| format!("reading {}", path.display()))?;
        if !file.starts_with(&[0xff, 0xd8]) {
            let (size, bytes) = read_png(path)?;
            return Ok(Self { size, bytes });
        }
        let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&file[..]), options);
        let bytes = decoder.decode().map_err(|e| anyhow::anyhow!("reading {}: {e}", path.display()))?;
        let info = decoder.info().with_context(|| format!("reading {}: no size", path.display()))?;
        Ok(Self { size: [info.width, info.height].map(usize::from), bytes })
    }

    /// Its pixels.
    ///
    /// # Errors
    /// Never of what was read.
    pub fn rgb(&self) -> Result<Rgb<'_>, ImageError> {
        Rgb::new(self.size[0], self.size[1], &self.bytes)
    }

    /// Writes it as PNG into a folder, named as the file that it was read from.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn write(&self, folder: &Path, path: &Path) -> anyhow::Result<()> {
        let name = Path::new(path.file_name().unwrap_or_default()).with_extension("png");
        let [width, height] = self.size.map(|px| px as u32);
        write_png(
            &folder.join(name),
            (width, height),
            (png::ColorType::Rgb, png::BitDepth::Eight),
            &self.bytes,
        )
    }

    /// Colours the pixels within `radius` of a place, as far as there are any.
    pub fn dot(&mut self, [column, row]: [f64; 2], radius: i64, colour: [u8; 3]) {
        let [width, height] = self.size.map(|px| px as i64);
        let (x, y) = (column.floor() as i64, row.floor() as i64);
        for y in (y - radius).max(0)..(y + radius + 1).min(height) {
            for x in (x - radius).max(0)..(x + radius + 1).min(width) {
                self.bytes[3 * (y * width + x) as usize..][..3].copy_from_slice(&colour);
            }
        }
    }

    /// Draws a frame along the sides of a box: left, top, width and height, pixels.
    pub fn frame(&mut self, [left, top, across, down]: [f64; 4], colour: [u8; 3]) {
        let [width, height] = self.size;
        let within = |px: f64, n: usize| px.round().clamp(0.0, n as f64 - 1.0) as usize;
        let columns = [left, left + across].map(|px| within(px, width));
        let rows = [top, top + down].map(|px| within(px, height));
        let mut dot = |x: usize, y: usize| self.dot([x as f64, y as f64], 0, colour);
        (columns[0]..=columns[1]).for_each(|x| rows.iter().for_each(|y| dot(x, *y)));
        (rows[0]..=rows[1]).for_each(|y| columns.iter().for_each(|x| dot(*x, y)));
    }
}
