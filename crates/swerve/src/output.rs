//! Results go to standard output in one place; everything else goes to standard error.

use std::io::Write as _;

/// Writes to standard output. A reader that has gone away (`swerve ... | head`) is no error.
pub fn print(text: &str) {
    let mut out = std::io::stdout().lock();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}
