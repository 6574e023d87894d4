//! The four-corner car: body motion and commands in, forces out.

use swerve_geom::{Ego, Map, Point, Transform, Vector};

use crate::actuator::{Actuators, DeadTime};
use crate::suspension::{Corner, wheel_loads_n};
use crate::tyre::{ContactPatch, PatchInput};
use crate::{Controls, VehicleParams};

/// Motion of the car's body, as integrated by its owner.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct BodyMotion {
    /// Pose of the ego frame.
    pub map_from_ego: Transform<Map, Ego>,
    /// Velocity of the centre of gravity, m/s.
    pub velocity_mps: Vector<Map>,
    /// Angular velocity, rad/s.
    pub angular_velocity_radps: Vector<Map>,
}

/// Level ground below one wheel.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Ground {
    /// Height in the map, metres.
    pub height_m: f64,
    /// Peak friction coefficient of the car's tyre on it, of a road [`TyreParams::friction_on`](crate::TyreParams::friction_on);
    /// NaN and values at or below 0 give no grip.
    pub friction: f64,
}

/// Force of the ground on one wheel.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct WheelForce {
    /// Point of application.
    pub point: Point<Map>,
    /// The force, newtons.
    pub force_n: Vector<Map>,
}

/// All forces on the body except gravity and collisions.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct CarForces {
    /// Wheel forces: front left, front right, rear left, rear right.
    pub wheels: [WheelForce; 4],
    /// Air drag at the centre of gravity, newtons.
    pub drag_n: Vector<Map>,
}

/// One wheel after a step, for logs and tests.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct WheelState {
    /// Load, newtons.
    pub load_n: f64,
    /// Force along the wheel's heading, newtons.
    pub fx_n: f64,
    /// Force to the wheel's left, newtons.
    pub fy_n: f64,
    /// Spin, rad/s; positive forward.
    pub spin_radps: f64,
    /// Longitudinal slip `(omega R - v) / |v|`; zero below 0.1 m/s.
    pub slip: f64,
}

#[derive(Clone, Copy, PartialEq, Debug)]
struct Wheel {
    spin_radps: f64,
    patch: ContactPatch,
    /// Fraction of the brake torque passed by the anti-lock control.
    brake_share: f64,
    seen: WheelState,
}

/// Longest step of wheels and tyres, seconds; longer steps of the body are subdivided.
const SUBSTEP_MAX_S: f64 = 0.002;
/// Change of the brake share per second and unit of relative slip error: the slip settles within about
/// 0.1 s without chattering.
const ABS_GAIN_PS: f64 = 20.0;

/// Load, ground and torques of one wheel in a step of the body.
struct WheelInput {
    patch: PatchInput,
    drive_nm: f64,
    brake_nm: f64,
    rolling_nm: f64,
    /// Target slip of the anti-lock control.
    slip_target: f64,
}

/// A car with state: wheels, tyres, actuators and commands in transit.
#[derive(Clone, PartialEq, Debug)]
pub struct Car {
    params: VehicleParams,
    dead_time: DeadTime,
    actuators: Actuators,
    wheels: [Wheel; 4],
    /// Slip of largest force on ground with friction 1.
    peak_slip: f64,
    refused: u64,
}

impl Car {
    /// Creates a car that rolls at `speed_mps` with straight wheels and released pedals.
    pub fn new(params: &VehicleParams, speed_mps: f64) -> Self {
        let spin_radps = speed_mps / params.wheel.radius_m;
        let loads_n = params.static_loads_n();
        let wheel = |i: usize| Wheel {
            spin_radps,
            patch: ContactPatch::default(),
            brake_share: 1.0,
            seen: WheelState { load_n: loads_n[i], spin_radps, ..WheelState::default() },
        };
        Self {
            dead_time: DeadTime::new(params.dead_time_s, Controls::default()),
            actuators: Actuators::default(),
            wheels: core::array::from_fn(wheel),
            peak_slip: params.tyre.longitudinal.peak_slip(1.0),
            refused: 0,
            params: params.clone(),
        }
    }

    /// The car's parameters.
    pub fn params(&self) -> &VehicleParams {
        &self.params
    }

    /// Current angle of the front road wheels, radians.
    pub fn steering_rad(&self) -> f64 {
        self.actuators.steering_rad
    }

    /// Current torques of the drivetrain at the driven wheels and requested from the brakes, N m.
    pub fn torques_nm(&self) -> (f64, f64) {
        (self.actuators.drive_nm, self.actuators.brake_nm)
    }

