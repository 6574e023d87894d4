//! Lidar and radar points as `foxglove.PointCloud`.

use foxglove::messages::packed_element_field::NumericType;
use foxglove::messages::{PackedElementField, PointCloud as Shown, Pose, Quaternion};
use swerve_core::Time;
use swerve_geom::{Point, Transform, math};
use swerve_msg::{PointCloud, RadarScan};

use crate::form::{frame_of, timestamp, vector};

/// Frame of any sensor.
#[derive(Clone, Copy, Debug)]
pub struct Sensor;

/// Motion of the sensor up to the stamp: instants, the last of which is the stamp, with the sensor's pose relative
/// to its pose at the stamp.
pub(crate) type Motion = Vec<(Time, Transform<Sensor, Sensor>)>;

/// Bytes per lidar point: three coordinates, ring, intensity (0 to 255), and padding.
const STRIDE: usize = 16;

/// Converts one lidar turn. Compensates the motion during the turn: points are given relative to the sensor's pose
/// at the stamp.
pub(crate) fn lidar(sensor: &str, cloud: &PointCloud, motion: &Motion) -> Option<Shown> {
    cloud.check().ok()?;
    let moves = Moves::new(cloud.stamp, motion);
    let mut data = Vec::with_capacity(STRIDE * cloud.len());
    for k in 0..cloud.len() {
        let point = cloud.get(k)?;
        for number in moves.moved(point.place_m, point.time_offset_s) {
            data.extend(number.to_le_bytes());
        }
        data.extend(point.ring.to_le_bytes());
        data.extend([(255.0 * point.intensity).round() as u8, 0]);
    }
    let small = |name: &str, offset, kind: NumericType| PackedElementField {
        name: name.into(),
        offset,
        r#type: kind as i32,
    };
    let mut fields = floats(&["x", "y", "z"]);
    fields.push(small("ring", 12, NumericType::Uint16));
    fields.push(small("intensity", 14, NumericType::Uint8));
    Some(shown(sensor, cloud.stamp, fields, STRIDE, data))
}

/// Converts the detections of a radar; without elevation, in its horizontal plane.
pub(crate) fn radar(sensor: &str, scan: &RadarScan) -> Shown {
    let mut data = Vec::with_capacity(24 * scan.detections.len());
    for echo in &scan.detections {
        let (sin, cos) = math::sin_cos(echo.azimuth_rad);
        let (up, level) = math::sin_cos(echo.elevation_rad.unwrap_or(0.0));
        let place = [cos * level, sin * level, up].map(|along| along * echo.range_m);
        let [x, y, z] = place;
        for number in [x, y, z, echo.range_rate_mps, echo.rcs_dbsm, echo.snr_db] {
            data.extend((number as f32).to_le_bytes());
        }
    }
    let fields = floats(&["x", "y", "z", "range_rate_mps", "rcs_dbsm", "snr_db"]);
    shown(sensor, scan.stamp, fields, 24, data)
}

fn floats(names: &[&str]) -> Vec<PackedElementField> {
    let field = |(k, name): (usize, &&str)| PackedElementField {
        name: (*name).to_owned(),
        offset: 4 * k as u32,
        r#type: NumericType::Float32 as i32,
    };
    names.iter().enumerate().map(field).collect()
}

fn shown(sensor: &str, stamp: Time, fields: Vec<PackedElementField>, stride: usize, data: Vec<u8>) -> Shown {
    let identity = Quaternion { x: 0.0, y: 0.0, z: 0.0, w: 1.0 };
    Shown {
        timestamp: Some(timestamp(stamp)),
        frame_id: frame_of(sensor),
        pose: Some(Pose { position: Some(vector([0.0; 3])), orientation: Some(identity) }),
        point_stride: stride as u32,
        fields,
        data: data.into(),
    }
}

/// Motion as 3x4 matrices, by seconds relative to the stamp.
struct Moves(Vec<(f32, [[f32; 4]; 3])>);

impl Moves {
    fn new(stamp: Time, motion: &Motion) -> Self {
        let matrix = |at: &Transform<Sensor, Sensor>| {
            let origin = at.origin();
            let axis = |x, y, z| (*at * Point::<Sensor>::new(x, y, z) - origin).coords;
            let (x, y, z) = (axis(1.0, 0.0, 0.0), axis(0.0, 1.0, 0.0), axis(0.0, 0.0, 1.0));
            let o = origin.coords;
            [[x.x, y.x, z.x, o.x], [x.y, y.y, z.y, o.y], [x.z, y.z, z.z, o.z]]
                .map(|row| row.map(|number| number as f32))
        };
        Self(motion.iter().map(|(t, at)| ((*t - stamp).as_secs() as f32, matrix(at))).collect())
    }

