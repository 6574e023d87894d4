//! Front end of a pass, shared by both back ends: sub-frames, viewpoints, lighting and sensors.

pub(crate) mod lamp;
pub(crate) mod lens;
pub(crate) mod light;
pub(crate) mod pinhole;
pub(crate) mod pose;
pub(crate) mod sensor;
pub(crate) mod shadow;
pub(crate) mod sub_frame;
pub(crate) mod surface;
pub(crate) mod texture;
pub(crate) mod viewpoint;

use crate::error::RenderError;

/// Number of rows that share lists of triangles and are a unit of work.
pub(crate) const BAND: usize = 16;

/// Threads of a renderer.
pub(crate) enum Threads {
    /// The caller's thread.
    One,
    /// Threads of the pool that the caller runs in, if any.
    Callers,
    /// A pool owned by the renderer.
    Own(rayon::ThreadPool),
}

impl Threads {
    /// Threads for the number in [`crate::RenderOptions::threads`].
    pub(crate) fn new(threads: usize) -> Result<Self, RenderError> {
        let named =
            rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("render-{k}"));
        match threads {
            0 => Ok(Self::Callers),
            1 => Ok(Self::One),
            _ => match named.build() {
                Ok(pool) => Ok(Self::Own(pool)),
                Err(error) => Err(RenderError::Threads { threads, why: error.to_string() }),
            },
        }
    }

    /// Runs `work` so that its parallel parts run on these threads; its argument is true if there are several.
    pub(crate) fn run<T: Send>(&self, work: impl FnOnce(bool) -> T + Send) -> T {
        match self {
            Self::One => work(false),
            Self::Callers => work(rayon::current_thread_index().is_some()),
            Self::Own(pool) => pool.install(|| work(true)),
        }
    }
}
