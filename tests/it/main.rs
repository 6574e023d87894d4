//! Integration tests: one binary, one module a subject.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

mod common; // scenarios, configurations and recorded runs for the others
mod determinism; // the digest: threads, seeds, repeats, recorded run times
mod docs; // pages: commands, files, code and settings that they show
mod drives; // drives whose operators are looked at from outside
mod foxglove; // logs opened elsewhere: layouts, readers in Python and JavaScript
mod own_stack; // operators of a package of its own
mod replay; // logs computed again: verified, altered, damaged
mod scenarios; // every shipped scenario under every pipeline that it expects something of
mod supply_chain; // what others made: its rules, its bill, its compiler
mod tidy; // the house: dependency arrows, licences, page lengths
