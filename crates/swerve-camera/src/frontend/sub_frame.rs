//! Sub-frames: the instants and slabs of rows that make up one image.

use core::ops::Range;

use super::BAND;
use crate::Camera;
use crate::frame::Outputs;

/// Sub-frame: an instant, a slab of rows, and a share of the light.
#[derive(Clone, Debug)]
pub(crate) struct SubFrame {
    /// Time after the stamp of the image, seconds.
    pub(crate) at_s: f64,
    pub(crate) rows: Range<usize>,
    /// Index and number of samples of its rows.
    pub(crate) sample: u32,
    pub(crate) samples: u32,
}

impl SubFrame {
    /// All sub-frames of an image: slab by slab, each with its samples in order.
    pub(crate) fn all(camera: &Camera, outputs: Outputs) -> impl Iterator<Item = Self> {
        let (height, shutter) = (camera.height_px(), camera.spec().shutter);
        let samples = if outputs.rgb { shutter.blur_samples } else { 1 };
        let slabs = if shutter.readout_s > 0.0 { shutter.readout_slabs as usize } else { 1 };
        let step = height.div_ceil(slabs).next_multiple_of(BAND);
        (0..height).step_by(step).flat_map(move |from| {
            let to = (from + step).min(height);
            let middle = (0.5 * (from + to) as f64) / height as f64 - 0.5;
            (0..samples).map(move |sample| {
                let spread = (f64::from(sample) + 0.5) / f64::from(samples) - 0.5;
                let part = if sample == samples / 2 { 0.0 } else { spread };
                let at_s = shutter.readout_s * middle + shutter.exposure_s * part;
                Self { at_s, rows: from..to, sample, samples }
            })
        })
    }

    /// Sampling offset from the pixel centre, evenly distributed; zero for the sample that provides ids.
    pub(crate) fn offset(&self) -> [f64; 2] {
        if self.gives_ids() {
            return [0.0; 2];
        }
        // The additive recurrence of the plastic number covers the square evenly for any count.
        let k = f64::from(self.sample + 1);
        [0.754_877_666_246_693 * k, 0.569_840_290_998_053 * k].map(|x| x - x.floor() - 0.5)
    }

    /// Returns true if depth and ids are taken from this sub-frame.
    pub(crate) fn gives_ids(&self) -> bool {
        self.sample == self.samples / 2
    }
}
