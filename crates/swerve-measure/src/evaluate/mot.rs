//! MOTChallenge rows: `frame,id,left,top,width,height,confidence`; further columns are ignored.
//!
//! Frames count from 1, may be missing and come in any order. In the ground truth, boxes with confidence 0 do not
//! count.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use swerve_eval::{TrackingFrame, TrackingMetrics};

use super::Compared;
use super::input::{number, text, wrong};

/// Maximum number of frames: the range from the first to the last is iterated.
const FRAMES_MAX: u64 = 10_000_000;

/// Box of one row.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Row {
    /// Frame number, starting at 1.
    pub(crate) frame: u64,
    /// Identity; negative if there is none.
    pub(crate) id: i64,
    /// Left, top, width, height, pixels.
    pub(crate) box_px: [f64; 4],
    /// Confidence; 1 if the row has none.
    pub(crate) confidence: f64,
}

/// Reads a file of rows in file order, each with its line number.
///
/// # Errors
/// If the file cannot be read, or a row has too few columns, a non-number or a value out of range; the error names
/// file, line and column.
pub(crate) fn read(path: &Path) -> anyhow::Result<Vec<(usize, Row)>> {
    let text = text(path)?;
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines.map(|(k, line)| Ok((k + 1, row(line).map_err(|what| wrong(path, k + 1, what))?))).collect()
}

fn row(line: &str) -> Result<Row, String> {
    const NAMES: [&str; 7] = ["frame", "id", "left", "top", "width", "height", "confidence"];
    let mut of = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let words: Vec<&str> = line.split(',').collect();
    if words.len() < 6 {
        let names = NAMES[..6].join(",");
        return Err(format!("expected at least 6 columns between commas ({names}), found {}", words.len()));
    }
    for ((value, name), word) in of.iter_mut().zip(NAMES).zip(&words) {
        *value = number(name, word)?;
    }
    let [frame, id, left, top, width, height, confidence] = of;
    if frame.fract() != 0.0 || !(1.0..=FRAMES_MAX as f64).contains(&frame) {
        return Err(format!("frame: expected a whole number from 1 to {FRAMES_MAX}, found {frame}"));
    }
    if id.fract() != 0.0 || id.abs() > 1e15 {
        return Err(format!("id: expected a whole number, found {id}"));
    }
    for (name, size) in [("width", width), ("height", height)] {
        if size < 0.0 {
            return Err(format!("{name}: expected at least 0, found {size}"));
        }
    }
    Ok(Row { frame: frame as u64, id: id as i64, box_px: [left, top, width, height], confidence })
}

/// Boxes by frame: identity; left, top, right, bottom.
type Tracks = BTreeMap<u64, Vec<(u64, [f64; 4])>>;

/// Tracks of a file.
fn tracks(path: &Path, counts: impl Fn(&Row) -> bool) -> anyhow::Result<Tracks> {
    let mut tracks = Tracks::new();
    let mut seen = BTreeSet::new();
    for (line, row) in read(path)? {
        let Ok(id) = u64::try_from(row.id) else {
            return Err(wrong(path, line, format!("id: expected at least 0, found {}", row.id)));
        };
        if !seen.insert((row.frame, id)) {
            let what = format!("frame {} has two boxes of identity {id}, expected one", row.frame);
            return Err(wrong(path, line, what));
        }
        let [left, top, width, height] = row.box_px;
        if counts(&row) {
            tracks.entry(row.frame).or_default().push((id, [left, top, left + width, top + height]));
        }
    }
    Ok(tracks)
}

pub(super) fn evaluate(compared: &Compared) -> anyhow::Result<TrackingMetrics> {
    let truth = tracks(&compared.truth, |row| row.confidence != 0.0)?;
    let found = tracks(&compared.found, |_| true)?;
    let last = truth.keys().chain(found.keys()).max().copied().unwrap_or(0);
    let boxes = |of: &Tracks, k: usize| of.get(&(k as u64 + 1)).cloned().unwrap_or_default();
    let frames: Vec<TrackingFrame> = compared
        .timely
        .judged(usize::try_from(last)?)
        .into_iter()
        .map(|(t, r)| {
            TrackingFrame::of_boxes(&boxes(&truth, t), &r.map_or_else(Vec::new, |r| boxes(&found, r)))
        })
        .collect();
    Ok(TrackingMetrics::of(&frames))
}
