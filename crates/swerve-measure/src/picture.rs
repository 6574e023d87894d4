//! Image files: reads PNG and JPEG, rotated according to their EXIF data, and writes PNG.

mod exif;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use anyhow::Context as _;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_report::files::{entries, refuse_to_replace, write_png};
use swerve_text::{open_file, read_bytes};
use swerve_vision::{ImageError, Rgb};
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

/// Extensions of the images in a folder.
const EXTENSIONS: [&str; 3] = ["png", "jpg", "jpeg"];

/// Input images, each with the output file for its annotated copy.
#[derive(Debug)]
pub struct Pictures(Vec<(PathBuf, Option<PathBuf>)>);

impl Pictures {
    /// Collects image files, and those of folders by name. If annotated copies are written to the folder `out`, each
    /// gets a unique name there.
    ///
    /// # Errors
    /// If a folder has no images, an image or another file would be overwritten, or `out` cannot be created.
    pub fn new(paths: &[PathBuf], out: Option<&Path>, overwrite: OverwriteArgs) -> anyhow::Result<Self> {
        let mut images = Vec::new();
        for path in paths {
            if path.is_dir() {
                images.extend(images_in(path)?);
            } else {
                images.push(path.clone());
            }
        }
        let Some(out) = out else { return Ok(Self(images.into_iter().map(|image| (image, None)).collect())) };
        let mut taken = BTreeSet::new();
        let mut drawing = |image: &Path| {
            let stem = image.file_stem().unwrap_or_default().to_string_lossy();
            let mut drawing = out.join(format!("{stem}.png"));
            let mut number = 1;
            while !taken.insert(drawing.clone()) {
                number += 1;
                drawing = out.join(format!("{stem}-{number}.png"));
            }
            drawing
        };
        let pairs: Vec<_> = images.iter().map(|image| (image.clone(), Some(drawing(image)))).collect();
        refuse_to_replace(taken.iter().map(PathBuf::as_path), &images)?;
        std::fs::create_dir_all(out).with_context(|| format!("making {}", out.display()))?;
        overwrite.check(taken.iter().map(PathBuf::as_path))?;
        Ok(Self(pairs))
    }

    /// Images, each with the file for its annotated copy, if requested.
    pub fn iter(&self) -> impl Iterator<Item = (&Path, Option<&Path>)> {
        self.0.iter().map(|(image, drawing)| (image.as_path(), drawing.as_deref()))
    }
}

/// PNG and JPEG files of a folder, in the order of their names.
///
/// # Errors
/// If it cannot be read, or has none.
pub fn images_in(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut images = entries(folder).with_context(|| format!("reading {}", folder.display()))?;
    images.retain(|path| {
        let extension = path.extension().map(|e| e.to_string_lossy().to_lowercase());
        extension.is_some_and(|e| EXTENSIONS.contains(&e.as_str())) && path.is_file()
    });
    anyhow::ensure!(!images.is_empty(), "{}: expected PNG or JPEG files in it", folder.display());
    Ok(images)
}

/// Maximum size of an image file, bytes.
const IMAGE_BYTES_MAX: u64 = 256 << 20;

/// Default maximum image size, megapixels. Detectors need up to about 120 bytes per pixel.
pub const MEGAPIXELS_MAX: u32 = 16;

/// Refuses an image of more than this many megapixels, before memory is allocated for it.
fn within_bound(path: &Path, [width, height]: [u32; 2], megapixels_max: u32) -> anyhow::Result<()> {
    let pixels = u64::from(width) * u64::from(height);
    anyhow::ensure!(
        pixels <= u64::from(megapixels_max) * 1_000_000,
        "reading {}: {width} x {height} pixels: expected at most {megapixels_max} megapixels",
        path.display()
    );
    Ok(())
}

/// Width, height and bytes of an RGB image of 8 bits per channel, rotated as its EXIF data require.
pub fn read_png(path: &Path) -> anyhow::Result<([usize; 2], Vec<u8>)> {
    let file = open_file(path).with_context(|| format!("reading {}", path.display()))?;
    decode_png(std::io::BufReader::new(file), path, MEGAPIXELS_MAX)
}

