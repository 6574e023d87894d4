//! Devices of a program that was built without the feature `gpu`: none.

use std::sync::Arc;

use crate::NOT_BUILT;
use crate::adapter::{AdapterKind, AdapterReport, Adapters, NoAdapter};

/// A device shared between back ends of one process. This program was built without them, so there is no value.
#[derive(Debug)]
pub enum Gpu {}

/// Reports that this program uses no adapter.
pub fn probe() -> Adapters {
    Adapters { found: Vec::new(), absent: vec![NOT_BUILT.to_owned()] }
}

impl Gpu {
    /// The shared device of this kind.
    ///
    /// # Errors
    /// Always: there is none.
    pub fn shared(kind: AdapterKind) -> Result<Arc<Self>, NoAdapter> {
        Err(probe().none(kind))
    }

    /// An unshared device of this kind.
    ///
    /// # Errors
    /// Always: there is none.
    pub fn fresh(kind: AdapterKind) -> Result<Arc<Self>, NoAdapter> {
        Self::shared(kind)
    }

    /// Report on its adapter.
    pub fn report(&self) -> &AdapterReport {
        match *self {}
    }

    /// First error since the device was opened.
    pub fn error(&self) -> Option<String> {
        match *self {}
    }
}
