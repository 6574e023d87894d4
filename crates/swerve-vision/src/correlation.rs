//! Tracking of a target from image to image by correlation: DSST (Danelljan and others, BMVC 2014), with one filter for
//! position and one for scale, over histograms of gradients.

mod fhog;
mod fourier;
#[cfg(test)]
mod tests;

use swerve_geom::math;
use swerve_geom::simd::widest;
use thiserror::Error;

use self::fhog::{CELL, Fhog, PLANES};
use self::fourier::{COUNT, Fourier, Numbers};
use crate::Plane;

/// Target area in an image, pixels.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Area {
    /// Column and row of its centre.
    pub middle: [f64; 2],
    /// Width and height.
    pub size: [f64; 2],
}

/// Reason that an area cannot be tracked.
#[derive(Clone, Copy, PartialEq, Debug, Error)]
pub enum AreaError {
    /// Area outside the image, or too small to have gradients.
    #[error(
        "{0:?} in an image of {1} x {2} pixels, expected at least 8 x 8 pixels with the middle in the image"
    )]
    Unusable(Area, usize, usize),
}

/// Side of the search square, as a multiple of the square root of the target's area.
const PADDING: f64 = 2.5;
/// Ratio of neighbouring scales.
const STEP: f64 = 1.02;
/// Learning rate of the filters per image.
const RATE: f32 = 0.025;
/// Regularisation of the filter's denominator.
const REGULAR: f32 = 0.01;
/// Square root of the number of pixels to which the target is resampled for scale estimation.
const SIZED: f64 = 23.0;

/// Filter over 32 x 32 or 32 frequencies: numerators, one for each frequency and feature, and a shared denominator.
#[derive(Clone, Debug, Default)]
struct Filter {
    numerators: Numbers,
    denominator: Vec<f32>,
}

/// Number of partial sums.
const LANES: usize = 8;

impl Filter {
    /// Updates the filter with transformed features and their transformed desired response.
    fn learn(&mut self, features: &Numbers, answer: &Numbers, rate: f32) {
        self.numerators.re.resize(features.re.len(), 0.0);
        self.numerators.im.resize(features.re.len(), 0.0);
        self.denominator.resize(answer.re.len(), 0.0);
        let (count, keep) = (features.re.len() / answer.re.len(), 1.0 - rate);
        widest(
            #[inline(always)]
            || {
                for (at, denominator) in self.denominator.iter_mut().enumerate() {
                    let (re, im) = (answer.re[at], answer.im[at]);
                    let own = |part| of(part, at, count);
                    let f = own(&features.re).iter().zip(own(&features.im));
                    let old_re = self.numerators.re[at * count..][..count].as_chunks_mut::<LANES>().0;
                    let old_im = self.numerators.im[at * count..][..count].as_chunks_mut::<LANES>().0;
                    let mut squares = [0.0; LANES];
                    for ((f_re, f_im), (old_re, old_im)) in f.zip(old_re.iter_mut().zip(old_im)) {
                        let (mut new_re, mut new_im) = (*old_re, *old_im);
                        for k in 0..LANES {
                            new_re[k] = keep * new_re[k] + rate * (re * f_re[k] + im * f_im[k]);
                            new_im[k] = keep * new_im[k] + rate * (re * f_im[k] - im * f_re[k]);
                            squares[k] += f_re[k] * f_re[k] + f_im[k] * f_im[k];
                        }
                        (*old_re, *old_im) = (new_re, new_im);
                    }
                    *denominator = keep * *denominator + rate * squares.iter().sum::<f32>();
                }
            },
        );
    }

    /// Conjugate response to transformed features; another forward transform gives 32 or 32 x 32 times the response.
    fn answer(&self, features: &Numbers, into: &mut Numbers) {
        into.clear(self.denominator.len());
        let count = features.re.len() / self.denominator.len();
        widest(
            #[inline(always)]
            || {
                for (at, denominator) in self.denominator.iter().enumerate() {
                    let own = |part| of(part, at, count);
                    let a = own(&self.numerators.re).iter().zip(own(&self.numerators.im));
                    let f = own(&features.re).iter().zip(own(&features.im));
                    let (mut re, mut im) = ([0.0; LANES], [0.0; LANES]);
                    for ((a_re, a_im), (f_re, f_im)) in a.zip(f) {
                        for k in 0..LANES {
                            re[k] += a_re[k] * f_re[k] + a_im[k] * f_im[k];
                            im[k] += a_re[k] * f_im[k] - a_im[k] * f_re[k];
                        }
                    }
                    into.re[at] = re.iter().sum::<f32>() / (denominator + REGULAR);
                    into.im[at] = -im.iter().sum::<f32>() / (denominator + REGULAR);
                }
            },
        );
    }
}

/// Values of one frequency, of `count` values per frequency.
#[inline(always)]
fn of(numbers: &[f32], frequency: usize, count: usize) -> &[[f32; LANES]] {
    numbers[frequency * count..][..count].as_chunks().0
}

/// Tracked target.
#[derive(Clone, Debug)]
pub struct Correlation {
    area: Area,
    fourier: Fourier,
    fhog: Fhog,
    hann: [f32; COUNT],
    place: Filter,
    scale: Filter,
    answers: [Numbers; 2],
    sampler: Sampler,
    patch: Plane<f32>,
    features: Numbers,
    found: Numbers,
}