    /// State of the wheels after the last step: front left, front right, rear left, rear right.
    pub fn wheels(&self) -> [WheelState; 4] {
        self.wheels.map(|wheel| wheel.seen)
    }

    /// Number of non-finite commands that were refused; the last valid one stays in effect.
    pub fn commands_refused(&self) -> u64 {
        self.refused
    }

    /// Positions of the contact points in the ego frame: front left, front right, rear left, rear right.
    pub fn contact_points(&self) -> [Point<Ego>; 4] {
        let (l, half) = (self.params.shape.wheelbase_m, 0.5 * self.params.body.track_m);
        [(l, half), (l, -half), (0.0, half), (0.0, -half)].map(|(x, y)| Point::new(x, y, 0.0))
    }

    /// Centre of gravity in the ego frame.
    pub fn center_of_gravity(&self) -> Point<Ego> {
        Point::new(self.params.cg_to_rear_m(), 0.0, self.params.body.cg_height_m)
    }

    /// Advances actuators, wheels and tyres by `dt_s` under `controls` while the body moves as in `motion`, and returns
    /// the mean forces on the body over the step.
    ///
    /// Non-finite commands are refused, out-of-range ones clamped.
    pub fn step(
        &mut self,
        motion: &BodyMotion,
        ground: &[Ground; 4],
        controls: Controls,
        dt_s: f64,
    ) -> CarForces {
        let given = controls.within(&self.params);
        self.refused += u64::from(given.is_none());
        let acting = self.dead_time.step(given, dt_s);
        let driven_spin = self.driven_spin_radps();
        self.actuators.step(&self.params, acting, driven_spin, dt_s);

        let pose = motion.map_from_ego;
        let cg = pose * self.center_of_gravity();
        let ahead = pose * Vector::<Ego>::new(1.0, 0.0, 0.0);
        let flat = (ahead.coords.x * ahead.coords.x + ahead.coords.y * ahead.coords.y).sqrt().max(1e-9);
        let heading = [ahead.coords.x / flat, ahead.coords.y / flat];
        // On its side or roof the car has no wheel on the ground.
        let upright = (pose * Vector::<Ego>::new(0.0, 0.0, 1.0)).coords.z > 0.2;

        let corners_map = self.contact_points().map(|point| pose * point);
        let corners = core::array::from_fn(|i| Corner {
            compression_m: ground[i].height_m - corners_map[i].coords.z,
            compression_mps: -velocity_at(motion, cg, corners_map[i]).coords.z,
        });
        let loads_n = if upright { wheel_loads_n(&self.params, &corners) } else { [0.0; 4] };
        let turns = self.wheel_turns();

        let mut forces = CarForces { drag_n: self.drag(motion.velocity_mps), ..CarForces::default() };
        for i in 0..4 {
            let point = Point::new(corners_map[i].coords.x, corners_map[i].coords.y, ground[i].height_m);
            let velocity = velocity_at(motion, cg, point).coords;
            let [cos, sin] = turns[i];
            let along = [heading[0] * cos - heading[1] * sin, heading[1] * cos + heading[0] * sin];
            let patch = PatchInput {
                load_n: loads_n[i],
                friction: ground[i].friction.max(0.0),
                vx_mps: velocity.x * along[0] + velocity.y * along[1],
                vy_mps: velocity.y * along[0] - velocity.x * along[1],
            };
            let [fx, fy] = self.step_wheel(i, patch, dt_s);
            let force_n =
                Vector::new(fx * along[0] - fy * along[1], fx * along[1] + fy * along[0], loads_n[i]);
            forces.wheels[i] = WheelForce { point, force_n };
        }
        forces
    }

    /// Mean spin of the driven axle, at which the motor turns.
    fn driven_spin_radps(&self) -> f64 {
        let spin = |i: usize| self.wheels[i].spin_radps;
        let front = self.params.drivetrain.front_share;
        0.5 * (front * (spin(0) + spin(1)) + (1.0 - front) * (spin(2) + spin(3)))
    }

    /// Cosine and sine of each wheel's steering angle: Ackermann geometry at the front, about one point on the rear
    /// axle.
    fn wheel_turns(&self) -> [[f64; 2]; 4] {
        let tan = swerve_geom::math::tan(self.actuators.steering_rad);
        let half = 0.5 * self.params.body.track_m / self.params.shape.wheelbase_m * tan;
        let turn = |tan: f64| {
            let cos = 1.0 / (1.0 + tan * tan).sqrt();
            [cos, tan * cos]
        };
        [turn(tan / (1.0 - half)), turn(tan / (1.0 + half)), [1.0, 0.0], [1.0, 0.0]]
    }

