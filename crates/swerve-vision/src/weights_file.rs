//! Weights files: an eight-byte magic, a version, the digest (XXH3) of the payload, and the payload in postcard
//! encoding.

use serde::Serialize;
use serde::de::DeserializeOwned;
use swerve_core::Digest;
use thiserror::Error;

/// Error of reading a weights file.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum WeightsError {
    /// Wrong magic bytes.
    #[error("no weights of a {of}: expected a file that begins with `{magic}`")]
    Foreign {
        /// Kind of weights that was expected.
        of: &'static str,
        /// Magic bytes of that kind.
        magic: &'static str,
    },
    /// Unsupported version.
    #[error("weights of version {found}, expected {expected}")]
    Version {
        /// Version of the file.
        found: u8,
        /// Supported version.
        expected: u8,
    },
    /// Digest mismatch.
    #[error("damaged weights: their digest is {found}, expected {expected}")]
    Damaged {
        /// Digest of the payload.
        found: Digest,
        /// Digest stored in the file.
        expected: Digest,
    },
    /// Well-formed file with invalid content.
    #[error("weights that make no sense: {0}")]
    Content(&'static str),
}

/// Format of one kind of weights file.
pub(crate) struct WeightsFile {
    /// Kind of weights.
    pub(crate) of: &'static str,
    /// Magic of eight ASCII letters.
    pub(crate) magic: &'static str,
    pub(crate) version: u8,
}

impl WeightsFile {
    /// Parses a file; the caller validates the content.
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

    /// Serialises weights to a file's bytes.
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

/// Returns an error unless the condition holds.
pub(crate) fn ensure(holds: bool, what: &'static str) -> Result<(), &'static str> {
    if holds { Ok(()) } else { Err(what) }
}
