//! Kalman filter of a position in the plane with nearly constant velocity, and its smoother.

use std::collections::VecDeque;

use nalgebra::{Matrix2, Matrix2x4, Matrix4, RowVector4, Vector2, Vector4};
use swerve_core::Time;
use swerve_geom::{Point2, math};

/// Filter with the state x and y in metres, and their velocities in m/s (Bar-Shalom, Li and Kirubarajan 2001, section
/// 6.2.2: continuous white noise acceleration).
#[derive(Clone, PartialEq, Debug)]
pub(super) struct Filter {
    /// Steps, one per instant, the latest last.
    steps: VecDeque<Step>,
}

/// Filter step at one instant.
#[derive(Clone, PartialEq, Debug)]
struct Step {
    at: Time,
    /// Time since the previous instant, seconds.
    since_s: f64,
    predicted: Gauss,
    filtered: Gauss,
    is_measured: bool,
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Gauss {
    mean: Vector4<f64>,
    covariance: Matrix4<f64>,
}

impl Gauss {
    /// Predicts by `dt_s` with acceleration noise of this spectral density, m²/s³.
    fn moved(&self, dt_s: f64, density: f64) -> Self {
        let f = transition(dt_s);
        let (a, b, c) = (dt_s * dt_s * dt_s / 3.0, 0.5 * dt_s * dt_s, dt_s);
        #[rustfmt::skip]
        let q = Matrix4::new(
            a, 0.0, b, 0.0,
            0.0, a, 0.0, b,
            b, 0.0, c, 0.0,
            0.0, b, 0.0, c,
        ) * density;
        Self { mean: f * self.mean, covariance: f * self.covariance * f.transpose() + q }
    }
}

/// Measurement matrix: the position of a state.
fn position() -> Matrix2x4<f64> {
    Matrix2x4::new(1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0)
}

/// State transition matrix.
fn transition(dt_s: f64) -> Matrix4<f64> {
    let mut f = Matrix4::identity();
    (f[(0, 2)], f[(1, 3)]) = (dt_s, dt_s);
    f
}

impl Filter {
    /// Initial state at a measured position with an unknown velocity; both with a covariance, m² and m²/s².
    pub(super) fn new(
        at: Time,
        measured: Vector2<f64>,
        covariance: Matrix2<f64>,
        velocity: Matrix2<f64>,
    ) -> Self {
        let mean = Vector4::new(measured.x, measured.y, 0.0, 0.0);
        let mut p = Matrix4::zeros();
        p.fixed_view_mut::<2, 2>(0, 0).copy_from(&covariance);
        p.fixed_view_mut::<2, 2>(2, 2).copy_from(&velocity);
        let state = Gauss { mean, covariance: p };
        let first = Step { at, since_s: 0.0, predicted: state, filtered: state, is_measured: true };
        Self { steps: [first].into() }
    }

    /// Predicts to an instant; `density` is the spectral density of the acceleration, m²/s³.
    pub(super) fn predict(&mut self, at: Time, density: f64) {
        let last = self.last();
        let since_s = (at - last.at).as_secs();
        let predicted = last.filtered.moved(since_s, density);
        self.steps.push_back(Step { at, since_s, predicted, filtered: predicted, is_measured: false });
    }

    /// Assumes a sudden velocity change with this standard deviation, m/s, right after the previous instant. Earlier
    /// steps are dropped, as they carry no information on the motion after it.
    pub(super) fn jump(&mut self, change_mps: f64) {
        let predicted = self.expected(change_mps);
        self.steps.drain(..self.steps.len().saturating_sub(2));
        if let Some(step) = self.steps.back_mut() {
            (step.predicted, step.filtered) = (predicted, predicted);
        }
    }

    /// Predicted current state after such a change.
    fn expected(&self, change_mps: f64) -> Gauss {
        let dt_s = self.last().since_s;
        let (b, c) = (dt_s * change_mps * change_mps, change_mps * change_mps);
        #[rustfmt::skip]
        let change = Matrix4::new(
            dt_s * b, 0.0, b, 0.0,
            0.0, dt_s * b, 0.0, b,
            b, 0.0, c, 0.0,
            0.0, b, 0.0, c,
        );
        let Gauss { mean, covariance } = self.last().predicted;
        Gauss { mean, covariance: covariance + change }
    }

    /// Updates with a measurement of the current position. Steps before the last `kept` measured ones are dropped.
    pub(super) fn update(&mut self, measured: Vector2<f64>, noise: Matrix2<f64>, kept: usize) {
        let step = self.steps.back_mut().expect("a filter starts with a step and keeps its last");
        let (h, Gauss { mean, covariance }) = (position(), step.predicted);
        let Some(inverse) = (h * covariance * h.transpose() + noise).try_inverse() else { return };
        let gain = covariance * h.transpose() * inverse;
        // Joseph form: symmetric and positive definite despite rounding.
        let rest = Matrix4::identity() - gain * h;
        step.filtered = Gauss {
            mean: mean + gain * (measured - h * mean),
            covariance: rest * covariance * rest.transpose() + gain * noise * gain.transpose(),
        };
        step.is_measured = true;
        while self.steps.iter().filter(|step| step.is_measured).count() > kept.max(1) {
            self.steps.pop_front();
        }
    }