impl Correlation {
    /// Starts to track the content of an area of an image.
    ///
    /// # Errors
    /// If the area is smaller than 8 x 8 pixels or its centre is outside the image.
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
        let (mut place, mut scale) = (Numbers::default(), Numbers::default());
        place.clear(COUNT * COUNT);
        place
            .re
            .iter_mut()
            .enumerate()
            .for_each(|(at, v)| *v = bell(at % COUNT, 0.8) * bell(at / COUNT, 0.8));
        fourier.squares(&mut place);
        scale.clear(COUNT);
        scale.re.iter_mut().enumerate().for_each(|(at, v)| *v = bell(at, 1.4));
        fourier.lines(&mut scale);
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
            sampler: Sampler::default(),
            patch: Plane::default(),
            features: Numbers::default(),
            found: Numbers::default(),
        };
        tracker.learn(image, 1.0);
        Ok(tracker)
    }

    /// Current target area.
    pub fn area(&self) -> Area {
        self.area
    }

    /// Locates the target in the next image.
    pub fn follow(&mut self, image: &Plane<u8>) -> Area {
        self.see_place(image);
        self.place.answer(&self.features, &mut self.found);
        self.fourier.squares(&mut self.found);
        let [x, y] = peak(&self.found.re);
        let cell = self.side() / COUNT as f64;
        let ends = [image.width(), image.height()];
        for (axis, moved) in [x, y].into_iter().enumerate() {
            let middle = self.area.middle[axis] + moved * cell;
            self.area.middle[axis] = middle.clamp(0.0, ends[axis] as f64);
        }
        self.see_scales(image);
        self.scale.answer(&self.features, &mut self.found);
        self.fourier.lines(&mut self.found);
        let factor = math::pow(STEP, peak(&self.found.re)[0]);
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

    /// Side of the search square, pixels.
    fn side(&self) -> f64 {
        PADDING * (self.area.size[0] * self.area.size[1]).sqrt()
    }

    /// Computes and transforms the features of the square around the target.
    fn see_place(&mut self, image: &Plane<u8>) {
        let cells = COUNT + 2;
        let side = self.side() * cells as f64 / COUNT as f64;
        self.sampler.sample(image, (self.area.middle, [side; 2]), [CELL * cells; 2], &mut self.patch);
        self.features.clear(PLANES * COUNT * COUNT);
        let (features, hann) = (&mut self.features.re, &self.hann);
        self.fhog.cells(
            &self.patch,
            #[inline(always)]
            |x, y, planes| put(planes, hann[x] * hann[y], &mut features[(y * COUNT + x) * PLANES..]),
        );
        self.fourier.squares(&mut self.features);
    }

    /// Computes the features of the target at 32 scales, transformed along the scales.
    fn see_scales(&mut self, image: &Plane<u8>) {
        let size = self.area.size;
        let shrink = SIZED / (size[0] * size[1]).sqrt();
        let cells = size.map(|side| ((side * shrink / CELL as f64).round() as usize).clamp(2, 16));
        // The target's aspect ratio is constant, so the number of cells is too.
        let count = cells[0] * cells[1] * PLANES;
        self.features.clear(count * COUNT);
        let sizes = self.features.re.chunks_exact_mut(count).zip(&self.hann);
        for (at, (features, weight)) in sizes.enumerate() {
            let factor = math::pow(STEP, at as f64 - (COUNT / 2) as f64);
            let sides =
                [0, 1].map(|axis| size[axis] * factor * (cells[axis] + 2) as f64 / cells[axis] as f64);
            let pixels = cells.map(|n| CELL * (n + 2));
            self.sampler.sample(image, (self.area.middle, sides), pixels, &mut self.patch);
            self.fhog.cells(
                &self.patch,
                #[inline(always)]
                |x, y, planes| put(planes, *weight, &mut features[(y * cells[0] + x) * PLANES..]),
            );
        }
        self.fourier.lines(&mut self.features);
    }
}

/// Writes a cell's values times a weight.
#[inline(always)]
fn put(planes: &[f32; PLANES], weight: f32, into: &mut [f32]) {
    into[..PLANES].iter_mut().zip(planes).for_each(|(into, value)| *into = value * weight);
}

/// Resamples rectangles of images; reuses its buffers.
#[derive(Clone, Debug, Default)]
struct Sampler {
    /// Left and right source pixel of each column, and the weight of the right one.
    columns: Vec<(u32, u32, f32)>,
}

impl Sampler {
    /// Resamples a rectangle, given by its centre and sides, bilinearly; border pixels are repeated outside the image.
    fn sample(
        &mut self,
        image: &Plane<u8>,
        (middle, sides): ([f64; 2], [f64; 2]),
        size: [usize; 2],
        into: &mut Plane<f32>,
    ) {
        into.reset(size[0], size[1]);
        let ends = [image.width() - 1, image.height() - 1];
        let place = |axis: usize, at: usize| {
            let from = middle[axis] + ((at as f64 + 0.5) / size[axis] as f64 - 0.5) * sides[axis] - 0.5;
            let from = from.clamp(0.0, ends[axis] as f64);
            let first = from as u32;
            (first, (first + 1).min(ends[axis] as u32), (from - f64::from(first)) as f32)
        };
        self.columns.clear();
        self.columns.extend((0..size[0]).map(|x| place(0, x)));
        for y in 0..size[1] {
            let (above, below, fy) = place(1, y);
            let (above, below) = (image.row(above as usize), image.row(below as usize));
            for (value, &(left, right, fx)) in into.row_mut(y).iter_mut().zip(&self.columns) {
                let across = |row: &[u8]| {
                    let [left, right] = [left, right].map(|x| f32::from(row[x as usize]));
                    left + (right - left) * fx
                };
                let (above, below) = (across(above), across(below));
                *value = (above + (below - above) * fy) * (1.0 / 255.0);
            }
        }
    }
}

/// Position of the largest response, in cells from the centre, interpolated by a parabola.
fn peak(answers: &[f32]) -> [f64; 2] {
    let value = |at: usize| f64::from(answers[at]);
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
