//! `swerve graph`: prints the dataflow of a configuration.

use std::path::PathBuf;

use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::assembly::{Assembly, Redirected};
use swerve_stack::pipeline::Pipeline;

use crate::load::load_as_written;
use crate::overwrite::OverwriteArgs;
use crate::pictures::PictureArgs;
use crate::{RunInput, note_idle};

/// `swerve graph`.
#[derive(clap::Args, Debug)]
pub struct GraphArgs {
    #[command(flatten)]
    input: RunInput,
    /// Print Graphviz instead of text
    #[arg(long, conflicts_with = "picture")]
    dot: bool,
    /// Print the complete configuration of this pipeline as TOML, as a starting point
    #[arg(long, conflicts_with_all = ["dot", "picture"])]
    toml: bool,
    /// Draw the graph into this file
    #[arg(long, value_name = "FILE")]
    picture: Option<PathBuf>,
    #[command(flatten)]
    overwrite: OverwriteArgs,
    #[command(flatten)]
    how: PictureArgs,
}

/// Prints the graph.
///
/// # Errors
/// All errors in scenario and configuration, or a failure to write the picture.
pub fn run(args: &GraphArgs, registry: &Registry) -> anyhow::Result<()> {
    if let Some(file) = &args.picture {
        swerve_report::files::refuse_toml(file)?;
        args.overwrite.check([file.as_path()])?;
    }
    let (config, scenario) = load_as_written(registry, &args.input)?;
    let pipeline = Pipeline::build(&config, &scenario)?;
    note_redirected(&config, &pipeline.assembly);
    note_idle(&config, &args.input);
    let info = pipeline.graph.describe()?;
    if args.toml {
        return swerve_report::output::print(&pipeline.assembly.to_toml(&config, &info));
    }
    if let Some(file) = &args.picture {
        args.how.write(file, &swerve_report::graph::draw(&info))?;
    }
    swerve_report::output::print(&if args.dot {
        swerve_report::graph::dot(&info)
    } else {
        swerve_report::graph::text(&info)
    })
}

/// Reports on standard error, a line each, the operators that an added operator makes read other streams.
pub fn note_redirected(config: &Setup, assembly: &Assembly) {
    for Redirected { added, operator, reads, in_place_of } in assembly.redirected(config) {
        swerve_report::output::tell(&format!(
            "note: [operator.{added}] changes what `{operator}` reads: {} in place of {}; `reads` in [operator.{operator}] \
             chooses",
            listed(&reads),
            listed(&in_place_of)
        ));
    }
}

fn listed(streams: &[String]) -> String {
    let quoted: Vec<String> = streams.iter().map(|stream| format!("`{stream}`")).collect();
    quoted.join(", ")
}
