//! How many threads: what the command line takes, what this machine has.

use clap::builder::RangedU64ValueParser;

/// What `--threads` may be: a thread costs memory and a stack, so a slip of the finger must not start a million.
pub fn parser() -> RangedU64ValueParser<usize> {
    RangedU64ValueParser::new().range(1..=256)
}

/// Processors that this process may use.
pub fn cores() -> usize {
    std::thread::available_parallelism().map_or(1, usize::from)
}
