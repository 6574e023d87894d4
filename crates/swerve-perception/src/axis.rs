//! Kalman filter of one coordinate with a nearly constant rate.

/// Estimate and covariance of a value and its rate.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Axis {
    pub(crate) value: f64,
    pub(crate) rate: f64,
    /// Variance of the value, covariance, variance of the rate.
    covariance: [f64; 3],
}

impl Axis {
    /// Initial estimate at a value, with the variances of value and rate; a rate variance of 0 keeps the rate at 0.
    pub(crate) fn new(value: f64, variances: [f64; 2]) -> Self {
        Self { value, rate: 0.0, covariance: [variances[0], 0.0, variances[1]] }
    }

    /// Predicts by `dt`, in the time unit of the rate; `noise` is added to the variances of value and rate.
    pub(crate) fn predict(&mut self, dt: f64, noise: [f64; 2]) {
        self.value += dt * self.rate;
        let [value, both, rate] = self.covariance;
        let moved = value + 2.0 * dt * both + dt * dt * rate;
        self.covariance = [moved + noise[0], both + dt * rate, rate + noise[1]];
    }

    /// Updates with a measurement and its variance.
    pub(crate) fn update(&mut self, measured: f64, variance: f64) {
        let [value, both, rate] = self.covariance;
        let gain = [value / (value + variance), both / (value + variance)];
        let off = measured - self.value;
        self.value += gain[0] * off;
        self.rate += gain[1] * off;
        self.covariance = [value - gain[0] * value, both - gain[0] * both, rate - gain[1] * both];
    }

    /// Squared Mahalanobis distance of a measurement with this variance.
    pub(crate) fn squared_distance(&self, measured: f64, variance: f64) -> f64 {
        let off = measured - self.value;
        off * off / (self.covariance[0] + variance)
    }
}
