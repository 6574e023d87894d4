//! `swerve graph`: the dataflow that a configuration makes.

mod render;

use std::path::PathBuf;

use swerve_stack::Registry;

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
    /// The text that makes this pipeline, to start a configuration from
    #[arg(long, conflicts_with_all = ["dot", "svg"])]
    toml: bool,
    /// Draw it into this file
    #[arg(long, value_name = "FILE")]
    svg: Option<PathBuf>,
}

/// Prints the graph.
pub fn run(args: &GraphArgs, registry: &Registry) -> anyhow::Result<()> {
    if let Some(file) = &args.svg {
        crate::files::refuse_toml(file)?;
    }
    let (config, scenario) = load(registry, &args.input)?;
    let pipeline = Pipeline::build(&config, &scenario)?;
    if args.toml {
        return crate::output::print(&pipeline.assembly.to_toml());
    }
    let info = pipeline.graph.describe()?;
    if let Some(file) = &args.svg {
        crate::files::write_whole(file, render::svg(&info).as_bytes())?;
    }
    crate::output::print(&if args.dot { render::dot(&info) } else { render::text(&info) })
}
