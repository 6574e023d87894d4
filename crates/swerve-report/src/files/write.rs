//! File output: regular files are written atomically, pipes and devices are written through.

use std::ffi::OsStr;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use swerve_core::Hasher;

use crate::page::data_of;

/// The destination of a write. Symbolic links are not followed.
enum Destination {
    /// The path does not exist.
    Free,
    /// A regular file, to be replaced.
    Regular(Metadata),
    /// A pipe, a device, a socket or an open descriptor (`/dev/stdout`), to be written through.
    Stream,
}

impl Destination {
    /// Examines a path.
    ///
    /// # Errors
    /// If it is a folder, or a symbolic link other than the system's links to open descriptors.
    fn of(path: &Path) -> anyhow::Result<Self> {
        let metadata = match path.symlink_metadata() {
            Ok(metadata) => metadata,
            Err(error) if error.kind() == ErrorKind::NotFound => return Ok(Self::Free),
            Err(error) => return Err(error).with_context(|| format!("writing {}", path.display())),
        };
        let kind = metadata.file_type();
        match () {
            () if kind.is_dir() => bail!("writing {}: it is a folder", path.display()),
            () if kind.is_file() => Ok(Self::Regular(metadata)),
            () if kind.is_symlink() && !is_descriptor(path) => {
                let target = std::fs::read_link(path).unwrap_or_default();
                bail!(
                    "writing {}: it is a symbolic link to {}: expected the file itself",
                    path.display(),
                    target.display()
                )
            }
            () => Ok(Self::Stream),
        }
    }
}

/// True if the system made this link for an open descriptor: in `/dev` itself or in a process's `fd`.
fn is_descriptor(link: &Path) -> bool {
    let folder = link.parent().and_then(|folder| folder.canonicalize().ok());
    folder.is_some_and(|folder| {
        folder == Path::new("/dev") || (folder.starts_with("/proc") && folder.ends_with("fd"))
    })
}

/// Writes `bytes` to a path. A regular file is written under a temporary name beside the target and renamed, so that
/// readers never see a partial file; on failure nothing is left behind. Pipes, devices and open descriptors such as
/// `/dev/stdout` are written through.
///
/// # Errors
/// If the path cannot be written, or is a folder or a symbolic link.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let writing = || format!("writing {}", path.display());
    match Destination::of(path)? {
        Destination::Stream => write_through(path, bytes).with_context(writing),
        Destination::Free | Destination::Regular(_) => {
            let part = Part::create(path)?;
            (&part.file).write_all(bytes).with_context(writing)?;
            part.finish()
        }
    }
}

/// Writes to a pipe, a device or a descriptor. A reader that closed early, such as `head`, is not an error.
fn write_through(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let descriptor = is_descriptor(path).then(|| descriptor(path)).flatten();
    let written = match descriptor {
        // Reopening it would write a redirected file from its start.
        Some(1) => {
            let mut out = std::io::stdout().lock();
            out.write_all(bytes).and_then(|()| out.flush())
        }
        Some(2) => std::io::stderr().lock().write_all(bytes),
        _ => OpenOptions::new().append(true).open(path).and_then(|mut to| to.write_all(bytes)),
    };
    match written {
        Err(error) if error.kind() == ErrorKind::BrokenPipe => Ok(()),
        written => written,
    }
}

/// Number of this process's descriptor that a link names.
fn descriptor(link: &Path) -> Option<u32> {
    match link.file_name().and_then(OsStr::to_str)? {
        "stdout" => Some(1),
        "stderr" => Some(2),
        number => {
            let own = Path::new("/proc/self/fd").canonicalize().ok();
            let is_own = link.parent().and_then(|folder| folder.canonicalize().ok()) == own;
            if is_own { number.parse().ok() } else { None }
        }
    }
}

/// Temporary file that replaces its target when complete. Removed if dropped before that.
pub struct Part {
    /// Temporary path, with the extension of the target.
    pub path: PathBuf,
    file: File,
    whole: PathBuf,
    is_whole: bool,
}

impl Part {
    /// Creates an empty temporary file.
    ///
    /// # Errors
    /// If the target is not a regular file, or the folder is not writable.
    pub fn create(whole: &Path) -> anyhow::Result<Self> {
        let writing = || format!("writing {}", whole.display());
        let earlier = match Destination::of(whole)? {
            Destination::Free => None,
            Destination::Regular(metadata) => Some(metadata.permissions()),
            Destination::Stream => bail!("{}: expected a regular file", writing()),
        };
        for number in 0..PARTS_MAX {
            let path = beside(whole, number);
            // An existing temporary file may belong to another process and is never opened.
            match File::create_new(&path) {
                Ok(file) => {
                    let part = Self { path, file, whole: whole.to_owned(), is_whole: false };
                    // The new file keeps the permissions of the one it replaces.
                    let kept = earlier.map_or(Ok(()), |permissions| part.file.set_permissions(permissions));
                    kept.with_context(writing)?;
                    return Ok(part);
                }
                Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
                Err(error) => return Err(error).with_context(writing),
            }
        }
        bail!("{}: {PARTS_MAX} parts of earlier calls are beside it: expected them removed", writing())
    }

