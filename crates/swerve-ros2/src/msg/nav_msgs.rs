//! `nav_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::geometry_msgs::{PoseStamped, PoseWithCovariance, TwistWithCovariance, pose, twist};
use super::std_msgs::Header;
use crate::check::parts::{frame, variances};
use crate::check::{Check, Invalid};

/// Pose of `child_frame_id` in the header's frame; the twist is in `child_frame_id`.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Odometry {
    pub header: Header,
    pub child_frame_id: String,
    pub pose: PoseWithCovariance,
    pub twist: TwistWithCovariance,
}

/// A path of poses.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Path {
    pub header: Header,
    pub poses: Vec<PoseStamped>,
}

impl Check for Odometry {
    fn check(&self) -> Result<(), Invalid> {
        frame("header.frame_id", &self.header.frame_id)?;
        frame("child_frame_id", &self.child_frame_id)?;
        pose("pose.pose", &self.pose.pose)?;
        twist("twist.twist", &self.twist.twist)?;
        variances("pose.covariance", &self.pose.covariance.0, 6)?;
        variances("twist.covariance", &self.twist.covariance.0, 6)
    }
}

impl Check for Path {
    fn check(&self) -> Result<(), Invalid> {
        for (i, stamped) in self.poses.iter().enumerate() {
            pose(&format!("poses[{i}].pose"), &stamped.pose)?;
        }
        Ok(())
    }
}
