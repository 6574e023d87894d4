//! Page of a run from its log, and comparison page of two runs.

use std::collections::BTreeMap;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use swerve_foxglove::logged_image;
use swerve_log::{Bag, Log, LogError, PublicationRecord, Record};
use swerve_msg::truth::WorldState;
use swerve_msg::{Command, EgoState, Image, Plan, PredictionList, TrackList};
use swerve_report::output::{quoted, tell};
use swerve_report::page::{Collector, Message, Page, Pair, Parting, RunPage, photo_of};
use swerve_scenario::Scenario;
use swerve_stack::Registry;
use swerve_stack::Setup;
use swerve_stack::config::{Config, Images};
use swerve_stack::pipeline::Pipeline;
use swerve_text::FILE_MAX;
use zune_jpeg::JpegDecoder;
use zune_jpeg::zune_core::bytestream::ZCursor;
use zune_jpeg::zune_core::colorspace::ColorSpace;
use zune_jpeg::zune_core::options::DecoderOptions;

use super::{COMMAND, RunReport};
use crate::ego::{EgoRun, of_ego};
use crate::load::problems_error;
use crate::logged_scenario;
use crate::shipped::Kind;

/// Log named by a path to it or to the folder of its run; the partial log of an interrupted run.
pub fn log_of(path: &Path) -> Option<PathBuf> {
    if path.extension().is_some_and(|extension| extension == "mcap") {
        return Some(path.to_owned());
    }
    ["log.mcap", "log.partial.mcap"].map(|name| path.join(name)).into_iter().find(|log| log.is_file())
}

/// Same as [`log_of`] for a command line: the path itself if it exists or names a log.
///
/// # Errors
/// If there is no such file: with the folder below `out` of this name, or the command that makes it.
pub fn given_log(path: &Path) -> anyhow::Result<PathBuf> {
    if let Some(log) = log_of(path) {
        return Ok(log);
    }
    if path.exists() {
        return Ok(path.to_owned());
    }
    let name = path.file_stem().unwrap_or_default();
    let (shown, folder) = (path.display(), Path::new("out").join(name));
    if log_of(&folder).is_some() {
        anyhow::bail!("there is no log {shown}; did you mean `{}`?", folder.display());
    }
    let is_scenario = Kind::Scenario.text(path).is_ok();
    let run = if is_scenario { format!("swerve run {shown}") } else { "swerve run SCENARIO".to_owned() };
    anyhow::bail!("there is no log {shown}; `{run}` records one in a folder below `out`")
}

/// The readable part of a log.
pub struct LogSoFar {
    /// Records kept.
    pub log: Log,
    path: PathBuf,
    /// Reason why it was not read to its end.
    damage: Option<LogError>,
}

impl LogSoFar {
    /// Reads the records of a log accepted by `keep`. If the log is incomplete, one line on standard error gives the
    /// instant and the location; later uses of the log do not repeat it.
    ///
    /// # Errors
    /// If it cannot be read at all.
    pub fn read(path: &Path, keep: impl Fn(&Record) -> bool) -> Result<Self, LogError> {
        let (log, damage) = Log::salvage_where(path, keep)?;
        if let Some(damage) = &damage {
            let until_s = log.whole_until().as_secs().max(0.0);
            tell(&format!("note: the log is not complete, it is read up to {until_s:.3} s: {damage}"));
        }
        Ok(Self { log, path: path.to_owned(), damage })
    }

    /// Wraps a log that was read to its end.
    pub fn whole(path: &Path, log: Log) -> Self {
        Self { log, path: path.to_owned(), damage: None }
    }
}

/// Creates the page of a run, of the named or the first ego, from its log and, if it exists beside the log and belongs
/// to the same run, `metrics.json`.
/// An incomplete log gives a partial page.
///
/// # Errors
/// If the log cannot be read at all, or its configuration cannot be read by this version.
pub fn page_of_log(registry: &Registry, path: &Path, ego: Option<&str>) -> anyhow::Result<Page<RunPage>> {
    page_of(registry, &LogSoFar::read(path, |_| true)?, ego)
}

/// Same as [`page_of_log`], for a log in memory.
fn page_of(registry: &Registry, so_far: &LogSoFar, ego: Option<&str>) -> anyhow::Result<Page<RunPage>> {
    let LogSoFar { log, path, damage } = so_far;
    let document = Config::logged(&log.start.config)?;
    let config = Setup::from_document_with(registry, &document, &[]).map_err(|p| problems_error(&p))?;
    let scenario = logged_scenario(&log.start)?;
    let own = of_ego(log, &config, &scenario, ego)?;
    let (log, config, scenario) = match &own {
        // The page names the seed of the run.
        Some(EgoRun { log, setup, scenario }) => {
            let mut setup = setup.clone();
            setup.seed = config.seed;
            (log, setup, scenario.clone())
        }
        None => (log, config, scenario),
    };
    let mut report = RunReport::of_config(&config, &scenario, String::new());
    report.page.command = command_of_log(log, &config, &scenario);
    if config.live.is_some() {
        report.set_up_live(&config, &scenario)?;
    } else {
        report.set_up(&config, &Pipeline::build(&config, &scenario)?);
    }
    for record in &log.records {
        take(&mut report.collector, record)?;
    }
    if config.log.images == Images::Jpeg {
        // An incomplete log was reported already.
        let _cut_off = photos(&mut report.collector, path, log);
    }
    report.page.notes.extend(damage.iter().map(|damage| format!("The log is not complete: {damage}")));
    let digest = log.end.as_ref().map_or_else(String::new, |end| end.digest.to_string());
    let metrics = metrics_beside(path, &digest, &scenario.ego_name).unwrap_or_else(|why| {
        report.page.notes.push(format!("{why}: verdict and metrics are not shown."));
        "null".to_owned()
    });
    report.finish(&digest, &metrics)
}

