//! The command line: one module per command, except for commands in crates of their own.

mod check;
pub mod cli;
mod doctor;
mod look;
mod new;
pub mod plan;
pub mod replay;
mod run;
mod shell;
mod summary;

pub use summary::Summary;
pub use swerve_stack::Registry;

/// Entry point of the command line with the operators of a registry; called by binaries with custom operators.
pub fn main(registry: Registry) -> std::process::ExitCode {
    swerve_gpu::turn_off_display_layer();
    let cli = cli::parse(std::env::args_os()).unwrap_or_else(|error| error.exit());
    match cli::main(&cli, &registry) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            swerve_report::output::tell(&format!("error: {}", swerve_report::output::message(&error)));
            std::process::ExitCode::FAILURE
        }
    }
}
