//! Ridges: strips of paint width that are brighter than the road on both sides.

use super::level::LevelView;
use super::line::Mark;

/// Smallest contrast with both sides, grey levels.
const CONTRAST_MIN: f64 = 8.0;
/// Most strips kept per row, by contrast.
const OF_ROW_MAX: usize = 16;
/// Rows are skipped where marks are wide, near the camera: one more row for each multiple of this width, pixels.
const SKIP_PX: f64 = 12.0;
/// Smallest width searched for, pixels; used for narrower marks too.
const NARROWEST_PX: f64 = 2.0;

/// Ridge detector with its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Ridges {
    sums: Vec<i32>,
    contrasts: Vec<f32>,
    peaks: Vec<Mark>,
}

impl Ridges {
    /// Detects strips of the width of a mark, for a camera pitched down by `pitch_rad` relative to its mounting.
    pub(super) fn find(&mut self, view: &LevelView, pitch_rad: f64, mark_m: f64, into: &mut Vec<Mark>) {
        into.clear();
        let mut row = 0;
        while row < view.pixels().height() {
            let width_px = view.mark_px(row, pitch_rad, mark_m);
            self.row(view, row, width_px.max(NARROWEST_PX));
            into.extend_from_slice(&self.peaks);
            row += 1 + (width_px / SKIP_PX) as usize;
        }
    }

    /// Detects the strips of one row, in falling order of contrast.
    fn row(&mut self, view: &LevelView, row: usize, width_px: f64) {
        self.peaks.clear();
        let [first, end] = view.seen(row);
        let pixels = &view.pixels().row(row)[first..end];
        let width = (width_px.round() as usize).max(2);
        // From the left: road, mark, road, with gaps between them for worn or wider paint.
        let gap = width / 4 + 1;
        let all = 3 * width + 2 * gap;
        if pixels.len() < all + 2 {
            return;
        }
        self.sums.clear();
        self.sums.push(0);
        self.sums.extend(pixels.iter().scan(0, |sum, pixel| {
            *sum += i32::from(*pixel);
            Some(*sum)
        }));
        let sums = &self.sums;
        let scale = 1.0 / width as f32;
        self.contrasts.clear();
        self.contrasts.extend((0..=pixels.len() - all).map(|k| {
            let strip = |from: usize| sums[from + width] - sums[from];
            let beside = strip(k).max(strip(k + 2 * (width + gap)));
            (strip(k + width + gap) - beside) as f32 * scale
        }));
        let middle = first as f64 + (width + gap) as f64 + 0.5 * (width as f64 - 1.0);
        self.peaks_of_row(width, |k| (view.left(middle + k), view.down(row as f64)));
    }

    /// Keeps the local maxima of the contrast.
    fn peaks_of_row(&mut self, width: usize, ray: impl Fn(f64) -> (f64, f64)) {
        let contrasts = &self.contrasts;
        let mut k = 1;
        while k + 1 < contrasts.len() {
            let here = contrasts[k];
            let around = k.saturating_sub(width)..(k + width + 1).min(contrasts.len());
            if f64::from(here) < CONTRAST_MIN || here < contrasts[k - 1] || here <= contrasts[k + 1] {
                k += 1;
                continue;
            }
            if contrasts[around].iter().all(|other| *other <= here) {
                let (left, down) = ray(k as f64 + top(contrasts[k - 1], here, contrasts[k + 1]));
                self.peaks.push(Mark { left, down, contrast: f64::from(here) });
            }
            k += 1;
        }
        let order = |a: &Mark, b: &Mark| b.contrast.total_cmp(&a.contrast).then(b.left.total_cmp(&a.left));
        self.peaks.sort_unstable_by(order);
        self.peaks.truncate(OF_ROW_MAX);
    }
}

/// Position of the maximum of a parabola through three values, relative to the middle one.
fn top(before: f32, here: f32, after: f32) -> f64 {
    let bend = f64::from(before - 2.0 * here + after);
    if bend < 0.0 { 0.5 * f64::from(before - after) / bend } else { 0.0 }
}