    /// Updates with a measured velocity component along a unit vector, m/s, of this standard deviation. Call it after
    /// [`update`](Self::update).
    pub(super) fn update_speed(&mut self, along: Vector2<f64>, speed_mps: f64, noise_mps: f64, gate: f64) {
        let step = self.steps.back_mut().expect("a filter starts with a step and keeps its last");
        let (h, Gauss { mean, covariance }) = (RowVector4::new(0.0, 0.0, along.x, along.y), step.filtered);
        let variance = (h * covariance * h.transpose())[0] + noise_mps * noise_mps;
        let off_mps = speed_mps - (h * mean)[0];
        if off_mps * off_mps > gate * variance {
            return;
        }
        let gain = covariance * h.transpose() / variance;
        let rest = Matrix4::identity() - gain * h;
        step.filtered = Gauss {
            mean: mean + gain * off_mps,
            covariance: rest * covariance * rest.transpose()
                + gain * gain.transpose() * (noise_mps * noise_mps),
        };
    }

    /// Squared Mahalanobis distance of a measurement from the predicted position, after a sudden velocity change with
    /// this standard deviation, m/s; and the logarithm of the determinant of its covariance.
    pub(super) fn squared_distance(
        &self,
        change_mps: f64,
        measured: Vector2<f64>,
        noise: Matrix2<f64>,
    ) -> Option<(f64, f64)> {
        let (h, Gauss { mean, covariance }) = (position(), self.expected(change_mps));
        let off = measured - h * mean;
        let spread = h * covariance * h.transpose() + noise;
        Some(((off.transpose() * spread.try_inverse()? * off)[0], math::ln(spread.determinant())))
    }

    /// Squared Mahalanobis distance of the present positions of two tracks with independent errors.
    pub(super) fn apart(&self, other: &Self) -> Option<f64> {
        let (h, a, b) = (position(), self.last().filtered, other.last().filtered);
        let off = h * (a.mean - b.mean);
        Some((off.transpose() * (h * (a.covariance + b.covariance) * h.transpose()).try_inverse()? * off)[0])
    }

    /// Moves the reference point of the body: shifts the current and all stored positions.
    pub(super) fn shift(&mut self, by: Vector2<f64>) {
        let by = Vector4::new(by.x, by.y, 0.0, 0.0);
        for step in &mut self.steps {
            step.predicted.mean += by;
            step.filtered.mean += by;
        }
    }

    /// Sets the current velocity to zero.
    pub(super) fn rest(&mut self) {
        let step = self.steps.back_mut().expect("a filter starts with a step and keeps its last");
        for state in [&mut step.predicted, &mut step.filtered] {
            state.mean.fixed_rows_mut::<2>(2).fill(0.0);
        }
    }

    /// Current position and velocity.
    pub(super) fn state(&self) -> (f64, f64, [f64; 2]) {
        let mean = self.last().filtered.mean;
        (mean[0], mean[1], [mean[2], mean[3]])
    }

    /// Current velocity, each component along an axis of its covariance reduced to what exceeds its error: by the
    /// non-negative garrote (Breiman 1995) with `doubt` standard deviations.
    pub(super) fn sure_mps(&self, doubt: f64) -> Vector2<f64> {
        let Gauss { mean, covariance } = self.last().filtered;
        let velocity = mean.fixed_rows::<2>(2).into_owned();
        if doubt <= 0.0 {
            return velocity;
        }
        let axes = covariance.fixed_view::<2, 2>(2, 2).into_owned().symmetric_eigen();
        let parts = axes.eigenvectors.transpose() * velocity;
        let reduced = parts.zip_map(&axes.eigenvalues, |part, variance| {
            let square = part * part;
            part * (1.0 - doubt * doubt * variance / square.max(f64::MIN_POSITIVE)).max(0.0)
        });
        axes.eigenvectors * reduced
    }

    /// True if the current velocity along a unit vector is not zero: more than this speed, m/s, and more than three
    /// standard deviations.
    pub(super) fn moves_along(&self, axis: Vector2<f64>, least_mps: f64) -> bool {
        let Gauss { mean, covariance } = self.last().filtered;
        let h = RowVector4::new(0.0, 0.0, axis.x, axis.y);
        let speed_mps = (h * mean)[0];
        let variance = (h * covariance * h.transpose())[0];
        speed_mps.abs() > least_mps && speed_mps * speed_mps > 9.0 * variance
    }

    /// Current instant.
    pub(super) fn at(&self) -> Time {
        self.last().at
    }

    /// Covariance of the current position and velocity.
    pub(super) fn covariance(&self) -> Matrix4<f64> {
        self.last().filtered.covariance
    }

    /// Determinant of the covariance of the current position, m⁴.
    pub(super) fn spread_m4(&self) -> f64 {
        (position() * self.covariance() * position().transpose()).determinant()
    }

