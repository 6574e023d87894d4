//! Texts written by people (TOML): documents with the lines of their keys, `--set` assignments, and all [`Problem`]s of
//! a text at once, each with file, line, key, the expected value and the nearest name.
//!
//! There are two ways from a [`Document`] to values. [`Document::to`] deserializes a type through serde, with ranges
//! checked afterwards: for forms that are expressed by a type. [`TableReader`] reads key by key: for forms in which one
//! key determines others, or each value has its range. Both report the same mistake in the same words.
//!
//! External JSON is read by [`from_json`], which reports the first mistake in the same words.
//!
//! All files are opened by [`open_file`], which accepts only regular files; all files read whole are read by
//! [`read_bytes`], which limits their size.
//!
//! The crate depends on no other crate of this project and on no domain type; it opens only the files passed to it.

mod assign;
mod bound;
mod decode;
mod document;
mod file;
mod form;
mod gzip;
mod json;
mod overridden;
mod problem;
mod table;
mod words;

pub use assign::{is_one_value, parse_assignment, parse_assignments, set};
pub use bound::{NAME_MAX, PARAGRAPH_MAX};
pub use decode::{NotText, decoded};
pub use document::{Document, read_given_text, read_text, unreadable};
pub use file::{FILE_MAX, open_file, read_bytes, read_given, read_string};
pub use form::{Guessed, Misread, built_in, is_within, keys, read, read_meant};
pub use gzip::unpacked;
pub use json::{from_json, json_problems, read_json};
pub use overridden::overridden;
pub use problem::{KeyProblem, Problem, Problems, in_one_line};
pub use table::{Range, Reading, TableReader};
pub use words::{did_you_mean, list, nearest, number, unknown_key};
