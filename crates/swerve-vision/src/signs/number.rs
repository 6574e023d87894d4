//! Recognition of the number on a speed limit.

use std::sync::LazyLock;

use swerve_geom::math;

use crate::Rgb;

/// Columns and rows of the patch in which numbers are compared.
const COLUMNS: usize = 26;
const ROWS: usize = 16;
/// Width of a digit in its own units of strokes, and widths and half stroke widths of the drawn lettering, as shares of the
/// digit height: from DIN 1451 narrow to Transport bold.
const DIGIT: f64 = 0.6;
const WIDTHS: [f64; 4] = [0.34, 0.44, 0.54, 0.64];
const STROKES: [f64; 3] = [0.06, 0.09, 0.12];
/// Width of the foot of a 1, in units of strokes.
const FOOT: f64 = 0.5;
/// Gaps between digits, as shares of the digit height.
const GAPS: [f64; 2] = [0.1, 0.2];
/// Number of points of a digit's arcs.
const ROUND: usize = 16;
/// Quantile of brightness taken as white, in any light.
const WHITE: f64 = 0.75;
/// Smallest contrast of a number, as a share of white.
const CONTRAST_MIN: f64 = 0.25;
/// Smallest lead of the best correlation over the next one.
const LEAD_MIN: f64 = 0.03;
/// Samples per cell along each axis.
const LOOKS: usize = 3;

type Patch = [f64; COLUMNS * ROWS];

/// Drawing of a number, with zero mean and unit norm.
struct Drawing {
    number: u8,
    /// Width over height.
    aspect: f64,
    patch: Patch,
}

static DRAWINGS: LazyLock<Vec<Drawing>> = LazyLock::new(|| {
    let mut drawings = Vec::new();
    for number in (1..=13).map(|tens| 10 * tens) {
        // A footed 1 before a single digit resembles a blurred 2.
        let feet: &[bool] = if number >= 100 { &[false, true] } else { &[false] };
        for foot in feet.iter().copied() {
            for width in WIDTHS {
                for gap in GAPS {
                    drawings.extend(STROKES.map(|half| Drawing::new(number, foot, [width, gap], half)));
                }
            }
        }
    }
    drawings
});

/// Reads numbers; reuses its buffers.
#[derive(Clone, Debug, Default)]
pub(super) struct Reader {
    sorted: Vec<u8>,
}

impl Reader {
    /// Reads the dark number within an ellipse; returns it with its correlation, up to 1.
    pub(super) fn read(&mut self, image: Rgb<'_>, center: [f64; 2], size: [f64; 2]) -> Option<(u8, f64)> {
        let dark = self.darkness(image, center, size)?;
        let bounds = bounds(&dark, center, size)?;
        let aspect = (bounds[2] - bounds[0]) / (bounds[3] - bounds[1]);
        let patch = normalised(patch(&dark, bounds))?;
        let likeness = |drawing: &Drawing| {
            let same: f64 = drawing.patch.iter().zip(&patch).map(|(a, b)| a * b).sum();
            // Tolerates the foreshortening of signs turned away; a larger difference means another number of digits.
            let off = math::ln(aspect / drawing.aspect).abs();
            (drawing.number, same - 0.3 * (off - 0.25).max(0.0))
        };
        let (mut best, mut next) = ((0, f64::NEG_INFINITY), f64::NEG_INFINITY);
        for one in DRAWINGS.iter().map(likeness) {
            // Drawings of one number are adjacent; the next best is of another one.
            if one.1 > best.1 {
                next = if one.0 == best.0 { next } else { best.1 };
                best = one;
            } else if one.0 != best.0 {
                next = next.max(one.1);
            }
        }
        (best.1 - next >= LEAD_MIN).then_some(best)
    }

    /// Darkness of the pixels of an ellipse, from white (0) to black (1); `None` without contrast.
    fn darkness<'a>(
        &mut self,
        image: Rgb<'a>,
        center: [f64; 2],
        size: [f64; 2],
    ) -> Option<impl Fn(f64, f64) -> f64 + use<'a>> {
        self.sorted.clear();
        let [x0, y0] = [0, 1].map(|axis| (center[axis] - 0.5 * size[axis]).max(0.0) as usize);
        let x1 = ((center[0] + 0.5 * size[0]) as usize + 1).min(image.width());
        let y1 = ((center[1] + 0.5 * size[1]) as usize + 1).min(image.height());
        for y in y0..y1 {
            for x in x0..x1 {
                if is_within([x as f64 + 0.5, y as f64 + 0.5], center, size) {
                    self.sorted.push(brightness(image, x, y));
                }
            }
        }
        self.sorted.sort_unstable();
        let white = f64::from(*self.sorted.get((self.sorted.len() as f64 * WHITE) as usize)?);
        // The darkest twentieth, so that a single pixel does not decide.
        let black = f64::from(self.sorted[self.sorted.len() / 20]);
        if white - black < CONTRAST_MIN * white {
            return None;
        }
        Some(move |x: f64, y: f64| {
            if !is_within([x, y], center, size) {
                return 0.0;
            }
            ((white - between(image, x - 0.5, y - 0.5)) / (white - black)).clamp(0.0, 1.0)
        })
    }
}

