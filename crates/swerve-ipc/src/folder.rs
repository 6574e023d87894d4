//! A name of its own for all that a run leaves on the machine, and the removal of what dead runs left.
//!
//! Shared memory outlives a process that is killed. So every run has a folder in one that is its user's alone, a
//! prefix for its files in the shared-memory folder, and a lock on a file beside the folder for as long as it
//! lives. Whoever starts next removes what carries the name of a run whose lock is free. The run's files in shared memory have a
//! locked marker beside them, for runs that look into another folder.
//!
//! A run can also be given a name. Then others may join its shared memory, such as a tunnel to another host, and
//! what is there is not the run's alone: iceoryx2 removes what each dead process left, when the next one joins.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::{Deserialize, Serialize};

use crate::IpcError;
use crate::leftovers::{self, Marker};

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
    _marker: Option<Marker>,
}

impl RunFolder {
    /// Makes one, after removing those of dead runs.
    pub(crate) fn create() -> Result<Self, IpcError> {
        let base = base();
        Self::create_in(&base, TRIES).map_err(|error| refused(&base, &error))
    }

    fn create_in(base: &Path, tries: u32) -> io::Result<Self> {
        own(base)?;
        // Nobody else makes or removes folders meanwhile: a lock file that is not locked is one of a dead run.
        let guard = OpenOptions::new().create(true).append(true).open(base.join("guard"))?;
        lock(&guard, tries)?;
        remove_dead(base)?;
        // Runs of this folder have been looked at; what cannot be removed stays.
        let _left = leftovers::remove_dead(&|run| base.join(format!("{run}.lock")).exists());
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
                    let marker = match Marker::create(&name) {
                        Ok(marker) => marker,
                        Err(_taken) => {
                            fs::remove_file(lock_file)?;
                            n += 1;
                            continue;
                        }
                    };
                    let root = base.join(&name);
                    fs::create_dir_all(&root)?;
                    let address = Address { root, prefix: prefix(&name) };
                    return Ok(Self { address, lock_file: Some(lock_file), _lock: lock, _marker: marker });
                }
            }
        }
    }

    /// The folder of this name, of letters, digits and underscores; a letter comes first.
    pub(crate) fn named(name: &str) -> Result<Self, IpcError> {
        let doing = || format!("making the folder `{name}` for shared memory");
        let base = base();
        let root = base.join(name);
        own(&base).map_err(|error| refused(&base, &error))?;
        fs::create_dir_all(&root).map_err(IpcError::of(doing()))?;
        let lock = OpenOptions::new().create(true).append(true).open(root.join("lock"));
        let lock = lock.map_err(IpcError::of(doing()))?;
        if lock.try_lock().is_err() {
            let error = "another run has this name".to_owned();
            return Err(IpcError::Shared { doing: doing(), error });
        }
        let address = Address { root, prefix: prefix(name) };
        Ok(Self { address, lock_file: None, _lock: lock, _marker: None })
    }
}

impl Drop for RunFolder {
    fn drop(&mut self) {
        let Some(lock_file) = &self.lock_file else { return };
        // What cannot be removed now is removed by the next run.
        let _left = remove_run(&self.address, lock_file);
    }
}

/// How often a lock is tried, and the wait between: ten seconds in all, in which any start of a run is over.
const TRIES: u32 = 100;
const WAIT: Duration = Duration::from_millis(100);

/// The folder of all runs of this user: where the system keeps what is its user's alone, else a temporary one. Sockets
/// lie below it, whose paths have to be short.
fn base() -> PathBuf {
    const LONG: usize = 40;
    let is_short = |path: &PathBuf| path.as_os_str().len() <= LONG;
    let runtime = std::env::var_os("XDG_RUNTIME_DIR").map(PathBuf::from);
    if let Some(runtime) = runtime.filter(|path| is_short(path) && is_ours_alone(path)) {
        return runtime.join("swerve_ipc");
    }
    let temporary = Some(std::env::temp_dir()).filter(is_short);
    temporary.unwrap_or_else(|| PathBuf::from("/tmp")).join(format!("swerve_ipc_{}", user()))
}

pub(crate) fn user() -> u32 {
    fs::metadata("/proc/self").map_or(0, |of| of.uid())
}

fn is_ours_alone(folder: &Path) -> bool {
    fs::symlink_metadata(folder).is_ok_and(|of| of.is_dir() && of.uid() == user() && of.mode() & 0o077 == 0)
}

