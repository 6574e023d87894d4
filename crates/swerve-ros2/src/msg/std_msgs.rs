//! `std_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Time;
use crate::check::{Check, Invalid};

/// Stamp and frame.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Header {
    pub stamp: Time,
    pub frame_id: String,
}

/// Red, green, blue and opacity, 0 to 1.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct ColorRGBA {
    pub r: f32,
    pub g: f32,
    pub b: f32,
    pub a: f32,
}

/// One boolean.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Bool {
    pub data: bool,
}

/// Empty; one byte on the wire, which has no empty structs.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Empty {
    pub structure_needs_at_least_one_member: u8,
}

impl Check for Bool {
    fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}

impl Check for Empty {
    fn check(&self) -> Result<(), Invalid> {
        Ok(())
    }
}
