//! The program as its users call it: one binary, one module a subject.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

mod bad_input; // what is wrong is told once, with its place, and nothing finished is lost
mod interrupt; // Ctrl-C in a study, behind SWERVE_SLOW=1
mod output; // what goes where, and which options change it
mod ray; // shards on Ray workers, behind SWERVE_SLOW=1
mod sensors; // a rig from a file, its log, its faults
mod slurm; // the shards of a Slurm array, simulated
mod study; // cells, resuming, shards, failing cells, repeating a cell
mod support; // a folder to call the program in
