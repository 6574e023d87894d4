//! Result files and the folders of runs.

mod write;

use std::collections::BTreeSet;
use std::fs::{File, TryLockError};
use std::io::{BufReader, ErrorKind};
use std::path::{Path, PathBuf};

use anyhow::{Context as _, anyhow, bail};
use swerve_text::{FILE_MAX, open_file, read_given, read_string};

use write::beside;
pub use write::{Part, is_ours, is_unchanged, refuse_irregular, refuse_unwritable, write_whole};

/// Reads a whole file named on the command line, or an inherited descriptor (`/dev/stdin`, `/dev/fd/N`).
///
/// # Errors
/// If the file cannot be read, is not a regular file, or is longer than 1 GiB (64 MiB for a descriptor).
pub fn read_whole(path: &Path) -> anyhow::Result<Vec<u8>> {
    read_given(path, FILE_MAX).map_err(|error| anyhow!("{}: cannot be read: {error}", path.display()))
}

/// Refuses to overwrite inputs with results.
///
/// # Errors
/// If one of `outs` is also in `inputs`.
pub fn refuse_to_replace<'a>(
    outs: impl IntoIterator<Item = &'a Path>,
    inputs: &[PathBuf],
) -> anyhow::Result<()> {
    let read: BTreeSet<PathBuf> = inputs.iter().filter_map(|input| input.canonicalize().ok()).collect();
    let replaced = outs.into_iter().find(|out| out.canonicalize().is_ok_and(|out| read.contains(&out)));
    let Some(out) = replaced else { return Ok(()) };
    bail!("{}: is read, and would be written over: expected another --out", out.display())
}

/// Entries of a folder, sorted by name.
///
/// # Errors
/// If the folder cannot be read.
pub fn entries(folder: &Path) -> std::io::Result<Vec<PathBuf>> {
    let mut paths =
        std::fs::read_dir(folder)?.map(|entry| Ok(entry?.path())).collect::<std::io::Result<Vec<_>>>()?;
    paths.sort();
    Ok(paths)
}

