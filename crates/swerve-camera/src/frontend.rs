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

/// Threads of a renderer, if it is to have more than the caller's.
pub(crate) fn thread_pool(threads: usize) -> Result<Option<rayon::ThreadPool>, RenderError> {
    if threads < 2 {
        return Ok(None);
    }
    let named = rayon::ThreadPoolBuilder::new().num_threads(threads).thread_name(|k| format!("render-{k}"));
    named.build().map(Some).map_err(|error| RenderError::Threads { threads, why: error.to_string() })
}
