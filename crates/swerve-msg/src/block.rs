//! Shared memory for large payloads, which other processes read in place.
//!
//! A sensor requests [`Room`] from its [`Memory`], writes to it and seals it. It is then a [`Block`]: immutable,
//! and readable in place by other processes. A message to another process refers to the block by its [`BlockId`]. The
//! encoding of a message is selected around the serializer call ([`writing`], [`reading`]), because logs and
//! digests always contain the numbers themselves, wherever they are stored.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// Allocator for the payloads of a sensor.
pub trait Memory: Send + Sync {
    /// Allocates at least `bytes` bytes, all zero; `None` if the memory is full.
    fn room(&self, bytes: usize) -> Option<Box<dyn Room>>;
}

/// Memory that is being written.
pub trait Room: Send + Sync {
    /// Content so far, aligned to 8 bytes. May be slightly longer than requested.
    fn bytes(&self) -> &[u8];
    /// Content, to be written.
    fn bytes_mut(&mut self) -> &mut [u8];
    /// Ends writing and makes the content readable by other processes.
    ///
    /// # Errors
    /// If the memory cannot be shared. The content is lost.
    fn seal(self: Box<Self>) -> Result<Arc<dyn Block>, String>;
}

/// Immutable shared memory.
pub trait Block: Send + Sync {
    /// Content, aligned to 8 bytes.
    fn bytes(&self) -> &[u8];
    /// Identifier of the block.
    fn place(&self) -> BlockId;
}

/// Identifier of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct BlockId {
    /// Index of the sensor's memory.
    pub memory: u32,
    /// Index of the block within that memory, starting at 1.
    pub seq: u64,
}

/// Resolves the identifiers of blocks of other processes.
pub trait Shelf {
    /// The block, or `None` if it is not available.
    fn find(&self, place: BlockId) -> Option<Arc<dyn Block>>;
}

/// Statistics of the arrays written for another process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Bytes of arrays longer than `big` that were copied.
    pub copied: usize,
    /// Number of arrays longer than `big` that were written as their place.
    pub in_place: usize,
}

/// Current encoding of arrays of numbers.
#[derive(Clone, Copy)]
enum Writing {
    /// Always as numbers: for logs and digests.
    Plainly,
    /// For another process: as a place where possible.
    Away { places: bool, big: usize, written: Written },
}

thread_local! {
    static WRITING: Cell<Writing> = const { Cell::new(Writing::Plainly) };
    static READING: RefCell<Option<Rc<dyn Shelf>>> = const { RefCell::new(None) };
}

/// Serializes for another process: arrays that have a place are written as it if `places` is set. Counts arrays
/// longer than `big` bytes.
pub fn writing<R>(places: bool, big: usize, write: impl FnOnce() -> R) -> (R, Written) {
    WRITING.set(Writing::Away { places, big, written: Written::default() });
    let result = write();
    match WRITING.replace(Writing::Plainly) {
        Writing::Away { written, .. } => (result, written),
        Writing::Plainly => (result, Written::default()),
    }
}

/// Deserializes data that was written under [`writing`].
pub fn reading<R>(shelf: Rc<dyn Shelf>, read: impl FnOnce() -> R) -> R {
    READING.set(Some(shelf));
    let result = read();
    READING.set(None);
    result
}

/// Deserializes plain data inside [`reading`]: values that another program has made meanwhile.
pub fn reading_plainly<R>(read: impl FnOnce() -> R) -> R {
    let shelf = READING.take();
    let result = read();
    READING.set(shelf);
    result
}

/// Encoding of the next array.
pub(crate) enum Form {
    Plain,
    Away { place: Option<BlockId> },
}

/// Selects the encoding of an array of `bytes` bytes and counts the array.
pub(crate) fn form(bytes: usize, place: Option<BlockId>) -> Form {
    let Writing::Away { places, big, mut written } = WRITING.get() else { return Form::Plain };
    let place = place.filter(|_| places);
    if bytes > big {
        match place {
            Some(_) => written.in_place += 1,
            None => written.copied += bytes,
        }
    }
    WRITING.set(Writing::Away { places, big, written });
    Form::Away { place }
}

/// Returns true if the current input was written under [`writing`].
pub(crate) fn is_reading() -> bool {
    READING.with_borrow(Option::is_some)
}

/// Resolves a place in the current input.
pub(crate) fn find(place: BlockId) -> Option<Arc<dyn Block>> {
    READING.with_borrow(|shelf| shelf.as_ref()?.find(place))
}
