//! The option of every command that writes a file of a given name.

use std::path::Path;

use swerve_report::files::refuse_unwritable;

/// Consent to the replacement of files.
#[derive(clap::Args, Clone, Copy, Default, Debug)]
pub struct OverwriteArgs {
    /// Replace a file that is there already; without it only what this program wrote and nobody changed since
    #[arg(long)]
    pub overwrite: bool,
}

impl OverwriteArgs {
    /// Refuses files for results that cannot be written or may not be replaced; to be asked before long work.
    ///
    /// # Errors
    /// The first such file.
    pub fn check<'a>(self, files: impl IntoIterator<Item = &'a Path>) -> anyhow::Result<()> {
        files.into_iter().try_for_each(|file| refuse_unwritable(file, self.overwrite))
    }
}
