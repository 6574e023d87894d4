//! Scenarios written by hand, and those of TU Munich.

mod shared;
