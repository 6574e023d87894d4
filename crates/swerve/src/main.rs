//! `swerve`: the command line with the built-in operators.

use std::process::ExitCode;

fn main() -> ExitCode {
    swerve::main(swerve::Registry::standard())
}
