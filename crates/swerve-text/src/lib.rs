//! Texts that people write (TOML): documents with the lines of their keys, `--set` assignments, and every [`Problem`]
//! of a text at once, each with file, line, key, what was expected and the nearest name.
//!
//! There are two ways from a [`Document`] to values. [`Document::to`] reads a type through serde: for forms that a
//! type says, with ranges checked afterwards. [`TableReader`] reads key by key: for forms where one key decides on
//! others, or each value has its range. Both say the same of the same mistake.
//!
//! JSON that comes from outside is read by [`from_json`], which tells the first mistake in the same words.
//!
//! Every file that is read is opened by [`open_file`], which takes regular files alone; what is read whole, settings or
//! not, is read by [`read_bytes`], which has a bound.
//!
//! Absences: no crate of ours, no type of any domain; the only file it opens is the one that it is given.

mod assign;
mod bound;
mod document;
mod file;
mod form;
mod json;
mod overridden;
mod problem;
mod table;
mod words;

pub use assign::{parse_assignment, parse_assignments, set};
pub use bound::{NAME_MAX, PARAGRAPH_MAX};
pub use document::{Document, NotText, decoded, read_given_text, read_text, unreadable};
pub use file::{FILE_MAX, open_file, read_bytes, read_given, read_string};
pub use form::{Guessed, Misread, built_in, is_within, keys, read, read_meant};
pub use json::from_json;
pub use overridden::overridden;
pub use problem::{KeyProblem, Problem, Problems, in_one_line};
pub use table::{Range, Reading, TableReader};
pub use words::{did_you_mean, list, nearest, number};
