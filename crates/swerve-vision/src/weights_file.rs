//! Files of what was learnt: eight bytes that say what it is, a version, the digest (XXH3) of the rest, and the rest in
//! postcard's form.

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::Digest;
use thiserror::Error;

/// What is wrong with a file of weights.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum WeightsError {
    /// Its first bytes are something else's.
    #[error("no weights of a {of}: expected a file that begins with `{magic}`")]
    Foreign {
        /// Whose weights were expected.
        of: &'static str,
        /// What their files begin with.
        magic: &'static str,
    },
    /// It is of a version that is not known.
    #[error("weights of version {found}, expected {expected}")]
    Version {
        /// What the file says.
        found: u8,
        /// What is known.
        expected: u8,
    },
    /// Its digest is another one.
    #[error("damaged weights: their digest is {found}, expected {expected}")]
    Damaged {
        /// Of what is there.
        found: Digest,
        /// What the file says.
        expected: Digest,
    },
    /// It is whole, but makes no sense.
    #[error("weights that make no sense: {0}")]
    Content(&'static str),
}

/// One kind of such files.
pub(crate) struct WeightsFile {
    /// Whose weights they are.
    pub(crate) of: &'static str,
    /// Eight letters.
    pub(crate) magic: &'static str,
    pub(crate) version: u8,
}

impl WeightsFile {
    /// Reads a file; whether what it says makes sense is the reader's to check.
    pub(crate) fn read<T: DeserializeOwned>(&self, bytes: &[u8]) -> Result<T, WeightsError> {
        let &Self { of, magic, version } = self;
        let rest = bytes.strip_prefix(magic.as_bytes()).ok_or(WeightsError::Foreign { of, magic })?;
        let (&found, rest) = rest.split_first().ok_or(WeightsError::Foreign { of, magic })?;
        if found != version {
            return Err(WeightsError::Version { found, expected: version });
        }
        let (sum, rest) = rest.split_first_chunk().map_or((0, &[][..]), |(s, r)| (u64::from_le_bytes(*s), r));
        let (found, expected) = (digest(rest), Digest(sum));
        if found != expected {
            return Err(WeightsError::Damaged { found, expected });
        }
        postcard::from_bytes(rest).map_err(|_| WeightsError::Content("cut short"))
    }

    /// The bytes of a file.
    pub(crate) fn write<T: Serialize>(&self, weights: &T) -> Vec<u8> {
        let rest = postcard::to_allocvec(weights).expect("numbers and text are always written");
        [self.magic.as_bytes(), &[self.version], &digest(&rest).0.to_le_bytes(), &rest].concat()
    }
}

fn digest(bytes: &[u8]) -> Digest {
    let mut hasher = swerve_core::Hasher::new();
    hasher.bytes(bytes);
    hasher.digest()
}

/// A condition on what was read.
pub(crate) fn ensure(holds: bool, what: &'static str) -> Result<(), &'static str> {
    if holds { Ok(()) } else { Err(what) }
}
