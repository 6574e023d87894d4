//! Linear templates over blocks of histograms: every window's sum, many windows at a time.

use serde::{Deserialize, Serialize};

use super::windows::Windows;

/// Windows of neighbouring columns whose sums are kept side by side.
const LANES: usize = 32;

/// Weights whose sum over a window's features is its score, as a support vector machine learns them.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Template {
    /// Of each feature: plane after plane, each row by row.
    pub weights: Vec<f32>,
    /// Added to the sum.
    pub offset: f32,
}

impl Template {
    /// Reports the windows of so many columns and lines whose sum is above the least, with it.
    #[inline(always)]
    pub(super) fn scan(
        &self,
        size: [usize; 2],
        windows: &Windows<'_>,
        report: &mut impl FnMut([usize; 2], f32),
    ) {
        let stride = windows.stride;
        for (line, columns) in windows.runs {
            let mut rest = columns.clone();
            while rest.len() >= LANES {
                let sums = self.sums::<LANES>(size, windows, [rest.start, *line]);
                for (lane, &sum) in sums.iter().enumerate().step_by(stride) {
                    if sum > windows.reject {
                        report([rest.start + lane, *line], sum);
                    }
                }
                rest.start += LANES.next_multiple_of(stride);
            }
            for column in rest.step_by(stride) {
                let [sum] = self.sums::<1>(size, windows, [column, *line]);
                if sum > windows.reject {
                    report([column, *line], sum);
                }
            }
        }
    }

    /// The sums of some windows beside each other, each added up in the same order.
    #[inline(always)]
    fn sums<const N: usize>(
        &self,
        [columns, lines]: [usize; 2],
        windows: &Windows<'_>,
        [left, top]: [usize; 2],
    ) -> [f32; N] {
        let mut sums = [self.offset; N];
        for (k, weights) in self.weights.chunks_exact(columns).enumerate() {
            let row = &windows.cells.row(k / lines, top + k % lines)[left..];
            for (weight, values) in weights.iter().zip(row.windows(N)) {
                for lane in 0..N {
                    sums[lane] += weight * values[lane];
                }
            }
        }
        sums
    }
}
