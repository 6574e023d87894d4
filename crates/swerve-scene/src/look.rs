//! Appearance of one instance of a mesh.

/// Lamps of [`Look::lamps`], as bits.
pub mod lamps {
    /// Head lamps of a vehicle.
    pub const HEAD: u8 = 0;
    /// Tail lamps.
    pub const TAIL: u8 = 1;
    /// Brake lamps.
    pub const BRAKE: u8 = 2;
    /// Indicators on the left.
    pub const LEFT: u8 = 3;
    /// Indicators on the right.
    pub const RIGHT: u8 = 4;
    /// Red of a traffic light.
    pub const RED: u8 = 0;
    /// Yellow of a traffic light.
    pub const YELLOW: u8 = 1;
    /// Green of a traffic light.
    pub const GREEN: u8 = 2;
    /// Street lamps and lit windows, switched by the scene's weather.
    pub const NIGHT: u8 = 7;
}

/// Appearance of one instance of a mesh.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Look {
    /// Factors for the colours of tinted materials, linear.
    pub tints: [[f32; 3]; 4],
    /// Bit mask of lamps that are on, see [`lamps`].
    pub lamps: u8,
}

impl Default for Look {
    fn default() -> Self {
        Self { tints: [[1.0; 3]; 4], lamps: 0 }
    }
}

impl Look {
    /// This appearance with a lamp switched.
    #[must_use]
    pub fn with_lamp(mut self, lamp: u8, on: bool) -> Self {
        if on {
            self.lamps |= 1 << lamp;
        } else {
            self.lamps &= !(1 << lamp);
        }
        self
    }
}
