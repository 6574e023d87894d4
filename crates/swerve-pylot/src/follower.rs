//! The originals' follower: a speed law, and steering by the angle to one point of the plan.

use swerve_control::lateral::{WaypointParams, waypoint_angle};
use swerve_control::pid::{Params, Pid};
use swerve_control::{Output, Pedals, Status};
use swerve_core::Time;
use swerve_geom::Point2;
use swerve_msg::{Command, EgoState, Plan, PlanPoint};
use swerve_vehicle::{Limits, Shape};

use crate::{Rules, SpeedLaw, Waypoint};

/// Smallest distance of the target point under [`Waypoint::Distance`], metres. Source: `pylot` be7bf9c,
/// `control/flags.py`.
const AWAY_M: f64 = 5.0;

/// Distance within which the first point counts as passed under [`Waypoint::Number`], metres. Source: `pylot` c0454eb,
/// `planning/utils.py:26-70`.
const PASSED_M: f64 = 0.9;

/// Speed per pair of points of look-ahead under [`Waypoint::Number`], m/s.
const SPEED_PER_PAIR_MPS: f64 = 3.0;

/// Gain from excess speed in m/s to `u`. Source: `pylot` c0454eb, `control/flags.py`.
const PER_MPS: f64 = 0.25;

/// Integral gain of `u` per second and m/s, over the current step only. Source: as above, and `pid_controller` 0.2.
const PER_METRE: f64 = 0.20;

/// Follows plans point by point; their instants are ignored.
#[derive(Clone, Debug)]
pub struct Follower {
    waypoint: Waypoint,
    params: WaypointParams,
    /// Distance from the ego origin forward to the steered point, metres.
    ahead_m: f64,
    steering_max_rad: f64,
    speed: SpeedLaw,
    default_throttle: f64,
    pid: Pid,
    before: Option<Time>,
}

impl Follower {
    /// Creates a follower for a vehicle of this shape and these limits.
    pub fn new(rules: &Rules, shape: &Shape, limits: &Limits) -> Self {
        Self {
            waypoint: rules.waypoint,
            params: WaypointParams { steer_gain: rules.steer_gain, ..WaypointParams::default() },
            ahead_m: if rules.middle_of_car { shape.center_ahead_m() } else { 0.0 },
            steering_max_rad: limits.steering_max_rad,
            speed: rules.speed,
            default_throttle: rules.default_throttle,
            pid: Pid::new(Params::default()),
            before: None,
        }
    }

    /// Runs one step: no pedal and no steering before the first plan.
    pub fn step(&mut self, now: Time, ego: &EgoState, plan: Option<&Plan>) -> Output {
        let dt_s = self.before.map_or(0.0, |before| (now - before).as_secs().max(0.0));
        self.before = Some(now);
        let none = Output {
            command: Command { steering_rad: 0.0, throttle: 0.0, brake: 0.0 },
            speed_mps: ego.speed_mps,
            accel_mps2: None,
            status: Status::Route,
            mpc: None,
        };
        let Some(plan) = plan.filter(|plan| !plan.points.is_empty()) else { return none };
        let pose = ego.pose.ahead(self.ahead_m);
        let (steered_at, speed_mps) = self.choose(plan, pose.point(), ego.speed_mps);
        let steering_rad = waypoint_angle(pose, steered_at, &self.params);
        let steering_rad = steering_rad.clamp(-self.steering_max_rad, self.steering_max_rad);
        let Pedals { throttle, brake } = match self.speed {
            SpeedLaw::Pid => self.pid.step(speed_mps, ego.speed_mps, dt_s),
            SpeedLaw::Proportional => self.proportional(ego.speed_mps.max(0.0) - speed_mps, dt_s),
        };
        let command = Command { steering_rad, throttle, brake };
        Output { command, speed_mps, status: Status::Plan, ..none }
    }

    /// Pedals for a car that is too fast by `too_fast_mps`.
    fn proportional(&self, too_fast_mps: f64, dt_s: f64) -> Pedals {
        let u = (PER_MPS + PER_METRE * dt_s) * too_fast_mps;
        Pedals {
            throttle: (self.default_throttle - 1.3 * u).clamp(0.0, 0.75),
            brake: if u > 0.5 { (0.35 * u).min(1.0) } else { 0.0 },
        }
    }

