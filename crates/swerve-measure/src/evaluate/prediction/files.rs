//! Recordings in files, with the lanes of maps beside them.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use anyhow::anyhow;
use clap::ValueEnum;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_map::Map;
use swerve_map_io::commonroad::{self, Centers};
use swerve_prediction::recorded::{Recording, commonroad_csv, eth_ucy};
use swerve_report::files::{entries, read_whole};

#[expect(missing_docs, reason = "in help and schemas the keys that take it describe it")]
#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum, Deserialize, JsonSchema)]
#[value(rename_all = "snake_case")]
#[serde(rename_all = "snake_case")]
pub enum Format {
    /// ETH and UCY: *.txt with rows of `frame person x y`, ten frames per 0.4 s
    EthUcy,
    /// CommonRoad's recorded scenarios: *.csv or *.csv.gz with rows every 0.1 s; lanes from *.xml or *.xml.gz in the
    /// sibling folder `maps`
    CommonroadCsv,
}

/// Name of the folder with maps beside the recordings.
const MAPS: &str = "maps";
/// Minimum share of road users driving in the middle of a lane for a map to match a recording.
const ON_LANES_MIN: f64 = 0.4;

/// Recordings of one file.
pub struct File {
    /// File name without folder.
    pub(crate) name: String,
    /// Recordings with the names of their scenarios; the name is empty in formats without scenarios.
    recordings: Vec<(String, Recording)>,
    pub(crate) lanes: Lanes,
}

/// Number of recordings by the source of their lanes.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize)]
pub(crate) struct Lanes {
    /// Recordings with lanes of their own map.
    own: usize,
    /// Recordings moved onto another map of their site by fitting the driven paths.
    placed: usize,
    without: usize,
}

impl File {
    /// Recordings in file order.
    pub fn recordings(self) -> Vec<Recording> {
        self.recordings.into_iter().map(|(_, recording)| recording).collect()
    }

    /// Recordings in file order.
    pub(crate) fn each(&self) -> impl Iterator<Item = &Recording> {
        self.recordings.iter().map(|(_, recording)| recording)
    }
}

/// Reads a file, or all files of this format in a folder.
///
/// # Errors
/// If the folder has no such files, or a file cannot be read or has another format; the error names file, line and the
/// expected content.
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

/// Files of a folder with one of these endings, sorted; for a file, the file itself.
fn matching(dir: &Path, endings: &[&str]) -> anyhow::Result<Vec<PathBuf>> {
    let told = |error| anyhow!("{}: cannot be read: {error}", dir.display());
    if !std::fs::metadata(dir).map_err(told)?.is_dir() {
        return Ok(vec![dir.to_owned()]);
    }
    let mut paths = entries(dir).map_err(told)?;
    paths.retain(|path| endings.iter().any(|ending| path.to_string_lossy().ends_with(ending)));
    Ok(paths)
}

/// Reads the recordings of one file.
///
/// # Errors
/// If the file cannot be read or has another format; the error names file, line and the expected content.
pub fn file(path: &Path, format: Format) -> anyhow::Result<File> {
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
    swerve_text::unpacked(read_whole(path)?).map_err(|error| anyhow!("{}: {error}", path.display()))
}

/// Adds lanes from the folder `maps` beside the file: a scenario gets the map of its own name, or is moved onto the
/// best-fitting map of its site (the name up to the first `-`).
///
/// # Errors
/// If a map cannot be read or parsed; the error names file, line and the expected content.
pub fn on_lanes(mut file: File, path: &Path) -> anyhow::Result<File> {
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

/// Maps of the sites in a file, by scenario name.
fn maps(folder: &Path, file: &File) -> anyhow::Result<BTreeMap<String, Arc<Map>>> {
    let mut maps = BTreeMap::new();
    for path in matching(folder, &[".xml", ".xml.gz"])? {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let name = name.trim_end_matches(".gz").trim_end_matches(".xml").to_owned();
        if file.recordings.iter().any(|(scenario, _)| site(scenario) == site(&name)) {
            let roads = commonroad::read(&path.display().to_string(), &unpacked(&path)?, Centers::Middles)?;
            maps.insert(name, Arc::new(roads.lanes.map));
        }
    }
    Ok(maps)
}

fn site(name: &str) -> &str {
    name.split('-').next().unwrap_or(name)
}
