//! The `--format` option of commands that draw pictures.

use std::path::{Path, PathBuf};

use anyhow::Context as _;
use swerve_draw::{Format, Picture};
use swerve_report::files::{is_ours, write_whole};

/// Output format of pictures.
#[derive(clap::Args, Clone, Copy, Debug, Default)]
pub struct PictureArgs {
    /// Picture format: svg, pdf or png [default: by the file extension, else svg]
    #[arg(long, value_name = "FORMAT")]
    format: Option<Format>,
}

impl PictureArgs {
    /// File name of the picture `stem` with the extension of its format.
    pub fn name(self, stem: &str) -> String {
        format!("{stem}.{}", self.format.unwrap_or_default())
    }

    /// Writes a picture into a folder and returns the file name.
    ///
    /// # Errors
    /// If it cannot be drawn or written.
    pub fn write_in(self, folder: &Path, stem: &str, picture: &Picture) -> anyhow::Result<String> {
        let name = self.name(stem);
        write_whole(&folder.join(&name), &picture.bytes(self.format.unwrap_or_default())?)?;
        // Remove the same picture of an earlier run in another format.
        for other in Format::ALL.into_iter().filter(|other| *other != self.format.unwrap_or_default()) {
            let old: PathBuf = folder.join(format!("{stem}.{other}"));
            if is_ours(&old) {
                std::fs::remove_file(&old)?;
            }
        }
        Ok(name)
    }

    /// Writes a picture to the given file.
    ///
    /// # Errors
    /// If it cannot be drawn or written.
    pub fn write(self, file: &Path, picture: &Picture) -> anyhow::Result<()> {
        let format = self.format.or(Format::of(file)).or(file.extension().is_none().then(Format::default));
        let format = format.with_context(|| {
            format!("{}: expected a name that ends in .svg, .pdf or .png, or --format", file.display())
        })?;
        write_whole(file, &picture.bytes(format)?)
    }
}
