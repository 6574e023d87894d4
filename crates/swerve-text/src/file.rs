//! The one way to open a file for reading, and files that are read whole, with a bound on their length.

use std::fs::{File, FileType, Metadata, OpenOptions};
use std::io::{self, Read};
use std::path::Path;

use crate::decoded;

/// The longest file that is read whole where nothing shorter is expected, bytes.
pub const FILE_MAX: u64 = 1 << 30;

/// The most that is read of a stream, which has no length.
const STREAM_MAX: u64 = 64 << 20;

/// Opens a regular file for reading. Never waits: a named pipe, a device, a socket and a file of `/proc` or `/sys` are
/// refused without reading them.
///
/// # Errors
/// The file cannot be opened, or is not a regular file.
pub fn open_file(path: &Path) -> io::Result<File> {
    let (file, found) = open_at_once(path)?;
    match other_than_file(&file, &found) {
        None => Ok(file),
        Some(other) => Err(not_regular(&found, other)),
    }
}

/// Reads a regular file whole, of at most `bytes_max` bytes.
///
/// # Errors
/// As [`open_file`], or the file cannot be read or is longer.
pub fn read_bytes(path: &Path, bytes_max: u64) -> io::Result<Vec<u8>> {
    let file = open_file(path)?;
    let length = file.metadata()?.len();
    read_within(file, length, bytes_max)
}

/// As [`read_bytes`], of text in UTF-8.
///
/// # Errors
/// As there, or it is no such text.
pub fn read_string(path: &Path, bytes_max: u64) -> io::Result<String> {
    let wrong = |error| io::Error::new(io::ErrorKind::InvalidData, error);
    decoded(read_bytes(path, bytes_max)?).map_err(wrong)
}

/// As [`read_bytes`], of a path from the command line: a descriptor that the caller opened (`/dev/stdin`, `/dev/fd/N`,
/// the `<(...)` of a shell) is read as a stream, at most 64 MiB.
///
/// # Errors
/// As there.
pub fn read_given(path: &Path, bytes_max: u64) -> io::Result<Vec<u8>> {
    if !is_descriptor(path) {
        return read_bytes(path, bytes_max);
    }
    let (file, found) = open_at_once(path)?;
    match other_than_file(&file, &found) {
        None => read_within(file, found.len(), bytes_max),
        Some(other) if found.is_dir() => Err(not_regular(&found, other)),
        Some(_) => read_within(Stream(file), 0, bytes_max.min(STREAM_MAX)),
    }
}

fn read_within(from: impl Read, length: u64, bytes_max: u64) -> io::Result<Vec<u8>> {
    let too_long = || {
        let mib = bytes_max >> 20;
        Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("it is longer than {mib} MiB")))
    };
    if length > bytes_max {
        return too_long();
    }
    let mut bytes = Vec::with_capacity(usize::try_from(length).unwrap_or(0));
    // The file may grow meanwhile.
    from.take(bytes_max + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > bytes_max { too_long() } else { Ok(bytes) }
}

fn not_regular(found: &Metadata, other: &str) -> io::Error {
    let kind = if found.is_dir() { io::ErrorKind::IsADirectory } else { io::ErrorKind::InvalidInput };
    io::Error::new(kind, format!("expected a regular file, found {other}"))
}

/// The name of a descriptor that the caller of the program opened.
fn is_descriptor(path: &Path) -> bool {
    let Some(path) = path.to_str() else { return false };
    let number = ["/dev/fd/", "/proc/self/fd/"].iter().find_map(|folder| path.strip_prefix(folder));
    path == "/dev/stdin" || number.is_some_and(|number| number.parse::<u32>().is_ok())
}

/// Opens without waiting for the other end of a pipe.
fn open_at_once(path: &Path) -> io::Result<(File, Metadata)> {
    let mut options = OpenOptions::new();
    options.read(true);
    #[cfg(unix)]
    {
        use std::os::unix::fs::OpenOptionsExt as _;
        let flags = rustix::fs::OFlags::NONBLOCK | rustix::fs::OFlags::NOCTTY;
        options.custom_flags(flags.bits().cast_signed());
    }
    // A socket cannot be opened at all, and a device may refuse.
    let named = |error| match std::fs::metadata(path) {
        Ok(found) if !found.is_file() && !found.is_dir() => not_regular(&found, kind_of(found.file_type())),
        _ => error,
    };
    let file = options.open(path).map_err(named)?;
    let found = file.metadata()?;
    Ok((file, found))
}

/// What there is in place of a regular file.
fn other_than_file(file: &File, found: &Metadata) -> Option<&'static str> {
    if found.is_file() { file_of_kernel(file) } else { Some(kind_of(found.file_type())) }
}

