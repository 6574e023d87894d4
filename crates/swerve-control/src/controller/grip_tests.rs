//! Ice in a bend, with the four-corner car moving in the plane.

use super::*;
use crate::bicycle::road;
use crate::{GripParams, Pedals};
use swerve_geom::{Point, Point2, Polyline, Pose2, Transform, Vector};
use swerve_msg::PlanStatus;
use swerve_vehicle::{BodyMotion, Car, Controls, Ground, VehicleParams, pedals_for_accel};

/// Begin of the bend, its radius, and the ice by arc length, metres.
const BEND_M: f64 = 5.0;
const RADIUS_M: f64 = 12.0;
const ICE_M: core::ops::Range<f64> = 13.0..28.0;
const START_MPS: f64 = 3.0;
const STEP_S: f64 = 0.005;

/// A plan into a left bend that speeds up by 1.75 m/s², to 2 m/s² of lateral acceleration.
fn speeds_up() -> Plan {
    let (mut pose, mut s_m, mut speed_mps) = (Pose2::new(0.0, 0.0, 0.0), 0.0, START_MPS);
    let points = (0..140).map(|k| {
        let accel_mps2 = if speed_mps < (2.0 * RADIUS_M).sqrt() { 1.75 } else { 0.0 };
        let curvature_1pm = ((s_m - BEND_M) / 5.0).clamp(0.0, 1.0) / RADIUS_M;
        let point = PlanPoint { at: Time::from_ms(50 * k), pose, curvature_1pm, speed_mps, accel_mps2 };
        let way_m = 0.05 * (speed_mps + 0.5 * accel_mps2 * 0.05);
        let turn_rad = curvature_1pm * way_m;
        let there: Pose2 = Pose2::new(pose.x_m, pose.y_m, pose.heading_rad + 0.5 * turn_rad).ahead(way_m);
        pose = Pose2::new(there.x_m, there.y_m, pose.heading_rad + turn_rad);
        s_m += way_m;
        speed_mps += accel_mps2 * 0.05;
        point
    });
    Plan { status: PlanStatus::Comfortable, points: points.collect(), ..Plan::default() }
}

/// A car whose body moves in the plane.
struct PlaneCar {
    car: Car,
    pose: Pose2,
    /// Velocity of the centre of gravity, m/s.
    velocity_mps: [f64; 2],
    yaw_rate_radps: f64,
    /// Accelerations of the centre of gravity along the heading and to its left, m/s².
    accel_mps2: [f64; 2],
}

impl PlaneCar {
    fn new() -> Self {
        let car = Car::new(&VehicleParams::default(), START_MPS);
        let pose = Pose2::new(0.0, 0.0, 0.0);
        Self { car, pose, velocity_mps: [START_MPS, 0.0], yaw_rate_radps: 0.0, accel_mps2: [0.0; 2] }
    }

    fn ego(&self, stamp: Time) -> EgoState {
        let (sin, cos) = math::sin_cos(self.pose.heading_rad);
        EgoState {
            stamp,
            pose: self.pose,
            speed_mps: cos * self.velocity_mps[0] + sin * self.velocity_mps[1],
            accel_mps2: self.accel_mps2[0],
            lateral_accel_mps2: self.accel_mps2[1],
            yaw_rate_radps: self.yaw_rate_radps,
            steering_rad: self.car.steering_rad(),
        }
    }

