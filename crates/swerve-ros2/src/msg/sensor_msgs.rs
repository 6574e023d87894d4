//! `sensor_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::Matrix;
use super::geometry_msgs::{Quaternion, Vector3};
use super::std_msgs::Header;

/// Pixels, row by row from the top left; `step` is bytes of a row.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Image {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    pub encoding: String,
    pub is_bigendian: u8,
    pub step: u32,
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

/// A file of one picture: `format` says `jpeg` or `png`.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct CompressedImage {
    pub header: Header,
    pub format: String,
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

/// The part of the sensor that was read; all zero for the whole.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct RegionOfInterest {
    pub x_offset: u32,
    pub y_offset: u32,
    pub height: u32,
    pub width: u32,
    pub do_rectify: bool,
}

/// Calibration of a camera: `d` distortion, `k` intrinsics, `r` rectification, `p` projection.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct CameraInfo {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    pub distortion_model: String,
    pub d: Vec<f64>,
    pub k: Matrix<9>,
    pub r: Matrix<9>,
    pub p: Matrix<12>,
    pub binning_x: u32,
    pub binning_y: u32,
    pub roi: RegionOfInterest,
}

/// Where in a point's bytes a quantity lies.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PointField {
    pub name: String,
    pub offset: u32,
    pub datatype: u8,
    pub count: u32,
}

impl PointField {
    pub const INT8: u8 = 1;
    pub const UINT8: u8 = 2;
    pub const INT16: u8 = 3;
    pub const UINT16: u8 = 4;
    pub const INT32: u8 = 5;
    pub const UINT32: u8 = 6;
    pub const FLOAT32: u8 = 7;
    pub const FLOAT64: u8 = 8;
}

/// Points as bytes, `point_step` each, `row_step` a row.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PointCloud2 {
    pub header: Header,
    pub height: u32,
    pub width: u32,
    pub fields: Vec<PointField>,
    pub is_bigendian: bool,
    pub point_step: u32,
    pub row_step: u32,
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
    pub is_dense: bool,
}

/// Orientation, angular velocity (rad/s), specific force (m/s²). A covariance that starts with -1 says that the
/// quantity is not measured; one that is all zero that it is unknown.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct Imu {
    pub header: Header,
    pub orientation: Quaternion,
    pub orientation_covariance: Matrix<9>,
    pub angular_velocity: Vector3,
    pub angular_velocity_covariance: Matrix<9>,
    pub linear_acceleration: Vector3,
    pub linear_acceleration_covariance: Matrix<9>,
}

/// Which satellites, and whether there is a fix: -1 none, 0 plain, 1 satellite based augmentation, 2 ground based.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct NavSatStatus {
    pub status: i8,
    pub service: u16,
}

impl NavSatStatus {
    pub const NO_FIX: i8 = -1;
    pub const FIX: i8 = 0;
    pub const SERVICE_GPS: u16 = 1;
}

/// A place on WGS 84, degrees and metres; covariance of east, north, up, m². The altitude may be not-a-number.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct NavSatFix {
    pub header: Header,
    pub status: NavSatStatus,
    pub latitude: f64,
    pub longitude: f64,
    pub altitude: f64,
    pub position_covariance: Matrix<9>,
    pub position_covariance_type: u8,
}

impl NavSatFix {
    pub const COVARIANCE_TYPE_UNKNOWN: u8 = 0;
    pub const COVARIANCE_TYPE_DIAGONAL_KNOWN: u8 = 2;
}
