//! Integration tests: one binary, one module a subject.

mod common; // scenarios, configurations and recorded runs for the others
mod determinism; // the digest: threads, seeds, repeats, recorded run times
mod replay; // logs computed again: verified, altered, damaged
mod scenarios; // every shipped scenario under every pipeline that it expects something of
mod tidy; // the house: dependency arrows, licences, page lengths
