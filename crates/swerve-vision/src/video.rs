//! Frames of OpenCV's sample video for tests.

use std::path::Path;
use std::process::Command;

/// Root of the repository.
pub(crate) const ROOT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");

/// Sampled frames of the video, their width and height.
pub(crate) struct Video {
    folder: tempfile::TempDir,
    numbers: Vec<usize>,
    pub(crate) size: [usize; 2],
}

impl Video {
    /// Decodes frames with OpenCV; prints a note and returns `None` if the video or OpenCV is missing.
    pub(crate) fn open(first: usize, step: usize, count: usize) -> Option<Self> {
        let path = swerve_tests::data_folder().join("perception/opencv_samples/vtest.avi");
        let python = std::env::var("SWERVE_PYTHON").unwrap_or_else(|_| "python3".into());
        let folder = tempfile::tempdir().unwrap();
        let mut call = Command::new(&python);
        call.arg(Path::new(ROOT).join("tests/reference/vision/frames.py")).arg(&path);
        call.args([first, step, count].map(|n| n.to_string())).arg(folder.path());
        match call.output() {
            Ok(output) if path.exists() && output.status.success() => {
                let said = String::from_utf8(output.stdout).unwrap();
                let size: Vec<usize> = said.split_whitespace().map(|n| n.parse().unwrap()).collect();
                let numbers = (0..count).map(|k| first + step * k).collect();
                Some(Self { folder, numbers, size: [size[0], size[1]] })
            }
            _ => {
                swerve_tests::skipped(&format!(
                    "needs {} and a Python with OpenCV (SWERVE_PYTHON)",
                    path.display()
                ));
                None
            }
        }
    }

    /// Frame numbers, starting at 1.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = usize> {
        self.numbers.iter().copied()
    }

    /// Bytes of one frame.
    pub(crate) fn frame(&self, number: usize) -> Vec<u8> {
        std::fs::read(self.folder.path().join(format!("{number}.rgb"))).unwrap()
    }
}
