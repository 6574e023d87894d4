//! Files written whole or not at all.

use std::fs::{File, TryLockError};
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use anyhow::{Context as _, bail};

/// Writes `bytes` under `path`: first beside it, then renamed, so that a reader never sees half a file.
pub fn write_whole(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    let beside = beside(path);
    std::fs::write(&beside, bytes)
        .and_then(|()| std::fs::rename(&beside, path))
        .with_context(|| format!("writing {}", path.display()))
}

/// Makes a folder for results, and holds it until what this gives is dropped: two runs at once would mix theirs.
/// Nothing is left in the folder, and a program that is killed holds nothing.
pub fn claim(folder: &Path) -> anyhow::Result<Option<File>> {
    std::fs::create_dir_all(folder).with_context(|| format!("making {}", folder.display()))?;
    // Not every system opens folders, and not every file system has locks.
    let Ok(held) = File::open(folder) else { return Ok(None) };
    match held.try_lock() {
        Ok(()) => Ok(Some(held)),
        Err(TryLockError::WouldBlock) => bail!(
            "{}: another run writes its results there: expected an output folder (--out) of its own",
            folder.display()
        ),
        Err(TryLockError::Error(_)) => Ok(None),
    }
}

/// Writes `metrics.json` of a run beside its other files. The line for the terminal that says where they all are, and
/// whether they took the place of an earlier run's.
pub fn write_metrics(folder: &Path, others: &str, json: &str) -> anyhow::Result<String> {
    let path = folder.join("metrics.json");
    let earlier = if path.exists() { " (those of an earlier run are replaced)" } else { "" };
    write_whole(&path, json.as_bytes())?;
    Ok(format!("in {}: {others}, metrics.json{earlier}\n", folder.display()))
}

/// Writes an image of this width, height, colour and depth, quickly rather than small.
pub fn write_png(
    path: &Path,
    (width_px, height_px): (u32, u32),
    (colour, depth): (png::ColorType, png::BitDepth),
    bytes: &[u8],
) -> anyhow::Result<()> {
    let writing = || format!("writing {}", path.display());
    let file = BufWriter::new(File::create(path).with_context(writing)?);
    let mut encoder = png::Encoder::new(file, width_px, height_px);
    encoder.set_color(colour);
    encoder.set_depth(depth);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().with_context(writing)?;
    writer.write_image_data(bytes).with_context(writing)?;
    writer.finish().with_context(writing)
}

fn beside(path: &Path) -> PathBuf {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    path.with_file_name(format!(".{name}.{}.part", std::process::id()))
}

/// Fails where [`write_whole`] would: to be asked before long work, not after it.
pub fn refuse_unwritable(path: &Path) -> anyhow::Result<()> {
    anyhow::ensure!(!path.is_dir(), "writing {}: it is a folder", path.display());
    let beside = beside(path);
    std::fs::write(&beside, [])
        .and_then(|()| std::fs::remove_file(&beside))
        .with_context(|| format!("writing {}", path.display()))
}

/// Fails where a picture would take the place of a file that it is drawn from, or of another one of its kind.
pub fn refuse_toml(picture: &Path) -> anyhow::Result<()> {
    let is_toml = picture.extension().is_some_and(|e| e == "toml");
    anyhow::ensure!(!is_toml, "{}: a picture would replace a configuration", picture.display());
    Ok(())
}

/// The `.toml` files below `folder`, in order of their names. Links to folders are not followed, as they may lead back,
/// and what is no file (a pipe, a device) is left out.
pub fn toml_files(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    let mut folders = vec![folder.to_path_buf()];
    while let Some(folder) = folders.pop() {
        let entries = std::fs::read_dir(&folder).with_context(|| format!("reading {}", folder.display()))?;
        for entry in entries {
            let entry = entry?;
            let (path, kind) = (entry.path(), entry.file_type());
            if kind.is_ok_and(|kind| kind.is_dir()) {
                folders.push(path);
            } else if path.is_file() && path.extension().is_some_and(|e| e == "toml") {
                found.push(path);
            }
        }
    }
    found.sort();
    Ok(found)
}
