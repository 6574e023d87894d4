//! Short-term dead reckoning by wheels and gyroscopes, used to deskew lidar scans and as the initial guess of scan
//! matching.

use std::collections::VecDeque;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use swerve_core::{Span, Time};

use crate::eskf::{exp, unit};
use crate::sweep::Sweep;

/// Duration of the stored path, and longest extrapolation from a reading.
const KEPT: Span = Span::from_ms(3000);
const AHEAD_S: f64 = 0.2;

/// Sensor reading for dead reckoning.
#[derive(Clone, Copy, PartialEq, Debug)]
pub enum Reading {
    /// Speed of the rear axle from the wheels, m/s.
    Wheels(f64),
    /// Angular rate about the ego's axes, rad/s.
    Gyro([f64; 3]),
}

/// Path of the ego origin since its start.
#[derive(Clone, Debug)]
pub struct DeadReckoning {
    /// Pose at each reading, in the frame of the start.
    way: VecDeque<(Time, Isometry3<f64>)>,
    speed_mps: f64,
    gyro_radps: Vector3<f64>,
}

impl DeadReckoning {
    /// Creates one at rest at the origin of its frame.
    pub fn new() -> Self {
        Self { way: VecDeque::new(), speed_mps: 0.0, gyro_radps: Vector3::zeros() }
    }

    /// Processes a reading. Readings beyond the limits of a car, and those older than the newest, are ignored.
    pub fn take(&mut self, stamp: Time, reading: Reading) {
        match reading {
            Reading::Wheels(speed_mps) if speed_mps.abs() <= 150.0 => {
                if self.way.is_empty() {
                    self.begin(stamp, speed_mps);
                } else if self.advance(stamp) {
                    self.speed_mps = speed_mps;
                }
            }
            Reading::Gyro(gyro_radps)
                if gyro_radps.iter().all(|x| x.abs() <= 100.0)
                    && (self.way.is_empty() || self.advance(stamp)) =>
            {
                self.gyro_radps = Vector3::from(gyro_radps);
            }
            _ => {}
        }
    }

    /// Latest speed of the rear axle, m/s.
    pub fn speed_mps(&self) -> f64 {
        self.speed_mps
    }

    /// Starts with the first speed, which is extrapolated backwards as well.
    fn begin(&mut self, stamp: Time, speed_mps: f64) {
        self.speed_mps = speed_mps;
        let before = stamp - Span::from_secs(AHEAD_S);
        self.way.push_back((before, Isometry3::identity()));
        let now = self.ahead(stamp);
        self.way.push_back((stamp, now));
    }

    /// Advances to a stamp; returns false if the stamp is before the newest.
    fn advance(&mut self, stamp: Time) -> bool {
        let Some(&(last, _)) = self.way.back() else { return false };
        if stamp <= last {
            return stamp == last;
        }
        self.way.push_back((stamp, self.ahead(stamp)));
        while self.way.front().is_some_and(|(first, _)| stamp - *first > KEPT) {
            self.way.pop_front();
        }
        true
    }

    /// Pose extrapolated from the newest reading, limited to the longest extrapolation.
    fn ahead(&self, at: Time) -> Isometry3<f64> {
        let Some(&(last, pose)) = self.way.back() else { return Isometry3::identity() };
        let dt_s = (at - last).as_secs().clamp(0.0, AHEAD_S);
        let turn = self.gyro_radps * dt_s;
        let forward = exp(&(turn * 0.5)) * (Vector3::x() * (self.speed_mps * dt_s));
        moved_on(&pose, &forward, &exp(&turn))
    }

    fn at(&self, at: Time) -> Isometry3<f64> {
        let next = self.way.partition_point(|(stamp, _)| *stamp < at);
        let Some(&(after, to)) = self.way.get(next) else { return self.ahead(at) };
        let Some(&(before, from)) = next.checked_sub(1).and_then(|k| self.way.get(k)) else { return to };
        let share = (at - before).as_secs() / (after - before).as_secs();
        let between = from.inverse() * to;
        let coords = between.rotation.coords.xyz() * (2.0 * between.rotation.coords.w.signum() * share);
        moved_on(&from, &(between.translation.vector * share), &exp(&coords))
    }

    /// Motion between two instants, in the ego frame at the first; `None` before the first speed.
    pub fn between(&self, from: Time, to: Time) -> Option<Isometry3<f64>> {
        (!self.way.is_empty()).then(|| self.at(from).inverse() * self.at(to))
    }
}

impl Default for DeadReckoning {
    fn default() -> Self {
        Self::new()
    }
}

/// Motion of a lidar on a car, scan by scan.
#[derive(Clone, Debug)]
pub struct LidarMotion {
    /// Dead reckoning of the car.
    pub car: DeadReckoning,
    ego_from_lidar: Isometry3<f64>,
    /// End of the previous scan.
    last: Option<Time>,
}

/// Motion of a lidar over one scan.
#[derive(Clone, PartialEq, Debug)]
pub struct Turned {
    /// Motion over the period to which the time offsets of points refer.
    pub sweep: Sweep,
    /// Duration of that period, seconds.
    pub period_s: f64,
    /// Total motion over the scan, in the frame at its start.
    pub over_turn: Isometry3<f64>,
    /// True if the scan does not directly follow a previous one.
    pub is_first: bool,
}

/// Assumed duration of the first scan, seconds.
const FIRST_TURN_S: f64 = 0.1;
/// Gap after which a scan is treated as the first, seconds: the motion over a longer gap is taken as unknown.
const GAP_S: f64 = 0.5;
/// Number of pieces per scan: the turn rate of a car changes within one.
const PIECES: i64 = 8;

