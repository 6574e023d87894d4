//! Digests: 64-bit fingerprints; equal runs have equal digests.

mod form;

use core::fmt;

use serde::{Deserialize, Serialize, Serializer};
use xxhash_rust::xxh3::Xxh3;

use form::{DEFAULT, Form};

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

/// Hashes numbers, bytes and serializable values to a [`Digest`].
#[derive(Clone, Default)]
pub struct Hasher {
    xxh: Xxh3,
}

impl Hasher {
    /// An empty hasher.
    pub fn new() -> Self {
        Self::default()
    }

    /// Hashes bytes as they are.
    pub fn bytes(&mut self, bytes: &[u8]) {
        self.xxh.update(bytes);
    }

    /// Hashes one number, as eight little-endian bytes.
    pub fn number(&mut self, n: u64) {
        self.xxh.update(&n.to_le_bytes());
    }

    /// Hashes the serialized form of a value (fixed-width words) without storing the whole form.
    ///
    /// Floats are hashed by their bits: 0.0 and -0.0 differ, and so do NaNs of different sign or payload.
    ///
    /// # Panics
    /// If the value's `Serialize` returns an error, which is a bug in the type.
    pub fn value<T: Serialize + ?Sized>(&mut self, value: &T) {
        let mut form = Form::after(core::mem::take(&mut self.xxh));
        form.take_in(value);
        self.xxh = form.spilled();
    }

    /// Digest of everything hashed so far.
    pub fn digest(&self) -> Digest {
        Digest(self.xxh.digest())
    }
}

impl fmt::Debug for Hasher {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "Hasher({})", self.digest())
    }
}

/// Digest of one value: equal to that of a [`Hasher`] that hashed this value only.
///
/// # Panics
/// As [`Hasher::value`].
pub fn digest_of<T: Serialize + ?Sized>(value: &T) -> Digest {
    let mut form = Form::new();
    form.take_in(value);
    Digest(form.hash())
}

/// Serializes a field that was added to a type, with `#[serde(default, serialize_with = "unless_default")]`: its default
/// adds nothing to digests, which thus remain those of earlier versions. All other formats contain it.
///
/// Unlike `skip_serializing_if`, this also suits formats without field names.
///
/// # Errors
/// Those of the serializer.
pub fn unless_default<T, S>(value: &T, serializer: S) -> Result<S::Ok, S::Error>
where
    T: Serialize + Default + PartialEq,
    S: Serializer,
{
    let name = if *value == T::default() { DEFAULT } else { "value" };
    serializer.serialize_newtype_struct(name, value)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A sequence that does not report its length.
    struct Uncounted(Vec<u64>);

    impl Serialize for Uncounted {
        fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
            serializer.collect_seq(self.0.iter().filter(|_| true))
        }
    }

    #[test]
    fn equal_values_share_a_digest_and_one_bit_changes_it() {
        assert_eq!(digest_of(&(1.0_f64, "a")), digest_of(&(1.0_f64, "a")));
        assert_ne!(digest_of(&1.0_f64), digest_of(&f64::from_bits(1.0_f64.to_bits() + 1)));
    }

    #[test]
    fn forms_of_any_length_hash_as_one_run_of_bytes() {
        for n in [0, 1, 7, 13, 14, 15, 29, 30, 31, 32, 120, 127, 128, 240, 247, 248, 249, 256, 257, 511, 5000]
        {
            let text: String = (0..n).map(|i| char::from(b'a' + (i % 26) as u8)).collect();
            let numbers: Vec<f64> = (0..n).map(|i| f64::from(i as u32)).collect();
            let value = (&text, &numbers, 7_u8, Some(-3_i16), true);
            let count = (n as u64).to_le_bytes();
            let mut form = [&count[..], text.as_bytes()].concat();
            form.extend(count);
            numbers.iter().for_each(|x| form.extend(x.to_le_bytes()));
            form.extend([7, 1, 0xfd, 0xff, 1]);
            let mut bytes = Xxh3::new();
            bytes.update(&form);
            assert_eq!(digest_of(&value), Digest(bytes.digest()), "{n}");
            let mut hasher = Hasher::new();
            hasher.number(3);
            hasher.value(&value);
            let mut after = Xxh3::new();
            after.update(&3_u64.to_le_bytes());
            after.update(&form);
            assert_eq!(hasher.digest(), Digest(after.digest()), "{n}");
        }
    }

    #[test]
    fn floats_are_hashed_by_their_bits_and_sequences_with_their_lengths() {
        assert_ne!(digest_of(&0.0_f64), digest_of(&-0.0_f64));
        let other_nan = f64::from_bits(f64::NAN.to_bits() ^ 1);
        assert_eq!(digest_of(&f64::NAN), digest_of(&f64::NAN));
        assert_ne!(digest_of(&f64::NAN), digest_of(&other_nan));
        assert_ne!(digest_of(&(vec![1_u64], vec![2_u64, 3])), digest_of(&(vec![1_u64, 2], vec![3_u64])));
        assert_ne!(digest_of(&("ab", "c")), digest_of(&("a", "bc")));
        let pair = |a: &[u64], b: &[u64]| digest_of(&(Uncounted(a.to_vec()), Uncounted(b.to_vec())));
        assert_ne!(pair(&[1], &[2, 3]), pair(&[1, 2], &[3]));
        assert_ne!(digest_of(&None::<u8>), digest_of(&Some(0_u8)));
    }

    #[test]
    fn default_of_an_added_field_keeps_the_digest() {
        #[derive(Serialize)]
        struct Extended {
            old: u64,
            #[serde(serialize_with = "unless_default")]
            added: Vec<f64>,
        }
        let extended =
            |added: Vec<f64>| digest_of(&[Extended { old: 1, added }, Extended { old: 2, added: vec![] }]);
        assert_eq!(extended(vec![]), digest_of(&[1_u64, 2]));
        assert_ne!(extended(vec![0.5]), extended(vec![]));
        assert_ne!(extended(vec![0.5]), extended(vec![0.25]));
    }

    #[test]
    fn digest_of_a_value_is_the_same_on_any_machine() {
        let value = (-1_i64, 2.5_f32, "swerve", [Some('x'), None], vec![(1_u16, false)]);
        assert_eq!(digest_of(&value).to_string(), "137bcd1e013822cf");
    }

    #[test]
    fn digest_prints_sixteen_digits() {
        assert_eq!(Digest(0xab).to_string(), "00000000000000ab");
    }
}
