//! `tf2_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::geometry_msgs::TransformStamped;

/// Edges of the tree of frames.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct TFMessage {
    pub transforms: Vec<TransformStamped>,
}
