//! `swerve map show`: road networks of OpenDRIVE files.

use std::path::PathBuf;

use anyhow::{Context as _, anyhow, bail};
use swerve_drive::overwrite::OverwriteArgs;
use swerve_drive::pictures::PictureArgs;
use swerve_map_io::import::{Gap, Imported, import};
use swerve_map_io::links::Links;
use swerve_map_io::opendrive::Network;
use swerve_map_io::route::{self, Way};
use swerve_map_io::summary::Summary;
use swerve_map_io::{FILE_MAX, picture, points};
use swerve_text::{decoded, read_given};

#[derive(clap::Args, Debug)]
pub(super) struct ShowArgs {
    /// Road network (OpenDRIVE 1.4 to 1.8)
    #[arg(value_name = "FILE.xodr")]
    file: PathBuf,
    /// Picture file to write
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    #[command(flatten)]
    pictures: PictureArgs,
    #[command(flatten)]
    overwrite: OverwriteArgs,
    /// Print samples of lane centre lines at the places of a CSV file with the columns road, section, lane, s
    #[arg(long, value_name = "POINTS.csv", conflicts_with_all = ["links", "json", "route"])]
    sample: Option<PathBuf>,
    /// Print the gaps between the ends of linked lanes as one JSON object
    #[arg(long, conflicts_with_all = ["json", "route"])]
    links: bool,
    /// Find the way between two places: `road:lane:s`, or `x,y` for the nearest driving lane, metres
    #[arg(long, num_args = 2, value_names = ["FROM", "TO"], allow_hyphen_values = true, action = clap::ArgAction::Set)]
    route: Vec<String>,
    /// Fail if the file has defects: links to things that are not there, ends that do not meet, unknown types
    #[arg(long)]
    strict: bool,
    /// Print one JSON object and nothing else
    #[arg(long)]
    json: bool,
}

/// A file and what is made of it.
struct Loaded {
    file: String,
    bytes: usize,
    network: Network,
    links: Links,
    imported: Imported,
}

pub(super) fn show(args: &ShowArgs) -> anyhow::Result<String> {
    args.overwrite.check(args.out.as_deref())?;
    let loaded = load(args)?;
    let defects = loaded.network.defects.count() + loaded.imported.gaps.len();
    if args.strict && defects > 0 {
        let gap = |gap: &Gap| format!("\n{}: {} are {:.4} m apart", loaded.file, gap.ends, gap.gap_m);
        let gaps: String = loaded.imported.gaps.iter().map(gap).collect();
        bail!("{}: expected no defects, found {defects}\n{}{gaps}", loaded.file, loaded.network.defects);
    }
    let way = way(args, &loaded)?;
    let Loaded { file, network, links, imported, .. } = &loaded;
    let summary = Summary::of(network, imported, loaded.bytes);
    if let Some(out) = &args.out {
        let extent_m = summary.extent_m.with_context(|| format!("{file}: no lanes to draw"))?;
        let title = args.file.file_name().unwrap_or_default().to_string_lossy().into_owned();
        args.pictures.write(out, &picture::draw(network, imported, extent_m, &title, way.as_ref()))?;
    }
    if let Some(table) = &args.sample {
        let name = table.display().to_string();
        let text = decoded(read_given(table, FILE_MAX).with_context(|| format!("reading {name}"))?);
        return points::sampled(network, &name, &text.map_err(|error| anyhow!("{name}: {error}"))?)
            .map_err(|message| anyhow!(message));
    }
    if args.links {
        return Ok(format!("{:#}\n", links.json(network)));
    }
    if args.json {
        let mut json = summary.json(file, network, imported, links);
        if let Some(way) = &way {
            json["route"] = route::json(network, imported, way);
        }
        return Ok(format!("{json}\n"));
    }
    let mut text = summary.text(file, network, imported, links);
    if let Some(way) = &way {
        text.push_str(&route::text(network, imported, way));
    }
    if let Some(out) = &args.out {
        text.push_str(&format!("{}\n", out.display()));
    }
    Ok(text)
}

fn load(args: &ShowArgs) -> anyhow::Result<Loaded> {
    let file = args.file.display().to_string();
    let bytes = read_given(&args.file, FILE_MAX).with_context(|| format!("reading {file}"))?;
    let count = bytes.len();
    let text = decoded(bytes).map_err(|error| anyhow!("{file}: {error}"))?;
    let network = Network::read(&file, &text)?;
    let links = Links::of(&network);
    let imported = import(&network, &links).with_context(|| file.clone())?;
    Ok(Loaded { file, bytes: count, network, links, imported })
}

fn way(args: &ShowArgs, Loaded { network, imported, .. }: &Loaded) -> anyhow::Result<Option<Way>> {
    let [from, to] = &*args.route else { return Ok(None) };
    let stop =
        |text: &String| route::stop(network, imported, text).map_err(|message| anyhow!("--route: {message}"));
    let way = route::find(&imported.map, stop(from)?, stop(to)?);
    way.map(Some).with_context(|| format!("--route: no way from {from} to {to} over driving lanes"))
}
