//! Video encoding with the installed `ffmpeg`.

use std::ffi::OsStr;
use std::io::{Read as _, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use anyhow::{Context as _, bail, ensure};
use swerve_camera::Frame;
use swerve_report::files::Part;

/// Maximum number of bytes kept of `ffmpeg`'s standard error.
const WORDS_MAX: u64 = 1 << 16;

/// A video that is appended to picture by picture, under a partial name until it is complete.
pub(super) struct Video {
    file: PathBuf,
    part: Option<Part>,
    encoder: Child,
}

impl Video {
    /// Starts a video with pictures of this size, in pixels, at `rate_hz`.
    ///
    /// # Errors
    /// If `ffmpeg` is not on the search path or does not start, or if the file is not a regular one.
    pub(super) fn create(file: &Path, size_px: (u32, u32), rate_hz: f64) -> anyhow::Result<Self> {
        let Some(ffmpeg) = find("ffmpeg", std::env::var_os("PATH").as_deref()) else {
            bail!("--video: `ffmpeg` is not on the PATH: install it, or use --frames, which does not need it")
        };
        Self::by(&ffmpeg, file, size_px, rate_hz)
    }

    fn by(ffmpeg: &Path, file: &Path, (width, height): (u32, u32), rate_hz: f64) -> anyhow::Result<Self> {
        let mut command = Command::new(ffmpeg);
        command.args(["-y", "-loglevel", "error", "-f", "rawvideo", "-pixel_format", "rgb24"]);
        command.args(["-video_size", &format!("{width}x{height}"), "-framerate", &rate_hz.to_string()]);
        // Players support only this chroma subsampling.
        command.args(["-i", "pipe:0", "-pix_fmt", "yuv420p"]);
        // Absolute, so that no name is taken for an option or a protocol.
        let part = Part::create(file)?;
        command.arg(std::path::absolute(&part.path)?);
        command.stdin(Stdio::piped()).stdout(Stdio::null()).stderr(Stdio::piped());
        // Ctrl-C is handled by this process: the pictures so far become a complete file.
        #[cfg(unix)]
        std::os::unix::process::CommandExt::process_group(&mut command, 0);
        let encoder = command.spawn().with_context(|| format!("starting {}", ffmpeg.display()))?;
        Ok(Self { file: file.to_owned(), part: Some(part), encoder })
    }

    /// Adds a picture.
    pub(super) fn take(&mut self, frame: &Frame) -> anyhow::Result<()> {
        let pipe = self.encoder.stdin.as_mut().context("the video has ended")?;
        // The reason is on `ffmpeg`'s standard error once it has ended.
        if pipe.write_all(&frame.rgb).is_err() {
            self.finish()?;
            bail!("writing {}: ffmpeg ended before the drive", self.file.display());
        }
        Ok(())
    }

    /// Ends the video and waits until it is complete.
    pub(super) fn finish(&mut self) -> anyhow::Result<()> {
        let writing = || format!("writing {} by ffmpeg", self.file.display());
        drop(self.encoder.stdin.take());
        let mut said = String::new();
        if let Some(told) = self.encoder.stderr.take() {
            told.take(WORDS_MAX).read_to_string(&mut said).with_context(writing)?;
        }
        let ended = self.encoder.wait().with_context(writing)?;
        let part = self.part.take();
        ensure!(ended.success(), "{}: {ended}: {}", writing(), said.trim());
        part.map_or(Ok(()), Part::finish)
    }
}

impl Drop for Video {
    /// An interrupted drive leaves a video of the pictures so far.
    fn drop(&mut self) {
        if self.part.is_some() {
            let _untold = self.finish();
        }
    }
}

/// Finds a program on a search path.
fn find(name: &str, path: Option<&OsStr>) -> Option<PathBuf> {
    std::env::split_paths(path?).map(|folder| folder.join(name)).find(|file| file.is_file())
}

#[cfg(test)]
#[cfg(unix)]
mod tests {
    use std::os::unix::fs::PermissionsExt;

    use super::*;

    /// A fake `ffmpeg` that records its arguments and its input.
    fn fake(folder: &Path, script: &str) -> PathBuf {
        let program = folder.join("ffmpeg");
        std::fs::write(&program, format!("#!/bin/sh\n{script}\n")).unwrap();
        std::fs::set_permissions(&program, PermissionsExt::from_mode(0o755)).unwrap();
        find("ffmpeg", Some(folder.as_os_str())).unwrap()
    }

    fn picture(grey: u8) -> Frame {
        Frame { width_px: 4, height_px: 2, rgb: vec![grey; 24], ..Frame::default() }
    }

    #[test]
    fn pictures_are_passed_to_ffmpeg_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let program =
            fake(folder.path(), "for last; do :; done; echo \"$@\" > \"${last%/*}/words\"; cat > \"$last\"");
        let file = folder.path().join("drive.mp4");
        let mut video = Video::by(&program, &file, (4, 2), 20.0).unwrap();
        (1..=3).for_each(|grey| video.take(&picture(grey)).unwrap());
        video.finish().unwrap();
        let fed = [1, 2, 3].map(|grey| [grey; 24]).concat();
        assert_eq!(std::fs::read(&file).unwrap(), fed);
        let words = std::fs::read_to_string(folder.path().join("words")).unwrap();
        assert!(words.contains("-pixel_format rgb24 -video_size 4x2 -framerate 20 -i pipe:0"), "{words}");
    }

    #[test]
    fn ffmpeg_errors_and_its_absence_are_reported() {
        let folder = tempfile::tempdir().unwrap();
        let program = fake(folder.path(), "cat > /dev/null; echo 'Unknown encoder' >&2; exit 8");
        let mut video = Video::by(&program, &folder.path().join("d.mp4"), (4, 2), 20.0).unwrap();
        video.take(&picture(1)).unwrap();
        let error = format!("{:#}", video.finish().unwrap_err());
        assert!(error.contains("d.mp4") && error.contains("Unknown encoder"), "{error}");
        let gone = fake(folder.path(), "echo 'Invalid argument' >&2; exit 1");
        let mut video = Video::by(&gone, &folder.path().join("d.mp4"), (4, 2), 20.0).unwrap();
        let mut errors = (0..100_000).filter_map(|_| video.take(&picture(1)).err());
        let error = format!("{:#}", errors.next().unwrap());
        assert!(error.contains("Invalid argument"), "{error}");
        assert_eq!(find("ffmpeg", Some(OsStr::new("/nowhere:/neither"))), None);
        assert_eq!(find("ffmpeg", None), None);
    }

    /// If this machine has `ffmpeg`, it creates a file that starts like an MP4.
    #[test]
    fn real_ffmpeg_writes_an_mp4() {
        let Some(ffmpeg) = find("ffmpeg", std::env::var_os("PATH").as_deref()) else {
            swerve_tests::skipped("no ffmpeg on this machine");
            return;
        };
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("drive.mp4");
        let mut video = Video::by(&ffmpeg, &file, (64, 48), 20.0).unwrap();
        let frame = |grey: u8| Frame {
            width_px: 64,
            height_px: 48,
            rgb: vec![grey; 64 * 48 * 3],
            ..Frame::default()
        };
        (0..20).for_each(|k| video.take(&frame(10 * k)).unwrap());
        video.finish().unwrap();
        let bytes = std::fs::read(&file).unwrap();
        assert_eq!(&bytes[4..8], b"ftyp");
    }
}
