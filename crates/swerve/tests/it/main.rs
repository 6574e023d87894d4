//! The program as its users call it: one binary, one module a subject. Tests that are ignored need a machine that has
//! time for them, or other makers' programs: `cargo test -- --ignored` runs them.
#![expect(clippy::unwrap_used, reason = "a failed test says where")]

mod absent;
mod bad_input; // what is wrong is told once, with its place, and nothing finished is lost
mod bounds; // memory of images, files, viewers and long drives
mod browser; // a browser whose page is typed into
mod decoders; // bytes from outside never make a decoder panic
mod faults; // a full disk, no memory, no descriptors
mod hostile; // peers of ROS 2 topics that mean ill
mod inputs; // what is read: regular files, and what cannot be read is named
mod instructions; // what calls cost, counted, not timed
mod interrupt; // Ctrl-C in a study
mod live; // a car of another make, driven over ROS 2's topics
mod localization;
mod look; // objects, lanes, lamps and depth in images, and what cannot be looked with
mod names; // what goes by its name, and a folder to begin in
mod orphan; // a vehicle whose program is killed
mod output; // what goes where, and which options change it
mod processes; // runs over several processes: the same digest, and what is lost is noticed
mod ray; // shards on Ray workers
mod report; // pages of runs and studies, drawn by a real browser
mod ros2; // the simulated car on ROS 2's topics, recorded drives
mod scarce; // names and crowds out of proportion, few descriptors, no shared memory
mod sensors; // a rig from a file, its log, its faults
mod settings; // a drive at either end of every numeric setting
mod slurm; // the shards of a Slurm array, simulated
mod soak; // memory and descriptors over a long drive
mod study; // cells, resuming, shards, failing cells, repeating a cell
mod support; // a folder to call the program in
mod timing; // the engine against the reference model
mod trust; // programs that files name
mod view; // a run watched and commanded while it goes on
mod writing; // files for results, whole or not at all
