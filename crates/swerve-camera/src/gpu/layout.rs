//! Layout of the images of a submission in memory.

use core::ops::Range;

use super::records::NONE;
use crate::View;
use crate::frame::Outputs;

/// Location of one view's images, in words of the read-back buffer.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct ImageLayout {
    pub(super) pixels: usize,
    /// Colour, depth, classes, instances; [`NONE`] for images not requested.
    pub(super) first: [u32; 4],
    /// Unpacked colours and classes, a word each, and sums of sub-frames, three words each.
    pub(super) kept: u32,
    pub(super) sums: u32,
}

impl ImageLayout {
    /// Layouts of the images of views, one after the other.
    pub(super) fn all(views: &[(View<'_>, Outputs)]) -> Result<(Vec<Self>, ImageWords), String> {
        let (mut words, mut kept) = (0_usize, 0_usize);
        let layouts: Vec<Self> = views
            .iter()
            .map(|(view, outputs)| {
                let pixels = view.camera.width_px() * view.camera.height_px();
                let padded = pixels.next_multiple_of(ALIGNED);
                let wanted = [outputs.rgb, outputs.depth, outputs.semantic, outputs.instance];
                let sizes = [3 * padded / 4, padded, padded / 4, padded];
                let mut first = [NONE; 4];
                for k in 0..4 {
                    if wanted[k] {
                        first[k] = words as u32;
                        words += sizes[k].next_multiple_of(ALIGNED);
                    }
                }
                let own = kept;
                kept += padded;
                let sums = kept;
                if outputs.rgb && view.camera.spec().shutter.blur_samples > 1 {
                    kept += 3 * padded;
                }
                Self { pixels, first, kept: own as u32, sums: sums as u32 }
            })
            .collect();
        if words.max(kept) > (u32::MAX / 4) as usize {
            return Err(format!("images of {words} words are too large"));
        }
        Ok((layouts, ImageWords { images: words as u64, kept: kept as u64 }))
    }

    /// Byte range of an image.
    pub(super) fn bytes(&self, image: usize) -> Range<usize> {
        let size = self.pixels * [3, 4, 1, 4][image];
        let from = 4 * self.first[image] as usize;
        from..from + size
    }
}

/// Numbers of words of a submission: for images, and for intermediate data.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub(super) struct ImageWords {
    pub(super) images: u64,
    pub(super) kept: u64,
}

/// Alignment of a memory part, words.
const ALIGNED: usize = 64;

#[cfg(test)]
mod tests {
    use swerve_geom::Point;

    use super::*;
    use crate::{Camera, CameraSpec};

    #[test]
    fn layouts_place_only_requested_images_one_after_the_other() {
        let camera = Camera::new(CameraSpec { width_px: 7, height_px: 3, ..CameraSpec::default() }).unwrap();
        let at = swerve_geom::Transform::from_roll_pitch_yaw(Point::default(), 0.0, 0.0, 0.0);
        let view = View::new(&camera, at);
        let (layouts, words) = ImageLayout::all(&[(view, Outputs::GEOMETRY), (view, Outputs::RGB)]).unwrap();
        assert_eq!(layouts[0].first, [NONE, 0, 64, 128]);
        assert_eq!(layouts[1].first, [192, NONE, NONE, NONE]);
        assert_eq!((words.images, words.kept), (256, 128));
        assert_eq!((layouts[1].bytes(0), layouts[0].bytes(2)), (768..768 + 63, 256..256 + 21));
    }
}
