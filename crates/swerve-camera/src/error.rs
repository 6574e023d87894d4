//! Rendering errors.

use swerve_core::ParamError;
use swerve_gpu::NoAdapter;

use crate::frame::FrameSizeError;

/// Error of a rendering pass.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum RenderError {
    /// Image of the caller with the wrong size.
    #[error(transparent)]
    FrameSize(#[from] FrameSizeError),
    /// Scene weather out of range.
    #[error("weather: {0}")]
    Weather(#[from] ParamError),
    /// Non-finite pose, speed or angle.
    #[error("{what} is not finite")]
    NotFinite {
        /// Name of the quantity.
        what: &'static str,
    },
    /// Different numbers of views and frames.
    #[error("{views} views, but {frames} frames")]
    Count {
        /// Number of views.
        views: usize,
        /// Number of frames.
        frames: usize,
    },
    /// Requested image that was not submitted.
    #[error("the {image} image was not submitted")]
    NotSubmitted {
        /// Name of the image.
        image: &'static str,
    },
    /// No usable adapter.
    #[error(transparent)]
    NoAdapter(#[from] NoAdapter),
    /// Adapter without the capabilities that the back end needs.
    #[error("the adapter cannot be used: {why}")]
    Adapter {
        /// Reason given by the adapter.
        why: String,
    },
    /// Adapter failure while drawing.
    #[error("the adapter failed: {why}")]
    Lost {
        /// Reason given by the adapter.
        why: String,
    },
    /// Failure to start the renderer's threads.
    #[error("cannot start {threads} threads: {why}")]
    Threads {
        /// Number of threads.
        threads: usize,
        /// Message of the operating system.
        why: String,
    },
}
