//! The messages that cross the bridge, one module for each ROS package.
//!
//! Names, order and types of the fields are those of the packages' `.msg` files (Jazzy; Humble to Lyrical have
//! the same bytes): they are the wire format. Units are SI and radians unless a struct says otherwise.
//! Runs of bytes are `serde_bytes`, which makes a megabyte a copy instead of a million calls.

pub mod autoware_control_msgs;
pub mod autoware_perception_msgs;
pub mod autoware_planning_msgs;
pub mod autoware_vehicle_msgs;
pub mod builtin_interfaces;
pub mod ds_dbw_msgs;
pub mod geometry_msgs;
pub mod nav_msgs;
pub mod raptor_dbw_msgs;
pub mod rosgraph_msgs;
pub mod sensor_msgs;
pub mod std_msgs;
pub mod tf2_msgs;
pub mod visualization_msgs;

mod matrix;

pub use matrix::Matrix;
