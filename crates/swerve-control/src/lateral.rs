//! Steering laws: pure functions of a pose and a place on the path, returning the angle of the road wheels.
//!
//! All laws expect the path of the ego origin (centre of the rear axle), as in plans.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_geom::{Point2, Pose2, angle_between, math};

/// Parameters of Pylot's steering: proportional to the angle to a waypoint.
///
/// Pylot computes `steer = clip(gain * angle, -1, 1)`, gain 0.7 by default, 1.0 in its scenarios and 1.5 on its
/// car, to the first waypoint at least 5 m away. In CARLA a steer of 1 turns the wheels of the Lincoln MKZ
/// to 70 degrees, so that in angles of the road wheels the law is `1.222 gain * angle`: 0.855 per radian for 0.7,
/// 1.222 for 1.0. (Pure pursuit at that distance would be `2 * 2.85 m / 5 m = 1.14` per radian.)
/// CARLA additionally reduces the angle at higher speeds, which is not modelled here. Also different from Pylot: the
/// sign (left is positive here), and the reference point of the angle (path and pose are those of the rear axle here,
/// not of the car's centre). The road wheels never exceed the vehicle's limit.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct WaypointParams {
    /// Normalised steer per radian.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub steer_gain: f64,
    /// Angle of the road wheels at a normalised steer of 1, radians.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub steer_full_rad: f64,
    /// Distance of the waypoint, metres: the first one at least this far away sets angle and speed.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub waypoint_min_m: f64,
}

impl Default for WaypointParams {
    /// Values of Pylot's scenarios.
    fn default() -> Self {
        Self { steer_gain: 1.0, steer_full_rad: 70.0_f64.to_radians(), waypoint_min_m: 5.0 }
    }
}

/// Angle of the front road wheels by Pylot's law for a waypoint, radians.
pub fn waypoint_angle(pose: Pose2, waypoint: Point2, params: &WaypointParams) -> f64 {
    let angle = angle_between(pose.heading_rad, (waypoint - pose.point()).heading());
    (params.steer_gain * angle).clamp(-1.0, 1.0) * params.steer_full_rad
}

/// Parameters of [`pure_pursuit`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct PurePursuitParams {
    /// Look-ahead time, seconds. A longer one is calmer but returns to the path more slowly.
    #[schemars(range(min = 0.0, max = 60.0))]
    pub lookahead_s: f64,
    /// Shortest look-ahead distance, metres.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub lookahead_min_m: f64,
    /// Longest look-ahead distance, metres.
    #[schemars(range(min = 0.1, max = 1000.0))]
    pub lookahead_max_m: f64,
    /// True if the path's curvature is fed forward and only the deviation is pursued; false for the textbook law, which
    /// cuts corners.
    pub feed_forward: bool,
    /// Preview time of the curvature fed forward, seconds: compensates the lag of steering and tyres, and of a law
    /// without damping.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub preview_s: f64,
}

impl Default for PurePursuitParams {
    fn default() -> Self {
        Self {
            lookahead_s: 0.6,
            lookahead_min_m: 4.0,
            lookahead_max_m: 25.0,
            feed_forward: true,
            preview_s: 0.2,
        }
    }
}

impl PurePursuitParams {
    /// Look-ahead distance at `speed_mps`, metres.
    pub fn lookahead_m(&self, speed_mps: f64) -> f64 {
        (self.lookahead_s * speed_mps).clamp(self.lookahead_min_m, self.lookahead_max_m)
    }
}

/// The path beside the ego, as input of a law.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct OnPath {
    /// Nearest pose of the path.
    pub pose: Pose2,
    /// Curvature to feed forward, 1/m.
    pub curvature_1pm: f64,
}

/// Angle of the front road wheels by pure pursuit, radians (Coulter, CMU-RI-TR-92-01): the arc of the rear axle that
/// meets `goal`.
///
/// With feed-forward, the curvature is that of the path plus the difference between the arcs to `goal` from the ego and
/// from the path beside it: exact on a path of any shape.
pub fn pure_pursuit(
    pose: Pose2,
    goal: Point2,
    beside: OnPath,
    wheelbase_m: f64,
    params: &PurePursuitParams,
) -> f64 {
    let mut curvature = arc_to(pose, goal);
    if params.feed_forward {
        curvature += beside.curvature_1pm - arc_to(beside.pose, goal);
    }
    math::atan(wheelbase_m * curvature)
}

