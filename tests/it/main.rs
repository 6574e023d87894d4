//! Integration tests: one binary, one module per subject.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

mod common; // scenarios, configurations and recorded runs for the others
mod contents; // the table of contents, the gallery, the change log
mod determinism; // the digest: threads, seeds, repeats, recorded run times
mod docs; // pages: commands, files, code and settings that they show
mod drives; // drives observed from outside
mod foxglove; // logs in third-party programs: layouts, readers in Python and JavaScript
mod guest; // the stack in a foreign world: digests, bad input, logs
mod own_stack; // operators of an external package
mod replay; // replayed logs: verified, altered, damaged
mod scenarios; // every shipped scenario under every pipeline with an expectation
mod supply_chain; // third-party code: rules, bill of materials, compiler
mod tidy; // project rules: dependencies of crates, licences, page lengths
