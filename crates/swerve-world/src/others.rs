//! Road users that another simulator moves.

use core::fmt;

use swerve_core::Time;
use swerve_geom::Obb;
use swerve_msg::truth::EgoTruth;
use swerve_msg::{ActorId, ActorKind, Extent};

use crate::Movement;

/// A road user of another simulator at one instant.
#[derive(Clone, PartialEq, Debug)]
pub struct Other {
    /// Identity in the run: the same as long as the run lasts, also if it is absent in between.
    pub id: ActorId,
    /// Kind.
    pub kind: ActorKind,
    /// Size.
    pub extent: Extent,
    /// Pose of its centre, and velocity.
    pub movement: Movement,
}

/// Reason why the other simulator cannot go on.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct OthersError(pub String);

impl fmt::Display for OthersError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl core::error::Error for OthersError {}

/// Another simulator that moves road users around the ego. They come and go.
///
/// The result is a function of the calls, as long as the other simulator is one.
pub trait Others: Send {
    /// Road users at the instant `to`, ordered by identity. `ego` and its outline are those of the newest state of the
    /// world: of `to` in the first call, which is for instant 0, else of the step before.
    ///
    /// # Errors
    /// If the other simulator is missing, ends, does not answer, or answers with something else than road users.
    fn at(&mut self, to: Time, ego: &EgoTruth, outline: &Obb) -> Result<&[Other], OthersError>;
}
