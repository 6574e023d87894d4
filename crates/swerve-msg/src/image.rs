//! Camera images and calibration.

use core::fmt;

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::{Camera, Ego, Point, Transform};

use crate::Packed;
use crate::block::Memory;

/// One image of one camera.
///
/// Pixels are stored row by row from the top left. The image owns its memory, which [`Image::reset`] reuses.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
pub struct Image {
    /// Middle of the exposure.
    pub stamp: Time,
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Calibration of the camera.
    pub camera: CameraInfo,
    /// Pixel data.
    pub pixels: Pixels,
}

/// Meaning of the values of an image.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Encoding {
    /// Red, green, blue, a byte each, sRGB.
    #[default]
    Rgb8,
    /// Distance along the optical axis, metres; infinite where the ray hits nothing.
    DepthF32M,
    /// Semantic class, Cityscapes ids.
    ClassU8,
    /// Instance: an actor's identity, 0 for anything else. Ground truth, known only to the simulator.
    InstanceU32,
}

/// Values of an image, by encoding.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pixels {
    /// [`Encoding::Rgb8`]: three values per pixel.
    Rgb8(Packed<u8>),
    /// [`Encoding::DepthF32M`].
    DepthF32M(Packed<f32>),
    /// [`Encoding::ClassU8`].
    ClassU8(Packed<u8>),
    /// [`Encoding::InstanceU32`].
    InstanceU32(Packed<u32>),
}

/// Calibration of a camera: projection and mounting pose.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
pub struct CameraInfo {
    /// Projection from rays to pixels.
    pub intrinsics: Intrinsics,
    /// Mounting pose; camera axes are x right, y down, z forward along the optical axis.
    pub ego_from_camera: Transform<Ego, Camera>,
}

/// Pinhole projection with lens distortion (Brown, 1966).
///
/// With `x = X / Z`, `y = Y / Z` of a point in the camera's frame and `r² = x² + y²`, the lens moves `x` to
/// `x (1 + k1 r² + k2 r⁴ + k3 r⁶) + 2 p1 x y + p2 (r² + 2 x²)`, and `y` to
/// `y (1 + k1 r² + k2 r⁴ + k3 r⁶) + p1 (r² + 2 y²) + 2 p2 x y`; the pixel is at `(fx x + cx, fy y + cy)`.
/// Pixel `(column, row)` covers `[column, column + 1) x [row, row + 1)`, so its centre is at
/// `(column + 0.5, row + 0.5)`.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Intrinsics {
    /// Horizontal focal length, pixels.
    pub fx_px: f64,
    /// Vertical focal length, pixels.
    pub fy_px: f64,
    /// Column of the optical axis, pixels.
    pub cx_px: f64,
    /// Row of the optical axis, pixels.
    pub cy_px: f64,
    /// `k1, k2, p1, p2, k3`; all zero without distortion.
    pub distortion: [f64; 5],
    /// True for an orthographic projection: `x = X`, `y = Y`, and focal lengths in pixels per metre.
    pub is_parallel: bool,
}

impl Default for CameraInfo {
    /// At the ego origin, looking forward.
    fn default() -> Self {
        let (quarter, origin) = (core::f64::consts::FRAC_PI_2, Point::new(0.0, 0.0, 0.0));
        let ego_from_camera = Transform::from_roll_pitch_yaw(origin, -quarter, 0.0, -quarter);
        Self { intrinsics: Intrinsics::default(), ego_from_camera }
    }
}

impl Default for Pixels {
    fn default() -> Self {
        Self::new(Encoding::default())
    }
}

impl Pixels {
    /// Empty pixel data of this encoding.
    pub fn new(encoding: Encoding) -> Self {
        match encoding {
            Encoding::Rgb8 => Self::Rgb8(Packed::default()),
            Encoding::DepthF32M => Self::DepthF32M(Packed::default()),
            Encoding::ClassU8 => Self::ClassU8(Packed::default()),
            Encoding::InstanceU32 => Self::InstanceU32(Packed::default()),
        }
    }

