//! All commands of `swerve`, with an operator of one's own.

mod slow_down;

use std::process::ExitCode;

fn main() -> ExitCode {
    swerve::main(swerve::Registry::standard().with::<slow_down::SlowDown>())
}
