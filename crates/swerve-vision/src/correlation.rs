//! A target followed from image to image by correlation: DSST (Danelljan and others, BMVC 2014), a filter for its place
//! and one for its size, over histograms of gradients.

mod fhog;
mod fourier;
#[cfg(test)]
mod tests;

use swerve_geom::math;
use thiserror::Error;

use self::fhog::{CELL, Fhog, PLANES};
use self::fourier::{COUNT, Complex, Fourier, conjugate, times};
use crate::Plane;

/// Where a target is in an image, pixels.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Area {
    /// Column and row of its middle.
    pub middle: [f64; 2],
    /// Width and height.
    pub size: [f64; 2],
}

/// Why nothing can be followed.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum AreaError {
    /// Nothing in the image, or too little to have gradients.
    #[error(
        "{0:?} in an image of {1} x {2} pixels, expected at least 8 x 8 pixels with the middle in the image"
    )]
    Unusable(Area, usize, usize),
}

/// Side of what is looked at, in roots of the target's area.
const PADDING: f64 = 2.5;
/// By how much sizes differ that are tried.
const STEP: f64 = 1.02;
/// How much of a filter is renewed by an image.
const RATE: f32 = 0.025;
/// Keeps quotients finite where nothing is seen.
const REGULAR: f32 = 0.01;
/// Pixels of a target that its size is told from: root of their number.
const SIZED: f64 = 28.0;

/// A filter: for each of its lines (of 32 x 32 or 32 numbers) the numerator, and the one denominator.
#[derive(Clone, Debug, Default)]
struct Filter {
    numerators: Vec<Complex>,
    denominator: Vec<f32>,
}

impl Filter {
    /// Learns transformed features for the transformed answer that they should give.
    fn learn(&mut self, features: &[Complex], answer: &[Complex], rate: f32) {
        self.numerators.resize(features.len(), [0.0; 2]);
        self.denominator.resize(answer.len(), 0.0);
        self.denominator.iter_mut().for_each(|d| *d *= 1.0 - rate);
        let lines = self.numerators.chunks_exact_mut(answer.len()).zip(features.chunks_exact(answer.len()));
        for (numerators, features) in lines {
            for (at, (old, f)) in numerators.iter_mut().zip(features).enumerate() {
                let new = times(conjugate(answer[at]), *f);
                *old = [0, 1].map(|part| (1.0 - rate) * old[part] + rate * new[part]);
                self.denominator[at] += rate * (f[0] * f[0] + f[1] * f[1]);
            }
        }
    }

    /// The answer to transformed features, conjugate: transforming it once more gives 32 x or 32 x 32 times the answer.
    fn answer(&self, features: &[Complex], into: &mut [Complex]) {
        into.fill([0.0; 2]);
        let lines = self.numerators.chunks_exact(into.len()).zip(features.chunks_exact(into.len()));
        for (numerators, features) in lines {
            for ((sum, a), f) in into.iter_mut().zip(numerators).zip(features) {
                let part = times(conjugate(*a), *f);
                *sum = [sum[0] + part[0], sum[1] + part[1]];
            }
        }
        for (sum, d) in into.iter_mut().zip(&self.denominator) {
            *sum = [sum[0] / (d + REGULAR), -sum[1] / (d + REGULAR)];
        }
    }
}

/// A target that is followed.
#[derive(Clone, Debug)]
pub struct Correlation {
    area: Area,
    fourier: Fourier,
    fhog: Fhog,
    hann: [f32; COUNT],
    place: Filter,
    scale: Filter,
    answers: [Vec<Complex>; 2],
    patch: Plane<f32>,
    features: Vec<Complex>,
    found: Vec<Complex>,
}

impl Correlation {
    /// Begins to follow what is in an area of an image.
    ///
    /// # Errors
    /// Where the area has no 8 x 8 pixels, or its middle is outside.
    pub fn new(image: &Plane<u8>, area: Area) -> Result<Self, AreaError> {
        let ends = [image.width() as f64, image.height() as f64];
        let usable =
            (0..2).all(|a| (0.0..ends[a]).contains(&area.middle[a]) && (8.0..1e5).contains(&area.size[a]));
        if !usable {
            return Err(AreaError::Unusable(area, image.width(), image.height()));
        }
        let fourier = Fourier::new();
        let bell = |at: usize, sigma: f64| {
            let away = (at as f64 - (COUNT / 2) as f64) / sigma;
            math::exp(-0.5 * away * away) as f32
        };
        let mut place: Vec<Complex> =
            (0..COUNT * COUNT).map(|at| [bell(at % COUNT, 0.8) * bell(at / COUNT, 0.8), 0.0]).collect();
        fourier.square(&mut place);
        let mut scale: Vec<Complex> = (0..COUNT).map(|at| [bell(at, 1.4), 0.0]).collect();
        fourier.line(&mut scale);
        let hann = std::array::from_fn(|at| {
            let turn = std::f64::consts::TAU * (at as f64 + 0.5) / COUNT as f64;
            (0.5 - 0.5 * math::cos(turn)) as f32
        });
        let mut tracker = Self {
            area,
            fourier,
            fhog: Fhog::new(),
            hann,
            place: Filter::default(),
            scale: Filter::default(),
            answers: [place, scale],
            patch: Plane::default(),
            features: Vec::new(),
            found: Vec::new(),
        };
        tracker.learn(image, 1.0);
        Ok(tracker)
    }

    /// Where the target is.
    pub fn area(&self) -> Area {
        self.area
    }

