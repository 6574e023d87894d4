//! Conversion of point clouds.

use swerve_msg::{LidarPoint, PointCloud};

use super::{ConvertError, Epoch};
use crate::msg::sensor_msgs::field_bytes;
use crate::msg::sensor_msgs::{PointCloud2, PointField};

/// Maximum intensity in ROS point clouds.
const INTENSITY_MAX: f32 = 255.0;
/// Bytes per written point: x, y, z, intensity, ring, two of padding, time.
const POINT_BYTES: usize = 24;
/// Maximum duration of a sweep, seconds; larger time offsets are from another clock.
const SWEEP_MAX_S: f64 = 1.0;

/// Converts a sweep to `sensor_msgs/PointCloud2` with the fields `x y z intensity ring time`; the time is in
/// seconds relative to the stamp, as in Velodyne's driver.
pub fn cloud_to_ros(cloud: &PointCloud, epoch: Epoch, frame_id: &str) -> PointCloud2 {
    let field =
        |name: &str, offset, datatype| PointField { name: name.to_owned(), offset, datatype, count: 1 };
    let points = (0..cloud.len()).map_while(|i| cloud.get(i));
    let mut data = Vec::with_capacity(cloud.len() * POINT_BYTES);
    for point in points {
        for number in point.place_m {
            data.extend_from_slice(&number.to_le_bytes());
        }
        data.extend_from_slice(&(point.intensity * INTENSITY_MAX).to_le_bytes());
        data.extend_from_slice(&point.ring.to_le_bytes());
        data.extend_from_slice(&[0, 0]);
        data.extend_from_slice(&point.time_offset_s.to_le_bytes());
    }
    PointCloud2 {
        header: epoch.header(cloud.stamp, frame_id),
        height: 1,
        width: (data.len() / POINT_BYTES) as u32,
        fields: vec![
            field("x", 0, PointField::FLOAT32),
            field("y", 4, PointField::FLOAT32),
            field("z", 8, PointField::FLOAT32),
            field("intensity", 12, PointField::FLOAT32),
            field("ring", 16, PointField::UINT16),
            field("time", 20, PointField::FLOAT32),
        ],
        is_bigendian: false,
        point_step: POINT_BYTES as u32,
        row_step: data.len() as u32,
        data,
        is_dense: true,
    }
}

/// Position and type of a field within a point.
#[derive(Clone, Copy)]
struct Reader {
    offset: usize,
    datatype: u8,
    big_endian: bool,
}

impl Reader {
    fn find(cloud: &PointCloud2, names: &[&str]) -> Option<Self> {
        let field = cloud.fields.iter().find(|field| names.contains(&field.name.as_str()))?;
        Some(Self { offset: field.offset as usize, datatype: field.datatype, big_endian: cloud.is_bigendian })
    }

    /// Reads the number from the bytes of one point; the message check guarantees that it is within them.
    fn read(self, point: &[u8]) -> f64 {
        let n = field_bytes(self.datatype).unwrap_or(0) as usize;
        let mut bytes = [0; 8];
        let Some(found) = point.get(self.offset..self.offset + n) else { return f64::NAN };
        for (i, byte) in found.iter().enumerate() {
            bytes[if self.big_endian { n - 1 - i } else { i }] = *byte;
        }
        let [a, b, c, d, ..] = bytes;
        match self.datatype {
            PointField::INT8 => f64::from(a as i8),
            PointField::UINT8 => f64::from(a),
            PointField::INT16 => f64::from(i16::from_le_bytes([a, b])),
            PointField::UINT16 => f64::from(u16::from_le_bytes([a, b])),
            PointField::INT32 => f64::from(i32::from_le_bytes([a, b, c, d])),
            PointField::UINT32 => f64::from(u32::from_le_bytes([a, b, c, d])),
            PointField::FLOAT32 => f64::from(f32::from_le_bytes([a, b, c, d])),
            _ => f64::from_le_bytes(bytes),
        }
    }
}

/// Encoding of the measurement time by different drivers.
enum PointTime {
    None,
    /// Seconds from the stamp: `time` (Velodyne).
    Seconds(Reader),
    /// Nanoseconds from the stamp: `t` (Ouster), `time_stamp` (Autoware).
    Nanoseconds(Reader),
    /// Seconds since the epoch of the clock: `timestamp` (Hesai, RoboSense).
    Absolute(Reader, f64),
}

impl PointTime {
    fn new(cloud: &PointCloud2) -> Self {
        let is_float = |r: &Reader| matches!(r.datatype, PointField::FLOAT32 | PointField::FLOAT64);
        if let Some(reader) = Reader::find(cloud, &["timestamp"]).filter(is_float) {
            return Self::Absolute(reader, cloud.header.stamp.ns() as f64 * 1e-9);
        }
        match Reader::find(cloud, &["time", "t", "time_stamp", "timestamp"]) {
            None => Self::None,
            Some(reader) if is_float(&reader) => Self::Seconds(reader),
            Some(reader) => Self::Nanoseconds(reader),
        }
    }

    /// Time relative to the stamp, seconds; zero if implausible.
    fn offset_s(&self, point: &[u8]) -> f32 {
        let seconds = match self {
            Self::None => 0.0,
            Self::Seconds(reader) => reader.read(point),
            Self::Nanoseconds(reader) => reader.read(point) * 1e-9,
            Self::Absolute(reader, stamp_s) => reader.read(point) - stamp_s,
        };
        if seconds.abs() <= SWEEP_MAX_S { seconds as f32 } else { 0.0 }
    }
}

/// Converts a validated message, in the sensor's frame. Skips points without coordinates (NaN for a missing return)
/// or with all coordinates zero.
///
/// # Errors
/// If there are no coordinates in single or double precision.
pub fn cloud_from_ros(cloud: &PointCloud2, epoch: Epoch) -> Result<PointCloud, ConvertError> {
    let place = |name: &'static str| {
        Reader::find(cloud, &[name])
            .filter(|r| matches!(r.datatype, PointField::FLOAT32 | PointField::FLOAT64))
            .ok_or(ConvertError::Field(name))
    };
    let place = [place("x")?, place("y")?, place("z")?];
    let intensity = Reader::find(cloud, &["intensity", "i", "reflectivity"]);
    let ring = Reader::find(cloud, &["ring", "channel", "line"]);
    let time = PointTime::new(cloud);
    let (step, row_step) = ((cloud.point_step as usize).max(1), (cloud.row_step as usize).max(1));
    let rows = cloud.data.chunks_exact(row_step).take(cloud.height as usize);
    let mut ours = PointCloud { stamp: epoch.time(cloud.header.stamp), ..PointCloud::default() };
    for point in rows.flat_map(|row| row.chunks_exact(step).take(cloud.width as usize)) {
        let place_m = place.map(|axis| axis.read(point) as f32);
        if !place_m.iter().all(|m| m.is_finite()) || place_m == [0.0; 3] {
            continue;
        }
        let strength = intensity.map_or(0.0, |reader| reader.read(point) as f32 / INTENSITY_MAX);
        ours.push(LidarPoint {
            place_m,
            intensity: if strength.is_finite() { strength.clamp(0.0, 1.0) } else { 0.0 },
            ring: ring.map_or(0, |reader| reader.read(point) as u16),
            time_offset_s: time.offset_s(point),
        });
    }
    Ok(ours)
}
