//! The front end of a pass, which both back ends share: what is drawn from where, in which light, for which sensor.

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

/// Rows that share lists of triangles, and are the unit of work.
pub(crate) const BAND: usize = 16;

/// Threads of a renderer.
pub(crate) enum Threads {
    /// The caller's.
    One,
    /// Those of the pool in which the caller is, if it is in one.
    Callers,
    /// Its own.
    Own(rayon::ThreadPool),
}

impl Threads {
    /// As many, as [`crate::RenderOptions::threads`] has it.
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

    /// Does `work` where pieces of it that are joined run on these threads; it is told whether there are several.
    pub(crate) fn run<T: Send>(&self, work: impl FnOnce(bool) -> T + Send) -> T {
        match self {
            Self::One => work(false),
            Self::Callers => work(rayon::current_thread_index().is_some()),
            Self::Own(pool) => pool.install(|| work(true)),
        }
    }
}
