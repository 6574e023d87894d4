//! Memory that other processes read in place: what it looks like from here.
//!
//! A sensor asks its [`Memory`] for [`Room`], writes, and seals it: from then on it is a [`Block`], which nobody
//! changes and everybody may read where it lies. What stands for it in a message to another process is its
//! [`Place`]. How a message is written is decided around the writing of it ([`writing`], [`reading`]), because
//! logs and digests take in the numbers themselves whatever memory they are in.

use std::cell::{Cell, RefCell};
use std::rc::Rc;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

/// Where a sensor's payloads lie.
pub trait Memory: Send + Sync {
    /// Room for so many bytes, all zero; none where there is none left.
    fn room(&self, bytes: usize) -> Option<Box<dyn Room>>;
}

/// Memory to be written.
pub trait Room: Send + Sync {
    /// What is written so far; at an address that is a multiple of 8. Maybe a little more than was asked for.
    fn bytes(&self) -> &[u8];
    /// What is to be written.
    fn bytes_mut(&mut self) -> &mut [u8];
    /// Ends writing.
    ///
    /// # Errors
    /// When others cannot be given it. What was written is lost.
    fn seal(self: Box<Self>) -> Result<Arc<dyn Block>, String>;
}

/// Memory that nobody writes any more.
pub trait Block: Send + Sync {
    /// What is in it; at an address that is a multiple of 8.
    fn bytes(&self) -> &[u8];
    /// Which one it is.
    fn place(&self) -> Place;
}

/// Which block.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Place {
    /// Of which sensor's memory.
    pub memory: u32,
    /// The how manieth block of that, from 1.
    pub seq: u64,
}

/// Finds the blocks that other processes write of.
pub trait Shelf {
    /// The block, if it is to be had.
    fn find(&self, place: Place) -> Option<Arc<dyn Block>>;
}

/// What was written for another process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Written {
    /// Bytes of runs of numbers that were written themselves, of those that are longer than `big`.
    pub copied: usize,
    /// How many such runs were written as their place.
    pub in_place: usize,
}

/// How runs of numbers are written at the moment.
#[derive(Clone, Copy)]
enum Writing {
    /// As what they are.
    Plainly,
    /// For another process.
    Away { places: bool, big: usize, written: Written },
}

thread_local! {
    static WRITING: Cell<Writing> = const { Cell::new(Writing::Plainly) };
    static READING: RefCell<Option<Rc<dyn Shelf>>> = const { RefCell::new(None) };
}

/// Writes for another process: runs of numbers as their place where they have one and `places` says so. Counts
/// runs longer than `big` bytes.
pub fn writing<R>(places: bool, big: usize, write: impl FnOnce() -> R) -> (R, Written) {
    WRITING.set(Writing::Away { places, big, written: Written::default() });
    let result = write();
    match WRITING.replace(Writing::Plainly) {
        Writing::Away { written, .. } => (result, written),
        Writing::Plainly => (result, Written::default()),
    }
}

/// Reads what was written under [`writing`].
pub fn reading<R>(shelf: Rc<dyn Shelf>, read: impl FnOnce() -> R) -> R {
    READING.set(Some(shelf));
    let result = read();
    READING.set(None);
    result
}

/// How the next run of numbers is to be written.
pub(crate) enum Form {
    Plain,
    Away { place: Option<Place> },
}

/// Decides on that and counts it.
pub(crate) fn form(bytes: usize, place: Option<Place>) -> Form {
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

/// Whether what is being read was written under [`writing`].
pub(crate) fn is_reading() -> bool {
    READING.with_borrow(Option::is_some)
}

/// The block at a place that was read.
pub(crate) fn find(place: Place) -> Option<Arc<dyn Block>> {
    READING.with_borrow(|shelf| shelf.as_ref()?.find(place))
}
