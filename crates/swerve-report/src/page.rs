//! `report.html`: a run, a study or two of either as one page that needs neither network nor server.
//!
//! The page consists of the hand-written files in this crate's folder `page/` and of one JSON text that they render.
//! The same data give the same bytes. [`data_of`] reads the data back from a page.

mod behaviour;
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
    Actor, Behaviour, Changed, Commands, Ego, EgoShape, Input, Light, Marks, Messages, Operator, Parting,
    Photo, Plan, Predictions, Road, RunPage, StateChange, Steps, Table, Tracks,
};

/// Header and data of a page: its kind, program version and title.
#[derive(Clone, PartialEq, Eq, Debug, serde::Serialize)]
pub struct Page<T> {
    /// `run`, `live`, `runs`, `study`, `studies` or `figures`.
    pub kind: &'static str,
    /// Version of the program.
    pub version: &'static str,
    /// Heading of the page.
    pub title: String,
    /// Data that the page shows, serialised beside the other keys.
    #[serde(flatten)]
    pub of: T,
}

impl<T: serde::Serialize> Page<T> {
    /// Creates a page of a kind, with this program's version.
    pub fn new(kind: &'static str, title: impl Into<String>, of: T) -> Self {
        Self { kind, version: env!("CARGO_PKG_VERSION"), title: title.into(), of }
    }

    /// The page as HTML.
    pub fn html(&self) -> String {
        page(&self.title, self)
    }
}

/// Two runs or two studies side by side.
#[derive(Clone, PartialEq, Eq, Debug, serde::Serialize)]
pub struct Pair<T, D> {
    /// The first.
    pub a: T,
    /// The second.
    pub b: T,
    /// Differences between the two.
    pub parting: D,
}

/// Pictures and a table, for results without a dedicated page.
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
