//! `swerve track`: tracks from a file of detections, both in MOTChallenge's rows.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::PathBuf;

use clap::ValueEnum;
use swerve_perception::image_plane::{ByteTrack, ImageDetection, ImageTracker, Sort};
use swerve_report::files::{refuse_unwritable, write_whole};

use crate::evaluate::mot;

/// `swerve track`.
#[derive(clap::Args, Debug)]
pub struct TrackArgs {
    /// Detections: rows of frame,id,left,top,width,height,confidence; the id is passed over
    detections: PathBuf,
    /// How boxes become tracks
    #[arg(long, value_enum)]
    tracker: TrackerName,
    /// Write the tracks to this file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum TrackerName {
    /// Overlap alone (Bewley et al. 2016)
    Sort,
    /// Boxes of low scores keep tracks alive (Zhang et al. 2022)
    Bytetrack,
}

/// Runs `swerve track`.
///
/// # Errors
/// When the detections cannot be read or are no such rows (file, line, and what was expected), or the tracks cannot be
/// written.
pub fn run(args: &TrackArgs) -> anyhow::Result<()> {
    let mut frames = BTreeMap::<u64, Vec<ImageDetection>>::new();
    for (_, row) in mot::read(&args.detections)? {
        let [left, top, width, height] = row.box_px;
        let found = ImageDetection { box_px: [left, top, left + width, top + height], score: row.confidence };
        frames.entry(row.frame).or_default().push(found);
    }
    refuse_unwritable(&args.out)?;
    let rows = match args.tracker {
        TrackerName::Sort => tracks(&mut Sort::default(), &frames),
        TrackerName::Bytetrack => tracks(&mut ByteTrack::default(), &frames),
    };
    write_whole(&args.out, rows.as_bytes())?;
    let (boxes, last) = (rows.lines().count(), frames.keys().max().unwrap_or(&0));
    swerve_report::output::print(&format!(
        "{boxes} boxes of tracks in {last} frames in {}\n",
        args.out.display()
    ))
}

/// The rows of all frames from the first to the last, also those in which nothing was found.
fn tracks(tracker: &mut impl ImageTracker, frames: &BTreeMap<u64, Vec<ImageDetection>>) -> String {
    let mut rows = String::new();
    for frame in 1..=frames.keys().max().copied().unwrap_or(0) {
        for track in tracker.update(frames.get(&frame).map_or(&[][..], Vec::as_slice)) {
            let [left, top, right, bottom] = track.box_px;
            let (width, height) = (right - left, bottom - top);
            let _infallible = writeln!(
                rows,
                "{frame},{},{left:.3},{top:.3},{width:.3},{height:.3},{:.6},-1,-1,-1",
                track.id, track.score
            );
        }
    }
    rows
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_on(rows: &str, tracker: TrackerName) -> anyhow::Result<String> {
        let folder = tempfile::tempdir()?;
        let (detections, out) = (folder.path().join("det.txt"), folder.path().join("tracks.txt"));
        std::fs::write(&detections, rows)?;
        run(&TrackArgs { detections, tracker, out: out.clone() })?;
        Ok(std::fs::read_to_string(out)?)
    }

    /// Two people, one of whom goes; frame 3 has nobody, and rows go back.
    const ROWS: &str = "2,-1,10,0,40,80,0.9\n1,-1,0,0,40,80,0.9\n1,-1,300,0,40,80,0.3\n4,-1,30,0,40,80,0.2\n";

    #[test]
    fn rows_become_rows() {
        let tracked = run_on(ROWS, TrackerName::Bytetrack).unwrap();
        let starts: Vec<&str> = tracked.lines().map(|row| &row[..4]).collect();
        // The low score of frame 4 may only keep who was seen in the frame before it.
        assert_eq!(starts, ["1,1,", "2,1,"], "{tracked}");
        let sorted = run_on(ROWS, TrackerName::Sort).unwrap();
        let starts: Vec<&str> = sorted.lines().map(|row| &row[..4]).collect();
        // Everybody is reported in the first three frames, later only who was seen three times in a row.
        assert_eq!(starts, ["1,2,", "1,1,", "2,1,"], "{sorted}");
        assert!(sorted.ends_with(",0.900000,-1,-1,-1\n"), "{sorted}");
        assert_eq!(run_on("", TrackerName::Sort).unwrap(), "");
        let error = run_on("1,-1,0,0,40\n", TrackerName::Sort).unwrap_err().to_string();
        assert!(error.contains("det.txt:1: expected at least 6 columns"), "{error}");
    }
}
