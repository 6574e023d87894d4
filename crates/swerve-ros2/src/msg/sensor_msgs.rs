//! `sensor_msgs`.

#![expect(missing_docs, reason = "fields are named and ordered as the ROS definition has them")]

use serde::{Deserialize, Serialize};

use super::Matrix;
use super::geometry_msgs::{Quaternion, Vector3, quaternion};
use super::std_msgs::Header;
use crate::check::parts::{ACCEL_MAX_MPS2, TURN_MAX_RADPS, variances, variances_or_none};
use crate::check::{Check, IMAGE_SIDE_MAX, Invalid, POINTS_MAX, Why, invalid, within};

/// An image, row by row from the top left; `step` is the length of a row, bytes.
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

/// A compressed image; `format` contains `jpeg` or `png`.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct CompressedImage {
    pub header: Header,
    pub format: String,
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}

/// Part of the sensor that was read; all zero for the whole.
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

/// A field of a point: name, offset and type.
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

/// A point cloud as bytes: `point_step` per point, `row_step` per row.
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

/// Orientation, angular velocity (rad/s), specific force (m/s²). A covariance that starts with -1 marks a quantity
/// that is not measured; all zero marks an unknown covariance.
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

/// Satellite systems and fix: -1 none, 0 plain, 1 satellite-based augmentation, 2 ground-based augmentation.
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

/// A position on WGS 84, degrees and metres; covariance of east, north, up, m². The altitude may be NaN.
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

impl Check for Image {
    fn check(&self) -> Result<(), Invalid> {
        for (field, side) in [("height", self.height), ("width", self.width)] {
            within(field, f64::from(side), 1.0, f64::from(IMAGE_SIDE_MAX))?;
        }
        let Some(bytes) = bytes_per_pixel(&self.encoding) else {
            return invalid("encoding", Why::Name(self.encoding.chars().take(32).collect()));
        };
        let row = u64::from(self.width) * u64::from(bytes);
        if u64::from(self.step) < row {
            return invalid("step", Why::Length { found: u64::from(self.step), wanted: row });
        }
        let (found, wanted) = (self.data.len() as u64, u64::from(self.step) * u64::from(self.height));
        if found != wanted {
            return invalid("data", Why::Length { found, wanted });
        }
        Ok(())
    }

    fn fit(&mut self) {
        (self.width, self.height, self.step, self.is_bigendian) = (3, 2, 12, 0);
        self.encoding = "rgb8".to_owned();
        self.data = (0..24).collect();
    }
}

impl Check for CompressedImage {
    fn check(&self) -> Result<(), Invalid> {
        if self.data.is_empty() {
            return invalid("data", Why::Length { found: 0, wanted: 1 });
        }
        if self.format.is_empty() { invalid("format", Why::Name(String::new())) } else { Ok(()) }
    }
}

impl Check for CameraInfo {
    fn check(&self) -> Result<(), Invalid> {
        for (field, side) in [("height", self.height), ("width", self.width)] {
            within(field, f64::from(side), 1.0, f64::from(IMAGE_SIDE_MAX))?;
        }
        let wanted = match self.distortion_model.as_str() {
            "" => Some(0),
            "plumb_bob" => Some(5),
            "rational_polynomial" => Some(8),
            "equidistant" => Some(4),
            _ => None,
        };
        match wanted {
            None => {
                return invalid(
                    "distortion_model",
                    Why::Name(self.distortion_model.chars().take(32).collect()),
                );
            }
            Some(wanted) if !self.d.is_empty() && self.d.len() != wanted => {
                return invalid("d", Why::Length { found: self.d.len() as u64, wanted: wanted as u64 });
            }
            Some(_) => {}
        }
        // An uncalibrated camera has zeros here; a negative focal length is invalid.
        within("k[0]", self.k.0[0], 0.0, 1e6)?;
        within("k[4]", self.k.0[4], 0.0, 1e6)
    }

    fn fit(&mut self) {
        self.distortion_model = "plumb_bob".to_owned();
        self.d = vec![-0.25, 0.125, 0.0, 0.5, 0.0625];
    }
}

impl Check for PointCloud2 {
    fn check(&self) -> Result<(), Invalid> {
        let points = u64::from(self.height) * u64::from(self.width);
        if points > POINTS_MAX {
            return invalid("width", Why::Length { found: points, wanted: POINTS_MAX });
        }
        let row = u64::from(self.width) * u64::from(self.point_step);
        if u64::from(self.row_step) < row {
            return invalid("row_step", Why::Length { found: u64::from(self.row_step), wanted: row });
        }
        let (found, wanted) = (self.data.len() as u64, u64::from(self.row_step) * u64::from(self.height));
        if found != wanted {
            return invalid("data", Why::Length { found, wanted });
        }
        let mut taken: Vec<(u64, u64, &str)> = Vec::new();
        if self.fields.len() > 64 {
            return invalid("fields", Why::Length { found: self.fields.len() as u64, wanted: 64 });
        }
        for (i, field) in self.fields.iter().enumerate() {
            let at = |part: &str| format!("fields[{i}].{part}");
            let Some(bytes) = field_bytes(field.datatype) else {
                return invalid(at("datatype"), Why::NoSuchValue(i64::from(field.datatype)));
            };
            let start = u64::from(field.offset);
            let end = start + u64::from(bytes) * u64::from(field.count.max(1));
            if end > u64::from(self.point_step) {
                return invalid(at("offset"), Why::Length { found: end, wanted: u64::from(self.point_step) });
            }
            if taken.iter().any(|(_, _, name)| *name == field.name) {
                return invalid(at("name"), Why::Twice);
            }
            if let Some((_, _, other)) = taken.iter().find(|(s, e, _)| start < *e && *s < end) {
                return invalid(at("offset"), Why::Overlaps((*other).to_owned()));
            }
            taken.push((start, end, &field.name));
        }
        Ok(())
    }

