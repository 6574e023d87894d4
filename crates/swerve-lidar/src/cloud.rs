//! Points of one turn, in memory of the caller.

use crate::spec::LidarSpec;

/// Points of one turn: arrays with room for every shot, of which the first `len` elements are points.
#[derive(Clone, PartialEq, Debug, Default)]
pub struct Cloud {
    /// Number of points.
    pub len: usize,
    /// x coordinate (forward), metres, in the sensor frame at the instant of the shot.
    pub x_m: Vec<f32>,
    /// y coordinate (left), metres.
    pub y_m: Vec<f32>,
    /// z coordinate (up), metres.
    pub z_m: Vec<f32>,
    /// Intensity, 0 to 1.
    pub intensity: Vec<f32>,
    /// Index of the beam in [`LidarSpec::beams`].
    pub ring: Vec<u16>,
    /// Time of the shot since the start of the turn, seconds.
    pub offset_s: Vec<f32>,
    /// Ground truth: instance id, 0 for objects without an id. Empty if truth is not requested.
    pub instance: Vec<u32>,
    /// Ground truth: Cityscapes class id. Empty if truth is not requested.
    pub class: Vec<u8>,
}

impl Cloud {
    /// Cloud with room for a turn.
    pub fn new(spec: &LidarSpec, with_truth: bool) -> Self {
        let shots = spec.beams.len() * spec.columns as usize;
        let truth = if with_truth { shots } else { 0 };
        Self {
            len: 0,
            x_m: vec![0.0; shots],
            y_m: vec![0.0; shots],
            z_m: vec![0.0; shots],
            intensity: vec![0.0; shots],
            ring: vec![0; shots],
            offset_s: vec![0.0; shots],
            instance: vec![0; truth],
            class: vec![0; truth],
        }
    }

    /// Position of a point, metres.
    ///
    /// # Panics
    /// If the index is not below the length of the arrays.
    pub fn point_m(&self, index: usize) -> [f32; 3] {
        [self.x_m[index], self.y_m[index], self.z_m[index]]
    }

    /// Mutable views of the arrays, for a turn.
    pub fn as_mut(&mut self) -> CloudMut<'_> {
        let truth = TruthMut { instance: &mut self.instance, class: &mut self.class };
        let truth = if truth.instance.is_empty() && truth.class.is_empty() { None } else { Some(truth) };
        CloudMut {
            len: &mut self.len,
            x_m: &mut self.x_m,
            y_m: &mut self.y_m,
            z_m: &mut self.z_m,
            intensity: &mut self.intensity,
            ring: &mut self.ring,
            offset_s: &mut self.offset_s,
            truth,
        }
    }
}

/// Output buffers of a turn: any memory that can be borrowed, including shared memory.
///
/// All arrays have the same length. The first `len` elements are points; new points are appended.
#[derive(Debug)]
pub struct CloudMut<'a> {
    /// Number of points.
    pub len: &'a mut usize,
    /// See [`Cloud`].
    pub x_m: &'a mut [f32],
    /// See [`Cloud`].
    pub y_m: &'a mut [f32],
    /// See [`Cloud`].
    pub z_m: &'a mut [f32],
    /// See [`Cloud`].
    pub intensity: &'a mut [f32],
    /// See [`Cloud`].
    pub ring: &'a mut [u16],
    /// See [`Cloud`].
    pub offset_s: &'a mut [f32],
    /// Ground truth, available only in simulation; written if present.
    pub truth: Option<TruthMut<'a>>,
}

/// Output buffers for the ground truth of each point.
#[derive(Debug)]
pub struct TruthMut<'a> {
    /// See [`Cloud`].
    pub instance: &'a mut [u32],
    /// See [`Cloud`].
    pub class: &'a mut [u8],
}

/// Array too small for the points of a turn.
#[derive(Clone, PartialEq, Eq, Debug, thiserror::Error)]
#[error("the array `{array}` of the cloud has {len} elements, {expected} may be needed")]
pub struct CloudSizeError {
    /// Name of the array.
    pub array: &'static str,
    /// Number of its elements.
    pub len: usize,
    /// Smallest number of elements required.
    pub expected: usize,
}

impl CloudMut<'_> {
    /// Checks that every array has room for this many more points.
    pub(crate) fn check(&self, more: usize) -> Result<(), CloudSizeError> {
        let expected = self.len.saturating_add(more);
        let truth = self.truth.as_ref();
        let sizes = [
            ("x_m", self.x_m.len()),
            ("y_m", self.y_m.len()),
            ("z_m", self.z_m.len()),
            ("intensity", self.intensity.len()),
            ("ring", self.ring.len()),
            ("offset_s", self.offset_s.len()),
            ("truth.instance", truth.map_or(expected, |t| t.instance.len())),
            ("truth.class", truth.map_or(expected, |t| t.class.len())),
        ];
        match sizes.into_iter().find(|(_, len)| *len < expected) {
            Some((array, len)) => Err(CloudSizeError { array, len, expected }),
            None => Ok(()),
        }
    }

    /// Appends the points of a cloud with truth; the caller ensures the room.
    pub(crate) fn append(&mut self, cloud: &Cloud) {
        let new = *self.len..*self.len + cloud.len;
        self.x_m[new.clone()].copy_from_slice(&cloud.x_m[..cloud.len]);
        self.y_m[new.clone()].copy_from_slice(&cloud.y_m[..cloud.len]);
        self.z_m[new.clone()].copy_from_slice(&cloud.z_m[..cloud.len]);
        self.intensity[new.clone()].copy_from_slice(&cloud.intensity[..cloud.len]);
        self.ring[new.clone()].copy_from_slice(&cloud.ring[..cloud.len]);
        self.offset_s[new.clone()].copy_from_slice(&cloud.offset_s[..cloud.len]);
        if let Some(truth) = &mut self.truth {
            truth.instance[new.clone()].copy_from_slice(&cloud.instance[..cloud.len]);
            truth.class[new.clone()].copy_from_slice(&cloud.class[..cloud.len]);
        }
        *self.len = new.end;
    }

    /// Appends a point; the caller ensures the room.
    pub(crate) fn push(&mut self, point: &Point) {
        let at = *self.len;
        [self.x_m[at], self.y_m[at], self.z_m[at]] = point.at_m;
        (self.intensity[at], self.ring[at], self.offset_s[at]) =
            (point.intensity, point.ring, point.offset_s);
        if let Some(truth) = &mut self.truth {
            (truth.instance[at], truth.class[at]) = (point.instance, point.class);
        }
        *self.len = at + 1;
    }
}

/// Single point.
pub(crate) struct Point {
    pub(crate) at_m: [f32; 3],
    pub(crate) intensity: f32,
    pub(crate) ring: u16,
    pub(crate) offset_s: f32,
    pub(crate) instance: u32,
    pub(crate) class: u8,
}
