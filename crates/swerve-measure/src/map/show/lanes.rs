//! Output of `swerve map show` for files that describe lanes by their borders.

use anyhow::{Context as _, anyhow, bail};
use swerve_map::router::{self, Way};
use swerve_map_io::import::Gap;
use swerve_map_io::lane_map::LaneMap;
use swerve_map_io::overview::Overview;
use swerve_map_io::picture;
use swerve_map_io::route;

use super::{ShowArgs, Source};

pub(super) fn show(args: &ShowArgs, source: &Source, lanes: &LaneMap) -> anyhow::Result<String> {
    let file = &source.file;
    if args.sample.is_some() {
        bail!("--sample: expected an OpenDRIVE file, found {}: {file}", lanes.format);
    }
    let defects = Overview::defects(lanes);
    if args.strict && defects > 0 {
        let gap = |gap: &Gap| format!("\n{file}: {} are {:.4} m apart", gap.ends, gap.gap_m);
        let gaps: String = lanes.gaps.iter().map(gap).collect();
        bail!("{file}: expected no defects, found {defects}\n{}{gaps}", lanes.defects);
    }
    let way = way(args, lanes)?;
    let name = |lane| lanes.name(lane).to_owned();
    let overview = Overview::of(&lanes.map, source.bytes);
    if let Some(out) = &args.out {
        let extent_m = overview.extent_m.with_context(|| format!("{file}: no lanes to draw"))?;
        let picture = picture::lanes::draw(&lanes.map, extent_m, &source.title, way.as_ref());
        args.pictures.write(out, &picture)?;
    }
    if args.links {
        return Ok(format!("{:#}\n", overview.links(lanes)));
    }
    if args.json {
        let mut json = overview.json(file, lanes);
        if let Some(way) = &way {
            json["route"] = route::json(&name, way);
        }
        return Ok(format!("{json}\n"));
    }
    let mut text = overview.text(file, lanes);
    if let Some(way) = &way {
        text.push_str(&route::text(&lanes.map, &name, way));
    }
    Ok(text)
}

fn way(args: &ShowArgs, lanes: &LaneMap) -> anyhow::Result<Option<Way>> {
    let [from, to] = &*args.route else { return Ok(None) };
    let stop = |text: &String| route::stop_on(lanes, text).map_err(|message| anyhow!("--route: {message}"));
    let way = router::find(&lanes.map, stop(from)?, stop(to)?, &[]);
    way.map(Some).with_context(|| format!("--route: no way from {from} to {to} over driving lanes"))
}
