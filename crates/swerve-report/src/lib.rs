//! Results for people: text in columns, files written whole, progress, pictures.

pub mod canvas;
pub mod files;
pub mod graph;
pub mod output;
pub mod progress;
pub mod story;