/// [`read_png`] for the content of the file at `path`.
fn decode_png(
    file: impl std::io::BufRead + std::io::Seek,
    path: &Path,
    megapixels_max: u32,
) -> anyhow::Result<([usize; 2], Vec<u8>)> {
    let reading = || format!("reading {}", path.display());
    let mut decoder = png::Decoder::new(file);
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info().with_context(reading)?;
    let info = reader.info();
    within_bound(path, [info.width, info.height], megapixels_max)?;
    let size = reader.output_buffer_size().with_context(|| format!("{}: too large", path.display()))?;
    let mut bytes = vec![0; size];
    let info = reader.next_frame(&mut bytes).with_context(reading)?;
    bytes.truncate(info.buffer_size());
    let rgb = match info.color_type {
        png::ColorType::Rgb => bytes,
        png::ColorType::Rgba => bytes.chunks_exact(4).flat_map(|p| [p[0], p[1], p[2]]).collect(),
        png::ColorType::Grayscale => bytes.iter().flat_map(|v| [*v; 3]).collect(),
        png::ColorType::GrayscaleAlpha => bytes.chunks_exact(2).flat_map(|p| [p[0]; 3]).collect(),
        png::ColorType::Indexed => anyhow::bail!("{}: expected an image in colours", path.display()),
    };
    let orientation = reader.info().exif_metadata.as_deref().map_or(1, exif::orientation);
    Ok(exif::upright([info.width as usize, info.height as usize], rgb, orientation))
}

/// RGB image.
pub struct Picture {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Three bytes per pixel.
    pub bytes: Vec<u8>,
}

impl Picture {
    /// Reads a JPEG, recognised by its first bytes, or else a PNG, and rotates it as its EXIF data requires.
    ///
    /// # Errors
    /// If the file cannot be read, is not such an image, or has more than this many megapixels.
    pub fn read(path: &Path, megapixels_max: u32) -> anyhow::Result<Self> {
        let file =
            read_bytes(path, IMAGE_BYTES_MAX).with_context(|| format!("reading {}", path.display()))?;
        if !file.starts_with(&[0xff, 0xd8]) {
            anyhow::ensure!(
                file.starts_with(b"\x89PNG"),
                "reading {}: neither a PNG nor a JPEG image",
                path.display()
            );
            let (size, bytes) = decode_png(std::io::Cursor::new(&file), path, megapixels_max)?;
            return Ok(Self { size, bytes });
        }
        // Strict mode: a truncated image is an error rather than filled with grey.
        let options =
            DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB).set_strict_mode(true);
        let mut decoder = JpegDecoder::new_with_options(ZCursor::new(&file[..]), options);
        let failed = |e| anyhow::anyhow!("reading {}: {e}", path.display());
        decoder.decode_headers().map_err(failed)?;
        let info = decoder.info().with_context(|| format!("reading {}: no size", path.display()))?;
        within_bound(path, [info.width, info.height].map(u32::from), megapixels_max)?;
        let orientation = decoder.exif().map_or(1, |exif| exif::orientation(exif));
        let bytes = decoder.decode().map_err(failed)?;
        let (size, bytes) = exif::upright([info.width, info.height].map(usize::from), bytes, orientation);
        Ok(Self { size, bytes })
    }

    /// View of the pixels.
    ///
    /// # Errors
    /// If the size and the bytes do not match; never for an image that was read.
    pub fn rgb(&self) -> Result<Rgb<'_>, ImageError> {
        Rgb::new(self.size[0], self.size[1], &self.bytes)
    }

    /// Writes the image as PNG.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn write(&self, file: &Path) -> anyhow::Result<()> {
        let [width, height] = self.size.map(|px| px as u32);
        write_png(file, (width, height), (png::ColorType::Rgb, png::BitDepth::Eight), &self.bytes)
    }

    /// Colours the pixels within `radius` of a point, clipped to the image.
    pub fn dot(&mut self, [column, row]: [f64; 2], radius: i64, colour: [u8; 3]) {
        let [width, height] = self.size.map(|px| px as i64);
        let (x, y) = (column.floor() as i64, row.floor() as i64);
        for y in (y - radius).max(0)..(y + radius + 1).min(height) {
            for x in (x - radius).max(0)..(x + radius + 1).min(width) {
                self.bytes[3 * (y * width + x) as usize..][..3].copy_from_slice(&colour);
            }
        }
    }

    /// Draws the outline of a box: left, top, width and height, pixels.
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
