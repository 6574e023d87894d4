//! `story.svg`: the course of a run on one page.
//!
//! [`Story`] records a run as it goes on; [`draw`] turns it into a figure: a bird's-eye view (road, stop lines and
//! lights, paths of ego and actors, outlines every half second, tracks, the plan and the predictions at each change of
//! the plan, the first sight of the actor, the closest approach or the collision). Below it, over one time axis:
//! traffic light signals, the steps of why, speed, the states of the behaviour planner, steering, accelerations and time to collision. Map frame, metres,
//! seconds of run time.

mod birds_eye;
mod changes;
mod collision_time;
mod draw;
mod labels;
mod lights;
mod marks;
mod moments;
mod panels;
mod record;
mod shapes;
mod states;
mod tracks;
mod view;

pub use draw::draw;
pub use record::{ActorTrace, PlanMark, Story, TrackMark};

#[cfg(test)]
mod tests;
