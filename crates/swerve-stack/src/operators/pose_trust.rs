//! Speed by the accuracy of the pose: slower where it is poor, and a stop where it does not suffice for the lane.

use swerve_flow::Latest;
use swerve_geom::Pose2;
use swerve_msg::{Plan, PlanStatus, PoseMode, PoseQuality, Route};

/// Share of the target speed that is driven with the poorest pose that suffices for the lane.
const SLOWEST: f64 = 0.3;

/// Goes on after a stop when the deviations fit with this much to spare, as a share.
const RESUME: f64 = 1.1;

/// The accuracy of the pose, and the speed that it allows.
pub(super) struct PoseTrust {
    quality: Option<PoseQuality>,
    slow_by_sigma_m: [f64; 2],
    /// Standard deviations that must fit beside the car; 0 for none.
    stop_by_sigmas: f64,
    half_width_m: f64,
    stops: bool,
}

impl PoseTrust {
    pub(super) fn new(slow_by_sigma_m: [f64; 2], stop_by_sigmas: f64, width_m: f64) -> Self {
        Self { quality: None, slow_by_sigma_m, stop_by_sigmas, half_width_m: 0.5 * width_m, stops: false }
    }

    /// Takes the newest accuracy; while localization is lost, the one before counts.
    pub(super) fn take(&mut self, quality: Option<&Latest<PoseQuality>>) {
        let quality = quality.and_then(Latest::get).filter(|quality| quality.mode != PoseMode::Lost);
        self.quality = quality.map(|quality| **quality).or(self.quality);
    }

    /// Share of the target speed for an ego at a pose of its route; 1 without localization.
    pub(super) fn speed_share(&mut self, pose: Pose2, route: &Route) -> f64 {
        let Some(quality) = self.quality else { return 1.0 };
        let s_m = route.project(pose.point()).s_m;
        let room_m = route.left_m(s_m).min(route.right_m(s_m)) - self.half_width_m;
        let sigma_m = quality.across_sigma_m(route.line().at(s_m).pose.heading_rad);
        let spare = if self.stops { RESUME } else { 1.0 };
        self.stops = self.stop_by_sigmas * sigma_m * spare > room_m;
        if self.stops { 0.0 } else { speed_share(quality.sigma_m(), self.slow_by_sigma_m) }
    }

    /// The plan, with the reason for which it stops.
    pub(super) fn explained(&self, plan: Plan) -> Plan {
        let led = matches!(plan.status, PlanStatus::Comfortable | PlanStatus::Found | PlanStatus::Route);
        let status = if self.stops && led { PlanStatus::PoseUncertain } else { plan.status };
        Plan { status, ..plan }
    }
}

/// Share of the target speed at a deviation of the pose, metres.
fn speed_share(sigma_m: f64, [from_m, to_m]: [f64; 2]) -> f64 {
    if sigma_m <= from_m {
        return 1.0;
    }
    let slowed = ((sigma_m - from_m) / (to_m - from_m)).min(1.0);
    1.0 - (1.0 - SLOWEST) * slowed
}

#[cfg(test)]
mod tests {
    use swerve_geom::{Point2, Polyline};

    use super::*;

    #[test]
    fn speed_falls_with_the_deviation_of_the_pose() {
        let share = |sigma_m: f64| speed_share(sigma_m, [0.4, 1.0]);
        for (sigma_m, share_of_speed) in [(0.0, 1.0), (0.4, 1.0), (0.7, 0.65), (1.0, 0.3), (50.0, 0.3)] {
            assert!((share(sigma_m) - share_of_speed).abs() < 1e-12, "{sigma_m}");
        }
        assert_eq!(speed_share(1e9, [f64::MAX; 2]), 1.0, "the paper's planners do not");
        assert!((speed_share(0.5, [0.4, 0.4]) - SLOWEST).abs() < 1e-12);
    }

    /// On a road along x of 4 m to the left and 2 m to the right, in a car of 1.9 m.
    fn share(trust: &mut PoseTrust, along_m: f64, across_m: f64) -> f64 {
        let covariance = [along_m * along_m, 0.0, across_m * across_m, 0.0, 0.0, 0.0];
        trust.quality = Some(PoseQuality { covariance, ..PoseQuality::default() });
        trust.speed_share(Pose2::new(50.0, 0.0, 0.0), &route())
    }

    fn route() -> Route {
        let line = Polyline::new(&[Point2::new(0.0, 0.0), Point2::new(200.0, 0.0)]).unwrap();
        Route::uniform(line, 4.0, 2.0)
    }

    #[test]
    fn stops_where_two_deviations_do_not_fit_beside_the_car() {
        let mut trust = PoseTrust::new([9.0, 9.0], 2.0, 1.9);
        // 2 - 0.95 = 1.05 m to the nearer edge: two deviations of 0.525 m fit.
        assert_eq!([0.1, 0.52].map(|sigma_m| share(&mut trust, 0.1, sigma_m)), [1.0, 1.0]);
        assert_eq!(share(&mut trust, 3.0, 0.1), 1.0, "a place that is open along the lane is in the lane");
        assert_eq!(share(&mut trust, 0.1, 0.53), 0.0);
        let plan = |status| Plan { status, ..Plan::default() };
        assert_eq!(trust.explained(plan(PlanStatus::Comfortable)).status, PlanStatus::PoseUncertain);
        assert_eq!(trust.explained(plan(PlanStatus::Brake)).status, PlanStatus::Brake, "an emergency is one");
        // 1.1 times two deviations fit from 0.477 m on.
        assert_eq!([0.48, 0.47].map(|sigma_m| share(&mut trust, 0.1, sigma_m)), [0.0, 1.0]);
        assert_eq!(trust.explained(plan(PlanStatus::Comfortable)).status, PlanStatus::Comfortable);
    }

    #[test]
    fn zero_deviations_never_stop() {
        assert_eq!(share(&mut PoseTrust::new([9.0, 9.0], 0.0, 1.9), 0.1, 5.0), 1.0);
        assert_eq!(PoseTrust::new([0.4, 1.0], 2.0, 1.9).speed_share(Pose2::default(), &route()), 1.0);
    }
}
