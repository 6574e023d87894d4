//! Cleanup of shared memory that killed runs left.
//!
//! The lock on a run's folder shows that the run is alive, but only to runs that use the same folder. With another
//! `XDG_RUNTIME_DIR` or `TMPDIR`, or after the folder was cleaned, the owner of files in the shared-memory folder would
//! be unknown. A run therefore also locks a marker beside these files.

use std::collections::BTreeMap;
use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};

/// Folder of POSIX shared memory.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// Prefix of the names of all runs' files.
const PROGRAM: &str = "swerve_";
/// Suffix of the name of a marker.
const MARKER: &str = ".lock";

/// Marker of a living run in the shared-memory folder: a locked file, removed on drop.
#[derive(Debug)]
pub(crate) struct Marker {
    path: PathBuf,
    _lock: File,
}

impl Marker {
    /// Marks the run of this name as alive; `None` if the shared-memory folder accepts no files.
    ///
    /// # Errors
    /// [`AlreadyExists`](io::ErrorKind::AlreadyExists) if a living run, possibly in another process namespace, has this
    /// name.
    pub(crate) fn create(name: &str) -> io::Result<Option<Self>> {
        Self::create_in(Path::new(SHARED_MEMORY), name)
    }

    fn create_in(shared: &Path, name: &str) -> io::Result<Option<Self>> {
        let path = shared.join(format!("{PROGRAM}{name}{MARKER}"));
        if File::open(&path).is_ok_and(|other| other.try_lock().is_err()) {
            return Err(io::ErrorKind::AlreadyExists.into());
        }
        // Renamed only once it is locked: an unlocked marker belongs to a dead run.
        let beside = shared.join(format!("{PROGRAM}new_{name}"));
        let made = OpenOptions::new().create_new(true).write(true).mode(0o600).open(&beside);
        let Ok(lock) = made else { return Ok(None) };
        let named = lock.lock().and_then(|()| fs::rename(&beside, &path));
        if named.is_err() {
            let _gone = fs::remove_file(&beside);
            return Ok(None);
        }
        Ok(Some(Self { path, _lock: lock }))
    }
}

impl Drop for Marker {
    fn drop(&mut self) {
        let _gone = fs::remove_file(&self.path);
    }
}

/// Files that a dead run left.
struct Leftover {
    files: Vec<PathBuf>,
    /// Marker of the run, locked while its files are removed so that no new run takes the name.
    _lock: Option<File>,
}

/// Number of dead runs of this user with files in the shared-memory folder; the next run with processes removes them.
pub fn dead_runs() -> usize {
    find(Path::new(SHARED_MEMORY), &|_| false).len()
}

/// Removes files that dead runs of this user left in the shared-memory folder, except runs that `is_known` accepts.
pub(crate) fn remove_dead(is_known: &dyn Fn(&str) -> bool) -> io::Result<()> {
    remove_dead_in(Path::new(SHARED_MEMORY), is_known)
}

fn remove_dead_in(shared: &Path, is_known: &dyn Fn(&str) -> bool) -> io::Result<()> {
    let all = find(shared, is_known);
    all.iter().flat_map(|leftover| &leftover.files).try_for_each(|file| gone(fs::remove_file(file)))
}

fn find(shared: &Path, is_known: &dyn Fn(&str) -> bool) -> Vec<Leftover> {
    let mut runs: BTreeMap<String, Vec<PathBuf>> = BTreeMap::new();
    for entry in fs::read_dir(shared).into_iter().flatten().flatten() {
        let is_ours = entry.metadata().is_ok_and(|of| of.is_file() && of.uid() == user());
        let name = entry.file_name();
        if let Some(run) = name.to_str().and_then(run_of).filter(|_| is_ours) {
            runs.entry(run.to_owned()).or_default().push(entry.path());
        }
    }
    let dead = |(run, files): (String, Vec<PathBuf>)| {
        if is_known(&run) {
            return None;
        }
        let marker = shared.join(format!("{PROGRAM}{run}{MARKER}"));
        let lock = match files.contains(&marker) {
            true => Some(File::open(&marker).ok().filter(|marker| marker.try_lock().is_ok())?),
            // Without a marker, as an older version left it.
            false if is_alive(&run) => return None,
            false => None,
        };
        Some(Leftover { files, _lock: lock })
    };
    runs.into_iter().filter_map(dead).collect()
}

