//! Hand-crafted appearance descriptor of a box: colours of its upper and lower half, and gradients.

use core::ops::Range;

use swerve_vision::channels::Luv;
use swerve_vision::hog::{HogDetector, LinearHog};
use swerve_vision::{Rgb, Stack};

/// Size to which a box is resampled, pixels, and in cells of the gradient histograms.
const WIDTH_PX: usize = 32;
const HEIGHT_PX: usize = 64;
const CELLS: [usize; 2] = [WIDTH_PX / 8, HEIGHT_PX / 8];
/// Columns used for colours; the sides mostly show background.
const MIDDLE: Range<usize> = 6..26;
/// Bins of L, u and v, and their ranges; values outside count in the first or last bin.
const BINS: [usize; 3] = [8, 8, 8];
const ENDS: [[f32; 2]; 3] = [[0.0, 100.0], [-40.0, 80.0], [-60.0, 60.0]];
/// Scale and offset of L, u and v in [`Luv`].
const LUV_SCALE: f32 = 270.0;
const LUV_START: [f32; 3] = [0.0, 88.0, 134.0];
/// Smallest visible size of a box with a descriptor in either direction, pixels.
const LEAST_PX: f64 = 4.0;
/// Number of partial sums; fixes the order of summation for any vector width.
const LANES: usize = 8;

/// Appearance descriptor, a unit vector.
#[derive(Clone, PartialEq, Debug)]
pub struct Look(Vec<f32>);

impl Look {
    /// Distance of two descriptors, 0 for equal and 1 for orthogonal: one minus the mean of three similarities, of the
    /// colours of the upper and of the lower half (Bhattacharyya coefficient) and of the gradients (cosine).
    pub fn distance(&self, other: &Self) -> f64 {
        let mut sums = [0.0_f32; LANES];
        for (a, b) in self.0.chunks(LANES).zip(other.0.chunks(LANES)) {
            for (sum, (a, b)) in sums.iter_mut().zip(a.iter().zip(b)) {
                *sum += a * b;
            }
        }
        1.0 - f64::from(sums.iter().sum::<f32>())
    }
}

/// Computes descriptors; reuses its buffers.
#[derive(Clone, Debug)]
pub struct Appearance {
    gradients: HogDetector,
    luv: Luv,
    crop: Vec<u8>,
    colours: Stack,
}

impl Default for Appearance {
    fn default() -> Self {
        let weights = vec![0.0; LinearHog::features(CELLS)];
        let gradients = HogDetector::new(LinearHog { cells: CELLS, weights, offset: 0.0 });
        let crop = vec![0; 3 * WIDTH_PX * HEIGHT_PX];
        Self { gradients, luv: Luv::default(), crop, colours: Stack::default() }
    }
}

impl Appearance {
    /// Descriptor of a box (left, top, right, bottom, pixels); `None` if almost nothing of it is inside the image.
    pub fn describe(&mut self, image: Rgb<'_>, box_px: [f64; 4]) -> Option<Look> {
        let [width, height] = [image.width() as f64, image.height() as f64];
        let [left, top, right, bottom] = box_px;
        let cut = [
            left.clamp(0.0, width),
            top.clamp(0.0, height),
            right.clamp(0.0, width),
            bottom.clamp(0.0, height),
        ];
        // Comparisons with NaN are false.
        if !(cut[2] - cut[0] >= LEAST_PX && cut[3] - cut[1] >= LEAST_PX) {
            return None;
        }
        self.cut_out(image, cut);
        let crop = Rgb::new(WIDTH_PX, HEIGHT_PX, &self.crop).ok()?;
        self.luv.compute(crop, 0..HEIGHT_PX, &mut self.colours);
        let mut look = Vec::with_capacity(2 * BINS.iter().product::<usize>() + LinearHog::features(CELLS));
        for rows in [0..HEIGHT_PX / 2, HEIGHT_PX / 2..HEIGHT_PX] {
            self.histogram(rows, &mut look);
        }
        let gradients = self.gradients.describe(crop)?;
        let length = gradients.iter().map(|g| g * g).sum::<f32>().sqrt().max(f32::MIN_POSITIVE);
        let third = 1.0 / 3.0_f32.sqrt();
        look.extend(gradients.iter().map(|g| g / length * third));
        Some(Look(look))
    }

    /// Resamples the box: means over the pixels covered by each new pixel, at least one.
    fn cut_out(&mut self, image: Rgb<'_>, [left, top, right, bottom]: [f64; 4]) {
        let (columns, rows) = (
            |k| part(left, right, k, WIDTH_PX, image.width()),
            |k| part(top, bottom, k, HEIGHT_PX, image.height()),
        );
        for (k, pixel) in self.crop.chunks_exact_mut(3).enumerate() {
            let (across, down) = (columns(k % WIDTH_PX), rows(k / WIDTH_PX));
            let mut sums = [0_u32; 3];
            for row in down.clone() {
                for rgb in image.row(row)[3 * across.start..3 * across.end].chunks_exact(3) {
                    sums.iter_mut().zip(rgb).for_each(|(sum, value)| *sum += u32::from(*value));
                }
            }
            let count = (across.len() * down.len()) as u32;
            pixel.iter_mut().zip(sums).for_each(|(value, sum)| *value = ((sum + count / 2) / count) as u8);
        }
    }

    /// Square roots of the colour shares in some rows, scaled to the norm one over the root of three.
    fn histogram(&self, rows: Range<usize>, look: &mut Vec<f32>) {
        let mut counts = [0_u16; BINS[0] * BINS[1] * BINS[2]];
        let total = (rows.len() * MIDDLE.len()) as f32;
        for row in rows {
            let planes: [&[f32]; 3] = core::array::from_fn(|plane| self.colours.row(plane, row));
            for x in MIDDLE {
                let bin = |k: usize| {
                    let [begin, end] = ENDS[k];
                    let value = planes[k][x] * LUV_SCALE - LUV_START[k];
                    // Casting clamps negative values to the first bin.
                    (((value - begin) / (end - begin) * BINS[k] as f32) as usize).min(BINS[k] - 1)
                };
                counts[(bin(0) * BINS[1] + bin(1)) * BINS[2] + bin(2)] += 1;
            }
        }
        look.extend(counts.iter().map(|count| (f32::from(*count) / total / 3.0).sqrt()));
    }
}

/// Pixels, at least one, covered by part `k` of `parts` between two edges.
fn part(from: f64, to: f64, k: usize, parts: usize, size: usize) -> Range<usize> {
    let edge = |k: usize| from + (to - from) * k as f64 / parts as f64;
    let first = (edge(k).round() as usize).min(size - 1);
    first..(edge(k + 1).round() as usize).clamp(first + 1, size)
}