/// Curvature of the arc that leaves `from` along its heading and meets `goal`, 1/m; zero if it is too close.
fn arc_to(from: Pose2, goal: Point2) -> f64 {
    let to = goal - from.point();
    let squared = to.norm_squared();
    if squared < 1e-6 { 0.0 } else { 2.0 * from.direction().cross(to) / squared }
}

/// Parameters of [`stanley`].
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct StanleyParams {
    /// Gain on the cross-track error, 1/s: an error decays about this fast.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub gain_ps: f64,
    /// Added to the speed, so that the law is well-behaved near standstill, m/s.
    #[schemars(range(min = 0.001, max = 100.0))]
    pub softening_mps: f64,
    /// Steering angle per rad/s by which the car's yaw rate exceeds the path's, seconds.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub yaw_damping_s: f64,
    /// Speed above which the gain on deviations decreases with speed, m/s: the path's response to steering grows with
    /// `speed / wheelbase`, while the lag of steering and tyres stays the same.
    #[schemars(range(min = 0.001, max = 1000.0))]
    pub full_gain_mps: f64,
    /// Preview time of the curvature fed forward, seconds: compensates the lag of steering and tyres.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub preview_s: f64,
}

impl Default for StanleyParams {
    fn default() -> Self {
        Self { gain_ps: 2.0, softening_mps: 1.0, yaw_damping_s: 0.15, full_gain_mps: 18.0, preview_s: 0.15 }
    }
}