    fn drag(&self, velocity: Vector<Map>) -> Vector<Map> {
        let aero = &self.params.aero;
        velocity * (-0.5 * aero.air_density_kgpm3 * aero.drag_area_m2 * velocity.norm())
    }

    fn step_wheel(&mut self, i: usize, patch: PatchInput, dt_s: f64) -> [f64; 2] {
        let (p, a) = (&self.params, &self.actuators);
        let axle = |front_share: f64| 0.5 * if i < 2 { front_share } else { 1.0 - front_share };
        let input = WheelInput {
            patch,
            // Open differentials: equal torque to both wheels of an axle.
            drive_nm: a.drive_nm * axle(p.drivetrain.front_share),
            brake_nm: a.brake_nm * axle(p.brakes.front_share),
            rolling_nm: p.wheel.rolling_resistance * patch.load_n * p.wheel.radius_m,
            slip_target: p.brakes.abs.slip_target * self.peak_slip * patch.friction,
        };
        self.wheels[i].step(p, &input, dt_s)
    }
}

fn velocity_at(motion: &BodyMotion, cg: Point<Map>, point: Point<Map>) -> Vector<Map> {
    let lever = (point - cg).coords;
    let turning = motion.angular_velocity_radps.coords.cross(&lever);
    motion.velocity_mps + Vector::new(turning.x, turning.y, turning.z)
}

