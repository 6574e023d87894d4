//! `tf2_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::geometry_msgs::TransformStamped;
use crate::check::{Check, Invalid};

/// Edges of the transform tree.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TFMessage {
    pub transforms: Vec<TransformStamped>,
}

impl Check for TFMessage {
    fn check(&self) -> Result<(), Invalid> {
        for (i, edge) in self.transforms.iter().enumerate() {
            edge.check().map_err(|e| Invalid { field: format!("transforms[{i}].{}", e.field), ..e })?;
        }
        Ok(())
    }
}
