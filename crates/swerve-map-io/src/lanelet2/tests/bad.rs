//! Invalid and hostile files.