    fn fit(&mut self) {
        self.fit_to(4, 2);
    }
}

impl Check for Imu {
    fn check(&self) -> Result<(), Invalid> {
        if self.orientation_covariance.0[0] != -1.0 {
            // Some sensors without orientation send all zeros without the -1.
            let q = &self.orientation;
            if [q.x, q.y, q.z, q.w] != [0.0; 4] {
                quaternion("orientation", q)?;
            }
        }
        variances_or_none("orientation_covariance", &self.orientation_covariance.0)?;
        variances_or_none("angular_velocity_covariance", &self.angular_velocity_covariance.0)?;
        variances_or_none("linear_acceleration_covariance", &self.linear_acceleration_covariance.0)?;
        let (w, a) = (&self.angular_velocity, &self.linear_acceleration);
        for (axis, v) in [("x", w.x), ("y", w.y), ("z", w.z)] {
            within(&format!("angular_velocity.{axis}"), v, -TURN_MAX_RADPS, TURN_MAX_RADPS)?;
        }
        for (axis, v) in [("x", a.x), ("y", a.y), ("z", a.z)] {
            within(&format!("linear_acceleration.{axis}"), v, -ACCEL_MAX_MPS2, ACCEL_MAX_MPS2)?;
        }
        Ok(())
    }
}

impl Check for NavSatFix {
    const MAY_BE_NAN: &[&str] = &["altitude"];

    fn check(&self) -> Result<(), Invalid> {
        within("status.status", f64::from(self.status.status), -2.0, 2.0)?;
        within("latitude", self.latitude, -90.0, 90.0)?;
        within("longitude", self.longitude, -180.0, 180.0)?;
        if !self.altitude.is_nan() {
            within("altitude", self.altitude, -1e3, 1e5)?;
        }
        within("position_covariance_type", f64::from(self.position_covariance_type), 0.0, 3.0)?;
        variances("position_covariance", &self.position_covariance.0, 3)
    }
}

/// Bytes per pixel of an encoding in `sensor_msgs/image_encodings`; `None` for others.
pub(crate) fn bytes_per_pixel(encoding: &str) -> Option<u32> {
    Some(match encoding {
        "mono8" | "8UC1" | "8SC1" => 1,
        "bayer_rggb8" | "bayer_bggr8" | "bayer_gbrg8" | "bayer_grbg8" => 1,
        "mono16" | "16UC1" | "16SC1" | "8UC2" | "yuv422" | "yuv422_yuy2" | "uyvy" | "yuyv" => 2,
        "bayer_rggb16" | "bayer_bggr16" | "bayer_gbrg16" | "bayer_grbg16" => 2,
        "rgb8" | "bgr8" | "8UC3" => 3,
        "rgba8" | "bgra8" | "8UC4" | "32FC1" | "32SC1" => 4,
        "rgb16" | "bgr16" | "16UC3" => 6,
        "rgba16" | "bgra16" | "16UC4" | "64FC1" | "32FC2" => 8,
        "32FC3" => 12,
        _ => return None,
    })
}

/// Bytes per number of a point field's type.
pub(crate) fn field_bytes(datatype: u8) -> Option<u32> {
    use self::PointField as F;
    Some(match datatype {
        F::INT8 | F::UINT8 => 1,
        F::INT16 | F::UINT16 => 2,
        F::INT32 | F::UINT32 | F::FLOAT32 => 4,
        F::FLOAT64 => 8,
        _ => return None,
    })
}

impl PointCloud2 {
    /// Resizes to `height` rows of `width` points with position, intensity and ring; 18 bytes per point.
    fn fit_to(&mut self, width: u32, height: u32) {
        let field =
            |name: &str, offset, datatype| PointField { name: name.to_owned(), offset, datatype, count: 1 };
        self.fields = vec![
            field("x", 0, PointField::FLOAT32),
            field("y", 4, PointField::FLOAT32),
            field("z", 8, PointField::FLOAT32),
            field("intensity", 12, PointField::FLOAT32),
            field("ring", 16, PointField::UINT16),
        ];
        (self.width, self.height, self.point_step, self.row_step) = (width, height, 18, 18 * width);
        self.is_bigendian = false;
        self.data = (0..width * height)
            .flat_map(|i| {
                let numbers = [1.0, 2.0, 3.0, 0.5].map(|n| n + 0.25 * (i % 64) as f32);
                let place = numbers.into_iter().flat_map(f32::to_le_bytes);
                place.chain(((i % 32) as u16).to_le_bytes()).collect::<Vec<u8>>()
            })
            .collect();
    }
}

/// A cloud of `points` points, for tests with payloads of many datagrams.
pub fn large_cloud(points: u32) -> PointCloud2 {
    let mut cloud = PointCloud2 { is_dense: true, ..PointCloud2::default() };
    cloud.header.frame_id = "lidar".to_owned();
    cloud.fit_to(points, 1);
    cloud
}
