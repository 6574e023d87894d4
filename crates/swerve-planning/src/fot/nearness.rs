//! Nearness to obstacles: the part of a candidate's cost that couples its lateral and longitudinal motion.

use swerve_core::{Span, Time};

use crate::collision::Obstacles;

/// Corners of all boxes grown by the clearance: (box x 4 + corner) x sample.
#[derive(Clone, Debug, Default)]
pub(super) struct Corners {
    x: Vec<f64>,
    y: Vec<f64>,
    samples: usize,
}

impl Corners {
    /// From all obstacles at the samples.
    pub(super) fn set(&mut self, obstacles: &Obstacles, at: Time, clearance_m: f64, samples_s: &[f64]) {
        self.samples = samples_s.len();
        self.x.clear();
        self.y.clear();
        let mut boxes = 0;
        obstacles.for_each_at(at, |_| boxes += 1);
        self.x.resize(boxes * 4 * self.samples, 0.0);
        self.y.resize(boxes * 4 * self.samples, 0.0);
        for (k, &t) in samples_s.iter().enumerate() {
            let mut row = k;
            obstacles.for_each_at(at + Span::from_secs(t), |solid| {
                let mut grown = *solid;
                grown.half_length_m += clearance_m;
                grown.half_width_m += clearance_m;
                for corner in grown.corners() {
                    self.x[row] = corner.x_m;
                    self.y[row] = corner.y_m;
                    row += self.samples;
                }
            });
        }
    }

    /// Whether there is nothing to be near to.
    pub(super) fn is_empty(&self) -> bool {
        self.x.is_empty()
    }
}

/// Positions by coordinate, metres.
#[derive(Clone, Copy)]
pub(super) struct Points<'a> {
    pub(super) x: &'a [f64],
    pub(super) y: &'a [f64],
}

impl<'a> Points<'a> {
    /// The first `n`; of so many the compiler makes loops without checks.
    fn first(self, n: usize) -> Self {
        Self { x: &self.x[..n], y: &self.y[..n] }
    }
}

/// Sum over samples and boxes of 1 / distance from `a` to the nearest corner; with `b`, of the stretch from
/// `a` to `b`, where each corner counts as far as the further end.
pub(super) fn sum_nearness(corners: &Corners, a: Points<'_>, b: Option<Points<'_>>, near: &mut [f64]) -> f64 {
    let n = near.len();
    let (a, b) = (a.first(n), b.map(|b| b.first(n)));
    let mut total = 0.0;
    let boxes = corners.x.len() / (4 * corners.samples);
    for index in 0..boxes {
        near.fill(f64::INFINITY);
        for corner in 0..4 {
            let first = (4 * index + corner) * corners.samples;
            let corner = Points { x: &corners.x[first..first + n], y: &corners.y[first..first + n] };
            match b {
                None => nearest(near, corner, a),
                Some(b) => nearest_of_stretch(near, corner, a, b),
            }
        }
        // Many at a time; the sum keeps its order.
        near.iter_mut().for_each(|squared| *squared = 1.0 / squared.sqrt());
        for nearness in near.iter() {
            total += nearness;
        }
    }
    total
}

fn nearest(near: &mut [f64], corner: Points<'_>, a: Points<'_>) {
    for (k, near) in near.iter_mut().enumerate() {
        let (dx, dy) = (corner.x[k] - a.x[k], corner.y[k] - a.y[k]);
        let squared = dx * dx + dy * dy;
        *near = if squared < *near { squared } else { *near };
    }
}

fn nearest_of_stretch(near: &mut [f64], corner: Points<'_>, a: Points<'_>, b: Points<'_>) {
    for (k, near) in near.iter_mut().enumerate() {
        let (ax, ay) = (corner.x[k] - a.x[k], corner.y[k] - a.y[k]);
        let (bx, by) = (corner.x[k] - b.x[k], corner.y[k] - b.y[k]);
        let (to_a, to_b) = (ax * ax + ay * ay, bx * bx + by * by);
        let squared = if to_a > to_b { to_a } else { to_b };
        *near = if squared < *near { squared } else { *near };
    }
}
