//! Published detectors on a real video, whose frames are those of the sequence PETS09-S2L1.

use std::path::{Path, PathBuf};
use std::process::Command;

use swerve_eval::{AveragePrecision, Found, Recalls};

use crate::acf::{Detection, Overlap, Scanner, iou};
use crate::{Rgb, shipped};

const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// Frames 5, 31, ... 785 of the video, width and height.
struct Video {
    folder: tempfile::TempDir,
    size: [usize; 2],
}

impl Video {
    const FRAMES: usize = 31;

    fn open() -> Option<Self> {
        let path = Path::new(ROOT).join("../shared/data/perception/opencv_samples/vtest.avi");
        let python = std::env::var("SWERVE_PYTHON").unwrap_or_else(|_| "python3".into());
        let folder = tempfile::tempdir().unwrap();
        let script = Path::new(ROOT).join("tests/reference/vision/frames.py");
        let mut call = Command::new(&python);
        call.arg(script).arg(&path).args(["5", "26", &Self::FRAMES.to_string()]).arg(folder.path());
        match call.output() {
            Ok(output) if path.exists() && output.status.success() => {
                let said = String::from_utf8(output.stdout).unwrap();
                let size: Vec<usize> = said.split_whitespace().map(|n| n.parse().unwrap()).collect();
                Some(Self { folder, size: [size[0], size[1]] })
            }
            _ => {
                println!("skipped: needs {} and a Python with OpenCV (SWERVE_PYTHON)", path.display());
                None
            }
        }
    }

    fn frame(&self, number: usize) -> Vec<u8> {
        std::fs::read(self.folder.path().join(format!("{number}.rgb"))).unwrap()
    }
}

/// Boxes of the frames, as their authors detected them.
fn truth() -> Vec<(usize, [f64; 4])> {
    let path: PathBuf = Path::new(ROOT).join("../shared/data/mot15/det/PETS09-S2L1.csv");
    let text = std::fs::read_to_string(path).unwrap();
    let line = |line: &str| {
        let numbers: Vec<f64> = line.split(',').filter_map(|n| n.parse().ok()).collect();
        (numbers[0] as usize, [numbers[1], numbers[2], numbers[3], numbers[4]])
    };
    text.lines().filter(|line| line.starts_with(|c: char| c.is_ascii_digit())).map(line).collect()
}

/// Average precision at an overlap of one half over the frames, with the image twice as large.
fn average_precision(name: &str, video: &Video) -> f64 {
    let weights = shipped::detector(name).unwrap().unwrap();
    let mut weights = weights;
    weights.overlap = (0.5, Overlap::Union);
    let rung = weights.rungs[0].clone();
    let mut scanner = Scanner::new(weights, rung, video.size, None);
    let (truth, mut ap, mut found) = (truth(), AveragePrecision::new(0.5), Vec::<Detection>::new());
    for number in (0..Video::FRAMES).map(|k| 5 + 26 * k) {
        let bytes = video.frame(number);
        scanner.detect(Rgb::new(video.size[0], video.size[1], &bytes).unwrap(), &mut found).unwrap();
        let wanted: Vec<[f64; 4]> =
            truth.iter().filter(|(of, _)| *of == number).map(|(_, bbox)| *bbox).collect();
        let boxes: Vec<Found> = found.iter().map(|d| Found { score: d.score, counts: true }).collect();
        ap.frame(&boxes, &vec![true; wanted.len()], |f, w| iou(found[f].bbox, wanted[w]));
    }
    assert!(ap.wanted() > 150);
    ap.value(Recalls::Coco101).unwrap()
}

#[test]
#[ignore = "OpenCV"]
fn published_models_find_the_people_of_pets() {
    let Some(video) = Video::open() else { return };
    for (name, least) in [("acf_inria", 0.82), ("ldcf_inria", 0.82)] {
        let value = average_precision(name, &video);
        println!("{name}: AP50 {value:.3}");
        assert!(value >= least, "{name}: {value:.3}, expected at least {least}");
    }
}
