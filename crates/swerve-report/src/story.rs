//! `story.svg`: what happened in a run, on one page.
//!
//! [`Story`] takes in a run as it goes on and keeps what a reader wants to see; [`draw`] turns it into a figure:
//! a bird's-eye view (road, stop lines and lights, ways of ego and actors, outlines every half second, tracks, the plan
//! and the predictions at each change of the plan, when the actor was first visible, the closest approach or the
//! collision), and below it what lights showed, the steps of why, speed, steering, accelerations and time to collision
//! over one time axis. Map frame, metres, seconds of run time.

mod birds_eye;
mod collision_time;
mod draw;
mod labels;
mod lights;
mod marks;
mod panels;
mod record;
mod tracks;
mod view;

pub use draw::draw;
pub use record::{ActorTrace, PlanMark, Story, TrackMark};

#[cfg(test)]
mod tests;