fn is_within(point: [f64; 2], center: [f64; 2], size: [f64; 2]) -> bool {
    let [x, y] = [0, 1].map(|axis| 2.0 * (point[axis] - center[axis]) / size[axis]);
    x * x + y * y <= 1.0
}

/// Brightness as the red channel, in which a red ring is almost as bright as the disc, so that it is never taken for a part
/// of the number, however wide it is.
fn brightness(image: Rgb<'_>, x: usize, y: usize) -> u8 {
    image.row(y)[3 * x]
}

/// Bilinearly interpolated brightness.
fn between(image: Rgb<'_>, x: f64, y: f64) -> f64 {
    let (x, y) = (x.clamp(0.0, image.width() as f64 - 1.0), y.clamp(0.0, image.height() as f64 - 1.0));
    let (column, row) = (x as usize, y as usize);
    let (right, below) = ((column + 1).min(image.width() - 1), (row + 1).min(image.height() - 1));
    let (u, v) = (x - column as f64, y - row as f64);
    let at = |x, y| f64::from(brightness(image, x, y));
    (1.0 - v) * ((1.0 - u) * at(column, row) + u * at(right, row))
        + v * ((1.0 - u) * at(column, below) + u * at(right, below))
}

/// Left, top, right and bottom of the dark pixels within an ellipse, to a quarter of a pixel.
fn bounds(dark: &impl Fn(f64, f64) -> f64, center: [f64; 2], size: [f64; 2]) -> Option<[f64; 4]> {
    const STEP: f64 = 0.25;
    let steps = size.map(|size| (size / STEP).ceil() as usize);
    let mut bounds = [f64::INFINITY, f64::INFINITY, f64::NEG_INFINITY, f64::NEG_INFINITY];
    for j in 0..steps[1] {
        let y = center[1] + (j as f64 + 0.5) * STEP - 0.5 * size[1];
        for i in 0..steps[0] {
            let x = center[0] + (i as f64 + 0.5) * STEP - 0.5 * size[0];
            if dark(x, y) > 0.5 {
                bounds = [bounds[0].min(x), bounds[1].min(y), bounds[2].max(x), bounds[3].max(y)];
            }
        }
    }
    // A number covers more than a third of the disc's height.
    (bounds[3] - bounds[1] > 0.33 * size[1] && bounds[2] - bounds[0] > 0.2 * size[0]).then_some(bounds)
}

fn patch(dark: &impl Fn(f64, f64) -> f64, [left, top, right, bottom]: [f64; 4]) -> Patch {
    let mut patch = [0.0; COLUMNS * ROWS];
    let at = |k: usize, count: usize| (k as f64 + 0.5) / (count * LOOKS) as f64;
    for (k, cell) in patch.iter_mut().enumerate() {
        for look in 0..LOOKS * LOOKS {
            let u = at(k % COLUMNS * LOOKS + look % LOOKS, COLUMNS);
            let v = at(k / COLUMNS * LOOKS + look / LOOKS, ROWS);
            *cell += dark(left + u * (right - left), top + v * (bottom - top));
        }
    }
    patch
}

/// Patch with zero mean and unit norm; `None` if all cells are equal.
fn normalised(mut patch: Patch) -> Option<Patch> {
    let mean = patch.iter().sum::<f64>() / patch.len() as f64;
    patch.iter_mut().for_each(|cell| *cell -= mean);
    let length = patch.iter().map(|cell| cell * cell).sum::<f64>().sqrt();
    patch.iter_mut().for_each(|cell| *cell /= length);
    (length > 1e-9).then_some(patch)
}

