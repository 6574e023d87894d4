//! The one way to write a file: regular files whole or not at all, pipes and devices written through.

use std::ffi::OsStr;
use std::fs::{File, Metadata, OpenOptions};
use std::io::{ErrorKind, Read as _, Write as _};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail, ensure};
use swerve_core::Hasher;

use crate::page::data_of;

/// The destination of a write. Symbolic links are not followed.
enum Destination {
    /// Nothing is there yet.
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
    /// It is a folder, or a symbolic link that is none of an open descriptor.
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

/// Whether a link is one that the system makes for an open descriptor: in `/dev` itself or a process's `fd`.
fn is_descriptor(link: &Path) -> bool {
    let folder = link.parent().and_then(|folder| folder.canonicalize().ok());
    folder.is_some_and(|folder| {
        folder == Path::new("/dev") || (folder.starts_with("/proc") && folder.ends_with("fd"))
    })
}

/// Writes `bytes` to a path. A regular file is written beside it, then renamed, so that a reader never sees half a file;
/// where that fails, nothing of it is left. Pipes, devices and open descriptors such as `/dev/stdout` are written through.
///
/// # Errors
/// It cannot be written; it is a folder or a symbolic link.
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

/// Writes to what is no regular file. A reader that left early, as `head` does, is no error.
fn write_through(path: &Path, bytes: &[u8]) -> std::io::Result<()> {
    let descriptor = is_descriptor(path).then(|| descriptor(path)).flatten();
    let written = match descriptor {
        // Opened anew, a file behind it would be written from its beginning.
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

/// The number of the descriptor of this process that a link names.
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

/// A file beside another one, whose place it takes when it is whole. Removed when dropped before.
pub struct Part {
    /// Where it is until then; it ends as the other does.
    pub path: PathBuf,
    file: File,
    whole: PathBuf,
    is_whole: bool,
}

impl Part {
    /// Creates it, empty.
    ///
    /// # Errors
    /// The destination is no regular file, or the folder takes no files.
    pub fn create(whole: &Path) -> anyhow::Result<Self> {
        let writing = || format!("writing {}", whole.display());
        let earlier = match Destination::of(whole)? {
            Destination::Free => None,
            Destination::Regular(metadata) => Some(metadata.permissions()),
            Destination::Stream => bail!("{}: expected a regular file", writing()),
        };
        for number in 0..PARTS_MAX {
            let path = beside(whole, number);
            // What is there is nobody's to follow or to shorten.
            match File::create_new(&path) {
                Ok(file) => {
                    let part = Self { path, file, whole: whole.to_owned(), is_whole: false };
                    // A file that is replaced keeps who may read it.
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

    /// Gives it the name of the whole file.
    ///
    /// # Errors
    /// The file system refuses.
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
            // On a full disk what is half written takes the room that others need.
            let _gone = std::fs::remove_file(&self.path);
        }
    }
}

/// Parts that may be beside a file: killed calls leave theirs.
const PARTS_MAX: u32 = 100;

/// A name beside `path` that ends as it does: some programs go by the ending.
pub(super) fn beside(path: &Path, number: u32) -> PathBuf {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    let ending = path.extension().map_or_else(String::new, |e| format!(".{}", e.to_string_lossy()));
    let number = if number == 0 { String::new() } else { format!(".{number}") };
    path.with_file_name(format!(".{name}.{}{number}.part{ending}", std::process::id()))
}

/// The attribute of a file that holds the digest of what this program wrote.
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

/// Marks a file as this program's, as it is now; not every file system keeps that.
fn mark(path: &Path, file: &File) {
    #[cfg(any(target_os = "linux", target_os = "macos"))]
    if let Ok(digest) = digest_of(path) {
        let flags = rustix::fs::XattrFlags::empty();
        let _kept = rustix::fs::fsetxattr(file, ATTRIBUTE, digest.as_bytes(), flags);
    }
    #[cfg(not(any(target_os = "linux", target_os = "macos")))]
    let _ = (path, file);
}

/// True if a file is as this program wrote it, by its attribute; none without the attribute.
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

/// True if this program wrote a file and it is unchanged since. Where the file system keeps no attributes, a report is
/// known by its content.
pub fn is_ours(path: &Path) -> bool {
    if let Some(is_unchanged) = is_unchanged(path) {
        return is_unchanged;
    }
    let is_page = path.extension().is_some_and(|ending| ending == "html");
    is_page
        && swerve_text::read_string(path, swerve_text::FILE_MAX).is_ok_and(|text| data_of(&text).is_some())
}

/// Refuses a file for a result where [`write_whole`] would fail, and one with something of others in it: what this
/// program wrote, and nobody changed since, is replaced. To be asked before long work.
///
/// # Errors
/// As above.
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

/// Refuses a file for results that could be followed, written through or waited for.
///
/// # Errors
/// It exists and is no regular file.
pub fn refuse_irregular(path: &Path) -> anyhow::Result<()> {
    match Destination::of(path)? {
        Destination::Free | Destination::Regular(_) => Ok(()),
        Destination::Stream => bail!("writing {}: expected a regular file", path.display()),
    }
}
