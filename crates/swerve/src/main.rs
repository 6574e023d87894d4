//! `swerve`: the command line with Swerve's own operators.

use std::process::ExitCode;

fn main() -> ExitCode {
    swerve::main(swerve::Registry::standard())
}