    /// Renames the temporary file to its target.
    ///
    /// # Errors
    /// If the file cannot be renamed.
    pub fn finish(mut self) -> anyhow::Result<()> {
        let writing = || format!("writing {}", self.whole.display());
        mark(&self.path, &self.file);
        std::fs::rename(&self.path, &self.whole).with_context(writing)?;
        self.is_whole = true;
        Ok(())
    }
}

impl Drop for Part {
    fn drop(&mut self) {
        if !self.is_whole {
            // On a full disk a partial file would use space needed by others.
            let _gone = std::fs::remove_file(&self.path);
        }
    }
}

/// Maximum number of temporary files beside a target; killed calls leave theirs behind.
const PARTS_MAX: u32 = 100;

/// Temporary name beside `path` with the same extension, since some programs depend on it.
pub(super) fn beside(path: &Path, number: u32) -> PathBuf {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let ending = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
    let number = if number == 0 { String::new() } else { format!(".{number}") };
    path.with_file_name(format!(".{name}.{}{number}.part{ending}", std::process::id()))
}

/// Extended attribute with the digest of the content that this program wrote.
const ATTRIBUTE: &str = "user.swerve.digest";

fn digest_of(path: &Path) -> std::io::Result<String> {
    let (mut file, mut hasher) = (swerve_text::open_file(path)?, Hasher::new());
    let mut part = vec![0; 1 << 16];
    loop {
        match file.read(&mut part)? {
            0 => return Ok(hasher.digest().to_string()),
            read => hasher.bytes(&part[..read]),
        }
    }
}

/// Marks the current content of a file as written by this program, where the file system supports attributes.
fn mark(path: &Path, file: &File) {
    #[cfg(any(target_os = "linux", target_os = "macos"))]
    if let Ok(digest) = digest_of(path) {
        let flags = rustix::fs::XattrFlags::empty();
        let _kept = rustix::fs::fsetxattr(file, ATTRIBUTE, digest.as_bytes(), flags);
    }
    #[cfg(not(any(target_os = "linux", target_os = "macos")))]
    let _ = (path, file);
}

/// True if a file is as this program wrote it, by its attribute; `None` without the attribute.
pub fn is_unchanged(path: &Path) -> Option<bool> {
    #[cfg(any(target_os = "linux", target_os = "macos"))]
    {
        let mut kept = [0; 64];
        let length = rustix::fs::lgetxattr(path, ATTRIBUTE, &mut kept).ok().filter(|length| *length > 0)?;
        Some(digest_of(path).is_ok_and(|digest| kept.get(..length) == Some(digest.as_bytes())))
    }
    #[cfg(not(any(target_os = "linux", target_os = "macos")))]
    {
        let _ = path;
        None
    }
}

/// True if this program wrote a file and it is unchanged since. Without extended attributes, a report is recognised by
/// its content.
pub fn is_ours(path: &Path) -> bool {
    if let Some(is_unchanged) = is_unchanged(path) {
        return is_unchanged;
    }
    let is_page = path.extension().is_some_and(|ending| ending == "html");
    is_page
        && swerve_text::read_string(path, swerve_text::FILE_MAX).is_ok_and(|text| data_of(&text).is_some())
}

/// Checks before long work that a result can be written: the path must be one that [`write_whole`] accepts, and an
/// existing file must be unchanged since this program wrote it, unless `overwrite` is set.
///
/// # Errors
/// If either condition fails.
pub fn refuse_unwritable(path: &Path, overwrite: bool) -> anyhow::Result<()> {
    match Destination::of(path)? {
        Destination::Stream => return Ok(()),
        Destination::Free => {}
        Destination::Regular(_) => ensure!(
            overwrite || is_ours(path),
            "{}: is there already, and was not written by this program or was changed since: expected another name, or \
             --overwrite",
            path.display()
        ),
    }
    Part::create(path).map(drop)
}

/// Refuses a results path that is not a regular file: links could be followed, pipes could block.
///
/// # Errors
/// If the path exists and is not a regular file.
pub fn refuse_irregular(path: &Path) -> anyhow::Result<()> {
    match Destination::of(path)? {
        Destination::Free | Destination::Regular(_) => Ok(()),
        Destination::Stream => bail!("writing {}: expected a regular file", path.display()),
    }
}
