//! Hot loops compiled for the widest vector instructions of the running processor, with the same bits on every
//! processor.
//!
//! Code compiled for any x86-64 processor uses 16-byte vectors. Hot loops are therefore compiled twice, and the
//! version is selected at run time (AVX2: 32 bytes). Both do the same operations on the same numbers, with nothing
//! fused or reordered.

use std::cell::Cell;

use pulp::Arch;

thread_local!(static IS_NARROW: Cell<bool> = const { Cell::new(false) });

/// Runs `work` compiled for this processor. This applies only to inlined code: closures marked `#[inline(always)]`,
/// and callees that are small or marked.
#[inline(always)]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    let arch = if IS_NARROW.get() { Arch::Scalar } else { Arch::new() };
    arch.dispatch(work)
}

/// Results of `work` on this thread as selected for this processor, and as on a processor without wide instructions.
/// Tests of [`widest`] loops check that they are equal.
pub fn both<R>(mut work: impl FnMut() -> R) -> [R; 2] {
    [false, true].map(|is_narrow| {
        IS_NARROW.set(is_narrow);
        let result = work();
        IS_NARROW.set(false);
        result
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_runs_the_work_once_wide_and_once_narrow() {
        let mut times = 0;
        let told = both(|| {
            times += 1;
            (IS_NARROW.get(), widest(|| [1.0, 2.0, 3.0, 4.0].map(|x: f64| x * x + 0.1)))
        });
        assert_eq!(told.map(|(is_narrow, _)| is_narrow), [false, true]);
        assert_eq!(told[0].1, told[1].1);
        assert_eq!((times, IS_NARROW.get()), (2, false));
    }
}