    /// Measured instants, oldest first, with the smoothed position of each given all stored measurements.
    pub(super) fn smoothed(&self) -> Vec<(Time, Point2)> {
        let mut after: Option<(&Step, Vector4<f64>)> = None;
        let mut way = Vec::with_capacity(self.steps.len());
        for step in self.steps.iter().rev() {
            let Gauss { mean, covariance } = step.filtered;
            let best = match after {
                None => mean,
                Some((next, smoothed)) => match next.predicted.covariance.try_inverse() {
                    Some(inverse) => {
                        let gain = covariance * transition(next.since_s).transpose() * inverse;
                        mean + gain * (smoothed - next.predicted.mean)
                    }
                    None => mean,
                },
            };
            if step.is_measured {
                way.push((step.at, Point2::new(best[0], best[1])));
            }
            after = Some((step, best));
        }
        way.reverse();
        way
    }

    fn last(&self) -> &Step {
        self.steps.back().expect("a filter starts with a step and keeps its last")
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{DMatrix, DVector};
    use swerve_core::Rng;

    /// Filter and smoother match the solution of one least-squares problem over all steps.
    #[test]
    fn smoother_matches_the_least_squares_solution() {
        let mut rng = Rng::keyed(1, "kalman", &[]);
        let noise = Matrix2::new(0.3, 0.1, 0.1, 0.2);
        let instants = [0_i64, 50, 100, 170, 200, 300];
        let measured: Vec<Vector2<f64>> =
            instants.iter().map(|ms| Vector2::new(*ms as f64 * 3e-3 + rng.normal(), rng.normal())).collect();
        let (density, speed) = (2.0, 4.0);
        let mut filter =
            Filter::new(Time::from_ms(0), measured[0], noise, Matrix2::identity() * (speed * speed));
        for k in 1..instants.len() {
            filter.predict(Time::from_ms(instants[k]), density);
            if k != 3 {
                filter.update(measured[k], noise, 100);
            }
        }
        // Unknowns: all states. Rows, each weighted by its inverse standard deviation: initial velocity, motion,
        // measurements.
        let n = instants.len();
        let mut information = DMatrix::<f64>::zeros(4 * n, 4 * n);
        let mut right = DVector::<f64>::zeros(4 * n);
        for d in 2..4 {
            information[(d, d)] += 1.0 / (speed * speed);
        }
        let h = position();
        let weight = noise.try_inverse().unwrap();
        for k in (0..n).filter(|k| *k != 3) {
            let mut block = information.fixed_view_mut::<4, 4>(4 * k, 4 * k);
            block += h.transpose() * weight * h;
            let mut rows = right.fixed_rows_mut::<4>(4 * k);
            rows += h.transpose() * weight * measured[k];
        }
        for k in 1..n {
            let dt = (instants[k] - instants[k - 1]) as f64 * 1e-3;
            let f = transition(dt);
            let (a, b, c) = (dt * dt * dt / 3.0, 0.5 * dt * dt, dt);
            #[rustfmt::skip]
            let q = Matrix4::new(a, 0., b, 0., 0., a, 0., b, b, 0., c, 0., 0., b, 0., c) * density;
            let w = q.try_inverse().unwrap();
            let (i, j) = (4 * (k - 1), 4 * k);
            let mut add = |r: usize, c: usize, m: Matrix4<f64>| {
                let mut block = information.fixed_view_mut::<4, 4>(r, c);
                block += m;
            };
            add(i, i, f.transpose() * w * f);
            add(i, j, -f.transpose() * w);
            add(j, i, -w * f);
            add(j, j, w);
        }
        let states = information.lu().solve(&right).unwrap();
        let (x, y, [vx, vy]) = filter.state();
        for (a, b) in [x, y, vx, vy].into_iter().zip(states.fixed_rows::<4>(4 * (n - 1)).iter()) {
            assert!((a - b).abs() < 1e-6, "{a} {b}");
        }
        let smoothed = filter.smoothed();
        assert_eq!(smoothed.len(), 5);
        for ((_, point), k) in smoothed.iter().zip([0, 1, 2, 4, 5]) {
            assert!((point.x_m - states[4 * k]).abs() < 1e-6 && (point.y_m - states[4 * k + 1]).abs() < 1e-6);
        }
    }

    #[test]
    fn covariance_grows_without_measurements_and_shrinks_with_them() {
        let noise = Matrix2::identity();
        let mut filter = Filter::new(Time::ZERO, Vector2::new(1.0, 2.0), noise, noise * 9.0);
        let far = Vector2::new(4.0, 2.0);
        filter.predict(Time::from_ms(100), 1.0);
        let seen = filter.squared_distance(0.0, far, noise).unwrap().0;
        filter.predict(Time::from_ms(600), 1.0);
        assert!(filter.squared_distance(0.0, far, noise).unwrap().0 < seen);
        filter.update(Vector2::new(1.0, 2.0), noise, 10);
        filter.predict(Time::from_ms(650), 1.0);
        assert_eq!(filter.smoothed().len(), 2, "what was not seen is no sighting");
    }
}
