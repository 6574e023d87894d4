//! Stateless random numbers: integer hashes keyed by their purpose.
//!
//! They use multiplications and exclusive ors of 32-bit integers, so that a shader can compute the same.

/// Mixes 32 bits; every bit of the input changes about half of the output.
pub fn mix(mut x: u32) -> u32 {
    x ^= x >> 16;
    x = x.wrapping_mul(0x7feb_352d);
    x ^= x >> 15;
    x = x.wrapping_mul(0x846c_a68b);
    x ^ (x >> 16)
}

/// Folds 64 bits to 32.
pub fn fold(x: u64) -> u32 {
    mix(x as u32 ^ mix((x >> 32) as u32 ^ 0x9e37_79b9))
}

/// A hash of a seed and a purpose.
pub fn keyed(seed: u64, purpose: u32) -> u32 {
    mix(fold(seed) ^ mix(purpose.wrapping_add(0x51ed_270b)))
}

/// Converts a hash to a number in [0, 1).
pub fn unit(hash: u32) -> f32 {
    (hash >> 8) as f32 * (1.0 / 16_777_216.0)
}

/// Sequence of random draws from one seed, for meshes and colours.
#[derive(Clone, Debug)]
pub struct Draws {
    seed: u64,
    count: u32,
}

impl Draws {
    /// Creates draws for one purpose of a seed.
    pub fn new(seed: u64, purpose: u32) -> Self {
        Self { seed: seed ^ (u64::from(mix(purpose)) << 32 | u64::from(purpose)), count: 0 }
    }

    /// Next hash.
    pub fn bits(&mut self) -> u32 {
        self.count = self.count.wrapping_add(1);
        keyed(self.seed, self.count)
    }

    /// Next number in [low, high).
    pub fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * unit(self.bits())
    }

    /// Next index below `count`, which must be at least 1.
    pub fn below(&mut self, count: usize) -> usize {
        ((u64::from(self.bits()) * count as u64) >> 32) as usize
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f32) -> bool {
        unit(self.bits()) < probability
    }

    /// One of several values, of which there must be at least one.
    pub fn one_of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len())]
    }
}

/// Folds values to a 64-bit key for caches (FNV-1a over 32-bit words).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Key(pub u64);

impl Default for Key {
    fn default() -> Self {
        Self(0xcbf2_9ce4_8422_2325)
    }
}

impl Key {
    /// Adds a word.
    pub fn word(&mut self, word: u32) {
        self.0 = (self.0 ^ u64::from(word)).wrapping_mul(0x0000_0100_0000_01b3);
        self.0 ^= self.0 >> 29;
    }

    /// Adds two words.
    pub fn long(&mut self, long: u64) {
        self.word(long as u32);
        self.word((long >> 32) as u32);
    }

    /// Adds the bits of a number.
    pub fn number(&mut self, number: f32) {
        self.word(number.to_bits());
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draws_are_even_and_follow_their_seed() {
        let mut draws = Draws::new(7, 1);
        let mean = (0..4000).map(|_| draws.between(0.0, 1.0)).sum::<f32>() / 4000.0;
        assert!((mean - 0.5).abs() < 0.02, "{mean}");
        assert_eq!(Draws::new(7, 1).bits(), Draws::new(7, 1).bits());
        assert_ne!(Draws::new(7, 1).bits(), Draws::new(8, 1).bits());
        assert_ne!(Draws::new(7, 1).bits(), Draws::new(7, 2).bits());
        assert!((0..100).all(|_| draws.below(3) < 3));
    }
}
