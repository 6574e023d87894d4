//! Files that are read whole, with a bound on their length.

use std::fs::File;
use std::io::{self, Read as _};
use std::path::Path;

use crate::decoded;

/// The longest file that is read whole where nothing shorter is expected, bytes.
pub const FILE_MAX: u64 = 1 << 30;

/// The most that is read of what has no length: a pipe, a terminal, a device.
const STREAM_MAX: u64 = 64 << 20;

/// Reads a file whole, of at most `bytes_max` bytes. Of pipes and devices, which may never end, 64 MiB are read at most.
///
/// # Errors
/// The file cannot be read, or is longer.
pub fn read_bytes(path: &Path, bytes_max: u64) -> io::Result<Vec<u8>> {
    let file = File::open(path)?;
    let found = file.metadata()?;
    let (known, most) = match found.is_file() {
        true => (found.len(), bytes_max),
        false => (0, bytes_max.min(STREAM_MAX)),
    };
    let too_long = || {
        let mib = most >> 20;
        Err(io::Error::new(io::ErrorKind::FileTooLarge, format!("it is longer than {mib} MiB")))
    };
    if known > most {
        return too_long();
    }
    let mut bytes = Vec::with_capacity(usize::try_from(known).unwrap_or(0));
    // It may grow meanwhile, and files of the system have no length.
    file.take(most + 1).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { too_long() } else { Ok(bytes) }
}

/// As [`read_bytes`], of text in UTF-8.
///
/// # Errors
/// As there, or it is no such text.
pub fn read_string(path: &Path, bytes_max: u64) -> io::Result<String> {
    let wrong = |error| io::Error::new(io::ErrorKind::InvalidData, error);
    decoded(read_bytes(path, bytes_max)?).map_err(wrong)
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

    #[test]
    fn device_without_end_is_read_to_the_bound_of_streams() {
        let refused = read_bytes(Path::new("/dev/zero"), FILE_MAX).unwrap_err();
        assert_eq!(refused.to_string(), "it is longer than 64 MiB");
        assert_eq!(read_bytes(Path::new("/dev/null"), FILE_MAX).unwrap(), [0; 0]);
        assert!(read_string(Path::new("/proc/self/status"), FILE_MAX).unwrap().starts_with("Name:"));
    }
}
