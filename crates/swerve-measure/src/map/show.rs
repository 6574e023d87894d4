//! `swerve map show`: road networks of OpenDRIVE, Lanelet2, CommonRoad and SUMO files.

mod lanes;
mod network;

use std::path::PathBuf;

use anyhow::{Context as _, anyhow};
use swerve_drive::overwrite::OverwriteArgs;
use swerve_drive::pictures::PictureArgs;
use swerve_map_io::commonroad::{self, Centers};
use swerve_map_io::format::Format;
use swerve_map_io::{FILE_MAX, lanelet2, sumo};
use swerve_text::{read_given, unpacked};

#[derive(clap::Args, Debug)]
pub(super) struct ShowArgs {
    /// Road network: OpenDRIVE 1.4 to 1.8 (.xodr), Lanelet2 (.osm), CommonRoad 2018b and 2020a (.xml, .xml.gz), SUMO
    /// (.net.xml)
    #[arg(value_name = "FILE")]
    file: PathBuf,
    /// Picture file to write
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    pictures: PictureArgs,
    #[command(flatten)]
    overwrite: OverwriteArgs,
    /// Print samples of lane centre lines at the places of a CSV file with the columns road, section, lane, s
    /// (OpenDRIVE)
    #[arg(long, value_name = "POINTS.csv", conflicts_with_all = ["links", "json", "route"])]
    sample: Option<PathBuf>,
    /// Print the gaps between the ends of linked lanes as one JSON object
    #[arg(long, conflicts_with_all = ["json", "route"])]
    links: bool,
    /// Find the way between two places: `road:lane:s` (OpenDRIVE) or `lane:s`, or `x,y` for the nearest driving lane,
    /// metres
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], allow_hyphen_values = true, action = clap::ArgAction::Set)]
    route: Vec<String>,
    /// Fail if the file has defects: links to things that are not there, ends that do not meet, unknown types
    #[arg(long)]
    strict: bool,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
}

/// A file as text.
struct Source {
    file: String,
    /// Name in pictures.
    title: String,
    /// Size of the text, bytes.
    bytes: usize,
    text: String,
}

pub(super) fn show(args: &ShowArgs) -> anyhow::Result<String> {
    args.overwrite.check(args.out.as_deref())?;
    let source = read(args)?;
    let file = &source.file;
    let mut text = match Format::of(file, &source.text).map_err(|message| anyhow!("{file}: {message}"))? {
        Format::OpenDrive => network::show(args, &source)?,
        Format::CommonRoad => {
            lanes::show(args, &source, &commonroad::read(file, &source.text, Centers::Rounded)?.lanes)?
        }
        Format::Lanelet2 => lanes::show(args, &source, &lanelet2::read(file, &source.text)?.lanes)?,
        Format::Sumo => lanes::show(args, &source, &sumo::read(file, &source.text)?.lanes)?,
    };
    if let Some(out) = args.out.as_ref().filter(|_| !args.json && !args.links && args.sample.is_none()) {
        text.push_str(&format!("{}\n", out.display()));
    }
    Ok(text)
}

/// Reads a file, which may be packed by gzip.
fn read(args: &ShowArgs) -> anyhow::Result<Source> {
    let file = args.file.display().to_string();
    let bytes = read_given(&args.file, FILE_MAX).with_context(|| format!("reading {file}"))?;
    let text = unpacked(bytes).map_err(|message| anyhow!("{file}: {message}"))?;
    let title = args.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Source { file, title, bytes: text.len(), text })
}
