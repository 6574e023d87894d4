//! Reasons why images cannot be made.

use swerve_core::ParamError;
use swerve_gpu::NoAdapter;

use crate::frame::FrameSizeError;

/// A pass could not be made.
#[derive(Clone, PartialEq, Debug, thiserror::Error)]
pub enum RenderError {
    /// An image of the caller has the wrong size.
    #[error(transparent)]
    FrameSize(#[from] FrameSizeError),
    /// The scene's weather is out of its range.
    #[error("weather: {0}")]
    Weather(#[from] ParamError),
    /// A pose, a speed or an angle is not finite.
    #[error("{what} is not finite")]
    NotFinite {
        /// The number's name.
        what: &'static str,
    },
    /// There are not as many frames as views.
    #[error("{views} views, but {frames} frames")]
    Count {
        /// Number of them.
        views: usize,
        /// Number of them.
        frames: usize,
    },
    /// An image is asked for that was not submitted.
    #[error("the {image} image was not submitted")]
    NotSubmitted {
        /// Which image.
        image: &'static str,
    },
    /// No adapter can be used.
    #[error(transparent)]
    NoAdapter(#[from] NoAdapter),
    /// The adapter does not take what the back end needs.
    #[error("the adapter cannot be used: {why}")]
    Adapter {
        /// Its words.
        why: String,
    },
    /// The adapter failed while it drew.
    #[error("the adapter failed: {why}")]
    Lost {
        /// Its words.
        why: String,
    },
    /// The threads of the renderer could not be started.
    #[error("cannot start {threads} threads: {why}")]
    Threads {
        /// How many.
        threads: usize,
        /// The system's words.
        why: String,
    },
}
