//! ROS messages, one module per package.
//!
//! Names, order and types of the fields are those of the packages' `.msg` files (Jazzy; identical on the wire from
//! Humble to Lyrical): they define the wire format. Units are SI and radians unless a struct states otherwise. Byte
//! arrays use `serde_bytes`, which copies a megabyte at once instead of byte by byte.

pub mod ackermann_msgs;
pub mod autoware_control_msgs;
pub mod autoware_perception_msgs;
pub mod autoware_planning_msgs;
pub mod autoware_vehicle_msgs;
pub mod builtin_interfaces;
pub mod carla_msgs;
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
