//! Hot loops for the widest vector instructions of the processor that runs them, with the same bits on every one.
//!
//! What is compiled for any x86-64 processor has 16 bytes at once. Hot loops are therefore compiled twice, and the
//! processor is asked (AVX2: 32 bytes). They do the same operations on the same numbers, nothing fused or reordered.

use std::cell::Cell;

use pulp::Arch;

thread_local!(static IS_NARROW: Cell<bool> = const { Cell::new(false) });

/// Does work, compiled for what this processor has. That reaches as far as it is inlined: a closure marked so, and of
/// what it calls the small or marked.
#[inline(always)]
pub fn widest<R>(work: impl FnOnce() -> R) -> R {
    let arch = if IS_NARROW.get() { Arch::Scalar } else { Arch::new() };
    arch.dispatch(work)
}

/// What some work gives on this thread as it is, and as a processor without wide instructions does it: the same, as
/// tests of [`widest`] loops hold.
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
    fn work_is_done_once_each_way_and_one_of_them_is_narrow() {
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
