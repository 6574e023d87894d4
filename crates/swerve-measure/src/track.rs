//! `swerve track`: tracks from a file of detections, both as MOTChallenge rows.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use clap::ValueEnum;
use swerve_drive::overwrite::OverwriteArgs;
use swerve_perception::image_plane::{
    Appearance, BOXES_MAX, ByteTrack, DeepSort, ImageDetection, ImageTrack, ImageTracker, Look, Sort,
};
use swerve_report::files::{refuse_to_replace, write_whole};

use crate::evaluate::mot;
use crate::picture::{MEGAPIXELS_MAX, Picture};

/// `swerve track`.
#[derive(clap::Args, Debug)]
pub struct TrackArgs {
    /// Detections: rows of frame,id,left,top,width,height,confidence; the id is ignored
    detections: PathBuf,
    /// Tracking algorithm
    #[arg(long, value_enum)]
    tracker: TrackerName,
    /// Images of the frames for `deepsort`: 000001.png or 000001.jpg, and so on; without them it uses motion alone
    #[arg(long, value_name = "FOLDER")]
    images: Option<PathBuf>,
    /// Write the tracks to this file
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
    #[command(flatten)]
    overwrite: OverwriteArgs,
}

#[derive(Clone, Copy, PartialEq, Eq, Debug, ValueEnum)]
enum TrackerName {
    /// Overlap only (Bewley et al. 2016)
    Sort,
    /// Overlap, with low-score boxes keeping tracks alive (Zhang et al. 2022)
    Bytetrack,
    /// Appearance and motion, most recently seen tracks first (Wojke et al. 2017)
    Deepsort,
}

/// Runs `swerve track`.
///
/// # Errors
/// If the detections cannot be read or are not such rows (the error names file, line and the expected content), an
/// image is missing or cannot be read, or the tracks cannot be written.
pub fn run(args: &TrackArgs) -> anyhow::Result<()> {
    let is_deep = args.tracker == TrackerName::Deepsort;
    ensure!(is_deep || args.images.is_none(), "--images: only `--tracker deepsort` looks at images");
    let (mut frames, mut out_of_range) = (Frames::new(), Vec::new());
    for (line, row) in mot::read(&args.detections)? {
        if !(0.0..=1.0).contains(&row.confidence) {
            out_of_range.push((line, row.confidence));
        }
        let [left, top, width, height] = row.box_px;
        let found = ImageDetection { box_px: [left, top, left + width, top + height], score: row.confidence };
        frames.entry(row.frame).or_default().push(found);
    }
    refuse_to_replace([args.out.as_path()], core::slice::from_ref(&args.detections))?;
    args.overwrite.check([args.out.as_path()])?;
    let rows = match (args.tracker, &args.images) {
        (TrackerName::Sort, _) => tracks(&frames, by_boxes(Sort::default())),
        (TrackerName::Bytetrack, _) => tracks(&frames, by_boxes(ByteTrack::default())),
        (TrackerName::Deepsort, None) => tracks(&frames, by_boxes(DeepSort::default())),
        (TrackerName::Deepsort, Some(folder)) => tracks(&frames, by_looks(folder)),
    }?;
    write_whole(&args.out, rows.as_bytes())?;
    let (boxes, last) = (rows.lines().count(), frames.keys().max().unwrap_or(&0));
    let mut told = format!("{boxes} boxes of tracks in {last} frames in {}\n", args.out.display());
    if is_deep && args.images.is_none() {
        told += "by motion alone: --images FOLDER has it look at the boxes too\n";
    }
    if let [(line, score), ..] = out_of_range[..] {
        let (at, count) = (args.detections.display(), out_of_range.len());
        let _infallible = writeln!(
            told,
            "{at}:{line}: confidence: expected 0 to 1, found {score} ({count} such rows, used as they are)"
        );
    }
    let most = frames.values().map(Vec::len).max().unwrap_or(0);
    if most > BOXES_MAX {
        let _infallible =
            writeln!(told, "{most} boxes in a frame: the {BOXES_MAX} surest of each were followed");
    }
    swerve_report::output::print(&told)
}

/// Detections by frame.
type Frames = BTreeMap<u64, Vec<ImageDetection>>;

/// Update function of a tracker that uses boxes only.
fn by_boxes(
    mut tracker: impl ImageTracker,
) -> impl FnMut(u64, &[ImageDetection]) -> anyhow::Result<Vec<ImageTrack>> {
    move |_, found| Ok(tracker.update(found))
}

/// Update function of DeepSORT, which also uses the appearance of the boxes in the images of a folder.
fn by_looks(folder: &Path) -> impl FnMut(u64, &[ImageDetection]) -> anyhow::Result<Vec<ImageTrack>> {
    let (mut tracker, mut appearance) = (DeepSort::default(), Appearance::default());
    move |frame, found| {
        let mut looks: Vec<Option<Look>> = Vec::new();
        if !found.is_empty() {
            let picture = image_of(folder, frame)?;
            let image = picture.rgb()?;
            looks.extend(found.iter().map(|found| appearance.describe(image, found.box_px)));
        }
        Ok(tracker.update_seen(found, &looks))
    }
}

/// Image of a frame, by MOTChallenge's file name.
fn image_of(folder: &Path, frame: u64) -> anyhow::Result<Picture> {
    let mut files = ["png", "jpg"].map(|ending| folder.join(format!("{frame:06}.{ending}"))).into_iter();
    match files.find(|file| file.is_file()) {
        Some(file) => Picture::read(&file, MEGAPIXELS_MAX),
        None => bail!("{}: no image of frame {frame}, expected {frame:06}.png or .jpg", folder.display()),
    }
}