/// Where the kernel makes up the files. They have no length, and reading one may wait or take something away
/// (`/proc/kmsg`).
#[cfg(target_os = "linux")]
fn file_of_kernel(file: &File) -> Option<&'static str> {
    const MADE_UP: [(i64, &str); 4] = [
        (0x9fa0, "a file of procfs"),
        (0x6265_6572, "a file of sysfs"),
        (0x7472_6163, "a file of tracefs"),
        (0x6462_6720, "a file of debugfs"),
    ];
    let of = rustix::fs::fstatfs(file).ok()?.f_type;
    MADE_UP.into_iter().find(|(magic, _)| i128::from(of) == i128::from(*magic)).map(|(_, name)| name)
}

#[cfg(not(target_os = "linux"))]
fn file_of_kernel(_file: &File) -> Option<&'static str> {
    None
}

#[cfg(unix)]
fn kind_of(kind: FileType) -> &'static str {
    use std::os::unix::fs::FileTypeExt as _;
    match kind {
        kind if kind.is_dir() => "a folder",
        kind if kind.is_fifo() => "a pipe",
        kind if kind.is_socket() => "a socket",
        _ => "a device",
    }
}

#[cfg(not(unix))]
fn kind_of(kind: FileType) -> &'static str {
    if kind.is_dir() { "a folder" } else { "something else" }
}

/// A descriptor that was opened without waiting, read with waiting: its writer is at work.
struct Stream(File);

impl Read for Stream {
    fn read(&mut self, into: &mut [u8]) -> io::Result<usize> {
        loop {
            match self.0.read(into) {
                #[cfg(unix)]
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {
                    use rustix::event::{PollFd, PollFlags, poll};
                    let awaited = poll(&mut [PollFd::new(&self.0, PollFlags::IN)], None);
                    match awaited {
                        Ok(_) | Err(rustix::io::Errno::INTR) => {}
                        Err(error) => return Err(error.into()),
                    }
                }
                read => return read,
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn file_beyond_the_bound_is_refused_before_it_is_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("sparse");
        let file = File::create(&path).unwrap();
        file.set_len(3 << 20).unwrap();
        assert_eq!(read_bytes(&path, 3 << 20).unwrap().len(), 3 << 20);
        let refused = read_bytes(&path, (3 << 20) - 1).unwrap_err();
        assert_eq!(refused.to_string(), "it is longer than 2 MiB");
        // A terabyte that nobody reads.
        file.set_len(1 << 40).unwrap();
        assert_eq!(read_bytes(&path, FILE_MAX).unwrap_err().to_string(), "it is longer than 1024 MiB");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn inputs_other_than_regular_files_are_refused_without_waiting() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        assert!(std::process::Command::new("mkfifo").arg(at("pipe")).status().unwrap().success());
        let _socket = std::os::unix::net::UnixListener::bind(at("socket")).unwrap();
        std::os::unix::fs::symlink(at("pipe"), at("link")).unwrap();
        for (path, found) in [
            (at("pipe"), "a pipe"),
            (at("link"), "a pipe"),
            (at("socket"), "a socket"),
            (folder.path().to_owned(), "a folder"),
            ("/dev/zero".into(), "a device"),
            ("/dev/null".into(), "a device"),
            ("/proc/self/status".into(), "a file of procfs"),
        ] {
            for refused in [open_file(&path).map(drop), read_given(&path, FILE_MAX).map(drop)] {
                let refused = refused.unwrap_err().to_string();
                assert_eq!(refused, format!("expected a regular file, found {found}"), "{}", path.display());
            }
        }
        std::fs::write(at("file"), "text").unwrap();
        std::os::unix::fs::symlink(at("file"), at("to_file")).unwrap();
        assert_eq!(read_string(&at("to_file"), FILE_MAX).unwrap(), "text");
    }

    /// As `<(...)` of a shell, whose writer may be slower than the reader, or gone before it.
    #[cfg(target_os = "linux")]
    #[test]
    fn descriptor_of_the_caller_is_read_to_its_end_within_the_bound_of_streams() {
        use std::io::Write as _;
        use std::os::fd::AsRawFd as _;
        let path = |file: &dyn std::os::fd::AsRawFd| {
            [format!("/dev/fd/{}", file.as_raw_fd()), format!("/proc/self/fd/{}", file.as_raw_fd())]
                .map(std::path::PathBuf::from)
        };
        for k in 0..2 {
            let (from, mut to) = io::pipe().unwrap();
            let path = &path(&from)[k];
            assert!(open_file(path).is_err(), "a file that names it");
            let writer = std::thread::spawn(move || {
                for part in ["one ", "two"] {
                    std::thread::yield_now();
                    to.write_all(part.as_bytes()).unwrap();
                }
            });
            assert_eq!(read_given(path, FILE_MAX).unwrap(), b"one two");
            writer.join().unwrap();
        }
        let endless = File::open("/dev/zero").unwrap();
        let refused = read_given(&path(&endless)[0], FILE_MAX).unwrap_err();
        assert_eq!(refused.to_string(), "it is longer than 64 MiB");
        let folder = File::open("/").unwrap();
        let refused = read_given(&path(&folder)[0], FILE_MAX).unwrap_err();
        assert_eq!(refused.to_string(), "expected a regular file, found a folder");
        assert!(endless.as_raw_fd() > 0);
    }
}