/// Makes a folder that nobody but this user reads or writes, or takes the one that is there, if it is ours: in a folder
/// like `/tmp`, where anybody makes files, somebody else may have been first.
fn own(folder: &Path) -> io::Result<()> {
    match fs::DirBuilder::new().mode(0o700).create(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    let found = fs::symlink_metadata(folder)?;
    let wrong = if !found.is_dir() {
        "it is no folder".to_owned()
    } else if found.uid() != user() {
        format!("it belongs to user {}", found.uid())
    } else {
        // One that an older version made is open to others.
        return fs::set_permissions(folder, fs::Permissions::from_mode(0o700));
    };
    Err(io::Error::new(
        io::ErrorKind::PermissionDenied,
        format!("{wrong}, and not yours: have it removed, or set XDG_RUNTIME_DIR to a folder of yours alone"),
    ))
}

/// Locks a file, within a time in which whoever holds it is through.
#[expect(clippy::disallowed_methods, reason = "the start of processes is no part of a run's time")]
fn lock(file: &File, tries: u32) -> io::Result<()> {
    for _ in 1..tries {
        if file.try_lock().is_ok() {
            return Ok(());
        }
        std::thread::sleep(WAIT);
    }
    file.try_lock().map_err(|_| {
        let held = format!("another process has held its `guard` for {} s", (tries * WAIT).as_secs());
        io::Error::new(io::ErrorKind::TimedOut, held)
    })
}

fn refused(base: &Path, error: &io::Error) -> IpcError {
    let doing = format!("making a folder for shared memory in {}", base.display());
    IpcError::Shared { doing, error: error.to_string() }
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
pub(crate) fn gone(result: io::Result<()>) -> io::Result<()> {
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
        let alive = RunFolder::create_in(base, TRIES).unwrap();
        // A run that was killed: its files are there, its lock is free.
        let name = format!("dead_{}", std::process::id());
        let (dead, lock) =
            (Address { root: base.join(&name), prefix: prefix(&name) }, format!("{name}.lock"));
        fs::create_dir_all(dead.root.join("nodes")).unwrap();
        let shared = Path::new(SHARED_MEMORY).join(format!("{}x.data", dead.prefix));
        fs::write(&shared, "left").unwrap();
        fs::write(base.join(&lock), "").unwrap();
        let other = RunFolder::create_in(base, TRIES).unwrap();
        assert!(!dead.root.exists() && !shared.exists() && !base.join(&lock).exists());
        assert!(alive.address.root.exists() && other.address.root.exists());
        assert_ne!(alive.address, other.address);
        let roots = [alive.address.root.clone(), other.address.root.clone()];
        drop((alive, other));
        assert!(roots.iter().all(|root| !root.exists()));
    }

    #[test]
    fn a_folder_that_is_not_ours_alone_is_refused_or_closed() {
        let temporary = tempfile::tempdir().unwrap();
        let at = |name: &str| temporary.path().join(name);
        let told = |name: &str| RunFolder::create_in(&at(name), 1).unwrap_err().to_string();
        fs::create_dir(at("elsewhere")).unwrap();
        std::os::unix::fs::symlink(at("elsewhere"), at("link")).unwrap();
        fs::write(at("file"), "").unwrap();
        for name in ["link", "file"] {
            assert!(told(name).starts_with("it is no folder, and not yours"), "{name}: {}", told(name));
        }
        assert_eq!(fs::read_dir(at("elsewhere")).unwrap().count(), 0, "nothing is made behind a link");
        // As an older version made it, open to all.
        fs::create_dir(at("open")).unwrap();
        fs::set_permissions(at("open"), fs::Permissions::from_mode(0o777)).unwrap();
        drop(RunFolder::create_in(&at("open"), 1).unwrap());
        assert!(is_ours_alone(&at("open")));
        // Only root can give a folder away.
        fs::create_dir(at("foreign")).unwrap();
        if std::os::unix::fs::chown(at("foreign"), Some(65_534), None).is_ok() {
            assert!(
                told("foreign").starts_with("it belongs to user 65534, and not yours"),
                "{}",
                told("foreign")
            );
        } else {
            println!("folders of other users: not looked at, only root can make one");
        }
    }

    #[test]
    fn a_lock_that_is_held_is_told_and_not_waited_for_without_end() {
        let base = tempfile::tempdir().unwrap();
        let guard = File::create(base.path().join("guard")).unwrap();
        guard.lock().unwrap();
        let told = RunFolder::create_in(base.path(), 2).unwrap_err().to_string();
        assert!(told.starts_with("another process has held its `guard`"), "{told}");
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
