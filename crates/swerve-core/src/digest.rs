//! Digests: one number that two equal runs share.

use core::fmt;

use postcard::ser_flavors::Flavor;
use serde::{Deserialize, Serialize};
use xxhash_rust::xxh3::{Xxh3, xxh3_64};

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
        let mut form = Form::new(Some(core::mem::take(&mut self.xxh)));
        form.take_in(value);
        self.xxh = form.spilled();
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

/// The digest of one value: the same as that of a [`Hasher`] which took in this value alone.
///
/// # Panics
/// As [`Hasher::value`].
pub fn digest_of<T: Serialize + ?Sized>(value: &T) -> Digest {
    let mut form = Form::new(None);
    form.take_in(value);
    form.digest()
}

/// What a serialized form is collected in before it is hashed: most messages fit, and are hashed at once.
const FORM_MAX: usize = 128;

/// A serialized form on its way to its digest.
struct Form {
    bytes: [u8; FORM_MAX],
    len: usize,
    /// Takes in what does not fit; absent as long as all fits.
    rest: Option<Xxh3>,
}

impl Form {
    fn new(rest: Option<Xxh3>) -> Self {
        Self { bytes: [0; FORM_MAX], len: 0, rest }
    }

    fn take_in<T: Serialize + ?Sized>(&mut self, value: &T) {
        postcard::serialize_with_flavor::<T, _, ()>(value, Sink(self))
            .expect("message types serialize without fail");
    }

    #[inline]
    fn push(&mut self, byte: u8) {
        if self.len == FORM_MAX {
            self.spill();
        }
        self.bytes[self.len] = byte;
        self.len += 1;
    }

    #[inline]
    fn extend(&mut self, bytes: &[u8]) {
        if self.len + bytes.len() > FORM_MAX {
            self.spill();
        }
        if bytes.len() > FORM_MAX {
            self.rest.get_or_insert_default().update(bytes);
        } else {
            self.bytes[self.len..self.len + bytes.len()].copy_from_slice(bytes);
            self.len += bytes.len();
        }
    }

    #[cold]
    fn spill(&mut self) {
        self.rest.get_or_insert_default().update(&self.bytes[..self.len]);
        self.len = 0;
    }

    fn spilled(mut self) -> Xxh3 {
        self.spill();
        self.rest.unwrap_or_default()
    }

    fn digest(self) -> Digest {
        match self.rest {
            None => Digest(xxh3_64(&self.bytes[..self.len])),
            Some(_) => Digest(self.spilled().digest()),
        }
    }
}

struct Sink<'a>(&'a mut Form);

impl Flavor for Sink<'_> {
    type Output = ();

    #[inline]
    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.0.push(byte);
        Ok(())
    }

    #[inline]
    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.0.extend(bytes);
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
    fn forms_of_any_length_hash_as_one_run_of_bytes() {
        for n in [0, 1, 7, 13, 14, 15, 120, 126, 127, 128, 129, 240, 300, 511, 5000] {
            let text: String = (0..n).map(|i| char::from(b'a' + (i % 26) as u8)).collect();
            let numbers: Vec<f64> = (0..n).map(|i| f64::from(i as u32)).collect();
            let value = (text, numbers, 7_u8);
            let mut bytes = Xxh3::new();
            bytes.update(&postcard::to_stdvec(&value).unwrap());
            assert_eq!(digest_of(&value), Digest(bytes.digest()), "{n}");
            let mut hasher = Hasher::new();
            hasher.number(3);
            hasher.value(&value);
            let mut after = Xxh3::new();
            after.update(&3_u64.to_le_bytes());
            after.update(&postcard::to_stdvec(&value).unwrap());
            assert_eq!(hasher.digest(), Digest(after.digest()), "{n}");
        }
    }

    #[test]
    fn a_digest_prints_sixteen_digits() {
        assert_eq!(Digest(0xab).to_string(), "00000000000000ab");
    }
}