    /// Meaning of the values.
    pub fn encoding(&self) -> Encoding {
        match self {
            Self::Rgb8(_) => Encoding::Rgb8,
            Self::DepthF32M(_) => Encoding::DepthF32M,
            Self::ClassU8(_) => Encoding::ClassU8,
            Self::InstanceU32(_) => Encoding::InstanceU32,
        }
    }

    /// Number of values.
    pub fn len(&self) -> usize {
        match self {
            Self::Rgb8(numbers) | Self::ClassU8(numbers) => numbers.len(),
            Self::DepthF32M(numbers) => numbers.len(),
            Self::InstanceU32(numbers) => numbers.len(),
        }
    }

    /// Returns true if there are no values.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The values as bytes, in native byte order.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Self::Rgb8(numbers) | Self::ClassU8(numbers) => numbers,
            Self::DepthF32M(numbers) => bytemuck::cast_slice(numbers),
            Self::InstanceU32(numbers) => bytemuck::cast_slice(numbers),
        }
    }
}

impl Encoding {
    /// Values per pixel.
    pub fn channels(self) -> usize {
        if self == Self::Rgb8 { 3 } else { 1 }
    }

    /// Bytes per pixel.
    pub fn bytes_per_pixel(self) -> usize {
        match self {
            Self::Rgb8 => 3,
            Self::ClassU8 => 1,
            Self::DepthF32M | Self::InstanceU32 => 4,
        }
    }
}

impl Default for Image {
    fn default() -> Self {
        Self::new(0, 0, Encoding::default())
    }
}

impl Image {
    /// A black image (all values zero).
    pub fn new(width_px: u32, height_px: u32, encoding: Encoding) -> Self {
        let mut image = Self {
            stamp: Time::ZERO,
            width_px: 0,
            height_px: 0,
            camera: CameraInfo::default(),
            pixels: Pixels::new(encoding),
        };
        image.reset(width_px, height_px, encoding);
        image
    }

    /// A black image in `memory`, if given and large enough.
    pub fn in_memory(memory: Option<&dyn Memory>, width_px: u32, height_px: u32, encoding: Encoding) -> Self {
        let n = width_px as usize * height_px as usize * encoding.channels();
        let pixels = match encoding {
            Encoding::Rgb8 => Pixels::Rgb8(Packed::in_memory(memory, n)),
            Encoding::DepthF32M => Pixels::DepthF32M(Packed::in_memory(memory, n)),
            Encoding::ClassU8 => Pixels::ClassU8(Packed::in_memory(memory, n)),
            Encoding::InstanceU32 => Pixels::InstanceU32(Packed::in_memory(memory, n)),
        };
        Self { stamp: Time::ZERO, width_px, height_px, camera: CameraInfo::default(), pixels }
    }

    /// Ends writing to shared memory.
    ///
    /// # Errors
    /// As [`Packed::seal`].
    pub fn seal(&mut self) -> Result<(), String> {
        match &mut self.pixels {
            Pixels::Rgb8(numbers) | Pixels::ClassU8(numbers) => numbers.seal(),
            Pixels::DepthF32M(numbers) => numbers.seal(),
            Pixels::InstanceU32(numbers) => numbers.seal(),
        }
    }

    /// Resizes to a black image of this size and encoding; keeps the memory if the encoding is unchanged.
    pub fn reset(&mut self, width_px: u32, height_px: u32, encoding: Encoding) {
        (self.width_px, self.height_px) = (width_px, height_px);
        if self.encoding() != encoding {
            self.pixels = Pixels::new(encoding);
        }
        let n = width_px as usize * height_px as usize * encoding.channels();
        match &mut self.pixels {
            Pixels::Rgb8(numbers) | Pixels::ClassU8(numbers) => numbers.reset(n),
            Pixels::DepthF32M(numbers) => numbers.reset(n),
            Pixels::InstanceU32(numbers) => numbers.reset(n),
        }
    }

