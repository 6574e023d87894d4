//! Pieces of a turn: inputs, results and errors.

use core::ops::Range;

use swerve_geom::{Lidar, Map, Transform};

use super::pattern::Pattern;
use crate::cloud::CloudSizeError;

/// Largest distance of a sensor from the map's origin, metres.
const REACH_MAX_M: f64 = 1e7;

/// Piece of a turn: a world step, and the sensor's pose at its begin and end.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Firing {
    /// Begin of the step, nanoseconds since the turn's first column; negative if the turn begins within the step.
    pub begin_ns: i64,
    /// Sensor pose at the begin of the step.
    pub begin: Transform<Map, Lidar>,
    /// End of the step, nanoseconds since the turn's first column; exclusive.
    pub end_ns: i64,
    /// Sensor pose at the end of the step.
    pub end: Transform<Map, Lidar>,
    /// Instance id invisible to this lidar: the vehicle that carries it.
    pub hidden_instance: Option<u32>,
}

impl Firing {
    /// Checks that the piece can be fired.
    ///
    /// # Errors
    /// If a pose is not finite, or the step ends before it begins.
    pub fn check(&self) -> Result<(), FireError> {
        for (when, pose) in [("begin", &self.begin), ("end", &self.end)] {
            let placed = pose.origin().coords.iter().all(|x| x.abs() <= REACH_MAX_M);
            if !placed || !pose.rotation().coords.iter().all(|x| x.is_finite()) {
                return Err(FireError::Pose { when });
            }
        }
        if self.end_ns < self.begin_ns {
            return Err(FireError::Backwards { by_ns: self.end_ns.abs_diff(self.begin_ns) });
        }
        Ok(())
    }
}

/// Result of firing a piece of a turn.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Fired {
    /// Columns fired.
    pub columns: Range<u32>,
    /// True if the last column of the turn was among them.
    pub is_complete: bool,
}

/// Error of firing a piece of a turn.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FireError {
    /// Arrays without room for the points.
    #[error(transparent)]
    CloudSize(#[from] CloudSizeError),
    /// Pose that is not finite or too far from the origin.
    #[error("the lidar's pose at the {when} of the step is not finite or beyond 10000 km")]
    Pose {
        /// `begin` or `end`.
        when: &'static str,
    },
    /// Step that ends before it begins.
    #[error("the step ends {by_ns} ns before it begins")]
    Backwards {
        /// Difference, nanoseconds.
        by_ns: u64,
    },
}

/// Columns of one world step.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    pub(crate) firing: Firing,
    pub(crate) columns: Range<u32>,
}

impl Piece {
    /// Columns that a lidar fires in a step.
    ///
    /// # Errors
    /// If a pose is not finite, or the step ends before it begins.
    pub(super) fn new(pattern: &Pattern, firing: &Firing) -> Result<Self, FireError> {
        firing.check()?;
        let columns = pattern.columns_between(firing.begin_ns, firing.end_ns);
        Ok(Self { firing: *firing, columns })
    }

    /// Result of firing it.
    pub(super) fn fired(&self, columns_of_turn: u32) -> Fired {
        let is_complete = !self.columns.is_empty() && self.columns.end == columns_of_turn;
        Fired { columns: self.columns.clone(), is_complete }
    }
}
