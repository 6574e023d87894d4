//! Output heads: normal distributions in the plane, and distances, with gradients.

/// ln 2π, the constant of the log-density in the plane.
const LN_TAU: f32 = 1.837_877_1;
/// Limit of a log-deviation relative to its base, as an exponent of e.
const WIDTH: f32 = 3.0;

/// Normal distribution in the plane by five numbers: mean, logarithms of two standard deviations, and regression of
/// the second axis on the first.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Normal {
    pub(crate) mean: [f32; 2],
    /// Log-deviations of the first axis, and of the second axis given the first.
    ln_sigma: [f32; 2],
    /// Regression slope of the second axis on the first.
    slope: f32,
    /// Derivatives of the log-deviations by the net's numbers.
    by: [f32; 2],
}

impl Normal {
    /// Creates the distribution of a net's five numbers, about `base` and a standard deviation of `e` to the power of
    /// `ln_base`.
    pub(crate) fn of(numbers: &[f32], base: [f32; 2], ln_base: f32) -> Self {
        let bent = [numbers[2], numbers[3]].map(|one| libm::tanhf(one / WIDTH));
        Self {
            mean: [base[0] + numbers[0], base[1] + numbers[1]],
            ln_sigma: bent.map(|bent| ln_base + WIDTH * bent),
            slope: libm::tanhf(numbers[4]),
            by: bent.map(|bent| 1.0 - bent * bent),
        }
    }

    /// Standardised residual of a position along both axes.
    fn away(&self, at: [f32; 2]) -> [f32; 2] {
        let off = [at[0] - self.mean[0], at[1] - self.mean[1]];
        let [first, second] = self.ln_sigma.map(|ln| libm::expf(-ln));
        [off[0] * first, (off[1] - self.slope * off[0]) * second]
    }

    /// Negative logarithm of the density.
    pub(crate) fn nats(&self, at: [f32; 2]) -> f32 {
        let [x, y] = self.away(at);
        0.5 * (x * x + y * y) + self.ln_sigma[0] + self.ln_sigma[1] + LN_TAU
    }

    /// Gradient of [`nats`](Self::nats) by the net's five numbers.
    pub(crate) fn gradient(&self, at: [f32; 2]) -> [f32; 5] {
        let [x, y] = self.away(at);
        let [first, second] = self.ln_sigma.map(|ln| libm::expf(-ln));
        let off = at[0] - self.mean[0];
        [
            -x * first + y * second * self.slope,
            -y * second,
            (1.0 - x * x) * self.by[0],
            (1.0 - y * y) * self.by[1],
            -y * second * off * (1.0 - self.slope * self.slope),
        ]
    }

    /// Covariance xx, xy, yy.
    pub(crate) fn covariance(&self) -> [f32; 3] {
        let [first, second] = self.ln_sigma.map(|ln| libm::expf(2.0 * ln));
        [first, self.slope * first, second + self.slope * self.slope * first]
    }

    /// Position with the standardised residual `away`.
    pub(crate) fn at(&self, away: [f32; 2]) -> [f32; 2] {
        let [first, second] = self.ln_sigma.map(libm::expf);
        let off = first * away[0];
        [self.mean[0] + off, self.mean[1] + second * away[1] + self.slope * off]
    }
}

/// Distance of two positions, smoothed at zero, and its gradient by the first.
pub(crate) fn distance(a: [f32; 2], b: [f32; 2]) -> (f32, [f32; 2]) {
    let off = [a[0] - b[0], a[1] - b[1]];
    let size = (off[0] * off[0] + off[1] * off[1] + 1e-6).sqrt();
    (size, off.map(|one| one / size))
}

/// Logarithm of the sum of exponentials, and the softmax.
pub(crate) fn ln_sum(of: &[f32]) -> (f32, Vec<f32>) {
    let most = of.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let raw: Vec<f32> = of.iter().map(|one| libm::expf(one - most)).collect();
    let total: f32 = raw.iter().sum();
    (most + libm::logf(total), raw.iter().map(|one| one / total).collect())
}
