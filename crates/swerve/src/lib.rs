//! The command line: one module a command, but for those that are crates of their own.

mod check;
pub mod cli;
mod doctor;
mod graph;
mod look_detector;
mod new;
mod operators;
pub mod plan;
pub mod replay;
mod run;
mod scenarios;
mod summary;

pub use summary::Summary;
pub use swerve_stack::Registry;

/// The command line, with the operators of a registry: what a binary with operators of one's own calls.
pub fn main(registry: Registry) -> std::process::ExitCode {
    let cli = <cli::Cli as clap::Parser>::parse();
    #[cfg(target_os = "linux")]
    with_runtime_dir();
    match cli::main(&cli, &registry) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            swerve_report::output::tell(&format!("error: {}", swerve_report::output::message(&error)));
            std::process::ExitCode::FAILURE
        }
    }
}

/// Begins once more with a folder for displays, where there is none: without one, drivers of graphics adapters write
/// errors of their own to standard error, as if pictures needed a display. The process stays the same one.
#[cfg(target_os = "linux")]
fn with_runtime_dir() {
    use std::os::unix::process::CommandExt as _;

    const NAME: &str = "XDG_RUNTIME_DIR";
    let mut words = std::env::args_os();
    if let (None, Ok(program), Some(name)) = (std::env::var_os(NAME), std::env::current_exe(), words.next()) {
        // It comes back only where that fails; then drivers say what they say.
        let _failed =
            std::process::Command::new(program).arg0(name).args(words).env(NAME, std::env::temp_dir()).exec();
    }
}
