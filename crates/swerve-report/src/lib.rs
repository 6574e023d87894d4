//! Presentation of results: text in columns, atomically written files, progress, pictures, pages.

pub mod files;
pub mod graph;
mod halved;
pub mod output;
pub mod page;
pub mod progress;
pub mod story;
