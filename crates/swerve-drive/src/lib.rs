//! Runs of a pipeline: loading, running, measuring and recording, in one or several processes.
//!
//! The engine and the operators are independent of files, names and processes. This crate turns a scenario and a
//! configuration into a run with an [`Outcome`].

mod drive;
mod ego;
mod guest;
mod lights;
mod load;
mod measured;
mod recording;
mod rungs;
mod scored;
mod story;

pub mod commonroad;
pub mod frames;
pub mod graph;
pub mod interrupt;
pub mod overwrite;
pub mod page;
pub mod pictures;
pub mod process;
pub mod program;
pub mod realtime;
pub mod scenarios;
pub mod shipped;
pub mod suggest;
pub mod sumo;
pub mod threads;
pub mod trust;
pub mod views;

pub use drive::{
    OtherOutcome, Outcome, Stopped, drive, drive_observed, drive_pipeline, drive_recorded, drive_unless,
    record_run_times,
};
pub use ego::{EgoRun, OfEgo, of_ego};
pub use guest::{Commanded, Commands, InputStream, Line, Referee, Stack, StackOptions, scenario_on_map};
pub use lights::light_courses;
pub use load::{
    RunInput, files_of, is_foreign, load, load_config, note_idle, operators_with_runtime, problems_error,
    read_scenario,
};
pub use measured::{norm, outline, track_names};
pub use overwrite::OverwriteArgs;
pub use recording::{Recording, left_out_of_logs, logged_scenario, of_version, run_start, set_up};
pub use rungs::{Budgets, RungCount, Rungs};
pub use story::{conclude, story, title};
pub use trust::CodeArgs;
