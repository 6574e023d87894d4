//! Metrics of the ego's motion.

use serde::{Deserialize, Serialize};
use swerve_core::Time;
use swerve_geom::Point2;
use swerve_msg::EgoState;

/// Metrics of the ego's motion.
#[derive(Clone, Copy, PartialEq, Debug, Default, Serialize, Deserialize)]
pub struct DriveMetrics {
    /// Time from the first to the last state, seconds.
    pub duration_s: f64,
    /// Length of the path of the ego origin, metres.
    pub path_length_m: f64,
    /// Speed at the first state, m/s.
    pub speed_start_mps: f64,
    /// Speed at the last state, m/s.
    pub speed_end_mps: f64,
    /// Largest magnitude of the lateral acceleration at the centre of gravity, m/s².
    pub lateral_accel_max_mps2: f64,
    /// Largest deceleration along the heading, m/s² (positive).
    pub deceleration_max_mps2: f64,
    /// Largest magnitude of the yaw rate, rad/s.
    pub yaw_rate_max_radps: f64,
}

/// Accumulates ego states.
#[derive(Clone, Debug, Default)]
pub struct Drive {
    first: Option<Time>,
    last: Option<Point2>,
    figures: DriveMetrics,
}

impl Drive {
    /// Adds the next state. `comfort` is false if accelerations and turn rates do not count, because the ego has hit
    /// something.
    pub fn take(&mut self, ego: &EgoState, comfort: bool) {
        let figures = &mut self.figures;
        let first = *self.first.get_or_insert(ego.stamp);
        let point = ego.pose.point();
        match self.last {
            Some(last) => figures.path_length_m += last.distance(point),
            None => figures.speed_start_mps = ego.speed_mps,
        }
        self.last = Some(point);
        figures.duration_s = crate::seconds(Time::ZERO + (ego.stamp - first));
        figures.speed_end_mps = ego.speed_mps;
        if comfort {
            let lateral = ego.lateral_accel_mps2.abs();
            figures.lateral_accel_max_mps2 = figures.lateral_accel_max_mps2.max(lateral);
            figures.deceleration_max_mps2 = figures.deceleration_max_mps2.max(-ego.accel_mps2);
            figures.yaw_rate_max_radps = figures.yaw_rate_max_radps.max(ego.yaw_rate_radps.abs());
        }
    }

    /// Metrics so far.
    pub fn metrics(&self) -> DriveMetrics {
        self.figures
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use swerve_geom::{Pose2, math};

    #[test]
    fn path_length_matches_a_quarter_circle() {
        let mut drive = Drive::default();
        for k in 0..=1000_i64 {
            let (sin, cos) = math::sin_cos(core::f64::consts::FRAC_PI_2 * k as f64 / 1000.0);
            let ego = EgoState {
                stamp: Time::from_ms(500 + 5 * k),
                pose: Pose2::new(20.0 * sin, 20.0 * (1.0 - cos), 0.0),
                speed_mps: 6.2,
                accel_mps2: if k == 10 { -3.0 } else { 1.0 },
                lateral_accel_mps2: if k == 20 { -2.5 } else { 1.97 },
                yaw_rate_radps: 0.314,
                ..EgoState::default()
            };
            drive.take(&ego, true);
            drive.take(&EgoState { accel_mps2: -100.0, lateral_accel_mps2: 100.0, ..ego }, false);
        }
        let m = drive.metrics();
        assert!((m.path_length_m - 10.0 * core::f64::consts::PI).abs() < 1e-4);
        assert_eq!((m.duration_s, m.deceleration_max_mps2), (5.0, 3.0));
        assert_eq!((m.lateral_accel_max_mps2, m.yaw_rate_max_radps), (2.5, 0.314));
    }
}
