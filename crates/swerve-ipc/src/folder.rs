//! A name of its own for all that a run leaves on the machine, and the removal of what dead runs left.
//!
//! Shared memory outlives a process that is killed. So every run has a folder under its user's temporary one,
//! a prefix for its files in the shared-memory folder, and a lock on a file beside the folder for as long as it
//! lives. Whoever starts next removes what carries the name of a run whose lock is free.
//!
//! A run can also be given a name. Then others may join its shared memory, such as a tunnel to another host, and
//! what is there is not the run's alone: iceoryx2 removes what each dead process left, when the next one joins.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::IpcError;

/// Where POSIX shared memory lies.
pub(crate) const SHARED_MEMORY: &str = "/dev/shm";

/// What a run's things on the machine are called.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Address {
    /// The folder of its services and nodes.
    pub(crate) root: PathBuf,
    /// What its files start with.
    pub(crate) prefix: String,
}

/// The folder of a run, locked for as long as this lives; removed with it, unless it has a name that was given.
#[derive(Debug)]
pub(crate) struct RunFolder {
    pub(crate) address: Address,
    /// What is removed last; none where all stays.
    lock_file: Option<PathBuf>,
    _lock: File,
}

impl RunFolder {
    /// Makes one, after removing those of dead runs.
    pub(crate) fn create() -> Result<Self, IpcError> {
        let base = base();
        Self::create_in(&base).map_err(IpcError::of(format!("making a folder in {}", base.display())))
    }

    fn create_in(base: &Path) -> io::Result<Self> {
        fs::create_dir_all(base)?;
        // Nobody else makes or removes folders meanwhile: a lock file that is not locked is one of a dead run.
        let guard = OpenOptions::new().create(true).append(true).open(base.join("guard"))?;
        guard.lock()?;
        remove_dead(base)?;
        let process = std::process::id();
        let mut n = 0;
        loop {
            let name = format!("{process}_{n}");
            let lock_file = base.join(format!("{name}.lock"));
            match OpenOptions::new().create_new(true).write(true).open(&lock_file) {
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => n += 1,
                Err(error) => return Err(error),
                Ok(lock) => {
                    lock.lock()?;
                    let root = base.join(&name);
                    fs::create_dir_all(&root)?;
                    let address = Address { root, prefix: prefix(&name) };
                    return Ok(Self { address, lock_file: Some(lock_file), _lock: lock });
                }
            }
        }
    }

    /// The folder of this name, of letters, digits and underscores; a letter comes first.
    pub(crate) fn named(name: &str) -> Result<Self, IpcError> {
        let doing = || format!("making the folder `{name}` for shared memory");
        let root = base().join(name);
        fs::create_dir_all(&root).map_err(IpcError::of(doing()))?;
        let lock = OpenOptions::new().create(true).append(true).open(root.join("lock"));
        let lock = lock.map_err(IpcError::of(doing()))?;
        if lock.try_lock().is_err() {
            let error = "another run has this name".to_owned();
            return Err(IpcError::Shared { doing: doing(), error });
        }
        Ok(Self { address: Address { root, prefix: prefix(name) }, lock_file: None, _lock: lock })
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        let Some(lock_file) = &self.lock_file else { return };
        // What cannot be removed now is removed by the next run.
        let _left = remove_run(&self.address, lock_file);
    }
}

/// The folder of all runs of this user. Sockets lie below it, whose paths have to be short.
fn base() -> PathBuf {
    const LONG: usize = 40;
    let temporary = Some(std::env::temp_dir()).filter(|path| path.as_os_str().len() <= LONG);
    let user = fs::metadata("/proc/self").map_or(0, |of| of.uid());
    temporary.unwrap_or_else(|| PathBuf::from("/tmp")).join(format!("swerve_ipc_{user}"))
}

fn prefix(name: &str) -> String {
    format!("swerve_{name}_")
}

fn remove_dead(base: &Path) -> io::Result<()> {
    for entry in fs::read_dir(base)? {
        let lock_file = entry?.path();
        let (Some("lock"), Some(name)) = (
            lock_file.extension().and_then(|e| e.to_str()),
            lock_file.file_stem().and_then(|name| name.to_str()),
        ) else {
            continue;
        };
        let dead = File::open(&lock_file).is_ok_and(|file| file.try_lock().is_ok());
        if dead {
            let address = Address { root: base.join(name), prefix: prefix(name) };
            remove_run(&address, &lock_file)?;
        }
    }
    Ok(())
}

fn remove_run(address: &Address, lock_file: &Path) -> io::Result<()> {
    for file in shared_files(&address.prefix) {
        gone(fs::remove_file(file))?;
    }
    gone(fs::remove_dir_all(&address.root))?;
    gone(fs::remove_file(lock_file))
}

/// That something is not there to be removed is no error.
fn gone(result: io::Result<()>) -> io::Result<()> {
    match result {
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        _ => Ok(()),
    }
}

/// The files in the shared-memory folder that start with `prefix`.
pub(crate) fn shared_files(prefix: &str) -> Vec<PathBuf> {
    let Ok(entries) = fs::read_dir(SHARED_MEMORY) else { return Vec::new() };
    let names = entries.filter_map(Result::ok).map(|entry| entry.path());
    let of_run = |path: &PathBuf| path.file_name().is_some_and(|n| n.to_string_lossy().starts_with(prefix));
    names.filter(of_run).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_dead_run_left_is_removed_by_the_next_and_a_live_one_is_left_alone() {
        // A folder of its own: other runs on this machine remove dead ones as well.
        let base = tempfile::tempdir().unwrap();
        let base = base.path();
        let alive = RunFolder::create_in(base).unwrap();
        // A run that was killed: its files are there, its lock is free.
        let name = format!("dead_{}", std::process::id());
        let (dead, lock) =
            (Address { root: base.join(&name), prefix: prefix(&name) }, format!("{name}.lock"));
        fs::create_dir_all(dead.root.join("nodes")).unwrap();
        let shared = Path::new(SHARED_MEMORY).join(format!("{}x.data", dead.prefix));
        fs::write(&shared, "left").unwrap();
        fs::write(base.join(&lock), "").unwrap();
        let other = RunFolder::create_in(base).unwrap();
        assert!(!dead.root.exists() && !shared.exists() && !base.join(&lock).exists());
        assert!(alive.address.root.exists() && other.address.root.exists());
        assert_ne!(alive.address, other.address);
        let roots = [alive.address.root.clone(), other.address.root.clone()];
        drop((alive, other));
        assert!(roots.iter().all(|root| !root.exists()));
    }

    #[test]
    fn a_name_belongs_to_one_run_at_a_time_and_outlives_it() {
        let name = format!("test_{}", std::process::id());
        let first = RunFolder::named(&name).unwrap();
        assert_eq!(first.address.prefix, format!("swerve_{name}_"));
        let refused = RunFolder::named(&name).unwrap_err().to_string();
        assert!(refused.contains("another run has this name"), "{refused}");
        let root = first.address.root.clone();
        drop(first);
        // Another run takes it for no dead one's.
        drop(RunFolder::create().unwrap());
        assert!(root.exists());
        RunFolder::named(&name).unwrap();
        fs::remove_dir_all(root).unwrap();
    }
}
