//! Grip of the front tyres: detection of a slide in a turn, and the acceleration during and after it.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_geom::math;
use swerve_msg::EgoState;

use crate::SlipParams;

/// Slide of the front tyres, as on ice in a bend.
///
/// The longitudinal and the lateral force of a tyre share its grip: driven front wheels that spin hardly turn the car
/// (Rajamani, "Vehicle Dynamics and Control", 2nd ed., chapter 13). While the front tyres slide, the controller
/// therefore brakes gently, as traction control does. This stops the spin, and reduces the speed.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct GripParams {
    /// Slip angle beyond which the front tyres slide, radians. Source: a steady turn at 7.85 m/s² on dry ground has
    /// 0.047; the largest force is at 0.13 on dry ground and at 0.04 on ice (friction 0.3).
    #[schemars(range(min = 0.01, max = 1.6))]
    pub slip_max_rad: f64,
    /// Lateral acceleration up to which they slide, m/s²: with more, they have the grip of dry ground, and a large slip
    /// angle is that of a swerve.
    #[schemars(range(min = 0.0, max = 20.0))]
    pub lateral_max_mps2: f64,
    /// Time for which they do, seconds: the car follows quick steering later.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub slides_s: f64,
    /// Speed below which slip is not estimated, m/s: it has the noise of the yaw rate, divided by the speed.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub speed_min_mps: f64,
    /// Deceleration while the front tyres slide, m/s² (positive).
    #[schemars(range(min = 0.0, max = 20.0))]
    pub decel_mps2: f64,
    /// Rate at which the largest acceleration rises from zero after a slide, m/s³: the ground ahead may be slippery too.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub rise_mps3: f64,
}

impl Default for GripParams {
    fn default() -> Self {
        Self {
            slip_max_rad: 0.05,
            lateral_max_mps2: 4.0,
            slides_s: 0.3,
            speed_min_mps: 3.0,
            decel_mps2: 1.5,
            rise_mps3: 1.0,
        }
    }
}

/// Largest acceleration that the grip of the front tyres allows, according to the ego states.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Grip {
    params: GripParams,
    accel_most_mps2: f64,
    /// Time of the slide by now, seconds.
    slides_s: f64,
}

impl Grip {
    pub(crate) fn new(params: GripParams) -> Self {
        Self { params, accel_most_mps2: f64::INFINITY, slides_s: 0.0 }
    }

    /// Takes the ego state `dt_s` after the previous one; `None` if there is no new one.
    pub(crate) fn advance(&mut self, ego: Option<&EgoState>, slip: &SlipParams, wheelbase_m: f64, dt_s: f64) {
        let GripParams { slip_max_rad, lateral_max_mps2, slides_s, speed_min_mps, decel_mps2, rise_mps3 } =
            self.params;
        self.accel_most_mps2 = self.accel_most_mps2.max(0.0) + rise_mps3 * dt_s;
        let slides = |ego: &EgoState| {
            ego.speed_mps >= speed_min_mps
                && ego.lateral_accel_mps2.abs() < lateral_max_mps2
                && front_slip_rad(ego, slip, wheelbase_m).abs() > slip_max_rad
        };
        let Some(ego) = ego else { return };
        let slides = slides(ego);
        self.slides_s = if slides { self.slides_s + dt_s } else { 0.0 };
        if slides && self.slides_s >= slides_s {
            self.accel_most_mps2 = -decel_mps2;
        }
    }

    /// Largest acceleration, m/s²: negative during a slide, infinite before the first.
    pub(crate) fn accel_most_mps2(&self) -> f64 {
        self.accel_most_mps2
    }
}

/// Slip angle of the front tyres of a moving car, radians: between the front wheels and the motion of the front axle.
/// Positive if the wheels are turned further to the left.
fn front_slip_rad(ego: &EgoState, slip: &SlipParams, wheelbase_m: f64) -> f64 {
    // The rear axle moves towards the outside of the turn by its own slip angle.
    let outwards_rad = slip.rear_s2pm * ego.lateral_accel_mps2;
    ego.steering_rad - math::atan(wheelbase_m * ego.yaw_rate_radps / ego.speed_mps - outwards_rad)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHEELBASE_M: f64 = 2.85;

    fn state(speed_mps: f64, steering_rad: f64, yaw_rate_radps: f64) -> EgoState {
        let lateral_accel_mps2 = speed_mps * yaw_rate_radps;
        EgoState { speed_mps, steering_rad, yaw_rate_radps, lateral_accel_mps2, ..EgoState::default() }
    }

    /// Largest acceleration after each of the states, 0.3 s apart, m/s².
    fn most_mps2(states: &[Option<EgoState>]) -> Vec<f64> {
        let mut grip = Grip::new(GripParams::default());
        let after = |ego: &Option<EgoState>| {
            grip.advance(ego.as_ref(), &SlipParams::default(), WHEELBASE_M, 0.3);
            grip.accel_most_mps2()
        };
        states.iter().map(after).collect()
    }

    /// Steady turns up to the limit of lateral acceleration, with the steering of the single-track model.
    #[test]
    fn turns_on_dry_ground_are_not_slides() {
        for speed_mps in [1.0, 3.0, 6.0, 12.0, 25.0] {
            for lateral_mps2 in [-7.85, -4.0, -1.0, 0.0, 1.0, 4.0, 7.85] {
                let curvature_1pm = lateral_mps2 / (speed_mps * speed_mps);
                let steering_rad = math::atan(WHEELBASE_M * curvature_1pm) + 0.0005 * lateral_mps2;
                let turn = state(speed_mps, steering_rad, speed_mps * curvature_1pm);
                if steering_rad.abs() < 0.61 {
                    assert_eq!(most_mps2(&[Some(turn)]), [f64::INFINITY], "{turn:?}");
                }
            }
        }
    }

    /// 4 m/s on ice: the wheels are at 0.28 rad, and the car turns by 0.25 rad/s instead of 0.4.
    #[test]
    fn slide_brakes_and_acceleration_rises_slowly_after_it() {
        for side in [1.0, -1.0] {
            let slide = state(4.0, side * 0.28, side * 0.25);
            let grip = state(4.0, side * 0.28, side * 0.4);
            let most = most_mps2(&[Some(slide), Some(slide), Some(grip), None, Some(grip), Some(slide)]);
            let expected = [-1.5, -1.5, 0.3, 0.6, 0.9, -1.5];
            assert!(most.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{most:?}");
        }
    }

    /// A swerve at the limit of dry ground, with slip angles of 0.1 rad.
    #[test]
    fn swerve_on_dry_ground_is_no_slide() {
        let swerve = state(15.0, math::atan(WHEELBASE_M * 8.0 / 225.0) + 0.1, 8.0 / 15.0);
        assert_eq!(most_mps2(&[Some(swerve)]), [f64::INFINITY]);
    }

    #[test]
    fn slow_cars_and_unknown_lateral_accelerations_do_not_slide() {
        let unknown = EgoState { lateral_accel_mps2: f64::NAN, ..state(8.0, 0.4, 0.0) };
        assert_eq!(most_mps2(&[Some(state(2.9, 0.6, 0.0)), Some(unknown)]), [f64::INFINITY; 2]);
    }
}
