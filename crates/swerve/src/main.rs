//! `swerve`: the command line to the exit code.

use std::process::ExitCode;

use clap::Parser as _;

fn main() -> ExitCode {
    let cli = swerve::cli::Cli::parse();
    match swerve::cli::main(&cli) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", swerve::cli::message(&error));
            ExitCode::FAILURE
        }
    }
}
