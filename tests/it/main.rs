//! Integration tests: one binary, one module a subject.

mod docs; // pages: commands, files, code and settings that they show
mod tidy; // the house: dependency arrows, licences, page lengths
