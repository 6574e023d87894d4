//! Images in files, and where what is drawn into them goes.

use std::path::Path;

use anyhow::Context as _;
use swerve_report::files::write_png;
use swerve_study::train::read_png;
use swerve_vision::{ImageError, Rgb};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// An image in colours.
pub(super) struct Picture {
    /// Columns and rows.
    pub(super) size: [usize; 2],
    /// Three bytes a pixel.
    pub(super) bytes: Vec<u8>,
}

impl Picture {
    /// Reads a file, JPEG by what it begins with, else PNG.
    pub(super) fn read(path: &Path) -> anyhow::Result<Self> {
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

    pub(super) fn rgb(&self) -> Result<Rgb<'_>, ImageError> {
        Rgb::new(self.size[0], self.size[1], &self.bytes)
    }

    /// Writes it as PNG into a folder, named as the file that it was read from.
    pub(super) fn write(&self, folder: &Path, path: &Path) -> anyhow::Result<()> {
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
    pub(super) fn dot(&mut self, [column, row]: [f64; 2], radius: i64, colour: [u8; 3]) {
        let [width, height] = self.size.map(|px| px as i64);
        let (x, y) = (column.floor() as i64, row.floor() as i64);
        for y in (y - radius).max(0)..(y + radius + 1).min(height) {
            for x in (x - radius).max(0)..(x + radius + 1).min(width) {
                self.bytes[3 * (y * width + x) as usize..][..3].copy_from_slice(&colour);
            }
        }
    }
}

/// Makes the folder for what is drawn, where one is asked for.
pub(super) fn make_folder(folder: Option<&Path>) -> anyhow::Result<()> {
    folder.map_or(Ok(()), |out| {
        std::fs::create_dir_all(out).with_context(|| format!("making {}", out.display()))
    })
}
