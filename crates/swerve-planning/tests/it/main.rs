//! Integration tests: one binary, one module a subject.

mod counting; // how often a thread allocates
mod fot_allocations; // a plan of FOT allocates its points only
