//! The `--overwrite` option of commands that write a named file.

use std::path::Path;

use swerve_report::files::refuse_unwritable;

/// Consent to replace files.
#[derive(clap::Args, Clone, Copy, Default, Debug)]
pub struct OverwriteArgs {
    /// Replace an existing file; without it, only files that this program wrote and nobody changed are replaced
    #[arg(long)]
    pub overwrite: bool,
}

impl OverwriteArgs {
    /// Refuses output files that cannot be written or may not be replaced; call this before long work.
    ///
    /// # Errors
    /// The first such file.
    pub fn check<'a>(self, files: impl IntoIterator<Item = &'a Path>) -> anyhow::Result<()> {
        files.into_iter().try_for_each(|file| refuse_unwritable(file, self.overwrite))
    }
}
