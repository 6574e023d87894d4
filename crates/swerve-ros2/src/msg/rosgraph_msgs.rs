//! `rosgraph_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::builtin_interfaces::Time;
use crate::check::{Check, Invalid, within};

/// Simulated time.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Clock {
    pub clock: Time,
}

impl Check for Clock {
    fn check(&self) -> Result<(), Invalid> {
        within("clock.sec", f64::from(self.clock.sec), 0.0, f64::from(i32::MAX))
    }
}
