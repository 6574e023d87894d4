//! Scenarios written by hand, invalid ones, and those of TU Munich.

mod bad;
mod hand;
pub(crate) mod shared;

/// Two parallel lanes, the left one with a successor; a stop line with lights, and a sign.
const SMALL: &str = include_str!("tests/small.xml");