/// Run that a file belongs to, as process and number: `12_0` for `swerve_12_0_x.data` and `swerve_12_0.lock`. `None`
/// for the files of named runs.
fn run_of(file: &str) -> Option<&str> {
    let rest = file.strip_prefix(PROGRAM)?;
    let digits = |text: &str| text.bytes().take_while(u8::is_ascii_digit).count();
    let process = digits(rest);
    let number = digits(rest.get(process..)?.strip_prefix('_')?);
    let (run, rest) = rest.split_at(process + 1 + number);
    let is_file = rest == MARKER || (rest.starts_with('_') && rest.len() > 1);
    (process > 0 && number > 0 && is_file).then_some(run)
}

fn is_alive(run: &str) -> bool {
    let process = run.split('_').next().unwrap_or_default();
    !Path::new("/proc/self").exists() || Path::new("/proc").join(process).exists()
}

/// Treats `NotFound` as success: there is nothing to remove.
pub(crate) fn gone(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

pub(crate) fn user() -> u32 {
    fs::metadata("/proc/self").map_or(0, |of| of.uid())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Process ID of a process that has ended.
    fn dead_process() -> u32 {
        let mut child = std::process::Command::new("true").spawn().unwrap();
        child.wait().unwrap();
        child.id()
    }

    #[test]
    fn files_of_dead_runs_are_removed_and_no_others() {
        let folder = tempfile::tempdir().unwrap();
        let shared = folder.path();
        let (dead, alive) = (dead_process(), std::process::id());
        let make = |name: String| {
            fs::write(shared.join(&name), "left").unwrap();
            name
        };
        let left = [format!("swerve_{dead}_0_a.data"), format!("swerve_{dead}_0_b.dyn")].map(make);
        // With an unlocked marker the run is dead, even if its process ID is in use.
        let unlocked = [format!("swerve_{alive}_7_a.data"), format!("swerve_{alive}_7.lock")].map(make);
        let kept = [
            format!("swerve_{alive}_0_a.data"),
            format!("swerve_two_hosts_{dead}_0_a.data"),
            format!("swerve_{dead}_a.data"),
            format!("swerve_{dead}_0_"),
            format!("other_{dead}_0_a.data"),
            format!("swerve_{dead}_1_a.data"),
        ]
        .map(make);
        std::os::unix::fs::symlink(shared.join(&kept[0]), shared.join(format!("swerve_{dead}_2_x"))).unwrap();
        let is_known = |run: &str| run == format!("{dead}_1");
        assert_eq!(find(shared, &is_known).len(), 2);
        remove_dead_in(shared, &is_known).unwrap();
        assert!(left.iter().chain(&unlocked).all(|name| !shared.join(name).exists()));
        assert!(kept.iter().all(|name| shared.join(name).exists()));
        assert!(shared.join(format!("swerve_{dead}_2_x")).is_symlink());
    }

    #[test]
    fn marked_run_is_alive_whatever_process_it_is_of() {
        let folder = tempfile::tempdir().unwrap();
        let shared = folder.path();
        // As in a container whose processes are not visible here.
        let run = format!("{}_0", dead_process());
        let marker = Marker::create_in(shared, &run).unwrap().unwrap();
        let file = shared.join(format!("swerve_{run}_a.data"));
        fs::write(&file, "used").unwrap();
        assert_eq!(find(shared, &|_| false).len(), 0);
        let taken = Marker::create_in(shared, &run).unwrap_err();
        assert_eq!(taken.kind(), io::ErrorKind::AlreadyExists);
        drop(marker);
        remove_dead_in(shared, &|_| false).unwrap();
        assert_eq!(fs::read_dir(shared).unwrap().count(), 0);
    }
}