impl Wheel {
    /// Advances the wheel and returns the mean force over the step, along its heading and to its left.
    fn step(&mut self, params: &VehicleParams, input: &WheelInput, dt_s: f64) -> [f64; 2] {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few substeps, above 0"
        )]
        let substeps = (dt_s / SUBSTEP_MAX_S).ceil().clamp(1.0, 1000.0) as u32;
        let h_s = dt_s / f64::from(substeps);
        let (mut fx, mut fy) = (0.0, 0.0);
        for _ in 0..substeps {
            let [fx_now, fy_now] = self.substep(params, input, h_s);
            fx += fx_now;
            fy += fy_now;
        }
        let (fx_n, fy_n) = (fx / f64::from(substeps), fy / f64::from(substeps));
        let slip = self.slip(params.wheel.radius_m, input.patch.vx_mps);
        self.seen = WheelState { load_n: input.patch.load_n, fx_n, fy_n, spin_radps: self.spin_radps, slip };
        [fx_n, fy_n]
    }

    fn slip(&self, radius_m: f64, vx_mps: f64) -> f64 {
        let speed = vx_mps.abs();
        if speed < 0.1 { 0.0 } else { (self.spin_radps * radius_m - vx_mps) / speed }
    }

    /// The wheel's spin is linearly implicit in the tyre force: with the tyre's stiffness, the wheel is far too light
    /// for an explicit step near standstill.
    fn substep(&mut self, params: &VehicleParams, input: &WheelInput, h_s: f64) -> [f64; 2] {
        let radius = params.wheel.radius_m;
        let brake_nm = input.brake_nm * self.anti_lock(params, input, h_s) + input.rolling_nm;
        let tread = self.spin_radps * radius;
        let (force, slope) = self.patch.step(&params.tyre, &input.patch, tread, h_s);
        let inertia = params.wheel.spin_inertia_kgm2 + h_s * radius * radius * slope;
        let free = self.spin_radps + h_s * (input.drive_nm - radius * force.fx_n) / inertia;
        // Dry friction of the brake: it slows the wheel, stops it, holds it, but never reverses it.
        let most = h_s * brake_nm / inertia;
        self.spin_radps = if free.abs() <= most { 0.0 } else { free - most * free.signum() };
        [force.fx_n, force.fy_n]
    }

    /// Fraction of the requested brake torque that is passed, advanced by `h_s`.
    fn anti_lock(&mut self, params: &VehicleParams, input: &WheelInput, h_s: f64) -> f64 {
        let abs = &params.brakes.abs;
        let vx = input.patch.vx_mps;
        if !abs.enabled || input.brake_nm <= 0.0 || vx < abs.speed_min_mps {
            self.brake_share = 1.0;
        } else {
            let slip = -self.slip(params.wheel.radius_m, vx);
            let error = 1.0 - slip / input.slip_target.max(1e-3);
            let rate = (ABS_GAIN_PS * error).clamp(-abs.release_rate_ps, abs.apply_rate_ps);
            self.brake_share = (self.brake_share + rate * h_s).clamp(0.0, 1.0);
        }
        self.brake_share
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEVEL: Ground = Ground { height_m: 0.0, friction: 0.9 };

    /// A body that moves ahead at constant speed, regardless of the forces.
    fn ahead(car: &Car, speed_mps: f64, roll_rad: f64, height_m: f64) -> BodyMotion {
        assert!(car.params().validate().is_ok());
        BodyMotion {
            map_from_ego: Transform::from_roll_pitch_yaw(Point::new(0.0, 0.0, height_m), roll_rad, 0.0, 0.0),
            velocity_mps: Vector::new(speed_mps, 0.0, 0.0),
            angular_velocity_radps: Vector::default(),
        }
    }

    #[test]
    fn ground_at_rest_carries_only_the_weight() {
        let mut car = Car::new(&VehicleParams::default(), 0.0);
        let motion = ahead(&car, 0.0, 0.0, 0.0);
        let forces = car.step(&motion, &[LEVEL; 4], Controls::default(), 0.005);
        let total = forces.wheels.iter().fold(forces.drag_n, |sum, wheel| sum + wheel.force_n).coords;
        assert!(total.x == 0.0 && total.y == 0.0 && (total.z - 1800.0 * crate::GRAVITY_MPS2).abs() < 1e-9);
    }

    #[test]
    fn open_differential_limits_both_wheels_to_the_torque_of_the_slippery_side() {
        let mut car = Car::new(&VehicleParams::default(), 5.0);
        let motion = ahead(&car, 5.0, 0.0, 0.0);
        let ice = Ground { friction: 0.1, ..LEVEL };
        let full = Controls { throttle: 1.0, ..Controls::default() };
        for _ in 0..100 {
            car.step(&motion, &[ice, LEVEL, ice, LEVEL], full, 0.005);
        }
        let [left, right, rear, _] = car.wheels();
        assert!(left.slip > 1.0, "the wheel on ice spins: {left:?}");
        assert!(right.slip > 0.0 && right.slip < 0.1, "the other one grips: {right:?}");
        assert!(left.fx_n < 0.11 * left.load_n && right.fx_n > 3.0 * left.fx_n);
        // Each side has half the torque: on the gripping side nearly all of it becomes force on the road.
        let (drive_nm, _) = car.torques_nm();
        assert!((right.fx_n * 0.335 / (0.5 * drive_nm) - 1.0).abs() < 0.1, "{right:?} {drive_nm}");
        assert!(rear.fx_n < 0.0, "the rear axle is not driven: {rear:?}");
    }

    #[test]
    fn wheels_without_contact_or_grip_give_no_longitudinal_force() {
        let no_grip = Ground { friction: f64::NAN, ..LEVEL };
        for (roll_rad, height_m, ground) in
            [(0.0, 1.0, LEVEL), (3.0, 1.4, LEVEL), (1.5, 0.9, LEVEL), (0.0, 0.0, no_grip)]
        {
            let mut car = Car::new(&VehicleParams::default(), 10.0);
            let motion = ahead(&car, 10.0, roll_rad, height_m);
            let controls = Controls { steering_rad: 0.3, throttle: 1.0, brake: 0.0 };
            for _ in 0..40 {
                let forces = car.step(&motion, &[ground; 4], controls, 0.005);
                for wheel in forces.wheels {
                    let force = wheel.force_n.coords;
                    assert!(force.x == 0.0 && force.y == 0.0, "{wheel:?} at {roll_rad} rad, {height_m} m");
                }
            }
        }
    }

    #[test]
    fn a_locked_wheel_slides_with_its_force_against_the_motion() {
        let mut params = VehicleParams::default();
        params.brakes.abs.enabled = false;
        let mut car = Car::new(&params, 15.0);
        let motion = BodyMotion { velocity_mps: Vector::new(12.0, 9.0, 0.0), ..ahead(&car, 0.0, 0.0, 0.0) };
        let brake = Controls { brake: 1.0, ..Controls::default() };
        for _ in 0..200 {
            car.step(&motion, &[LEVEL; 4], brake, 0.005);
        }
        for wheel in car.wheels() {
            assert_eq!(wheel.spin_radps, 0.0);
            // Not exactly: in full slide the two curves have decreased by different fractions.
            let across = (wheel.fx_n * 9.0 - wheel.fy_n * 12.0).abs() / (15.0 * wheel.load_n);
            assert!(wheel.fx_n < 0.0 && wheel.fy_n < 0.0 && across < 0.2, "{wheel:?}");
        }
    }
}