/// Command line of the run from its log; if missing, one that uses the configuration saved from the page.
fn command_of_log(log: &Log, config: &Config, scenario: &Scenario) -> String {
    let extra = |key: &str| log.start.extra.get(key).cloned();
    extra(COMMAND).unwrap_or_else(|| {
        let saved = quoted(&format!("{}.toml", scenario.name));
        let file = extra("scenario_file").unwrap_or_else(|| scenario.name.clone());
        match config.live {
            Some(_) => format!("swerve live {saved}"),
            None if config.sim.guest => "swerve replay log.mcap --verify".to_owned(),
            None => format!("swerve run {} -c {saved}", quoted(&file)),
        }
    })
}

/// Content of `metrics.json` beside a log for an ego, if it belongs to the same run; otherwise the reason why not.
fn metrics_beside(log: &Path, digest: &str, ego: &str) -> Result<String, String> {
    let path = log.with_file_name("metrics.json");
    let broken = |why: String| format!("{} is broken ({why})", path.display());
    let text = match swerve_text::read_string(&path, FILE_MAX) {
        Err(error) if error.kind() != ErrorKind::NotFound => return Err(broken(error.to_string())),
        text => text.ok(),
    };
    let of_another = || "No metrics.json of this run lies beside its log".to_owned();
    let text = text.ok_or_else(of_another)?;
    let metrics: serde_json::Value =
        serde_json::from_str(&text).map_err(|error| broken(error.to_string()))?;
    let of = metrics.get("digest").and_then(serde_json::Value::as_str);
    match of.ok_or_else(|| broken("expected the digest of a run in it".to_owned()))? == digest {
        true => Ok(metrics.get("egos").and_then(|egos| egos.get(ego)).map_or(text, ToString::to_string)),
        false => Err(of_another()),
    }
}

fn take(collector: &mut Collector, record: &Record) -> Result<(), LogError> {
    match record {
        Record::Publication(message) => return publication(collector, message),
        Record::Step(s) => collector.step(&s.operator, s.stamp, s.start, s.end, s.late),
        Record::Miss(m) => collector.miss(&m.operator, m.stamp, m.at, m.reaction.as_str()),
        Record::Drop(d) => collector.dropped(&d.operator, d.stamp, d.at, d.reason.as_str()),
        Record::Watermark(_) | Record::Unfinished(_) | Record::Decision(_) => {}
    }
    Ok(())
}

/// Adds a message: decoded if its type is shown on the page, otherwise only counted.
fn publication(collector: &mut Collector, message: &PublicationRecord) -> Result<(), LogError> {
    type Shown = fn(&mut Collector, &PublicationRecord) -> Result<(), LogError>;
    fn shown<T: DeserializeOwned + 'static>() -> (&'static str, Shown) {
        let show: Shown = |collector, message| {
            // A log with a fingerprint in place of an image has nothing to show.
            match message.decode::<T>() {
                Ok(payload) => collector.message(about(message), Some(&payload)),
                Err(_) if core::any::type_name::<T>() == core::any::type_name::<Image>() => {
                    collector.message(about(message), None);
                }
                Err(error) => return Err(error),
            }
            Ok(())
        };
        (core::any::type_name::<T>(), show)
    }
    let known: [(&str, Shown); 7] = [
        shown::<WorldState>(),
        shown::<EgoState>(),
        shown::<TrackList>(),
        shown::<PredictionList>(),
        shown::<Plan>(),
        shown::<Command>(),
        shown::<Image>(),
    ];
    match known.iter().find(|(name, _)| *name == message.stream.type_name) {
        Some((_, show)) => show(collector, message),
        None => {
            collector.message(about(message), None);
            Ok(())
        }
    }
}

/// Adds camera pictures of a log that stores images as fingerprints and, for Foxglove, as JPEG files.
fn photos(collector: &mut Collector, path: &Path, log: &Log) -> Result<(), LogError> {
    let mut bag = Bag::open(path)?;
    while let Some(message) = bag.next_message()? {
        let topic = bag.topics()[message.topic].name.strip_prefix("/view/");
        let Some(camera) = topic.and_then(|topic| topic.strip_suffix("/image")) else { continue };
        // The camera's first stream is its colour images.
        let of_camera = log.streams.iter().filter(|stream| {
            stream.operator == camera && stream.type_name == core::any::type_name::<Image>()
        });
        let Some(stream) = of_camera.min_by_key(|stream| stream.port) else { continue };
        if let Some((stamp, file)) = logged_image(&message.data) {
            collector.photo(&stream.stream, stamp, || photo_of_file(&file));
        }
    }
    Ok(())
}

