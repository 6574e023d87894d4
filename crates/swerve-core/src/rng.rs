//! Seeded random numbers that are independent of the order of drawing.

use rand::{Rng as _, SeedableRng};
use rand_pcg::Pcg64Mcg;
use xxhash_rust::xxh3::Xxh3;

/// A random number generator keyed by a seed and a list of names and numbers.
///
/// Draws under different keys never influence each other, so neither the order of execution nor the number of threads
/// affects a result. The same key gives the same numbers on any machine: integer arithmetic, square roots and `libm`
/// only.
#[derive(Clone, Debug)]
pub struct Rng {
    pcg: Pcg64Mcg,
}

impl Rng {
    /// Generator for `name` and `key` under `seed`.
    pub fn keyed(seed: u64, name: &str, key: &[i64]) -> Self {
        let mut hash = Xxh3::with_seed(seed);
        hash.update(name.as_bytes());
        for k in key {
            hash.update(&k.to_le_bytes());
        }
        Self { pcg: Pcg64Mcg::from_seed(hash.digest128().to_le_bytes()) }
    }

    /// Next 64 random bits.
    pub fn bits(&mut self) -> u64 {
        self.pcg.next_u64()
    }

    /// Uniform in `[0, 1)`.
    pub fn unit(&mut self) -> f64 {
        (self.bits() >> 11) as f64 * (1.0 / (1u64 << 53) as f64)
    }

    /// Uniform in `[low, high)`; `low` if the range is empty.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.unit()
    }

    /// Uniform in `0..n`; 0 if `n` is 0.
    pub fn below(&mut self, n: usize) -> usize {
        ((u128::from(self.bits()) * n as u128) >> 64) as usize
    }

    /// Standard normal (Box and Muller, 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * libm::log(1.0 - self.unit())).sqrt();
        radius * libm::cos(core::f64::consts::TAU * self.unit())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_depend_on_seed_name_and_key_only() {
        let draw = |seed, name, key: &[i64]| Rng::keyed(seed, name, key).bits();
        assert_eq!(draw(1, "lidar", &[5]), draw(1, "lidar", &[5]));
        assert_ne!(draw(1, "lidar", &[5]), draw(2, "lidar", &[5]));
        assert_ne!(draw(1, "lidar", &[5]), draw(1, "imu", &[5]));
        assert_ne!(draw(1, "lidar", &[5]), draw(1, "lidar", &[6]));
    }

    #[test]
    fn normal_has_mean_zero_and_deviation_one() {
        let mut rng = Rng::keyed(3, "normal", &[]);
        let n = 200_000;
        let (mut sum, mut square) = (0.0, 0.0);
        for _ in 0..n {
            let x = rng.normal();
            sum += x;
            square += x * x;
        }
        let mean = sum / f64::from(n);
        let deviation = (square / f64::from(n) - mean * mean).sqrt();
        assert!(mean.abs() < 0.01 && (deviation - 1.0).abs() < 0.01, "{mean} {deviation}");
    }

    #[test]
    fn unit_and_below_stay_in_range() {
        let mut rng = Rng::keyed(4, "unit", &[]);
        for _ in 0..10_000 {
            assert!((0.0..1.0).contains(&rng.unit()));
            assert!(rng.below(7) < 7);
        }
        assert_eq!(rng.below(0), 0);
    }
}
