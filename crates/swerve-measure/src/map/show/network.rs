//! Output of `swerve map show` for OpenDRIVE files.

use anyhow::{Context as _, anyhow, bail};
use swerve_map::router::{self, Way};
use swerve_map_io::import::{Gap, Imported, import};
use swerve_map_io::links::Links;
use swerve_map_io::opendrive::Network;
use swerve_map_io::route;
use swerve_map_io::summary::Summary;
use swerve_map_io::{FILE_MAX, picture, points};
use swerve_text::{decoded, read_given};

use super::{ShowArgs, Source};

/// A network and the map made of it.
struct Loaded {
    network: Network,
    links: Links,
    imported: Imported,
}

pub(super) fn show(args: &ShowArgs, source: &Source) -> anyhow::Result<String> {
    let file = &source.file;
    let loaded = load(source)?;
    let defects = loaded.network.defects.count() + loaded.imported.gaps.len();
    if args.strict && defects > 0 {
        let gap = |gap: &Gap| format!("\n{file}: {} are {:.4} m apart", gap.ends, gap.gap_m);
        let gaps: String = loaded.imported.gaps.iter().map(gap).collect();
        bail!("{file}: expected no defects, found {defects}\n{}{gaps}", loaded.network.defects);
    }
    let way = way(args, &loaded)?;
    let Loaded { network, links, imported } = &loaded;
    let name = |lane| route::lane_name(network, imported, lane);
    let summary = Summary::of(network, imported, source.bytes);
    if let Some(out) = &args.out {
        let extent_m = summary.extent_m.with_context(|| format!("{file}: no lanes to draw"))?;
        let picture = picture::draw(network, imported, extent_m, &source.title, way.as_ref());
        args.pictures.write(out, &picture)?;
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
            json["route"] = route::json(&name, way);
        }
        return Ok(format!("{json}\n"));
    }
    let mut text = summary.text(file, network, imported, links);
    if let Some(way) = &way {
        text.push_str(&route::text(&imported.map, &name, way));
    }
    Ok(text)
}

fn load(Source { file, text, .. }: &Source) -> anyhow::Result<Loaded> {
    let network = Network::read(file, text)?;
    let links = Links::of(&network);
    let imported = import(&network, &links).with_context(|| file.clone())?;
    Ok(Loaded { network, links, imported })
}

fn way(args: &ShowArgs, Loaded { network, imported, .. }: &Loaded) -> anyhow::Result<Option<Way>> {
    let [from, to] = &*args.route else { return Ok(None) };
    let stop =
        |text: &String| route::stop(network, imported, text).map_err(|message| anyhow!("--route: {message}"));
    let way = router::find(&imported.map, stop(from)?, stop(to)?, &[]);
    way.map(Some).with_context(|| format!("--route: no way from {from} to {to} over driving lanes"))
}
