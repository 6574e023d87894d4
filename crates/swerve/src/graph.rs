//! `swerve graph`: the dataflow that a configuration makes.

use std::path::PathBuf;

use swerve_drive::{RunInput, load};
use swerve_stack::Registry;
use swerve_stack::pipeline::Pipeline;

/// `swerve graph`.
#[derive(clap::Args, Debug)]
pub(crate) struct GraphArgs {
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
pub(crate) fn run(args: &GraphArgs, registry: &Registry) -> anyhow::Result<()> {
    if let Some(file) = &args.svg {
        swerve_report::files::refuse_toml(file)?;
    }
    let (config, scenario) = load(registry, &args.input)?;
    let pipeline = Pipeline::build(&config, &scenario)?;
    let info = pipeline.graph.describe()?;
    if args.toml {
        return swerve_report::output::print(&pipeline.assembly.to_toml(&config, &info));
    }
    if let Some(file) = &args.svg {
        swerve_report::files::write_whole(file, swerve_report::graph::svg(&info).as_bytes())?;
    }
    swerve_report::output::print(&if args.dot {
        swerve_report::graph::dot(&info)
    } else {
        swerve_report::graph::text(&info)
    })
}