/// Creates a results folder and locks it until the returned handle is dropped, so that two runs cannot mix their
/// results. No lock file is left behind, and a killed process releases the lock. `None` if the file system has no
/// locks.
pub fn claim(folder: &Path) -> anyhow::Result<Option<File>> {
    std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    // Some systems cannot open folders, and some file systems have no locks.
    let Ok(held) = File::open(folder) else { return Ok(None) };
    match held.try_lock() {
        Ok(()) => Ok(Some(held)),
        Err(TryLockError::WouldBlock) => bail!(
            "{}: another run writes its results there: expected a separate output folder (--out)",
            folder.display()
        ),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// Results folder of a run, as selected by `--out` and `--overwrite`.
pub struct RunFolder {
    /// The folder.
    pub path: PathBuf,
    /// Link to create when the results are complete: the newest run of this name. `None` with `--out`.
    newest: Option<PathBuf>,
    /// Lock that keeps a second run out of the folder.
    _held: Option<File>,
}

impl RunFolder {
    /// Claims the requested folder, or else creates the next numbered one: `out/NAME-3`.
    ///
    /// # Errors
    /// If the folder cannot be created, if another run is writing to it, or if it contains results and `overwrite` is
    /// false.
    pub fn claim(asked: Option<&Path>, name: &str, overwrite: bool) -> anyhow::Result<Self> {
        if let Some(path) = asked {
            let held = claim(path)?;
            let is_there = |name: &&&str| path.join(name).symlink_metadata().is_ok();
            if let Some(name) = OF_RUN.iter().find(is_there).filter(|_| !overwrite) {
                let path = path.display();
                // A log without metrics belongs to a run that was interrupted.
                let is_of_run = ["metrics.json", "log.mcap", "log.partial.mcap"].contains(name);
                let what = if is_of_run { "an earlier run's results are" } else { *name };
                let what = if is_of_run { what.to_owned() } else { format!("{what} is") };
                bail!("{path}: {what} there: expected another --out, or --overwrite");
            }
            OF_RUN.iter().try_for_each(|name| refuse_irregular(&path.join(name)))?;
            for part in PARTS.map(|(part, _)| path.join(part)).iter().filter(|part| part.exists()) {
                std::fs::remove_file(part).with_context(|| format!("removing {}", part.display()))?;
            }
            if path.join(CELLS).is_dir() {
                bail!("{}: a study's results are there: expected another --out", path.display());
            }
            return Ok(Self { path: path.to_owned(), newest: None, _held: held });
        }
        let path = first_of(name, |path| std::fs::create_dir(path))?;
        Ok(Self { newest: Some(Path::new(OUT).join(name)), _held: claim(&path)?, path })
    }

    /// Renames the completed files of a run to their final names.
    ///
    /// # Errors
    /// If a file cannot be renamed.
    pub fn name_whole(&self) -> anyhow::Result<()> {
        PARTS.iter().try_for_each(|(part, whole)| {
            let part = self.path.join(part);
            let renamed = if part.exists() { std::fs::rename(part, self.path.join(whole)) } else { Ok(()) };
            renamed.with_context(|| format!("writing {whole}"))
        })
    }

    /// Writes `metrics.json` once the other files are complete. Returns the terminal line that lists all results and
    /// their folder.
    ///
    /// # Errors
    /// If the file cannot be written.
    pub fn conclude(&self, others: &str, json: &str) -> anyhow::Result<String> {
        write_whole(&self.path.join("metrics.json"), json.as_bytes())?;
        let linked = self.newest.as_deref().filter(|newest| link(newest, &self.path));
        let linked = linked.map_or_else(String::new, |link| format!(" ({})", link.display()));
        Ok(format!("in {}{linked}: {others}, metrics.json\n", self.path.display()))
    }
}

/// Files that a run may write to its folder.
const OF_RUN: [&str; 10] = [
    "metrics.json",
    "log.mcap",
    "log.partial.mcap",
    "trace.json",
    "trace.partial.json",
    "report.html",
    "comparison.html",
    "story.svg",
    "story.pdf",
    "story.png",
];
/// Names of files during a run and after it.
const PARTS: [(&str, &str); 2] = [("log.partial.mcap", "log.mcap"), ("trace.partial.json", "trace.json")];

/// Default parent folder of results.
const OUT: &str = "out";
/// Subfolder of a study's folder for the finished cells.
pub const CELLS: &str = "cells";

/// Creates the first of `out/NAME-1`, `out/NAME-2`, ... that `make` accepts. `make` returns `AlreadyExists` for a
/// folder that belongs to another owner.
fn first_of(name: &str, make: impl Fn(&Path) -> std::io::Result<()>) -> anyhow::Result<PathBuf> {
    let all = Path::new(OUT);
    std::fs::create_dir_all(all).with_context(|| format!("making {OUT}"))?;
    for number in 1_u32.. {
        let path = all.join(format!("{name}-{number}"));
        match make(&path) {
            Ok(()) => return Ok(path),
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            Err(error) => return Err(error).with_context(|| format!("making {}", path.display())),
        }
    }
    bail!("{OUT}: no name is left for {name}")
}

/// File in a results folder that names its owner.
const OWNER: &str = ".owner";

/// Owner of a results folder; `None` if it has none.
pub fn owner_of(folder: &Path) -> Option<String> {
    read_string(&folder.join(OWNER), OWNER_MAX).ok()
}

/// Records the owner of a results folder.
///
/// # Errors
/// The folder or the file cannot be written.
pub fn set_owner(folder: &Path, owner: &str) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    write_whole(&folder.join(OWNER), owner.as_bytes())
}

/// Maximum length of an owner file, bytes: an owner is a digest, and longer files are ignored.
const OWNER_MAX: u64 = 1 << 10;

/// Numbered folder for results that a later call may resume: the one that `owner` had before, else a new one. Points
/// the link `out/NAME` to it.
///
/// # Errors
/// If the folder cannot be created.
pub fn folder_of(owner: &str, name: &str) -> anyhow::Result<PathBuf> {
    let is_owned = |path: &Path| owner_of(path).is_some_and(|text| text == owner);
    let is_numbered = |path: &Path| {
        let number = path.file_name().and_then(|file| file.to_str()?.strip_prefix(name)?.strip_prefix('-'));
        number.is_some_and(|number| number.parse::<u32>().is_ok())
    };
    let make = |path: &Path| {
        if path.symlink_metadata().is_ok() {
            return if is_owned(path) { Ok(()) } else { Err(ErrorKind::AlreadyExists.into()) };
        }
        // Created together with its owner file: shards that start at the same time share one folder.
        let beside = beside(path, 0);
        std::fs::create_dir_all(&beside)?;
        let made = std::fs::write(beside.join(OWNER), owner).and_then(|()| std::fs::rename(&beside, path));
        if made.is_err() {
            let _gone = std::fs::remove_dir_all(&beside);
        }
        match made {
            Err(_) if is_owned(path) => Ok(()),
            Err(_) if path.symlink_metadata().is_ok() => Err(ErrorKind::AlreadyExists.into()),
            made => made,
        }
    };
    let all = entries(Path::new(OUT)).unwrap_or_default();
    let before = all.into_iter().find(|path| is_numbered(path) && is_owned(path));
    let path = before.map_or_else(|| first_of(name, make), Ok)?;
    link(&Path::new(OUT).join(name), &path);
    Ok(path)
}

/// Points the link `newest` to a folder beside it. An existing link is replaced, any other file is not.
fn link(newest: &Path, folder: &Path) -> bool {
    if newest.exists() && !newest.is_symlink() {
        return false;
    }
    #[cfg(unix)]
    {
        let beside = beside(newest, 0);
        let target = folder.file_name().unwrap_or_default();
        let made =
            std::os::unix::fs::symlink(target, &beside).and_then(|()| std::fs::rename(&beside, newest));
        made.is_ok()
    }
    #[cfg(not(unix))]
    false
}

/// Writes an image of this width, height, colour type and bit depth, optimised for speed rather than size.
pub fn write_png(
    path: &Path,
    size_px: (u32, u32),
    colour: (png::ColorType, png::BitDepth),
    bytes: &[u8],
) -> anyhow::Result<()> {
    write_png_by(None, path, size_px, colour, bytes)
}

/// [`write_png`] with the name of the writing program in the file, for [`written_by`].
pub fn write_png_by(
    software: Option<&str>,
    path: &Path,
    (width_px, height_px): (u32, u32),
    (colour, depth): (png::ColorType, png::BitDepth),
    bytes: &[u8],
) -> anyhow::Result<()> {
    let writing = || format!("writing {}", path.display());
    let mut file = Vec::new();
    let mut encoder = png::Encoder::new(&mut file, width_px, height_px);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    if let Some(software) = software {
        encoder.add_text_chunk(SOFTWARE.into(), software.into()).with_context(writing)?;
    }
    let mut writer = encoder.write_header().with_context(writing)?;
    writer.write_image_data(bytes).with_context(writing)?;
    writer.finish().with_context(writing)?;
    write_whole(path, &file)
}

/// PNG keyword for the program that made an image.
const SOFTWARE: &str = "Software";

/// True if a file is an image that [`write_png_by`] wrote with this program name.
pub fn written_by(software: &str, path: &Path) -> bool {
    let Ok(file) = open_file(path) else { return false };
    let Ok(reader) = png::Decoder::new(BufReader::new(file)).read_info() else { return false };
    let mut texts = reader.info().uncompressed_latin1_text.iter();
    texts.any(|text| text.keyword == SOFTWARE && text.text == software)
}

/// Refuses to overwrite a configuration (`.toml`) with a picture.
pub fn refuse_toml(picture: &Path) -> anyhow::Result<()> {
    let is_toml = picture.extension().is_some_and(|e| e == "toml");
    anyhow::ensure!(!is_toml, "{}: a picture would replace a configuration", picture.display());
    Ok(())
}

/// The `.toml` files below `folder`, sorted by path, as [`files_below`].
pub fn toml_files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    files_below(folder, |path| path.extension().is_some_and(|e| e == "toml"))
}

/// The files below `folder` that `is_meant` accepts, sorted by path. Links to folders are not followed, as they may form
/// a cycle; only regular files are listed.
pub fn files_below(folder: &Path, is_meant: impl Fn(&Path) -> bool) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let entries = std::fs::read_dir(&folder).with_context(|| format!("reading {}", folder.display()))?;
        for entry in entries {
            let entry = entry?;
            let (path, kind) = (entry.path(), entry.file_type());
            if kind.is_ok_and(|kind| kind.is_dir()) {
                folders.push(path);
            } else if path.is_file() && is_meant(&path) {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}
