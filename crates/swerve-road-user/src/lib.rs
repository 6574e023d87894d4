//! Models of road users as formulas: car following, lane changes, forces between pedestrians, times of travel.
//!
//! Predictors and simulated traffic use the same ones, each with its own parameters. The functions have no state.
//!
//! Excluded: maps, messages, integration over time.

pub mod idm;
pub mod mobil;
pub mod social_force;
pub mod travel;
