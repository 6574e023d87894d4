//! Recordings in files, and the lanes of maps that lie beside them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;
use serde::Serialize;
use swerve_prediction::lanes::LaneGraph;
use swerve_prediction::recorded::{Recording, commonroad_csv, commonroad_lanelets, eth_ucy, text};
use swerve_report::files::{entries, read_whole};

use super::Format;

/// The folder of maps beside recordings.
const MAPS: &str = "maps";
/// Less than this share of who drives in the middle of a lane, and the map is not of there.
const ON_LANES_MIN: f64 = 0.4;

/// One file's recordings.
pub(crate) struct File {
    /// Its name without the folder.
    pub(crate) name: String,
    /// By the names of their scenarios, where they have one.
    recordings: Vec<(String, Recording)>,
    pub(crate) lanes: Lanes,
}

/// How many recordings have lanes below them.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize)]
pub(crate) struct Lanes {
    /// Those of their own map.
    own: usize,
    /// Those of another map of their site, onto which they were moved by the ways that were driven.
    placed: usize,
    without: usize,
}

impl File {
    /// In the order of the file.
    pub(crate) fn recordings(self) -> Vec<Recording> {
        self.recordings.into_iter().map(|(_, recording)| recording).collect()
    }

    /// In the order of the file.
    pub(crate) fn each(&self) -> impl Iterator<Item = &Recording> {
        self.recordings.iter().map(|(_, recording)| recording)
    }
}

/// All files of a folder that are of this form, or one.
///
/// # Errors
/// A folder without such files, a file that cannot be read or is not of its form: file, line, and what was expected.
pub(super) fn files(dir: &Path, format: Format) -> anyhow::Result<Vec<File>> {
    let endings = match format {
        Format::EthUcy => &[".txt"][..],
        Format::CommonroadCsv => &[".csv", ".csv.gz"][..],
    };
    let paths = matching(dir, endings)?;
    if paths.is_empty() {
        let endings = endings.join(" or ");
        return Err(anyhow!("{}: expected files that end in {endings}, found none", dir.display()));
    }
    paths.iter().map(|path| on_lanes(file(path, format)?, path)).collect()
}

/// The files of a folder with one of these endings, in order; a file is itself.
fn matching(dir: &Path, endings: &[&str]) -> anyhow::Result<Vec<PathBuf>> {
    let told = |error| anyhow!("{}: cannot be read: {error}", dir.display());
    if !std::fs::metadata(dir).map_err(told)?.is_dir() {
        return Ok(vec![dir.to_owned()]);
    }
    let mut paths = entries(dir).map_err(told)?;
    paths.retain(|path| endings.iter().any(|ending| path.to_string_lossy().ends_with(ending)));
    Ok(paths)
}

/// The recordings of one file.
///
/// # Errors
/// A file that cannot be read or is not of its form: file, line, and what was expected.
pub(crate) fn file(path: &Path, format: Format) -> anyhow::Result<File> {
    let at = path.display();
    let text = unpacked(path)?;
    let recordings = match format {
        Format::EthUcy => eth_ucy(&text).map(|recording| vec![(String::new(), recording)]),
        Format::CommonroadCsv => commonroad_csv(&text).map(|scenarios| scenarios.into_iter().collect()),
    };
    let recordings = recordings.map_err(|error| anyhow!("{at}:{error}"))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let lanes = Lanes { without: recordings.len(), ..Lanes::default() };
    Ok(File { name, recordings, lanes })
}

fn unpacked(path: &Path) -> anyhow::Result<String> {
    text(read_whole(path)?).map_err(|error| anyhow!("{}: {error}", path.display()))
}

/// A file with the lanes of the maps in the folder `maps` beside it: each scenario has those of its name, or is moved onto
/// those of its site (the name up to the first `-`) that it fits best.
///
/// # Errors
/// A map that cannot be read or is none: file, line, and what was expected.
pub(crate) fn on_lanes(mut file: File, path: &Path) -> anyhow::Result<File> {
    let folder = path.parent().unwrap_or(Path::new("")).join(MAPS);
    let is_there = file.recordings.iter().any(|(name, _)| !name.is_empty()) && folder.is_dir();
    let maps = if is_there { maps(&folder, &file)? } else { BTreeMap::new() };
    let mut lanes = Lanes::default();
    for (name, recording) in &mut file.recordings {
        if let Some(own) = maps.get(name) {
            recording.lanes = Some(own.clone());
            lanes.own += 1;
            continue;
        }
        let of_site = maps.iter().filter(|(map, _)| site(map) == site(name));
        let placed = of_site.filter_map(|(_, map)| recording.placed(map));
        match placed.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, share)| *share >= ON_LANES_MIN) {
            Some((moved, _)) => {
                *recording = moved;
                lanes.placed += 1;
            }
            None => lanes.without += 1,
        }
    }
    Ok(File { lanes, ..file })
}

/// Maps by the names of their scenarios: those of the sites of a file.
fn maps(folder: &Path, file: &File) -> anyhow::Result<BTreeMap<String, Arc<LaneGraph>>> {
    let mut maps = BTreeMap::new();
    for path in matching(folder, &[".xml", ".xml.gz"])? {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = name.trim_end_matches(".gz").trim_end_matches(".xml").to_owned();
        if file.recordings.iter().any(|(scenario, _)| site(scenario) == site(&name)) {
            let lanes = commonroad_lanelets(&unpacked(&path)?);
            let lanes = lanes.map_err(|error| anyhow!("{}:{error}", path.display()))?;
            maps.insert(name, Arc::new(lanes));
        }
    }
    Ok(maps)
}

fn site(name: &str) -> &str {
    name.split('-').next().unwrap_or(name)
}
