//! Conversion of RGB to CIE LUV; the RGB is treated as linear, each colour between 0 and 1.

use swerve_geom::math;
use swerve_geom::simd::widest;

use crate::image::Rgb;
use crate::stack::Stack;

/// Steps of the lightness table.
const STEPS: usize = 1024;
/// Entries of the table: beyond white, as the luminance weights sum to more than one, and a power of two so that
/// indices can be masked.
const ENTRIES: usize = 2 * STEPS;
/// Scale of L, u and v, which start at 0, -88 and -134.
const LARGEST: f32 = 270.0;
/// X, Y, Z rows of the red, green and blue primaries.
const XYZ: [[f32; 3]; 3] =
    [[0.430_574, 0.341_55, 0.178_325], [0.222_015, 0.706_655, 0.071_33], [0.020_183, 0.129_553, 0.939_18]];
/// u' and v' of the white point.
const WHITE: [f32; 2] = [0.197_833, 0.468_331];

/// Converts colours to LUV, with a table and buffers of one row.
#[derive(Clone, Debug)]
pub struct Luv {
    /// Lightness by luminance.
    lightness: Box<[f32; ENTRIES]>,
    x: Vec<f32>,
    z: Vec<f32>,
    /// Table index.
    y: Vec<i32>,
}

impl Default for Luv {
    fn default() -> Self {
        let lightness = |k: usize| {
            let y = k as f64 / STEPS as f64;
            let (dark, third) = (216.0 / 24389.0, 1.0 / 3.0);
            let l = if y > dark { 116.0 * math::pow(y, third) - 16.0 } else { y * 24389.0 / 27.0 };
            l as f32 / LARGEST
        };
        let lightness = Box::new(core::array::from_fn(lightness));
        Self { lightness, x: Vec::new(), z: Vec::new(), y: Vec::new() }
    }
}

impl Luv {
    /// Computes L, u and v of some rows of an image, in three planes.
    pub fn compute(&mut self, image: Rgb<'_>, rows: core::ops::Range<usize>, into: &mut Stack) {
        let width = image.width();
        into.shape(3, width, rows.len());
        self.x.resize(width, 0.0);
        self.z.resize(width, 0.0);
        self.y.resize(width, 0);
        widest(
            #[inline(always)]
            || {
                for (line, row) in rows.enumerate() {
                    self.row(image.row(row), line, into);
                }
            },
        );
    }

    #[inline(always)]
    fn row(&mut self, rgb: &[u8], line: usize, into: &mut Stack) {
        for (((x, z), y), rgb) in self.x.iter_mut().zip(&mut self.z).zip(&mut self.y).zip(rgb.chunks_exact(3))
        {
            let [r, g, b] = [rgb[0], rgb[1], rgb[2]].map(|value| f32::from(value) * (1.0 / 255.0));
            let [cx, cy, cz] = XYZ.map(|row| row[0] * r + row[1] * g + row[2] * b);
            let over = 1.0 / (cx + 15.0 * cy + 3.0 * cz + 1e-35);
            (*x, *z) = (cx * over, cy * over);
            *y = (cy * STEPS as f32) as i32;
        }
        for (l, y) in into.row_mut(0, line).iter_mut().zip(&self.y) {
            *l = self.lightness[*y as usize % ENTRIES];
        }
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

/// Row of the first plane, and the same row of a later plane, writable.
#[inline(always)]
fn two_rows(stack: &mut Stack, plane: usize, row: usize) -> (&[f32], &mut [f32]) {
    let (width, height) = (stack.width(), stack.height());
    let (first, later) = stack.numbers_mut().split_at_mut(width * height);
    (&first[row * width..][..width], &mut later[((plane - 1) * height + row) * width..][..width])
}
