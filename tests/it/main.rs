//! Integration tests: one binary, one module a subject.

mod tidy; // the house: dependency arrows, licences, page lengths
