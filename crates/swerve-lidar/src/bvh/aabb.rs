//! Axis-aligned bounding boxes.

/// Axis-aligned bounding box.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Aabb {
    /// Smallest coordinates.
    pub(crate) min: [f32; 3],
    /// Largest coordinates.
    pub(crate) max: [f32; 3],
}

impl Aabb {
    /// Empty box.
    pub(crate) const NONE: Self = Self { min: [f32::INFINITY; 3], max: [f32::NEG_INFINITY; 3] };

    /// Extends the box to contain a point.
    pub(crate) fn add(&mut self, point: [f32; 3]) {
        self.join(&Self { min: point, max: point });
    }

    /// Extends the box to contain another box.
    pub(crate) fn join(&mut self, other: &Self) {
        for axis in 0..3 {
            self.min[axis] = self.min[axis].min(other.min[axis]);
            self.max[axis] = self.max[axis].max(other.max[axis]);
        }
    }

    pub(crate) fn sides(&self) -> [f32; 3] {
        let ([x0, y0, z0], [x1, y1, z1]) = (self.min, self.max);
        [(x1 - x0).max(0.0), (y1 - y0).max(0.0), (z1 - z0).max(0.0)]
    }

    /// Half of the surface area.
    pub(crate) fn area(&self) -> f32 {
        let [x, y, z] = self.sides();
        x * y + y * z + z * x
    }

    pub(crate) fn centre(&self, axis: usize) -> f32 {
        0.5 * (self.min[axis] + self.max[axis])
    }
}
