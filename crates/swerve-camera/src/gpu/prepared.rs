//! Cells and views of a submission, prepared for its sub-frames.

use swerve_scene::Scene;

use super::instance::DrawInstance;
use super::layout::ImageLayout;
use super::lens_points::LensImage;
use crate::View;
use crate::frame::Outputs;

/// Cell with cameras in it.
pub(super) struct Cell {
    pub(super) centre: [f64; 3],
    /// First rows of the static and of the moving items.
    pub(super) items: [u32; 2],
    /// Index of the maps of sun and sky, if colour is requested.
    pub(super) maps: Option<usize>,
    /// True if the maps contain a moving instance.
    pub(super) moves: bool,
}

/// Index of static instances in pairs of maps, items and the like.
pub(super) const FIXED: usize = 0;

/// Index of moving instances.
pub(super) const MOVING: usize = 1;

/// View prepared for its sub-frames.
pub(super) struct PreparedView<'a> {
    pub(super) view: &'a View<'a>,
    pub(super) outputs: Outputs,
    pub(super) cell: usize,
    pub(super) lens: Option<LensImage>,
    /// Row of its record.
    pub(super) record: u32,
    pub(super) layout: ImageLayout,
}

/// Inputs of the sub-frames of a submission.
pub(super) struct Shown<'a> {
    pub(super) scene: &'a Scene,
    pub(super) moving: &'a [DrawInstance],
    pub(super) views: &'a [PreparedView<'a>],
    pub(super) cells: &'a [Cell],
}