impl LidarMotion {
    /// Creates one for a lidar mounted at this pose.
    pub fn new(ego_from_lidar: Isometry3<f64>) -> Self {
        Self { car: DeadReckoning::new(), ego_from_lidar, last: None }
    }

    /// Motion over a scan that ends at an instant; `None` unless that is later than the end of the previous scan.
    pub fn turn(&mut self, end: Time) -> Option<Turned> {
        let last = self.last;
        if last.is_some_and(|last| end <= last) {
            return None;
        }
        self.last = Some(end);
        let last = last.filter(|last| (end - *last).as_secs() <= GAP_S);
        let period_s = last.map_or(FIRST_TURN_S, |last| (end - last).as_secs());
        let begin = end - Span::from_secs(period_s);
        let at = |k: i64| self.moved(begin, begin + Span::from_secs(period_s * k as f64 / PIECES as f64));
        let poses: Vec<_> = (0..=PIECES).map(at).collect();
        let (sweep, over_turn) = (Sweep::through(&poses), self.moved(begin, end));
        Some(Turned { sweep, period_s, over_turn, is_first: last.is_none() })
    }

    fn moved(&self, from: Time, to: Time) -> Isometry3<f64> {
        let ego = self.car.between(from, to).unwrap_or_else(Isometry3::identity);
        self.ego_from_lidar.inverse() * ego * self.ego_from_lidar
    }
}

fn moved_on(pose: &Isometry3<f64>, forward: &Vector3<f64>, turn: &UnitQuaternion<f64>) -> Isometry3<f64> {
    let place = pose.translation.vector + pose.rotation * forward;
    Isometry3::from_parts(Translation3::from(place), unit(pose.rotation * turn))
}

#[cfg(test)]
mod tests {
    use swerve_geom::math;

    use super::*;

    #[test]
    fn dead_reckoning_follows_an_arc_and_ignores_implausible_readings() {
        let mut reckoning = DeadReckoning::new();
        let at = |ms: i64| Time::ZERO + Span::from_ms(ms);
        assert!(reckoning.between(at(0), at(100)).is_none());
        for ms in (0..=1000).step_by(10) {
            reckoning.take(at(ms), Reading::Gyro([0.0, 0.0, 0.5]));
            reckoning.take(at(ms), Reading::Wheels(10.0));
        }
        reckoning.take(at(1000), Reading::Wheels(f64::NAN));
        reckoning.take(at(1000), Reading::Gyro([f64::INFINITY, 0.0, 0.0]));
        reckoning.take(at(400), Reading::Wheels(90.0));
        let moved = reckoning.between(at(505), at(905)).unwrap();
        let exact = [20.0 * math::sin(0.2), 20.0 * (1.0 - math::cos(0.2))];
        let found = moved.translation.vector;
        assert!((found.x - exact[0]).abs() < 1e-3 && (found.y - exact[1]).abs() < 1e-3, "{found}");
        // If sensors fall silent, the extrapolation ends after 0.2 s.
        let far = reckoning.between(at(1000), at(60_000)).unwrap().translation.vector.norm();
        assert!((far - 2.0).abs() < 0.01, "{far}");
    }
    #[test]
    fn first_speed_is_extrapolated_backwards() {
        let mut reckoning = DeadReckoning::new();
        let at = |ms: i64| Time::ZERO + Span::from_ms(ms);
        reckoning.take(at(0), Reading::Gyro([0.0; 3]));
        assert!(reckoning.between(at(-50), at(0)).is_none(), "a speed is needed");
        reckoning.take(at(30), Reading::Wheels(20.0));
        let moved = reckoning.between(at(-50), at(50)).unwrap().translation.vector;
        assert!((moved.x - 2.0).abs() < 1e-9, "{moved}");
    }

    #[test]
    fn lidar_on_the_roof_swings_with_the_car() {
        let mount = Isometry3::from_parts(Translation3::new(2.0, 0.0, 1.8), UnitQuaternion::identity());
        let mut motion = LidarMotion::new(mount);
        let at = |ms: i64| Time::ZERO + Span::from_ms(ms);
        for ms in (0..=400).step_by(10) {
            motion.car.take(at(ms), Reading::Gyro([0.0, 0.0, 1.0]));
            motion.car.take(at(ms), Reading::Wheels(0.0));
        }
        assert!(motion.turn(at(100)).unwrap().is_first);
        let turned = motion.turn(at(200)).unwrap();
        // A rotation by 0.1 rad about the rear axle, two metres behind the lidar.
        let moved = turned.over_turn.translation.vector;
        let exact = [2.0 * (math::cos(0.1) - 1.0), 2.0 * math::sin(0.1)];
        assert!((moved.x - exact[0]).abs() < 1e-6 && (moved.y - exact[1]).abs() < 1e-6, "{moved}");
        assert_eq!((turned.is_first, turned.period_s), (false, 0.1));
        assert!(motion.turn(at(200)).is_none() && motion.turn(at(150)).is_none(), "stamps do not go back");
        let late = motion.turn(at(400)).unwrap();
        assert!((late.period_s - 0.2).abs() < 1e-12, "a turn that was missed counts with the next");
        let after_a_gap = motion.turn(at(3400)).unwrap();
        assert_eq!(
            (after_a_gap.is_first, after_a_gap.period_s),
            (true, 0.1),
            "a turn takes no three seconds"
        );
    }
}