impl Drawing {
    /// Drawing of a number with digits of this width, gap and half stroke width, as shares of the digit height; a 1 with or
    /// without a foot.
    fn new(number: u8, foot: bool, [digit_width, gap]: [f64; 2], half_stroke: f64) -> Self {
        let digits: Vec<u8> = number.to_string().bytes().map(|letter| letter - b'0').collect();
        let mut lines: Vec<[[f64; 2]; 2]> = Vec::new();
        let mut x = 0.0;
        for digit in digits {
            let strokes = if foot && digit == 1 { footed_one() } else { strokes(digit) };
            for stroke in &strokes {
                let at = |[u, v]: [f64; 2]| [x + u * digit_width / DIGIT, v];
                lines.extend(stroke.windows(2).map(|ends| [ends[0], ends[1]].map(at)));
            }
            let share = match (digit, foot) {
                (1, false) => 0.5,
                (1, true) => FOOT / DIGIT,
                _ => 1.0,
            };
            x += gap + share * digit_width;
        }
        let width = x - gap;
        let ink = |x: f64, y: f64| {
            let nearest = lines.iter().map(|line| distance([x, y], line)).fold(f64::INFINITY, f64::min);
            // Blur like that of an image in which a digit has nine rows.
            (1.0 - (nearest - half_stroke) / 0.06).clamp(0.0, 1.0)
        };
        let bounds = [-half_stroke, -half_stroke, width + half_stroke, 1.0 + half_stroke];
        let patch = normalised(patch(&ink, bounds)).expect("a number has strokes");
        Self { number, aspect: (width + 2.0 * half_stroke) / (1.0 + 2.0 * half_stroke), patch }
    }
}

/// Strokes of a digit in a box of width [`DIGIT`] and height 1, y down.
fn strokes(digit: u8) -> Vec<Vec<[f64; 2]>> {
    let round = |[x, y]: [f64; 2], [rx, ry]: [f64; 2]| -> Vec<[f64; 2]> {
        let angle = |k: usize| core::f64::consts::TAU * k as f64 / ROUND as f64;
        (0..=ROUND).map(|k| [x + rx * math::cos(angle(k)), y + ry * math::sin(angle(k))]).collect()
    };
    let six = [
        [0.48, 0.02],
        [0.2, 0.2],
        [0.05, 0.48],
        [0.0, 0.72],
        [0.12, 0.94],
        [0.3, 1.0],
        [0.48, 0.94],
        [0.6, 0.72],
        [0.48, 0.5],
        [0.3, 0.44],
        [0.12, 0.5],
        [0.02, 0.66],
    ];
    match digit {
        0 => {
            let left = [[0.3, 0.0], [0.1, 0.04], [0.0, 0.2], [0.0, 0.8], [0.1, 0.96], [0.3, 1.0]];
            vec![left.to_vec(), left.map(|[x, y]| [DIGIT - x, y]).to_vec()]
        }
        1 => vec![vec![[0.0, 0.22], [0.2, 0.0], [0.2, 1.0]]],
        2 => vec![vec![
            [0.0, 0.25],
            [0.08, 0.08],
            [0.3, 0.0],
            [0.52, 0.08],
            [0.6, 0.28],
            [0.5, 0.5],
            [0.0, 1.0],
            [0.6, 1.0],
        ]],
        3 => vec![vec![
            [0.02, 0.1],
            [0.28, 0.0],
            [0.54, 0.1],
            [0.57, 0.3],
            [0.48, 0.43],
            [0.24, 0.48],
            [0.5, 0.55],
            [0.6, 0.72],
            [0.54, 0.92],
            [0.28, 1.0],
            [0.0, 0.9],
        ]],
        4 => vec![vec![[0.45, 1.0], [0.45, 0.0], [0.0, 0.7], [0.6, 0.7]]],
        5 => vec![vec![
            [0.55, 0.0],
            [0.08, 0.0],
            [0.03, 0.42],
            [0.3, 0.37],
            [0.52, 0.46],
            [0.6, 0.68],
            [0.5, 0.92],
            [0.26, 1.0],
            [0.0, 0.9],
        ]],
        6 => vec![six.to_vec()],
        7 => vec![vec![[0.0, 0.0], [0.6, 0.0], [0.22, 1.0]]],
        8 => vec![round([0.3, 0.24], [0.25, 0.24]), round([0.3, 0.74], [0.3, 0.26])],
        _ => vec![six.map(|[x, y]| [DIGIT - x, 1.0 - y]).to_vec()],
    }
}

/// Strokes of a 1 with a serif at its foot.
fn footed_one() -> Vec<Vec<[f64; 2]>> {
    let middle = 0.5 * FOOT;
    vec![vec![[0.0, 0.14], [middle, 0.0], [middle, 1.0]], vec![[0.0, 1.0], [FOOT, 1.0]]]
}

/// Distance from a point to a line segment.
fn distance([x, y]: [f64; 2], [[x0, y0], [x1, y1]]: &[[f64; 2]; 2]) -> f64 {
    let (dx, dy) = (x1 - x0, y1 - y0);
    let along = (((x - x0) * dx + (y - y0) * dy) / (dx * dx + dy * dy)).clamp(0.0, 1.0);
    math::hypot(x - x0 - along * dx, y - y0 - along * dy)
}
