//! Results for people: text in columns, files written whole, progress, pictures, pages.

pub mod files;
pub mod graph;
pub mod output;
pub mod page;
pub mod progress;
pub mod story;
