//! Knots of the path.

use swerve_geom::Pose2;

use super::model::State;

/// One step of the path: the linearisation point, and the targets there.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Knot {
    /// A pose of the path, with the expected speed, steering and acceleration.
    pub state: State,
    /// Target position ahead of the pose along its heading, metres.
    pub wanted_along_m: f64,
    /// Target speed, m/s.
    pub wanted_speed_mps: f64,
    /// Target acceleration, m/s².
    pub wanted_accel_mps2: f64,
    /// Room to the left of the pose for the ego origin, metres; negative if the pose is outside.
    pub left_m: f64,
    /// Room to the right of the pose for the ego origin, metres; negative if the pose is outside.
    pub right_m: f64,
}

impl Knot {
    /// A knot on the x axis, with a metre of room to both sides.
    pub(crate) fn straight(x_m: f64, speed_mps: f64) -> Self {
        let state = State { pose: Pose2::new(x_m, 0.0, 0.0), speed_mps, ..State::default() };
        Self { state, wanted_speed_mps: speed_mps, left_m: 1.0, right_m: 1.0, ..Self::default() }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.state.is_finite()
            && [self.wanted_along_m, self.wanted_speed_mps, self.wanted_accel_mps2, self.left_m, self.right_m]
                .iter()
                .all(|x| x.is_finite())
    }
}
