//! Weight files: eight letters, a version, the digest (XXH3) of the rest, and the rest in postcard encoding.

use swerve_core::{Digest, Hasher};
use thiserror::Error;

use super::Net;
use super::shape::{Beside, Model, Shape, Weights};
use crate::net::Matrix;

const MAGIC: &[u8] = b"SWERVNET";
/// Versions: of weights with a straight baseline, and of all others.
const VERSIONS: [u8; 2] = [1, 2];

/// Error of reading a weight file.
#[derive(Clone, PartialEq, Eq, Debug, Error)]
pub enum WeightsError {
    /// The first bytes are different.
    #[error("no weights of a predictor: expected a file that begins with `SWERVNET`")]
    Foreign,
    /// The version is not supported.
    #[error("weights of version {0}, expected 1 or 2")]
    Version(u8),
    /// The digest does not match the contents.
    #[error("damaged weights: their digest is {found}, expected {expected}")]
    Damaged {
        /// Digest of the contents.
        found: Digest,
        /// Digest in the file.
        expected: Digest,
    },
    /// The digest matches, but the contents are invalid.
    #[error("weights that make no sense: {0}")]
    Content(String),
}

/// Stored form: source; model, modes, hidden, steps and their length; anchors; matrices.
type Stored = (String, (Model, usize, usize, usize, u32), Vec<Vec<f32>>, Vec<Matrix>);

impl Weights {
    /// Reads a weight file.
    ///
    /// # Errors
    /// If it is not a weight file, is damaged, or does not match its shape.
    pub fn read(bytes: &[u8]) -> Result<Self, WeightsError> {
        let rest = bytes.strip_prefix(MAGIC).ok_or(WeightsError::Foreign)?;
        let (&version, rest) = rest.split_first().ok_or(WeightsError::Foreign)?;
        if !VERSIONS.contains(&version) {
            return Err(WeightsError::Version(version));
        }
        let (sum, rest) = rest.split_first_chunk().map_or((0, &[][..]), |(s, r)| (u64::from_le_bytes(*s), r));
        let (found, expected) = (digest(rest), Digest(sum));
        if found != expected {
            return Err(WeightsError::Damaged { found, expected });
        }
        let stored: Result<(Beside, Stored), _> = match version {
            1 => postcard::from_bytes(rest).map(|stored| (Beside::Straight, stored)),
            _ => postcard::from_bytes(rest),
        };
        let (beside, stored) = stored.map_err(|_| WeightsError::Content("cut short".to_owned()))?;
        let (source, (model, modes, hidden, steps, step_ms), anchors, matrices) = stored;
        let weights =
            Self { source, shape: Shape { model, modes, hidden, steps, step_ms, beside }, anchors, matrices };
        weights.check().map_err(WeightsError::Content)?;
        Ok(weights)
    }

    /// Serializes the weights to the bytes of a file.
    ///
    /// # Panics
    /// Never: the stored values are plain numbers and text.
    pub fn write(&self) -> Vec<u8> {
        let Shape { model, modes, hidden, steps, step_ms, beside } = self.shape;
        let stored = (&self.source, (model, modes, hidden, steps, step_ms), &self.anchors, &self.matrices);
        let (version, rest) = match beside {
            Beside::Straight => (VERSIONS[0], postcard::to_allocvec(&stored)),
            Beside::Imm => (VERSIONS[1], postcard::to_allocvec(&(beside, stored))),
        };
        let rest = rest.expect("numbers and text are always written");
        [MAGIC, &[version], &digest(&rest).0.to_le_bytes(), &rest].concat()
    }

    fn check(&self) -> Result<(), String> {
        self.shape.check()?;
        let expected = Net::shapes(&self.shape);
        let found: Vec<[usize; 2]> = self.matrices.iter().map(|one| [one.rows, one.columns]).collect();
        if found != expected {
            return Err(format!("expected matrices of {expected:?}, found {found:?}"));
        }
        if let Some(bad) = self.matrices.iter().find(|one| one.rows * one.columns != one.values.len()) {
            return Err(format!(
                "a matrix of {} by {} has {} numbers",
                bad.rows,
                bad.columns,
                bad.values.len()
            ));
        }
        let [modes, long] = self.shape.anchors();
        if self.anchors.len() != modes || self.anchors.iter().any(|one| one.len() != long) {
            return Err(format!("expected {modes} anchors of {long} numbers"));
        }
        let numbers = self.matrices.iter().flat_map(|one| &one.values).chain(self.anchors.iter().flatten());
        match numbers.into_iter().find(|one| one.is_nan() || one.abs() >= 1e4) {
            Some(bad) => Err(format!("expected numbers below 10000, found {bad}")),
            None => Ok(()),
        }
    }
}

fn digest(bytes: &[u8]) -> Digest {
    let mut hasher = Hasher::new();
    hasher.bytes(bytes);
    hasher.digest()
}