    /// Meaning of its values.
    pub fn encoding(&self) -> Encoding {
        self.pixels.encoding()
    }

    /// Checks that the number of values matches the size.
    ///
    /// # Errors
    /// If it does not; data from a log or another process may be malformed.
    pub fn check(&self) -> Result<(), ImageError> {
        let wanted = u64::from(self.width_px) * u64::from(self.height_px) * self.encoding().channels() as u64;
        let found = self.pixels.len() as u64;
        if found == wanted {
            return Ok(());
        }
        Err(ImageError { width_px: self.width_px, height_px: self.height_px, wanted, found })
    }
}

/// The number of values of an image does not match its size.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct ImageError {
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Expected number of values.
    pub wanted: u64,
    /// Actual number of values.
    pub found: u64,
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { width_px, height_px, wanted, found } = self;
        write!(f, "an image of {width_px} x {height_px} pixels has {found} numbers, expected {wanted}")
    }
}

impl core::error::Error for ImageError {}

#[cfg(test)]
mod tests {
    use swerve_core::digest_of;
    use swerve_geom::Vector;

    use super::*;

    const ENCODINGS: [Encoding; 4] =
        [Encoding::Rgb8, Encoding::DepthF32M, Encoding::ClassU8, Encoding::InstanceU32];

    #[test]
    fn image_reset_reuses_its_memory() {
        for encoding in ENCODINGS {
            let mut image = Image::new(64, 48, encoding);
            assert_eq!(image.pixels.bytes().len(), 64 * 48 * encoding.bytes_per_pixel());
            assert_eq!((image.encoding(), image.check()), (encoding, Ok(())));
            let before = image.pixels.bytes().as_ptr();
            image.reset(32, 48, encoding);
            assert_eq!((image.pixels.bytes().as_ptr(), image.check()), (before, Ok(())));
            image.width_px = 33;
            let fault = image.check().unwrap_err();
            assert_eq!(fault.found + 48 * encoding.channels() as u64, fault.wanted);
        }
    }

    #[test]
    fn images_round_trip_through_cbor() {
        for encoding in ENCODINGS {
            let mut image = Image::new(9, 7, encoding);
            image.camera.intrinsics =
                Intrinsics { fx_px: 400.0, distortion: [0.1; 5], ..Intrinsics::default() };
            match &mut image.pixels {
                Pixels::DepthF32M(depth) => depth[5] = f32::INFINITY,
                Pixels::InstanceU32(ids) => ids[5] = 70_000,
                Pixels::Rgb8(bytes) | Pixels::ClassU8(bytes) => bytes[5] = 255,
            }
            let mut cbor = Vec::new();
            ciborium::into_writer(&image, &mut cbor).unwrap();
            let back: Image = ciborium::from_reader(&cbor[..]).unwrap();
            assert_eq!((digest_of(&back), &back), (digest_of(&image), &image));
        }
    }

    #[test]
    fn image_digest_changes_with_one_pixel() {
        let image = Image::new(800, 600, Encoding::Rgb8);
        let mut other = image.clone();
        if let Pixels::Rgb8(bytes) = &mut other.pixels {
            bytes[700_000] ^= 1;
        }
        assert_ne!(digest_of(&image), digest_of(&other));
    }

    #[test]
    fn default_camera_looks_forward() {
        let ahead = CameraInfo::default().ego_from_camera * Vector::<Camera>::new(0.0, 0.0, 1.0);
        let down = CameraInfo::default().ego_from_camera * Vector::<Camera>::new(0.0, 1.0, 0.0);
        assert!((ahead - Vector::new(1.0, 0.0, 0.0)).norm() < 1e-12, "{ahead:?}");
        assert!((down - Vector::new(0.0, 0.0, -1.0)).norm() < 1e-12, "{down:?}");
    }
}
