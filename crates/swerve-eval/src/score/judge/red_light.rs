//! Red lights run (`RunningRedLightTest`).

use swerve_geom::{Map, Point2};

use super::{Ego, RedLight, alignment};
use crate::score::leaderboard::Version;

/// Distance of the ego from the light's area of effect within which it counts, metres.
const NEAR_M: f64 = 15.0;
/// Near end of the piece that crosses the stop line, in half lengths behind the centre.
const TAIL_NEAR: f64 = 0.8;
/// Far end of that piece behind the tail, metres.
const TAIL_FAR_M: f64 = 1.0;

#[derive(Clone, Debug)]
pub(super) struct RunLights {
    /// Part of the lane's width to either side of its middle that is the stop line.
    half_width: f64,
    /// The last light that was run.
    last: Option<u64>,
}

impl RunLights {
    pub(super) fn new(version: Version) -> Self {
        Self { half_width: if version.is_second() { 0.6 } else { 0.4 }, last: None }
    }

    /// Number of red lights run in this step.
    pub(super) fn take(&mut self, ego: &Ego, red: &[RedLight]) -> u32 {
        let mut count = 0;
        for light in red {
            let is_near = light.center.distance(ego.center.point()) <= NEAR_M;
            if self.last != Some(light.id) && is_near && self.is_run(ego, light) {
                self.last = Some(light.id);
                count += 1;
            }
        }
        count
    }

    /// Returns true if the piece behind the ego's rear axle crosses the stop line.
    fn is_run(&self, ego: &Ego, light: &RedLight) -> bool {
        if !light.is_own_lane || alignment(ego.center, light.line.heading_rad) <= 0.0 {
            return false;
        }
        let at = |behind_m: f64| -> Point2<Map> { light.line.to_local(ego.center.ahead(-behind_m).point()) };
        let near = at(TAIL_NEAR * ego.half_length_m);
        let far = at(ego.half_length_m + TAIL_FAR_M);
        // The ego faces along the lane: the near end is further along than the far end.
        if near.x_m < 0.0 || far.x_m > 0.0 {
            return false;
        }
        let share = near.x_m / (near.x_m - far.x_m);
        let y_m = near.y_m + share * (far.y_m - near.y_m);
        y_m.abs() <= self.half_width * light.lane_width_m
    }
}
