//! Loops for the widest vector instructions of the processor that runs them.
//!
//! What is compiled for any x86-64 processor has 16 bytes at once. Hot loops are therefore compiled twice, and the
//! processor is asked (AVX2: 32 bytes). They do the same operations on the same numbers, nothing fused or reordered, so
//! the result has the same bits.

use pulp::Arch;

/// Does work, compiled for what this processor has. That reaches as far as it is inlined: a closure marked so, and of
/// what it calls the small or marked.
#[inline(always)]
pub(crate) fn widest<R>(work: impl FnOnce() -> R) -> R {
    #[cfg(test)]
    if narrow::is_asked() {
        return pulp::Simd::vectorize(pulp::Scalar, work);
    }
    Arch::new().dispatch(work)
}

/// What any processor runs, for tests that compare.
#[cfg(test)]
pub(crate) mod narrow {
    use std::cell::Cell;

    thread_local!(static ASKED: Cell<bool> = const { Cell::new(false) });

    pub(super) fn is_asked() -> bool {
        ASKED.get()
    }

    /// What some work gives, with and without wide instructions.
    pub(crate) fn both<R>(mut work: impl FnMut() -> R) -> [R; 2] {
        [false, true].map(|narrow| {
            ASKED.set(narrow);
            let result = work();
            ASKED.set(false);
            result
        })
    }
}