/// Limit of the pixels of a logged image that is shown: 4096 x 4096.
const PHOTO_PIXELS_MAX: u64 = 1 << 24;

/// Converts a JPEG file to a small picture; `None` for other data.
fn photo_of_file(file: &[u8]) -> Option<String> {
    let options = DecoderOptions::default().jpeg_set_out_colorspace(ColorSpace::RGB);
    let mut decoder = JpegDecoder::new_with_options(ZCursor::new(file), options);
    decoder.decode_headers().ok()?;
    let info = decoder.info()?;
    if u64::from(info.width) * u64::from(info.height) > PHOTO_PIXELS_MAX {
        return None;
    }
    let bytes = decoder.decode().ok()?;
    photo_of([info.width, info.height].map(usize::from), &bytes)
}

fn about(message: &PublicationRecord) -> Message<'_> {
    let (stream, header) = (&message.stream, &message.header);
    Message {
        stream: &stream.stream,
        operator: &stream.operator,
        stamp: header.stamp,
        at: header.visible_at,
        origin: header.origin,
    }
}

/// Compares two runs by their logs and finds where they diverge.
///
/// # Errors
/// Same as [`page_of_log`], except for reading the logs.
pub fn pair_of_logs(
    registry: &Registry,
    a: &LogSoFar,
    b: &LogSoFar,
) -> anyhow::Result<Page<Pair<Page<RunPage>, Vec<Parting>>>> {
    let parting = partings(&a.log, &b.log);
    let (a, b) = (page_of(registry, a, None)?, page_of(registry, b, None)?);
    let title = format!("{} | {}", a.title, b.title);
    Ok(Page::new("runs", title, Pair { a, b, parting }))
}

/// First difference of each stream of two logs, earliest first; streams that never differ are last.
fn partings(a: &Log, b: &Log) -> Vec<Parting> {
    type Both<'a> = [Vec<&'a PublicationRecord>; 2];
    let mut streams: BTreeMap<&str, Both<'_>> = BTreeMap::new();
    for (k, log) in [a, b].into_iter().enumerate() {
        for message in log.all_publications() {
            streams.entry(&message.stream.stream).or_default()[k].push(message);
        }
    }
    let mut partings: Vec<Parting> =
        streams.into_iter().map(|(stream, both)| parting(stream, &both[0], &both[1])).collect();
    partings.sort_by_key(|parting| parting.at.unwrap_or(i64::MAX));
    partings
}

fn parting(stream: &str, a: &[&PublicationRecord], b: &[&PublicationRecord]) -> Parting {
    let when = |message: &PublicationRecord| (message.header.stamp, message.header.visible_at);
    let is_same = |(a, b): &(&&PublicationRecord, &&PublicationRecord)| {
        when(a) == when(b) && a.payload_cbor == b.payload_cbor
    };
    let same = a.iter().zip(b).take_while(is_same).count();
    let (next_a, next_b) = (a.get(same), b.get(same));
    let first = next_a.into_iter().chain(next_b).min_by_key(|message| message.header.visible_at);
    let by = match (next_a, next_b) {
        (None, None) => "",
        (Some(a), Some(b)) if when(a) == when(b) => "content",
        (Some(_), Some(_)) => "instant",
        _ => "missing",
    };
    Parting {
        stream: stream.to_owned(),
        counts: [a.len(), b.len(), same],
        at: first.map(|message| message.header.visible_at.ns().div_euclid(1000)),
        stamp: first.map(|message| message.header.stamp.ns().div_euclid(1000)),
        by,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unreadable_metrics_are_not_reported_as_missing() {
        let folder = tempfile::tempdir().unwrap();
        let read = |text: &[u8]| {
            std::fs::write(folder.path().join("metrics.json"), text).unwrap();
            metrics_beside(&folder.path().join("log.mcap"), "12", "ego")
        };
        let whole = "{\"digest\": \"12\"}";
        assert_eq!(read(whole.as_bytes()).as_deref(), Ok(whole));
        for (text, why) in [
            (&whole.as_bytes()[..9], "line 1"),
            (b"\xff\xff", "UTF-8"),
            (b"", "line 1"),
            (b"[]", "expected the digest of a run"),
        ] {
            let told = read(text).unwrap_err();
            assert!(told.contains("metrics.json is broken (") && told.contains(why), "{told}");
        }
        assert!(read(b"{\"digest\": \"13\"}").unwrap_err().starts_with("No metrics.json of this run"));
        std::fs::remove_file(folder.path().join("metrics.json")).unwrap();
        let missing = metrics_beside(&folder.path().join("log.mcap"), "12", "ego");
        assert!(missing.unwrap_err().starts_with("No metrics.json of this run"));
    }
}
