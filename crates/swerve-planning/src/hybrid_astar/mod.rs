//! Hybrid A*: search over poses with motions that a car can drive.
mod dubins;
