//! Unique names for everything that a run leaves on the machine, and cleanup after dead runs.
//!
//! Shared memory outlives a killed process. Every run therefore has a folder in a directory private to its user, a
//! prefix for its files in the shared-memory folder, and a lock file beside its folder, locked for as long as the run
//! lives. The next run to start removes the files of every run whose lock is free. A locked marker beside the run's
//! files in shared memory protects them from runs that use another folder.
//!
//! A run can also be given a name. Other processes, such as a tunnel to another host, may then join its shared memory,
//! so the run does not remove it: iceoryx2 cleans up after each dead process when the next one joins.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};
use std::time::Duration;

use rustix::fs::{Access, access};
use serde::{Deserialize, Serialize};

use crate::IpcError;
use crate::leftovers::{self, Marker, SHARED_MEMORY, gone, user};

/// Names of a run's files and folders on the machine.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Address {
    /// Folder of its services and nodes.
    pub(crate) root: PathBuf,
    /// Prefix of its file names.
    pub(crate) prefix: String,
}

/// Folder of a run, locked for the lifetime of this value. Removed on drop unless the run was given a name.
#[derive(Debug)]
pub(crate) struct RunFolder {
    pub(crate) address: Address,
    /// Lock file, removed last; `None` for a named run, whose folder is kept.
    lock_file: Option<PathBuf>,
    _lock: File,
    _marker: Option<Marker>,
}

impl RunFolder {
    /// Creates a folder, after removing the folders of dead runs.
    pub(crate) fn create() -> Result<Self, IpcError> {
        let base = base();
        Self::create_in(&base, TRIES).map_err(|error| refused(&base, &error))
    }

    fn create_in(base: &Path, tries: u32) -> io::Result<Self> {
        own(base)?;
        // While `guard` is held, no other run creates or removes folders: an unlocked lock file belongs to a dead run.
        let guard = OpenOptions::new().create(true).append(true).open(base.join("guard"))?;
        lock(&guard, tries)?;
        remove_dead(base)?;
        // Runs of this folder were handled above; files that cannot be removed stay.
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

    /// Creates or opens the folder of a named run. A name consists of letters, digits and underscores and starts with a
    /// letter.
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
        // Files that cannot be removed now are removed by the next run.
        let _left = remove_run(&self.address, lock_file);
    }
}

/// Number of attempts to take a lock, and the wait between them: ten seconds in total, longer than any start of a run.
const TRIES: u32 = 100;
const WAIT: Duration = Duration::from_millis(100);

/// Folder of all runs of this user: in `XDG_RUNTIME_DIR` if that is private to the user, else in the temporary
/// directory. Its path is short, because it contains sockets, whose paths are limited in length.
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

fn is_ours_alone(folder: &Path) -> bool {
    fs::symlink_metadata(folder).is_ok_and(|of| of.is_dir() && of.uid() == user() && of.mode() & 0o077 == 0)
}

/// Creates a folder that only this user can access, or takes the existing one if this user owns it: in a shared folder
/// like `/tmp` another user may have created it first.
fn own(folder: &Path) -> io::Result<()> {
    match fs::DirBuilder::new().mode(0o700).create(folder) {
        Err(error) if error.kind() != io::ErrorKind::AlreadyExists => return Err(error),
        _ => {}
    }
    let found = fs::symlink_metadata(folder)?;
    let wrong = if !found.is_dir() {
        "it is not a folder".to_owned()
    } else if found.uid() != user() {
        format!("it belongs to user {}", found.uid())
    } else {
        // A folder made by an older version may be open to other users.
        return fs::set_permissions(folder, fs::Permissions::from_mode(0o700));
    };
    Err(io::Error::new(
        io::ErrorKind::PermissionDenied,
        format!("{wrong}, and not yours: have it removed, or set XDG_RUNTIME_DIR to a folder of yours alone"),
    ))
}

/// Locks a file; if another process holds it, tries `tries` times in all.
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

/// Checks that this user may create files in a folder.
///
/// # Errors
/// The system's error if the user may not.
pub fn writable(folder: &Path) -> io::Result<()> {
    Ok(access(folder, Access::WRITE_OK | Access::EXEC_OK)?)
}

/// Files in the shared-memory folder that start with `prefix`.
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
    fn next_run_removes_files_of_dead_runs_and_keeps_those_of_live_ones() {
        // A separate folder: other runs on this machine also remove dead ones.
        let base = tempfile::tempdir().unwrap();
        let base = base.path();
        let alive = RunFolder::create_in(base, TRIES).unwrap();
        // A killed run: its files exist, its lock is free.
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
            assert!(told(name).starts_with("it is not a folder, and not yours"), "{name}: {}", told(name));
        }
        assert_eq!(fs::read_dir(at("elsewhere")).unwrap().count(), 0, "nothing is made behind a link");
        // A folder as an older version made it, open to all.
        fs::create_dir(at("open")).unwrap();
        fs::set_permissions(at("open"), fs::Permissions::from_mode(0o777)).unwrap();
        drop(RunFolder::create_in(&at("open"), 1).unwrap());
        assert!(is_ours_alone(&at("open")));
        // Only root can change the owner of a folder.
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
    fn held_lock_is_reported_after_a_timeout() {
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
        // Another run does not take it for the folder of a dead run.
        drop(RunFolder::create().unwrap());
        assert!(root.exists());
        RunFolder::named(&name).unwrap();
        fs::remove_dir_all(root).unwrap();
    }
}
