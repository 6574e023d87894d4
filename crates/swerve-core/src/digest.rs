//! Digests: one number that two equal runs share.

use core::fmt;

use postcard::ser_flavors::Flavor;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::Xxh3;

/// A 64-bit fingerprint (XXH3), printed as sixteen hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Digest(pub u64);

impl fmt::Display for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:016x}", self.0)
    }
}

impl fmt::Debug for Digest {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Digest({self})")
    }
}

/// Takes in numbers, bytes and values and gives their [`Digest`].
#[derive(Clone, Default)]
pub struct Hasher {
    xxh: Xxh3,
}

impl Hasher {
    /// An empty hasher.
    pub fn new() -> Self {
        Self::default()
    }

    /// Takes in bytes as they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.xxh.update(bytes);
    }

    /// Takes in one number.
    pub fn number(&mut self, n: u64) {
        self.xxh.update(&n.to_le_bytes());
    }

    /// Takes in a value through its serialized form (postcard), without storing that form.
    ///
    /// # Panics
    /// When the value's `Serialize` refuses, or holds a sequence of unknown length: a bug of the type.
    pub fn value<T: Serialize + ?Sized>(&mut self, value: &T) {
        postcard::serialize_with_flavor::<T, _, ()>(value, Sink(&mut self.xxh))
            .expect("message types serialize without fail");
    }

    /// The digest of all that was taken in so far.
    pub fn digest(&self) -> Digest {
        Digest(self.xxh.digest())
    }
}

impl fmt::Debug for Hasher {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Hasher({})", self.digest())
    }
}

/// The digest of one value.
pub fn digest_of<T: Serialize + ?Sized>(value: &T) -> Digest {
    let mut hasher = Hasher::new();
    hasher.value(value);
    hasher.digest()
}

struct Sink<'a>(&'a mut Xxh3);

impl Flavor for Sink<'_> {
    type Output = ();

    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.0.update(&[byte]);
        Ok(())
    }

    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.0.update(bytes);
        Ok(())
    }

    fn finalize(self) -> postcard::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_values_share_a_digest_and_one_bit_tells() {
        assert_eq!(digest_of(&(1.0_f64, "a")), digest_of(&(1.0_f64, "a")));
        assert_ne!(digest_of(&1.0_f64), digest_of(&f64::from_bits(1.0_f64.to_bits() + 1)));
    }

    #[test]
    fn a_digest_prints_sixteen_digits() {
        assert_eq!(Digest(0xab).to_string(), "00000000000000ab");
    }
}