/// Rows of all frames from the first to the last, including frames without detections.
fn tracks(
    frames: &Frames,
    mut update: impl FnMut(u64, &[ImageDetection]) -> anyhow::Result<Vec<ImageTrack>>,
) -> anyhow::Result<String> {
    let mut rows = String::new();
    for frame in 1..=frames.keys().max().copied().unwrap_or(0) {
        let found = frames.get(&frame).map_or(&[][..], Vec::as_slice);
        for track in update(frame, found).with_context(|| format!("frame {frame}"))? {
            let [left, top, right, bottom] = track.box_px;
            let (width, height) = (right - left, bottom - top);
            let _infallible = writeln!(
                rows,
                "{frame},{},{left:.3},{top:.3},{width:.3},{height:.3},{:.6},-1,-1,-1",
                track.id, track.score
            );
        }
    }
    Ok(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run_on(rows: &str, tracker: TrackerName) -> anyhow::Result<String> {
        let folder = tempfile::tempdir()?;
        let (detections, out) = (folder.path().join("det.txt"), folder.path().join("tracks.txt"));
        std::fs::write(&detections, rows)?;
        run(&TrackArgs {
            detections,
            tracker,
            images: None,
            out: out.clone(),
            overwrite: OverwriteArgs::default(),
        })?;
        Ok(std::fs::read_to_string(out)?)
    }

    /// Two pedestrians, one of whom leaves; frame 3 is empty, and the rows are not sorted.
    const ROWS: &str = "2,-1,10,0,40,80,0.9\n1,-1,0,0,40,80,0.9\n1,-1,300,0,40,80,0.3\n4,-1,30,0,40,80,0.2\n";

    #[test]
    fn trackers_turn_detections_into_rows() {
        let tracked = run_on(ROWS, TrackerName::Bytetrack).unwrap();
        let starts: Vec<&str> = tracked.lines().map(|row| &row[..4]).collect();
        // The low score of frame 4 may only continue a track of the previous frame.
        assert_eq!(starts, ["1,1,", "2,1,"], "{tracked}");
        let sorted = run_on(ROWS, TrackerName::Sort).unwrap();
        let starts: Vec<&str> = sorted.lines().map(|row| &row[..4]).collect();
        // SORT reports all tracks in the first three frames, later only those matched in three consecutive frames.
        assert_eq!(starts, ["1,2,", "1,1,", "2,1,"], "{sorted}");
        assert!(sorted.ends_with(",0.900000,-1,-1,-1\n"), "{sorted}");
        assert_eq!(run_on("", TrackerName::Sort).unwrap(), "");
        // DeepSORT reports a track from its third box on; the score in the fourth frame is too low.
        assert_eq!(run_on(ROWS, TrackerName::Deepsort).unwrap(), "");
        let steady = "1,-1,0,0,40,80,0.9\n2,-1,5,0,40,80,0.9\n3,-1,10,0,40,80,0.9\n";
        let tracked = run_on(steady, TrackerName::Deepsort).unwrap();
        assert!(tracked.starts_with("3,1,") && tracked.lines().count() == 1, "{tracked}");
        let error = run_on("1,-1,0,0,40\n", TrackerName::Sort).unwrap_err().to_string();
        assert!(error.contains("det.txt:1: expected at least 6 columns"), "{error}");
    }

    #[test]
    fn deepsort_reads_images_and_reports_missing_ones() {
        let folder = tempfile::tempdir().unwrap();
        let (detections, out) = (folder.path().join("det.txt"), folder.path().join("tracks.txt"));
        let rows: String = (1..=4).map(|frame| format!("{frame},-1,{},2,20,40,0.9\n", 3 * frame)).collect();
        std::fs::write(&detections, rows).unwrap();
        let args = |tracker| TrackArgs {
            overwrite: OverwriteArgs::default(),
            detections: detections.clone(),
            tracker,
            images: Some(folder.path().to_owned()),
            out: out.clone(),
        };
        for frame in 1..=3 {
            let file = std::fs::File::create(folder.path().join(format!("{frame:06}.png"))).unwrap();
            let mut encoder = png::Encoder::new(file, 64, 48);
            encoder.set_color(png::ColorType::Rgb);
            let bytes: Vec<u8> = (0..64 * 48 * 3).map(|k| (k % 251) as u8).collect();
            encoder.write_header().unwrap().write_image_data(&bytes).unwrap();
        }
        let told = |tracker| format!("{:#}", run(&args(tracker)).unwrap_err());
        let missing = told(TrackerName::Deepsort);
        assert!(missing.contains("no image of frame 4, expected 000004.png or .jpg"), "{missing}");
        assert!(told(TrackerName::Sort).starts_with("--images: only"));
        std::fs::copy(folder.path().join("000003.png"), folder.path().join("000004.png")).unwrap();
        run(&args(TrackerName::Deepsort)).unwrap();
        let tracked = std::fs::read_to_string(&out).unwrap();
        assert!(tracked.starts_with("3,1,") && tracked.contains("\n4,1,"), "{tracked}");
        std::fs::write(folder.path().join("000002.png"), "no image").unwrap();
        assert!(told(TrackerName::Deepsort).contains("000002.png"));
    }
}
