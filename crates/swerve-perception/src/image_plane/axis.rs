//! A Kalman filter of one coordinate that moves with nearly constant rate, one step a frame.

/// Estimate and covariance of a value and its rate per frame.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Axis {
    pub(super) value: f64,
    pub(super) rate: f64,
    /// Of the value, of both, of the rate.
    covariance: [f64; 3],
}

impl Axis {
    /// First seen at a value, with variances of value and rate; a variance of 0 keeps the rate at 0.
    pub(super) fn new(value: f64, variances: [f64; 2]) -> Self {
        Self { value, rate: 0.0, covariance: [variances[0], 0.0, variances[1]] }
    }

    /// One frame on; `noise` is the variance that value and rate gain.
    pub(super) fn predict(&mut self, noise: [f64; 2]) {
        self.value += self.rate;
        let [value, both, rate] = self.covariance;
        self.covariance = [value + 2.0 * both + rate + noise[0], both + rate, rate + noise[1]];
    }

    /// Takes in a measurement with its variance.
    pub(super) fn update(&mut self, measured: f64, variance: f64) {
        let [value, both, rate] = self.covariance;
        let gain = [value / (value + variance), both / (value + variance)];
        let off = measured - self.value;
        self.value += gain[0] * off;
        self.rate += gain[1] * off;
        self.covariance = [value - gain[0] * value, both - gain[0] * both, rate - gain[1] * both];
    }
}
