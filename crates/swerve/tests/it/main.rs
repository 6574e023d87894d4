//! End-to-end tests of the program: one binary, one module per subject. Ignored tests need an idle machine or
//! third-party programs: `cargo test -- --ignored` runs them.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

mod absent;
mod bad_input; // errors are reported once, with their location; finished results are kept
mod bounds; // memory of images, files, viewers and long drives
mod browser; // a browser whose page is inspected and typed into
mod decoders; // bytes from outside never make a decoder panic
mod faults; // full disk, no memory, no file descriptors
mod hostile; // malicious ROS 2 peers
mod inputs; // input files: regular ones; others are named in errors
mod instructions; // instruction counts of calls
mod interrupt; // Ctrl-C in a study
mod live; // a third-party car, driven over ROS 2 topics
mod localization;
mod look; // objects, lanes, lamps and depth in images; invalid calls
mod map_show; // road networks of OpenDRIVE files
mod names; // built-in files by name, and new project folders
mod orphan; // a vehicle whose program is killed
mod output; // outputs, and the options that change them
mod processes; // runs over several processes: the same digest, and failures are detected
mod ray; // shards on Ray workers
mod report; // pages of runs and studies, drawn by a real browser
mod ros2; // the simulated car on ROS 2's topics, recorded drives
mod scarce; // huge names and crowds, few descriptors, no shared memory
mod sensors; // sensors from a file, their log, their faults
mod settings; // a drive at either end of every numeric setting
mod several_egos;
mod slurm; // the shards of a Slurm array, simulated
mod soak; // memory and descriptors over a long drive
mod study; // cells, resuming, shards, failing cells, repeating a cell
mod support; // a folder to call the program in
mod timing; // the engine against the reference model
mod trust; // programs named in files
mod tutorials; // commands and files of the tutorials
mod view; // a run watched and controlled while in progress
mod writing; // output files, complete or absent