    /// Transforms a point measured `offset_s` after the stamp to the sensor pose at the stamp: linear between the
    /// instants, clamped to the first and last.
    fn moved(&self, place: [f32; 3], offset_s: f32) -> [f32; 3] {
        let after = self.0.partition_point(|(t, _)| *t <= offset_s);
        let at = |k: usize| self.0[k].1.map(|[a, b, c, d]| a * place[0] + b * place[1] + c * place[2] + d);
        match after {
            0 if self.0.is_empty() => place,
            0 => at(0),
            k if k == self.0.len() => at(k - 1),
            k => {
                let (from, to) = (at(k - 1), at(k));
                let share = (offset_s - self.0[k - 1].0) / (self.0[k].0 - self.0[k - 1].0);
                core::array::from_fn(|i| from[i] + (to[i] - from[i]) * share)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::Span;
    use swerve_msg::{LidarPoint, RadarDetection};

    use super::*;

    fn numbers(data: &[u8], stride: usize) -> Vec<[f32; 3]> {
        let of = |bytes: &[u8], k: usize| f32::from_le_bytes(bytes[4 * k..4 * k + 4].try_into().unwrap());
        data.chunks_exact(stride).map(|point| [0, 1, 2].map(|k| of(point, k))).collect()
    }

    #[test]
    fn lidar_points_are_compensated_for_motion() {
        // The sensor drives at 20 m/s along x and turns; the object is 30 m ahead and 5 m to the left of its final
        // position.
        let end = Time::from_ms(2000);
        let thing = Point::<Sensor>::new(30.0, 5.0, 1.0);
        let now_from_then = |before_s: f64| {
            let origin = Point::new(-20.0 * before_s, 0.0, 0.0);
            Transform::<Sensor, Sensor>::from_roll_pitch_yaw(origin, 0.0, 0.0, -0.2 * before_s)
        };
        let steps = (0..=20).rev().map(|k| 0.005 * f64::from(k));
        let motion: Motion = steps.map(|s| (end - Span::from_secs(s), now_from_then(s))).collect();
        let mut cloud = PointCloud { stamp: end, ..PointCloud::default() };
        for k in 0..100 {
            let before_s = 0.001 * f64::from(k);
            let seen = now_from_then(before_s).inverse() * thing;
            let place_m = [seen.coords.x, seen.coords.y, seen.coords.z].map(|metres| metres as f32);
            cloud.push(LidarPoint { place_m, time_offset_s: -before_s as f32, ring: 7, intensity: 0.5 });
        }
        let shown = lidar("roof", &cloud, &motion).unwrap();
        let points = numbers(&shown.data, STRIDE);
        assert_eq!((points.len(), shown.point_stride, shown.frame_id.as_str()), (100, 16, "ego/roof"));
        for point in points {
            for (found, wanted) in point.iter().zip([30.0, 5.0, 1.0]) {
                assert!((found - wanted).abs() < 1e-3, "{point:?}");
            }
        }
        cloud.ring.pop();
        assert!(lidar("roof", &cloud, &motion).is_none(), "arrays of unequal length");
    }

    #[test]
    fn radar_points_match_range_and_angles() {
        let echo = |azimuth_rad, elevation_rad| RadarDetection {
            range_m: 10.0,
            range_rate_mps: -3.0,
            azimuth_rad,
            elevation_rad,
            rcs_dbsm: 10.0,
            snr_db: 20.0,
        };
        let quarter = core::f64::consts::FRAC_PI_2;
        let detections = vec![echo(0.0, None), echo(quarter, None), echo(0.0, Some(quarter))];
        let shown = radar("front", &RadarScan { stamp: Time::ZERO, detections });
        let round = |place: [f32; 3]| place.map(f32::round);
        let wanted = [[10.0, 0.0, 0.0], [0.0, 10.0, 0.0], [0.0, 0.0, 10.0]];
        assert_eq!(numbers(&shown.data, 24).into_iter().map(round).collect::<Vec<_>>(), wanted);
    }
}