    /// Target point of the steering, and target speed.
    fn choose(&self, plan: &Plan, from: Point2, speed_mps: f64) -> (Point2, f64) {
        let points = &plan.points;
        let place = |p: &PlanPoint| p.pose.ahead(self.ahead_m).point();
        let away_m = |k: usize| place(&points[k]).distance(from);
        let last = points.len() - 1;
        match self.waypoint {
            Waypoint::Number => {
                let first = usize::from(away_m(0) < PASSED_M && last > 0);
                let pairs = (speed_mps.max(0.0) / SPEED_PER_PAIR_MPS) as usize;
                (place(&points[(first + 2 * pairs).min(last)]), points[last].speed_mps)
            }
            Waypoint::Distance => {
                let nearest = (0..=last).min_by(|&a, &b| away_m(a).total_cmp(&away_m(b))).unwrap_or(0);
                let chosen = (nearest..=last).find(|&k| away_m(k) >= AWAY_M).unwrap_or(last);
                (place(&points[chosen]), points[chosen].speed_mps)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use swerve_core::Span;
    use swerve_geom::Pose2;

    use super::*;
    use crate::{Era, Original};

    /// Points half a metre apart on a curve that bends increasingly to the left.
    fn plan() -> Plan {
        let point = |k: i32| {
            let x_m = 0.5 * f64::from(k);
            let pose = Pose2::new(x_m, 0.01 * x_m * x_m, 0.0);
            PlanPoint {
                at: Time::ZERO + Span::from_ms(i64::from(k)),
                pose,
                speed_mps: 16.0,
                ..PlanPoint::default()
            }
        };
        Plan { points: (0..=60).map(point).collect(), ..Plan::default() }
    }

    fn follower(change: impl Fn(&mut Rules)) -> Follower {
        let mut rules = Rules { middle_of_car: false, ..Rules::of(Era::May2020, Original::Fot) };
        change(&mut rules);
        Follower::new(&rules, &Shape::default(), &Limits { steering_max_rad: 1.2, ..Limits::default() })
    }

    #[test]
    fn waypoint_number_grows_with_speed() {
        let chosen = |speed_mps| follower(|_| ()).choose(&plan(), Point2::new(0.0, 0.0), speed_mps).0.x_m;
        // One point is passed; then 10, 12, 12 and 14 more.
        assert_eq!([16.0, 18.0, 20.0, 22.0].map(chosen), [5.5, 6.5, 6.5, 7.5]);
        let by_distance = follower(|rules| rules.waypoint = Waypoint::Distance);
        assert_eq!(by_distance.choose(&plan(), Point2::new(3.0, 0.0), 22.0).0.x_m, 8.0);
    }

    #[test]
    fn steering_depends_on_the_gain_and_the_steered_point() {
        let ego = EgoState { speed_mps: 16.0, ..EgoState::default() };
        let steer =
            |follower: &mut Follower| follower.step(Time::ZERO, &ego, Some(&plan())).command.steering_rad;
        let one = steer(&mut follower(|_| ()));
        assert!(
            (steer(&mut follower(|rules| rules.steer_gain = 0.7)) - 0.7 * one).abs() < 1e-12 && one > 0.0
        );
        assert!((steer(&mut follower(|rules| rules.middle_of_car = true)) - one).abs() < 0.02);
    }

    #[test]
    fn follower_releases_all_without_a_plan_and_brakes_fully_for_speed_zero() {
        let ego = EgoState { speed_mps: 16.0, ..EgoState::default() };
        let command = follower(|_| ()).step(Time::ZERO, &ego, None).command;
        assert_eq!((command.steering_rad, command.throttle, command.brake), (0.0, 0.0, 0.0));
        let mut stop = plan();
        stop.points.iter_mut().for_each(|p| p.speed_mps = 0.0);
        assert_eq!(follower(|_| ()).step(Time::ZERO, &ego, Some(&stop)).command.brake, 1.0);
    }

    #[test]
    fn proportional_law_fades_and_pid_does_not() {
        let pedals = |speed, speed_mps: f64, target_mps: f64| {
            let mut plan = plan();
            plan.points.iter_mut().for_each(|p| p.speed_mps = target_mps);
            let ego = EgoState { speed_mps, ..EgoState::default() };
            let Command { throttle, brake, .. } =
                follower(|rules| (rules.speed, rules.default_throttle) = (speed, 0.5))
                    .step(Time::ZERO, &ego, Some(&plan))
                    .command;
            (throttle, brake)
        };
        assert_eq!(pedals(SpeedLaw::Proportional, 16.0, 16.0), (0.5, 0.0));
        assert_eq!(pedals(SpeedLaw::Proportional, 12.0, 16.0), (0.75, 0.0));
        // `u` is 0.25 times 8; at 2 m/s it is 0.5, which does not brake.
        let (throttle, brake) = pedals(SpeedLaw::Proportional, 8.0, 0.0);
        assert!(throttle == 0.0 && (brake - 0.7).abs() < 1e-12);
        assert_eq!(pedals(SpeedLaw::Proportional, 2.0, 0.0), (0.0, 0.0));
        assert_eq!(pedals(SpeedLaw::Pid, 2.0, 0.0), (0.0, 1.0));
    }
}
