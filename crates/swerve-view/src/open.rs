//! Opens the browser without a secret in its arguments, which other users can read in /proc.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use swerve_report::output::tell;

/// A page that redirects a browser to an address, readable only by its user. Removed when dropped.
pub(crate) struct Redirect {
    folder: PathBuf,
}

impl Redirect {
    /// Writes the page into a new private folder inside `within`.
    fn create(within: &Path, address: &str) -> std::io::Result<Self> {
        let mut random = [0; 16];
        getrandom::fill(&mut random).map_err(std::io::Error::other)?;
        let folder = within.join(format!("swerve-view-{:032x}", u128::from_le_bytes(random)));
        let (mut folders, mut files) = (std::fs::DirBuilder::new(), std::fs::OpenOptions::new());
        #[cfg(unix)]
        {
            use std::os::unix::fs::{DirBuilderExt as _, OpenOptionsExt as _};
            folders.mode(0o700);
            files.mode(0o600);
        }
        folders.create(&folder)?;
        let page = Self { folder };
        let mut text =
            "<!DOCTYPE html><meta charset=utf-8><meta name=referrer content=no-referrer>".to_owned();
        let _written = write!(text, "<meta http-equiv=refresh content=\"0; url={address}\">");
        files.write(true).create_new(true).open(page.file())?.write_all(text.as_bytes())?;
        Ok(page)
    }

    fn file(&self) -> PathBuf {
        self.folder.join("open.html")
    }
}

impl Drop for Redirect {
    fn drop(&mut self) {
        let _left_to_the_system = std::fs::remove_dir_all(&self.folder);
    }
}

/// Opens a browser at an address if there is a display. The address is in a file that exists until the returned value
/// is dropped.
pub(crate) fn in_browser(address: &str) -> Option<Redirect> {
    let has_screen = ["DISPLAY", "WAYLAND_DISPLAY"].iter().any(|name| std::env::var_os(name).is_some());
    if !has_screen {
        return None;
    }
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from).filter(|folder| folder.is_dir());
    let page = match Redirect::create(&runtime.unwrap_or_else(std::env::temp_dir), address) {
        Ok(page) => page,
        Err(error) => {
            tell(&format!("note: no browser is opened: {error}"));
            return None;
        }
    };
    let mut program = Command::new("xdg-open");
    let program = program.arg(page.file()).stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
    let _not_there = program.spawn();
    Some(page)
}
