use super::*;

fn params() -> GateParams {
    GateParams { lane_margin_m: 0.8, stop_decel_mps2: 3.0, ..GateParams::default() }
}

/// A car on a circle, with a pose that has a heading drift or a jump.
struct Drive {
    speed_mps: f64,
    steering_rad: f64,
    /// Heading drift of the pose from 2 s on, rad/s.
    drift_radps: f64,
    /// Position offset of the pose from 2 s on, metres.
    jump_m: f64,
    /// Age of a pose on arrival, ms.
    late_ms: i64,
    /// Declared standard deviations.
    sigma: [f64; 2],
    /// Lateral acceleration that the tyres hold, m/s².
    grip_mps2: f64,
}

impl Default for Drive {
    fn default() -> Self {
        Self {
            speed_mps: 8.0,
            steering_rad: 0.05,
            drift_radps: 0.0,
            jump_m: 0.0,
            late_ms: 0,
            sigma: [0.0; 2],
            grip_mps2: 9.0,
        }
    }
}

impl Drive {
    /// Time from the fault to its detection, seconds.
    fn found_s(&self) -> Option<f64> {
        let (mut check, params) = (PoseCheck::default(), params());
        let grip_radps = self.grip_mps2 / self.speed_mps.abs().max(1.0);
        let yaw_rate_radps = self.speed_mps * math::tan(self.steering_rad) / params.wheelbase_m;
        let yaw_rate_radps = yaw_rate_radps.clamp(-grip_radps, grip_radps);
        let truth = EgoState { speed_mps: self.speed_mps, yaw_rate_radps, ..EgoState::default() };
        for ms in (0..6000_i64).step_by(10) {
            let (stamp, of_ms) = (Time::from_ms(ms), ms - self.late_ms);
            let Drive { speed_mps, steering_rad, .. } = *self;
            let report = VehicleReport { stamp, speed_mps, steering_rad, driver_active: false };
            check.take_report(&report, 0.0, &params);
            if of_ms < 0 {
                continue;
            }
            let wrong_s = 0.001 * (of_ms - 2000).max(0) as f64;
            let mut pose = Pose2::default();
            for step in 0..of_ms / 10 {
                let drifts = if step >= 200 { self.drift_radps } else { 0.0 };
                let yaw_rate_radps = yaw_rate_radps + drifts;
                pose = EgoState { pose, yaw_rate_radps, ..truth }.pose_after(0.01);
            }
            if wrong_s > 0.0 {
                pose.x_m += self.jump_m;
            }
            let ego = EgoState { stamp: Time::from_ms(of_ms), pose, ..truth };
            let [place, heading] = self.sigma.map(|sigma| sigma * sigma);
            let covariance = [place, 0.0, place, 0.0, 0.0, heading];
            let quality = PoseQuality { covariance, ..PoseQuality::default() };
            check.take_pose(&ego, Some(&quality), &params);
            if check.is_implausible() {
                return Some(0.001 * (ms - 2000) as f64);
            }
        }
        None
    }
}

#[test]
fn a_pose_that_moves_as_the_wheels_do_is_plausible() {
    for speed_mps in [-2.0, 0.0, 1.0, 8.0, 25.0] {
        for late_ms in [0, 30, 700] {
            let drive = Drive { speed_mps, late_ms, ..Drive::default() };
            assert_eq!(drive.found_s(), None, "{speed_mps} {late_ms}");
        }
    }
}

#[test]
fn a_car_that_slides_at_the_limit_of_its_tyres_is_plausible() {
    // The wheels request 7 to 16 m/s², the tyres give 7.
    for steering_rad in [0.14, 0.2, 0.3] {
        let drive = Drive { speed_mps: 12.0, steering_rad, grip_mps2: 7.0, ..Drive::default() };
        assert_eq!(drive.found_s(), None, "{steering_rad}");
        // An additional heading drift is detected.
        let drifts = Drive { drift_radps: 0.3, ..drive };
        assert!(drifts.found_s().is_some_and(|s| s < 1.5), "{steering_rad} {:?}", drifts.found_s());
    }
}

#[test]
fn heading_drift_is_detected_before_a_stop_leaves_the_lane() {
    // At 8 m/s: 2.4 m and 10.67 m to a standstill, 0.8 m laterally: 0.061 rad, and 0.15 of the turn of 0.14 rad.
    let bound_rad = 0.8 / (2.4 + 10.667) + 0.15 * 8.0 * math::tan(0.05) / 2.85;
    let found_s = Drive { drift_radps: 0.2, ..Drive::default() }.found_s().unwrap();
    assert!((found_s - bound_rad / 0.2).abs() <= 0.021, "{found_s} {bound_rad}");
    // At 2 m/s, 1.27 m to a standstill tolerate 0.63 rad.
    let slow = Drive { speed_mps: 2.0, drift_radps: 0.2, ..Drive::default() };
    assert_eq!(slow.found_s(), None);
}

#[test]
fn jump_beyond_the_lane_is_detected_at_once() {
    let jump = |jump_m| Drive { jump_m, ..Drive::default() };
    // 0.8 m, and 0.05 of the distance of a second.
    assert_eq!(jump(1.0).found_s(), None);
    assert_eq!(jump(1.5).found_s(), Some(0.01));
    assert_eq!(jump(-1.5).found_s(), Some(0.01));
    assert_eq!(Drive { late_ms: 100, ..jump(1.5) }.found_s(), Some(0.11));
}

#[test]
fn localization_may_correct_itself_by_what_it_declares() {
    let declared = Drive { jump_m: 1.5, sigma: [0.3, 0.0], ..Drive::default() };
    assert_eq!(declared.found_s(), None);
    let drifting = Drive { drift_radps: 0.2, sigma: [0.0, 0.1], ..Drive::default() };
    assert_eq!(drifting.found_s(), None);
}

#[test]
fn gaps_restart_the_comparison() {
    let (mut check, params) = (PoseCheck::default(), params());
    let mut take = |ms: i64, x_m: f64, speed_mps: f64| {
        let stamp = Time::from_ms(ms);
        check.take_report(&VehicleReport { stamp, speed_mps, ..VehicleReport::default() }, 0.0, &params);
        let pose = Pose2::new(x_m, 0.0, 0.0);
        check.take_pose(&EgoState { stamp, pose, ..EgoState::default() }, None, &params);
        check.is_implausible()
    };
    assert!(!take(0, 0.0, 8.0) && !take(10, 0.08, 8.0));
    assert!(!take(500, 50.0, 8.0), "nothing is known of half a second");
    assert!(take(510, 60.0, 8.0));
}
