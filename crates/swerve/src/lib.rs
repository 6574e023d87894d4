//! The binary's library: configuration, operator adapters, graph assembly, commands, studies, reports.

pub mod calibrate;
pub mod check;
pub mod cli;
pub mod dataset;
pub mod doctor;
pub mod files;
pub mod frames;
pub mod graph;
pub mod live;
mod measured;
pub mod new;
pub mod operators;
pub mod output;
pub mod plan;
pub mod process;
pub mod program;
pub mod progress;
pub mod realtime;
pub mod recording;
pub mod replay;
pub mod ros2;
pub mod run;
pub mod rungs;
pub mod scenarios;
pub mod shipped;
pub mod story;
pub mod study;
mod summary;
#[cfg(test)]
mod tests;
mod threads;
pub mod timing;
mod views;

pub use swerve_stack::Registry;
pub use swerve_stack::{agent, config, pipeline, street};

/// The command line, with the operators of a registry: what a binary with operators of one's own calls.
pub fn main(registry: Registry) -> std::process::ExitCode {
    let cli = <cli::Cli as clap::Parser>::parse();
    match cli::main(&cli, &registry) {
        Ok(()) => std::process::ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", cli::message(&error));
            std::process::ExitCode::FAILURE
        }
    }
}
