//! Removal of small isolated patches of disparity, which are mostly wrong.

use crate::Plane;

/// Speckle filter with its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Speckles {
    seen: Vec<bool>,
    /// Pixels of the current patch; those at its end are still to be expanded.
    patch: Vec<usize>,
}

impl Speckles {
    /// Removes patches of fewer than `pixels` pixels; neighbours belong to one patch if they differ by at most
    /// `range_px`.
    pub(super) fn remove(&mut self, disparities: &mut Plane<f32>, pixels: usize, range_px: f32) {
        let (width, height) = (disparities.width(), disparities.height());
        self.seen.clear();
        self.seen.resize(width * height, false);
        self.patch.clear();
        self.patch.reserve(width * height);
        for first in 0..width * height {
            if self.seen[first] || disparities.pixels()[first].is_nan() {
                continue;
            }
            self.grow(disparities, first, range_px);
            if self.patch.len() < pixels {
                self.patch.iter().for_each(|&at| disparities.pixels_mut()[at] = f32::NAN);
            }
        }
    }

    fn grow(&mut self, disparities: &Plane<f32>, first: usize, range_px: f32) {
        let (width, pixels) = (disparities.width(), disparities.pixels());
        self.patch.clear();
        self.patch.push(first);
        self.seen[first] = true;
        let mut next = 0;
        while let Some(&at) = self.patch.get(next) {
            next += 1;
            let x = at % width;
            let around = [
                (x > 0).then(|| at - 1),
                (x + 1 < width).then_some(at + 1),
                at.checked_sub(width),
                Some(at + width).filter(|&below| below < pixels.len()),
            ];
            for other in around.into_iter().flatten() {
                // False if the neighbour is NaN.
                if !self.seen[other] && (pixels[other] - pixels[at]).abs() <= range_px {
                    self.seen[other] = true;
                    self.patch.push(other);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_patches_are_removed() {
        const N: f32 = f32::NAN;
        let before = [1.0, 1.5, N, 7.0, 9.0, 2.0, N, 7.5, N, 2.5, N, 3.0];
        let after = [1.0, 1.5, N, N, N, 2.0, N, N, N, 2.5, N, N];
        let mut plane = Plane::from_pixels(4, 3, before.to_vec()).unwrap();
        Speckles::default().remove(&mut plane, 4, 1.0);
        for (found, expected) in plane.pixels().iter().zip(after) {
            assert!(found.total_cmp(&expected).is_eq(), "{:?}", plane.pixels());
        }
    }
}
