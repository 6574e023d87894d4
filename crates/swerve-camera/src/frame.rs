//! Images of one pass, in memory of the caller.

use crate::Camera;

/// Set of images that a pass writes.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct Outputs {
    /// Colour, 8 bit per channel, sRGB.
    pub rgb: bool,
    /// Depth along the optical axis, metres.
    pub depth: bool,
    /// Cityscapes class ids.
    pub semantic: bool,
    /// Instance ids.
    pub instance: bool,
}

impl Outputs {
    /// All four images.
    pub const ALL: Self = Self { rgb: true, depth: true, semantic: true, instance: true };
    /// All images except colour: sufficient for perfect perception, and much cheaper.
    pub const GEOMETRY: Self = Self { rgb: false, depth: true, semantic: true, instance: true };
    /// Colour only.
    pub const RGB: Self = Self { rgb: true, depth: false, semantic: false, instance: false };
}

/// Images of one pass, row by row from the top left; images not requested are empty.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Frame {
    /// Number of columns.
    pub width_px: usize,
    /// Number of rows.
    pub height_px: usize,
    /// Red, green and blue of each pixel, sRGB.
    pub rgb: Vec<u8>,
    /// Distance along the optical axis, metres; infinite for sky.
    pub depth_m: Vec<f32>,
    /// Cityscapes class ids.
    pub semantic: Vec<u8>,
    /// Instance ids; 0 for none.
    pub instance: Vec<u32>,
}

impl Frame {
    /// Frame with buffers for the requested images.
    pub fn new(camera: &Camera, outputs: Outputs) -> Self {
        let (width_px, height_px) = (camera.width_px(), camera.height_px());
        let pixels = width_px * height_px;
        let len = |wanted: bool, per_pixel: usize| if wanted { pixels * per_pixel } else { 0 };
        Self {
            width_px,
            height_px,
            rgb: vec![0; len(outputs.rgb, 3)],
            depth_m: vec![0.0; len(outputs.depth, 1)],
            semantic: vec![0; len(outputs.semantic, 1)],
            instance: vec![0; len(outputs.instance, 1)],
        }
    }

    /// Mutable views of the images, for a pass.
    pub fn as_mut(&mut self) -> FrameMut<'_> {
        fn some<T>(image: &mut [T]) -> Option<&mut [T]> {
            if image.is_empty() { None } else { Some(image) }
        }
        FrameMut {
            rgb: some(&mut self.rgb),
            depth_m: some(&mut self.depth_m),
            semantic: some(&mut self.semantic),
            instance: some(&mut self.instance),
        }
    }
}

/// Output buffers of a pass: any memory that can be borrowed, including shared memory.
///
/// An image that is `None` is not computed.
#[derive(Debug, Default)]
pub struct FrameMut<'a> {
    /// Width x height x 3 bytes.
    pub rgb: Option<&'a mut [u8]>,
    /// Width x height, metres along the optical axis, infinite for sky.
    pub depth_m: Option<&'a mut [f32]>,
    /// Width x height, Cityscapes ids.
    pub semantic: Option<&'a mut [u8]>,
    /// Width x height, instance ids.
    pub instance: Option<&'a mut [u32]>,
}

/// Mismatch of an image size and the camera's.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the {image} image has {len} elements, the camera writes {expected}")]
pub struct FrameSizeError {
    /// Name of the image.
    pub image: &'static str,
    /// Number of its elements.
    pub len: usize,
    /// Number of elements required.
    pub expected: usize,
}

impl FrameMut<'_> {
    /// Reborrows the images for a shorter lifetime.
    pub(crate) fn reborrow(&mut self) -> FrameMut<'_> {
        FrameMut {
            rgb: self.rgb.as_deref_mut(),
            depth_m: self.depth_m.as_deref_mut(),
            semantic: self.semantic.as_deref_mut(),
            instance: self.instance.as_deref_mut(),
        }
    }

    /// Copies the images of a frame of the same size.
    pub(crate) fn copy_from(&mut self, frame: &Frame) {
        if let Some(rgb) = &mut self.rgb {
            rgb.copy_from_slice(&frame.rgb);
        }
        if let Some(depth_m) = &mut self.depth_m {
            depth_m.copy_from_slice(&frame.depth_m);
        }
        if let Some(semantic) = &mut self.semantic {
            semantic.copy_from_slice(&frame.semantic);
        }
        if let Some(instance) = &mut self.instance {
            instance.copy_from_slice(&frame.instance);
        }
    }

    /// Set of images present.
    pub fn outputs(&self) -> Outputs {
        Outputs {
            rgb: self.rgb.is_some(),
            depth: self.depth_m.is_some(),
            semantic: self.semantic.is_some(),
            instance: self.instance.is_some(),
        }
    }

    /// Checks that the images have the camera's size.
    ///
    /// # Errors
    /// The first image of another size.
    pub fn check(&self, camera: &Camera) -> Result<(), FrameSizeError> {
        let pixels = camera.width_px() * camera.height_px();
        let sizes = [
            ("rgb", self.rgb.as_ref().map(|i| i.len()), 3 * pixels),
            ("depth_m", self.depth_m.as_ref().map(|i| i.len()), pixels),
            ("semantic", self.semantic.as_ref().map(|i| i.len()), pixels),
            ("instance", self.instance.as_ref().map(|i| i.len()), pixels),
        ];
        for (image, len, expected) in sizes {
            if let Some(len) = len.filter(|len| *len != expected) {
                return Err(FrameSizeError { image, len, expected });
            }
        }
        Ok(())
    }
}
