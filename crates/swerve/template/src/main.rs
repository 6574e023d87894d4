//! All commands of `swerve`, with a custom operator.

mod slow_down;

use std::process::ExitCode;

fn main() -> ExitCode {
    swerve::main(swerve::Registry::standard().with::<slow_down::SlowDown>())
}
