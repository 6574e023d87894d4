//! Columns submitted and not yet collected.

use super::firing::Piece;
use crate::cloud::Cloud;
use crate::gpu::InFlight;
use crate::returns::Receiver;
use crate::scene_tree::flat::DynamicState;

/// Submitted columns.
pub(super) struct Submitted {
    pub(super) piece: Piece,
    pub(super) progress: Progress,
}

/// Progress of submitted columns.
pub(super) enum Progress {
    /// In progress on a GPU.
    OnGpu(Box<OnGpu>),
    /// Complete.
    Done(Cloud),
}

/// Rays on a GPU, with the data that the CPU needs if it is lost.
pub(super) struct OnGpu {
    pub(super) in_flight: InFlight,
    pub(super) dynamics: DynamicState,
    pub(super) receiver: Receiver,
}
