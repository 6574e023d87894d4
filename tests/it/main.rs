//! Integration tests: one binary, one module a subject.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

mod docs; // pages: commands, files, code and settings that they show
mod tidy; // the house: dependency arrows, licences, page lengths
