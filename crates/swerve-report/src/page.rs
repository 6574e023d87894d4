//! `report.html`: a run, a study or two of either as one page that needs no network and no server.
//!
//! The page is made of the hand-written files in this crate's folder `page/` and of one JSON text that they draw.
//! The same data give the same bytes. What a page holds can be read back from it with [`data_of`].

mod bound;
mod collect;
mod embed;
mod picture;
mod rows;
mod run;

#[cfg(test)]
mod tests;

pub use collect::{Collector, Message};
pub use embed::{data_of, page};
pub use picture::{photo, photo_of};
pub use rows::{Have, Rows};
pub use run::{
    Actor, Changed, Commands, Ego, EgoShape, Input, Light, Marks, Messages, Operator, Parting, Photo, Plan,
    Predictions, Road, RunPage, Steps, Table, Tracks,
};

/// What every page has: which program made it, of what kind it is, and what it is headed with.
#[derive(Clone, PartialEq, Eq, Debug, serde::Serialize)]
pub struct Page<T> {
    /// `run`, `live`, `runs`, `study`, `studies` or `figures`.
    pub kind: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// What the page is headed with.
    pub title: String,
    /// What it shows.
    #[serde(flatten)]
    pub of: T,
}

impl<T: serde::Serialize> Page<T> {
    /// A page of a kind.
    pub fn new(kind: &'static str, title: impl Into<String>, of: T) -> Self {
        Self { kind, version: env!("CARGO_PKG_VERSION"), title: title.into(), of }
    }

    /// The page's text.
    pub fn html(&self) -> String {
        page(&self.title, self)
    }
}

/// Two of a kind beside each other.
#[derive(Clone, PartialEq, Eq, Debug, serde::Serialize)]
pub struct Pair<T, D> {
    /// The first.
    pub a: T,
    /// The second.
    pub b: T,
    /// In what they differ.
    pub parting: D,
}

/// Pictures and a table: what has no page of its own.
#[derive(Clone, PartialEq, Eq, Debug, Default, serde::Serialize)]
pub struct Figures {
    /// The command line that made them.
    pub command: String,
    /// Names of the columns.
    pub columns: Vec<String>,
    /// The table, row by row.
    pub rows: Vec<Vec<String>>,
    /// Pictures as SVG, each with its title.
    pub pictures: Vec<(String, String)>,
}
