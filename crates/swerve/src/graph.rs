//! `swerve graph`: the dataflow that a configuration makes.

mod render;

use std::path::PathBuf;

use crate::pipeline::Pipeline;
use crate::run::{RunInput, load};

/// `swerve graph`.
#[derive(clap::Args, Debug)]
pub struct GraphArgs {
    #[command(flatten)]
    input: RunInput,
    /// Graphviz instead of text
    #[arg(long, conflicts_with = "svg")]
    dot: bool,
    /// Draw it into this file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

/// Prints the graph.
pub fn run(args: &GraphArgs) -> anyhow::Result<()> {
    if let Some(file) = &args.svg {
        crate::files::refuse_toml(file)?;
    }
    let (config, scenario) = load(&args.input)?;
    let info = Pipeline::build(&config, &scenario)?.graph.describe()?;
    if let Some(file) = &args.svg {
        crate::files::write_whole(file, render::svg(&info).as_bytes())?;
    }
    crate::output::print(&if args.dot { render::dot(&info) } else { render::text(&info) })
}
