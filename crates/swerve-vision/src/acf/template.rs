//! Linear templates over blocks of histograms: the dot products of many windows at a time.

use serde::{Deserialize, Serialize};

use super::windows::Windows;

/// Windows of neighbouring columns that are summed together.
const LANES: usize = 32;

/// Linear classifier over a window's features, as trained by a support vector machine.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Template {
    /// Weight of each feature: plane by plane, each row by row.
    pub weights: Vec<f32>,
    /// Added to the sum.
    pub offset: f32,
}

impl Template {
    /// Reports the windows whose score exceeds the threshold, with their scores.
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

    /// Sums of neighbouring windows, each added up in the same order.
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
