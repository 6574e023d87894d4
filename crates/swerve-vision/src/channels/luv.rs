//! CIE LUV of RGB that is taken as linear, each of the three between 0 and 1.

use swerve_geom::math;

use crate::image::Rgb;
use crate::stack::Stack;

/// Steps of the table of lightness.
const STEPS: usize = 1024;
/// The largest of L, u and v; they begin at 0, -88 and -134.
const LARGEST: f32 = 270.0;
/// Red, green and blue of the primaries in X, Y, Z.
const XYZ: [[f32; 3]; 3] =
    [[0.430_574, 0.341_55, 0.178_325], [0.222_015, 0.706_655, 0.071_33], [0.020_183, 0.129_553, 0.939_18]];
/// u' and v' of white.
const WHITE: [f32; 2] = [0.197_833, 0.468_331];

/// Makes LUV of colours: a table, and memory of one row.
#[derive(Clone, Debug)]
pub struct Luv {
    /// Lightness by luminance.
    lightness: Vec<f32>,
    x: Vec<f32>,
    z: Vec<f32>,
}

impl Default for Luv {
    fn default() -> Self {
        let lightness = |k: usize| {
            let y = k as f64 / STEPS as f64;
            let (dark, third) = (216.0 / 24389.0, 1.0 / 3.0);
            let l = if y > dark { 116.0 * math::pow(y, third) - 16.0 } else { y * 24389.0 / 27.0 };
            l as f32 / LARGEST
        };
        // A little more than white, where the weights sum up to more than one.
        Self { lightness: (0..STEPS + 8).map(lightness).collect(), x: Vec::new(), z: Vec::new() }
    }
}

impl Luv {
    /// L, u and v of some rows of an image, in three planes.
    pub fn compute(&mut self, image: Rgb<'_>, rows: core::ops::Range<usize>, into: &mut Stack) {
        let width = image.width();
        into.shape(3, width, rows.len());
        self.x.resize(width, 0.0);
        self.z.resize(width, 0.0);
        for (line, row) in rows.enumerate() {
            self.lightness_row(image.row(row), into.row_mut(0, line));
            for (plane, white, numerator) in [(1, WHITE[0], 4.0), (2, WHITE[1], 9.0)] {
                let start = if plane == 1 { 88.0 } else { 134.0 } / LARGEST;
                let (l, out) = two_rows(into, plane, line);
                let top = if plane == 1 { &self.x } else { &self.z };
                for ((out, l), share) in out.iter_mut().zip(l).zip(top) {
                    *out = l * 13.0 * (numerator * share - white) + start;
                }
            }
        }
    }

    /// L of one row; `x` and `z` become X and Y over X + 15 Y + 3 Z.
    fn lightness_row(&mut self, rgb: &[u8], into: &mut [f32]) {
        for (((l, x), z), rgb) in into.iter_mut().zip(&mut self.x).zip(&mut self.z).zip(rgb.chunks_exact(3)) {
            let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(|value| f32::from(value) * (1.0 / 255.0));
            let [cx, cy, cz] = XYZ.map(|row| row[0] * r + row[1] * g + row[2] * b);
            let over = 1.0 / (cx + 15.0 * cy + 3.0 * cz + 1e-35);
            (*x, *z) = (cx * over, cy * over);
            *l = self.lightness[(cy * STEPS as f32) as usize];
        }
    }
}

/// A row of the first plane, and the same of a later one to be written.
fn two_rows(stack: &mut Stack, plane: usize, row: usize) -> (&[f32], &mut [f32]) {
    let (width, height) = (stack.width(), stack.height());
    let (first, later) = stack.numbers_mut().split_at_mut(width * height);
    (&first[row * width..][..width], &mut later[((plane - 1) * height + row) * width..][..width])
}
