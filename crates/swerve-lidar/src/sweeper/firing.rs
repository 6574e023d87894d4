//! Pieces of a turn: what fires them, what they did, why they could not be fired.

use core::ops::Range;

use swerve_geom::{Lidar, Map, Transform};

use super::Sweeper;
use crate::cloud::CloudSizeError;

/// No sensor is farther from the origin of the map, metres.
const REACH_MAX_M: f64 = 1e7;

/// One piece of a turn: a step of the world, and where the sensor is at its begin and end.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Firing {
    /// Begin of the step, nanoseconds since the turn's first column; negative if the turn begins within the step.
    pub begin_ns: i64,
    /// The sensor's pose then.
    pub begin: Transform<Map, Lidar>,
    /// End of the step, nanoseconds since the turn's first column: its columns are fired before.
    pub end_ns: i64,
    /// The sensor's pose then.
    pub end: Transform<Map, Lidar>,
    /// The instance id that this lidar does not see: the vehicle that carries it.
    pub hidden_instance: Option<u32>,
}

impl Firing {
    /// A whole turn of a sensor at rest.
    pub fn turn_at_rest(sweeper: &Sweeper, map_from_lidar: Transform<Map, Lidar>) -> Self {
        let (begin, end) = (map_from_lidar, map_from_lidar);
        Self { begin_ns: 0, begin, end_ns: sweeper.period_ns(), end, hidden_instance: None }
    }

    /// Whether it can be fired.
    ///
    /// # Errors
    /// Poses that are not finite, a step that ends before it begins.
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

/// Outcome of a piece of a turn.
#[derive(Clone, PartialEq, Eq, Debug)]
pub struct Fired {
    /// Columns that were fired.
    pub columns: Range<u32>,
    /// Whether the last column of the turn was among them.
    pub is_complete: bool,
}

/// A piece of a turn could not be fired.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
pub enum FireError {
    /// The points have no room in the caller's memory.
    #[error(transparent)]
    CloudSize(#[from] CloudSizeError),
    /// A pose is not finite or beyond all maps.
    #[error("the lidar's pose at the {when} of the step is not finite or beyond 10000 km")]
    Pose {
        /// `begin` or `end`.
        when: &'static str,
    },
    /// A step ends before it begins.
    #[error("the step ends {by_ns} ns before it begins")]
    Backwards {
        /// By how much.
        by_ns: u64,
    },
}

/// The columns of one step of the world.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    pub(crate) firing: Firing,
    pub(crate) columns: Range<u32>,
}

impl Piece {
    /// The columns that a sweeper fires in a step.
    ///
    /// # Errors
    /// Poses that are not finite, a step that ends before it begins.
    pub(super) fn new(sweeper: &Sweeper, firing: &Firing) -> Result<Self, FireError> {
        firing.check()?;
        let columns = sweeper.columns_between(firing.begin_ns, firing.end_ns);
        Ok(Self { firing: *firing, columns })
    }

    /// Outcome of firing it.
    pub(super) fn fired(&self, columns_of_turn: u32) -> Fired {
        let is_complete = !self.columns.is_empty() && self.columns.end == columns_of_turn;
        Fired { columns: self.columns.clone(), is_complete }
    }
}