    /// Looks for the target in the next image.
    pub fn follow(&mut self, image: &Plane<u8>) -> Area {
        self.see_place(image);
        self.found.resize(COUNT * COUNT, [0.0; 2]);
        self.place.answer(&self.features, &mut self.found);
        self.fourier.square(&mut self.found);
        let [x, y] = peak(&self.found);
        let cell = self.side() / COUNT as f64;
        let ends = [image.width(), image.height()];
        for (axis, moved) in [x, y].into_iter().enumerate() {
            let middle = self.area.middle[axis] + moved * cell;
            self.area.middle[axis] = middle.clamp(0.0, ends[axis] as f64);
        }
        self.see_scales(image);
        self.found.resize(COUNT, [0.0; 2]);
        self.scale.answer(&self.features, &mut self.found);
        self.fourier.line(&mut self.found);
        let factor = math::pow(STEP, peak(&self.found)[0]);
        let largest = ends[0].max(ends[1]) as f64;
        if self.area.size.iter().all(|side| (8.0..=largest).contains(&(side * factor))) {
            self.area.size = self.area.size.map(|side| side * factor);
        }
        self.learn(image, RATE);
        self.area
    }

    fn learn(&mut self, image: &Plane<u8>, rate: f32) {
        self.see_place(image);
        self.place.learn(&self.features, &self.answers[0], rate);
        self.see_scales(image);
        self.scale.learn(&self.features, &self.answers[1], rate);
    }

    /// Side of the square that is looked at, pixels.
    fn side(&self) -> f64 {
        PADDING * (self.area.size[0] * self.area.size[1]).sqrt()
    }

    /// Features of the square around the target, transformed.
    fn see_place(&mut self, image: &Plane<u8>) {
        let cells = COUNT + 2;
        let side = self.side() * cells as f64 / COUNT as f64;
        sample(image, self.area.middle, [side; 2], [CELL * cells; 2], &mut self.patch);
        self.features.resize(PLANES * COUNT * COUNT, [0.0; 2]);
        let (features, hann) = (&mut self.features, &self.hann);
        self.fhog.cells(&self.patch, |x, y, planes| {
            for (plane, value) in planes.into_iter().enumerate() {
                features[(plane * COUNT + y) * COUNT + x] = [value * hann[x] * hann[y], 0.0];
            }
        });
        features.chunks_exact_mut(COUNT * COUNT).for_each(|plane| self.fourier.square(plane));
    }

    /// Features of the target in 32 sizes, transformed along sizes.
    fn see_scales(&mut self, image: &Plane<u8>) {
        let size = self.area.size;
        let shrink = SIZED / (size[0] * size[1]).sqrt();
        let cells = size.map(|side| ((side * shrink / CELL as f64).round() as usize).clamp(2, 16));
        // The shape of the target does not change, so the number of cells does not.
        self.features.resize(cells[0] * cells[1] * PLANES * COUNT, [0.0; 2]);
        let (features, hann) = (&mut self.features, &self.hann);
        for (at, weight) in hann.iter().enumerate() {
            let factor = math::pow(STEP, at as f64 - (COUNT / 2) as f64);
            let sides =
                [0, 1].map(|axis| size[axis] * factor * (cells[axis] + 2) as f64 / cells[axis] as f64);
            sample(image, self.area.middle, sides, cells.map(|n| CELL * (n + 2)), &mut self.patch);
            self.fhog.cells(&self.patch, |x, y, planes| {
                for (plane, value) in planes.into_iter().enumerate() {
                    features[((y * cells[0] + x) * PLANES + plane) * COUNT + at] = [value * weight, 0.0];
                }
            });
        }
        features.chunks_exact_mut(COUNT).for_each(|line| self.fourier.line(line));
    }
}

/// Resamples a rectangle of an image, between pixels by their neighbours; beyond the border is the border.
fn sample(image: &Plane<u8>, middle: [f64; 2], sides: [f64; 2], size: [usize; 2], into: &mut Plane<f32>) {
    into.reset(size[0], size[1]);
    let ends = [image.width() - 1, image.height() - 1];
    let place = |axis: usize, at: usize| {
        let from = middle[axis] + ((at as f64 + 0.5) / size[axis] as f64 - 0.5) * sides[axis] - 0.5;
        let from = from.clamp(0.0, ends[axis] as f64);
        (from as usize, (from as usize + 1).min(ends[axis]), from.fract() as f32)
    };
    for y in 0..size[1] {
        let (above, below, fy) = place(1, y);
        let (above, below) = (image.row(above), image.row(below));
        for (x, value) in into.row_mut(y).iter_mut().enumerate() {
            let (left, right, fx) = place(0, x);
            let across = |row: &[u8]| f32::from(row[left]) * (1.0 - fx) + f32::from(row[right]) * fx;
            *value = (across(above) * (1.0 - fy) + across(below) * fy) / 255.0;
        }
    }
}

/// Where the largest answer is, cells from the middle, between them by a parabola.
fn peak(answers: &[Complex]) -> [f64; 2] {
    let value = |at: usize| f64::from(answers[at][0]);
    let best = (0..answers.len()).fold(0, |best, at| if value(at) > value(best) { at } else { best });
    if value(best) <= 0.0 {
        return [0.0; 2];
    }
    let [x, y] = [best % COUNT, best / COUNT];
    let between = |at: usize, step: usize| {
        if at == 0 || at + 1 == COUNT {
            return 0.0;
        }
        let (before, after) = (value(best - step), value(best + step));
        let bend = before + after - 2.0 * value(best);
        if bend < 0.0 { 0.5 * (before - after) / bend } else { 0.0 }
    };
    let middle = (COUNT / 2) as f64;
    let rows = answers.len() > COUNT;
    [x as f64 - middle + between(x, 1), if rows { y as f64 - middle + between(y, COUNT) } else { 0.0 }]
}
