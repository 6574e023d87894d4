//! Drives whose operators are looked at from outside.

mod deadlines;
mod faults;
mod gate;
mod perception;
mod sensors;