    fn step(&mut self, command: Command, friction: impl Fn(Point2) -> f64) {
        let body = self.car.params().body;
        let Pose2 { x_m, y_m, heading_rad, .. } = self.pose;
        let map_from_ego = Transform::from_roll_pitch_yaw(Point::new(x_m, y_m, 0.0), 0.0, 0.0, heading_rad);
        let motion = BodyMotion {
            map_from_ego,
            velocity_mps: Vector::new(self.velocity_mps[0], self.velocity_mps[1], 0.0),
            angular_velocity_radps: Vector::new(0.0, 0.0, self.yaw_rate_radps),
        };
        let ground = self.car.contact_points().map(|point| {
            let at = (map_from_ego * point).coords;
            Ground { height_m: 0.0, friction: friction(Point2::new(at.x, at.y)) }
        });
        let Command { steering_rad, throttle, brake } = command;
        let forces = self.car.step(&motion, &ground, Controls { steering_rad, throttle, brake }, STEP_S);
        let cg = (map_from_ego * self.car.center_of_gravity()).coords;
        let (mut fx, mut fy, mut moment) = (forces.drag_n.coords.x, forces.drag_n.coords.y, 0.0);
        for wheel in forces.wheels {
            let (at, force) = (wheel.point.coords, wheel.force_n.coords);
            (fx, fy) = (fx + force.x, fy + force.y);
            moment += (at.x - cg.x) * force.y - (at.y - cg.y) * force.x;
        }
        let (sin, cos) = math::sin_cos(heading_rad);
        self.accel_mps2 = [(cos * fx + sin * fy) / body.mass_kg, (cos * fy - sin * fx) / body.mass_kg];
        self.velocity_mps[0] += fx / body.mass_kg * STEP_S;
        self.velocity_mps[1] += fy / body.mass_kg * STEP_S;
        let turn_rad = (self.yaw_rate_radps + 0.5 * moment / body.yaw_inertia_kgm2 * STEP_S) * STEP_S;
        self.yaw_rate_radps += moment / body.yaw_inertia_kgm2 * STEP_S;
        let [vx, vy] = self.velocity_mps;
        let to_rear_m = self.car.params().cg_to_rear_m();
        let (sin_next, cos_next) = math::sin_cos(heading_rad + turn_rad);
        self.pose = Pose2::new(
            x_m + vx * STEP_S + to_rear_m * (cos - cos_next),
            y_m + vy * STEP_S + to_rear_m * (sin - sin_next),
            heading_rad + turn_rad,
        );
    }
}

/// Largest distance from the path, metres, over 6 s on ice of a friction.
fn off_path_m(law: Law, grip: GripParams, friction: f64) -> f64 {
    let vehicle = VehicleParams::default();
    let plan = speeds_up();
    let points: Vec<_> = plan.points.iter().map(|p| p.pose.point()).collect();
    let line = Polyline::smooth(&points, 0.1).unwrap();
    let pedals = vehicle.clone();
    let pedals = move |accel: f64, speed: f64| {
        let p = pedals_for_accel(&pedals, speed, accel);
        Pedals { throttle: p.throttle, brake: p.brake }
    };
    let params = Params { law, grip, ..Params::default() };
    let mut controller = LawController::new(params, Shape::default(), vehicle.limits, Box::new(pedals));
    let route = Route::uniform(road().line().clone(), 60.0, 60.0);
    let (mut car, mut s_m, mut off_m) = (PlaneCar::new(), 0.0, 0.0f64);
    for k in 0..600 {
        let now = Time::from_ms(10 * k);
        let ego = car.ego(now);
        let command = controller.step(&Input { now, ego: &ego, plan: Some(&plan), route: &route }).command;
        for _ in 0..2 {
            let near_m = s_m;
            let is_ice = |point| ICE_M.contains(&line.project_near(point, near_m, 10.0).s_m);
            car.step(command, |point| if is_ice(point) { friction } else { 0.9 });
        }
        let at = line.project_near(car.pose.point(), s_m, 10.0);
        s_m = at.s_m;
        off_m = off_m.max(at.d_m.abs());
    }
    off_m
}

/// At 4.9 m/s the bend needs 2.0 m/s², the grip of the ice.
#[test]
fn car_that_speeds_up_on_ice_in_a_bend_stays_in_its_lane() {
    for law in [Law::PurePursuit, Law::Stanley, Law::Mpc] {
        let never = GripParams { slip_max_rad: 1.6, ..GripParams::default() };
        let without_m = off_path_m(law, never, 0.2);
        let off_m = off_path_m(law, GripParams::default(), 0.2);
        assert!(off_m < 0.6 && without_m > 1.2, "{law:?}: {off_m} m instead of {without_m} m");
    }
}

#[test]
fn grip_of_dry_ground_changes_nothing() {
    for law in [Law::PurePursuit, Law::Stanley, Law::Mpc] {
        let never = GripParams { slip_max_rad: 1.6, ..GripParams::default() };
        assert_eq!(off_path_m(law, GripParams::default(), 0.9), off_path_m(law, never, 0.9), "{law:?}");
    }
}
