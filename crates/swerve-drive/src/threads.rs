//! Thread counts: the command-line range, and the processors of this machine.

use clap::builder::RangedU64ValueParser;

/// Parser of `--threads`. Bounded, because each thread costs memory and a typo must not start a million.
pub fn parser() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=256)
}

/// Number of processors available to this process.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