/// Angle of the front road wheels by the law of Stanley, radians (Hoffmann et al., ACC 2007, equation 5), for a path of
/// the **rear** axle.
///
/// The original requires the path of the front axle, which follows from the rear's: with the rear axle at a pose of
/// curvature k, the front axle is one wheelbase ahead and heads `atan(wheelbase k)` further to the left. The law
/// therefore feeds the curvature forward and has no error on a path of constant curvature.
pub fn stanley(
    pose: Pose2,
    speed_mps: f64,
    yaw_rate_radps: f64,
    beside: OnPath,
    wheelbase_m: f64,
    params: &StanleyParams,
) -> f64 {
    let ahead_rad = math::atan(wheelbase_m * beside.curvature_1pm);
    let wanted = Pose2::<swerve_geom::Map>::new(0.0, 0.0, beside.pose.heading_rad + ahead_rad);
    let off = pose.ahead(wheelbase_m).point() - beside.pose.ahead(wheelbase_m).point();
    let cross_track_m = wanted.direction().cross(off);
    let speed = speed_mps.max(0.0);
    let heading = angle_between(pose.heading_rad, wanted.heading_rad);
    let back = math::atan2(-params.gain_ps * cross_track_m, params.softening_mps + speed);
    let damping = params.yaw_damping_s * (speed * beside.curvature_1pm - yaw_rate_radps);
    if speed <= params.full_gain_mps {
        return heading + back + damping;
    }
    ahead_rad + params.full_gain_mps / speed * (heading - ahead_rad + back) + damping
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f64::consts::PI;

    const L: f64 = 2.85;

    fn straight() -> OnPath {
        OnPath { pose: Pose2::new(0.0, 0.0, 0.0), curvature_1pm: 0.0 }
    }

    #[test]
    fn a_waypoint_to_the_left_steers_left_by_the_physical_gain() {
        let params = WaypointParams { steer_gain: 0.7, ..Default::default() };
        let steer = waypoint_angle(Pose2::new(0.0, 0.0, 0.0), Point2::new(5.0, 0.5), &params);
        let angle = math::atan(0.5 / 5.0);
        assert!((steer - 0.7 * 70f64.to_radians() * angle).abs() < 1e-12);
        assert!((steer / angle - 0.855).abs() < 1e-3);
    }

    #[test]
    fn full_steer_is_the_largest_angle() {
        let steer =
            waypoint_angle(Pose2::new(0.0, 0.0, 0.0), Point2::new(-5.0, 0.1), &WaypointParams::default());
        assert!((steer - 70f64.to_radians()).abs() < 1e-12);
    }

    #[test]
    fn stanley_reduces_the_gain_on_deviations_but_not_on_curvature_with_speed() {
        let params = StanleyParams { softening_mps: 0.0, yaw_damping_s: 0.0, ..StanleyParams::default() };
        let at = |speed_mps: f64, heading_rad: f64, curvature_1pm: f64| {
            let beside = OnPath { curvature_1pm, ..straight() };
            stanley(Pose2::new(0.0, 0.0, heading_rad), speed_mps, 0.0, beside, L, &params)
        };
        let v = params.full_gain_mps;
        // Steering times speed over wheelbase is the rate at which the heading returns: constant above that speed.
        for (speed_mps, share) in [(0.5 * v, 1.0), (v, 1.0), (2.0 * v, 0.5), (3.0 * v, 1.0 / 3.0)] {
            // The front axle is displaced by the wheelbase times the heading, too.
            let expected = -share * (0.01 + math::atan2(params.gain_ps * L * math::sin(0.01), speed_mps));
            assert!((at(speed_mps, 0.01, 0.0) - expected).abs() < 1e-9, "{speed_mps}");
            assert!((at(speed_mps, 0.0, 0.01) - math::atan(0.01 * L)).abs() < 1e-9, "{speed_mps}");
        }
    }

    #[test]
    fn laws_take_the_short_way_round() {
        // Ego heads just right of west, the path just left of it.
        let pose = Pose2::new(0.0, 0.0, PI - 0.05);
        let beside = OnPath { pose: Pose2::new(0.0, 0.0, -PI + 0.05), curvature_1pm: 0.0 };
        let steer =
            stanley(pose, 10.0, 0.0, beside, L, &StanleyParams { gain_ps: 0.0, ..Default::default() });
        assert!((steer - 0.1).abs() < 1e-12, "{steer}");
        let waypoint = waypoint_angle(pose, beside.pose.ahead(10.0).point(), &WaypointParams::default());
        assert!((waypoint / 70f64.to_radians() - 0.1).abs() < 1e-9, "{waypoint}");
        let goal = beside.pose.ahead(10.0).point();
        let params = PurePursuitParams { feed_forward: false, ..Default::default() };
        let pursuit = pure_pursuit(pose, goal, beside, L, &params);
        assert!((pursuit - math::atan(L * 2.0 * math::sin(0.1) / 10.0)).abs() < 1e-9, "{pursuit}");
    }

    #[test]
    fn pure_pursuit_is_the_textbook_arc() {
        let params = PurePursuitParams { feed_forward: false, ..Default::default() };
        let steer = pure_pursuit(Pose2::new(0.0, 0.0, 0.0), Point2::new(3.0, 4.0), straight(), L, &params);
        assert!((steer - math::atan(L * 2.0 * 4.0 / 25.0)).abs() < 1e-12);
    }

    #[test]
    fn on_the_path_every_law_steers_its_curvature() {
        let curvature = 0.05;
        let beside = OnPath { pose: Pose2::new(0.0, 0.0, 0.0), curvature_1pm: curvature };
        // A goal on a path that bends away from the arc: the textbook law would be off.
        let goal = Point2::new(8.0, 0.3);
        let want = math::atan(L * curvature);
        let pursuit = pure_pursuit(beside.pose, goal, beside, L, &PurePursuitParams::default());
        let hoffmann = stanley(beside.pose, 10.0, 0.5, beside, L, &StanleyParams::default());
        assert!((pursuit - want).abs() < 1e-12 && (hoffmann - want).abs() < 1e-12, "{pursuit} {hoffmann}");
    }

    #[test]
    fn left_of_the_path_every_law_steers_right() {
        let pose = Pose2::new(0.0, 1.0, 0.0);
        let goal = Point2::new(10.0, 0.0);
        assert!(waypoint_angle(pose, goal, &WaypointParams::default()) < -0.1);
        assert!(pure_pursuit(pose, goal, straight(), L, &PurePursuitParams::default()) < -0.01);
        assert!(stanley(pose, 10.0, 0.0, straight(), L, &StanleyParams::default()) < -0.1);
    }

    #[test]
    fn goal_at_the_ego_gives_zero_steering() {
        let at = straight();
        assert_eq!(pure_pursuit(at.pose, at.pose.point(), at, L, &PurePursuitParams::default()), 0.0);
    }
}
