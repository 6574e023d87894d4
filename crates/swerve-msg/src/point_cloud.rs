//! Lidar point clouds.

use core::fmt;

use serde::{Deserialize, Serialize};
use swerve_core::Time;

use crate::Packed;
use crate::block::Memory;

/// One sweep of a lidar as a structure of arrays of equal length.
///
/// Positions are in the sensor frame at the instant of each point's measurement, stamp plus `time_offset_s`;
/// consumers compensate the motion during the sweep. The cloud owns its memory, which [`PointCloud::clear`] keeps
/// for reuse.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct PointCloud {
    /// Reference instant of the time offsets.
    pub stamp: Time,
    /// Forward, metres.
    pub x_m: Packed<f32>,
    /// To the left, metres.
    pub y_m: Packed<f32>,
    /// Up, metres.
    pub z_m: Packed<f32>,
    /// Intensity of the return, 0 to 1.
    pub intensity: Packed<f32>,
    /// Index of the beam, from 0 at the lowest.
    pub ring: Packed<u16>,
    /// Time of measurement relative to the stamp, seconds.
    pub time_offset_s: Packed<f32>,
}

/// One point of a [`PointCloud`].
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct LidarPoint {
    /// Forward, left, up, metres.
    pub place_m: [f32; 3],
    /// Intensity of the return, 0 to 1.
    pub intensity: f32,
    /// Index of the beam, from 0 at the lowest.
    pub ring: u16,
    /// Time of measurement relative to the stamp, seconds.
    pub time_offset_s: f32,
}

impl PointCloud {
    /// Allocates a cloud of `points` points, all zero, in `memory`.
    pub fn in_memory(memory: Option<&dyn Memory>, points: usize) -> Self {
        let numbers = || Packed::in_memory(memory, points);
        Self {
            stamp: Time::ZERO,
            x_m: numbers(),
            y_m: numbers(),
            z_m: numbers(),
            intensity: numbers(),
            ring: Packed::in_memory(memory, points),
            time_offset_s: numbers(),
        }
    }

    /// Ends writing to shared memory.
    ///
    /// # Errors
    /// As [`Packed::seal`].
    pub fn seal(&mut self) -> Result<(), String> {
        let Self { x_m, y_m, z_m, intensity, time_offset_s, ring, .. } = self;
        [x_m, y_m, z_m, intensity, time_offset_s].into_iter().try_for_each(Packed::seal)?;
        ring.seal()
    }

    /// Number of points.
    pub fn len(&self) -> usize {
        self.x_m.len()
    }

    /// Returns true if there are no points.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Removes all points and keeps the memory.
    pub fn clear(&mut self) {
        for array in [&mut self.x_m, &mut self.y_m, &mut self.z_m] {
            array.clear();
        }
        self.intensity.clear();
        self.ring.clear();
        self.time_offset_s.clear();
    }

    /// Appends a point.
    pub fn push(&mut self, point: LidarPoint) {
        self.x_m.push(point.place_m[0]);
        self.y_m.push(point.place_m[1]);
        self.z_m.push(point.place_m[2]);
        self.intensity.push(point.intensity);
        self.ring.push(point.ring);
        self.time_offset_s.push(point.time_offset_s);
    }

    /// The point at `index`; `None` if any array is too short.
    pub fn get(&self, index: usize) -> Option<LidarPoint> {
        Some(LidarPoint {
            place_m: [*self.x_m.get(index)?, *self.y_m.get(index)?, *self.z_m.get(index)?],
            intensity: *self.intensity.get(index)?,
            ring: *self.ring.get(index)?,
            time_offset_s: *self.time_offset_s.get(index)?,
        })
    }

    /// Checks that all arrays have the same length.
    ///
    /// # Errors
    /// If they do not; data from a log or another process may be malformed.
    pub fn check(&self) -> Result<(), PointCloudError> {
        let lengths = [
            ("y_m", self.y_m.len()),
            ("z_m", self.z_m.len()),
            ("intensity", self.intensity.len()),
            ("ring", self.ring.len()),
            ("time_offset_s", self.time_offset_s.len()),
        ];
        match lengths.into_iter().find(|(_, found)| *found != self.len()) {
            Some((array, found)) => Err(PointCloudError { array, found, wanted: self.len() }),
            None => Ok(()),
        }
    }
}

/// The arrays of a point cloud differ in length.
#[derive(Clone, Copy, PartialEq, Eq, Debug)]
pub struct PointCloudError {
    /// First array that differs.
    pub array: &'static str,
    /// Its length.
    pub found: usize,
    /// Length of `x_m`.
    pub wanted: usize,
}

impl fmt::Display for PointCloudError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { array, found, wanted } = self;
        write!(f, "a point cloud has {found} numbers in `{array}` and {wanted} in `x_m`")
    }
}

impl core::error::Error for PointCloudError {}

#[cfg(test)]
mod tests {
    use swerve_core::digest_of;

    use super::*;

    fn cloud(n: u16) -> PointCloud {
        let mut cloud = PointCloud { stamp: Time::from_ms(100), ..PointCloud::default() };
        for i in 0..n {
            let x = f32::from(i);
            let place_m = [x, -x, 0.5 * x];
            cloud.push(LidarPoint { place_m, intensity: 0.25, ring: i % 32, time_offset_s: 1e-5 * x });
        }
        cloud
    }

    #[test]
    fn point_clouds_round_trip_through_cbor() {
        let cloud = cloud(5000);
        let mut cbor = Vec::new();
        ciborium::into_writer(&cloud, &mut cbor).unwrap();
        assert!(cbor.len() < 5000 * 22 + 200, "{}", cbor.len());
        let back: PointCloud = ciborium::from_reader(&cbor[..]).unwrap();
        assert_eq!((digest_of(&back), &back), (digest_of(&cloud), &cloud));
        assert_eq!((back.len(), back.get(7).unwrap().place_m[1], back.get(5000)), (5000, -7.0, None));
    }

    #[test]
    fn point_cloud_clear_keeps_the_memory() {
        let mut cloud = cloud(100);
        let before = cloud.ring.as_ptr();
        cloud.clear();
        assert!(cloud.is_empty());
        cloud.push(LidarPoint::default());
        assert_eq!((cloud.len(), cloud.ring.as_ptr(), cloud.check()), (1, before, Ok(())));
    }

    #[test]
    fn point_cloud_check_names_the_short_array() {
        let mut cloud = cloud(10);
        cloud.ring.pop();
        assert_eq!(
            cloud.check().unwrap_err().to_string(),
            "a point cloud has 9 numbers in `ring` and 10 in `x_m`"
        );
    }
}
