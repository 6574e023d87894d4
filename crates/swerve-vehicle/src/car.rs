//! The four-corner car: motion of its body and a command in, forces out.

use swerve_geom::{Ego, Map, Point, Transform, Vector};

use crate::actuator::{Actuators, DeadTime};
use crate::suspension::{Corner, wheel_loads_n};
use crate::tyre::{ContactPatch, PatchInput};
use crate::{Controls, VehicleParams};

/// Motion of the car's body, as the owner of the body has it.
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
    /// Peak friction coefficient of a tyre on it.
    pub friction: f64,
}

/// Force of the ground on one wheel.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct WheelForce {
    /// Where it acts.
    pub point: Point<Map>,
    /// The force, newtons.
    pub force_n: Vector<Map>,
}

/// Everything that acts on the body besides gravity and collisions.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct CarForces {
    /// Front left, front right, rear left, rear right.
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
    /// Share of the brake torque that the anti-lock control lets through.
    brake_share: f64,
    seen: WheelState,
}

/// Longest step of wheels and tyres, seconds; a longer step of the body is divided.
const SUBSTEP_MAX_S: f64 = 0.002;
/// Change of the brake share per second and unit of relative slip error: the slip settles within about
/// 0.1 s without chattering.
const ABS_GAIN_PS: f64 = 20.0;

/// What one wheel meets during a step of the body.
struct Meeting {
    patch: PatchInput,
    drive_nm: f64,
    brake_nm: f64,
    rolling_nm: f64,
    /// Slip that the anti-lock control aims at.
    slip_target: f64,
}

/// A car with state: wheels, tyres, actuators and commands on their way.
#[derive(Clone, PartialEq, Debug)]
pub struct Car {
    params: VehicleParams,
    dead_time: DeadTime,
    actuators: Actuators,
    wheels: [Wheel; 4],
    /// Slip of largest force on ground of friction 1.
    peak_slip: f64,
    refused: u64,
}

impl Car {
    /// A car that rolls at `speed_mps` with straight wheels and released pedals.
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

    /// The parameters that it was made with.
    pub fn params(&self) -> &VehicleParams {
        &self.params
    }

    /// Present angle of the front road wheels, radians.
    pub fn steering_rad(&self) -> f64 {
        self.actuators.steering_rad
    }

    /// Present torques of the drivetrain at the driven wheels and asked of the brakes, N m.
    pub fn torques_nm(&self) -> (f64, f64) {
        (self.actuators.drive_nm, self.actuators.brake_nm)
    }

    /// The wheels after the last step: front left, front right, rear left, rear right.
    pub fn wheels(&self) -> [WheelState; 4] {
        self.wheels.map(|wheel| wheel.seen)
    }

    /// How many commands were refused because they were not finite; the last good one went on.
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

    /// Moves actuators, wheels and tyres on by `dt_s` under `controls` while the body moves as `motion`
    /// says, and returns the mean forces on the body over the step.
    ///
    /// A command that is not finite is refused, one out of range is clamped.
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
                friction: ground[i].friction,
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

    /// Mean spin of the driven axle, which the motor turns with.
    fn driven_spin_radps(&self) -> f64 {
        let spin = |i: usize| self.wheels[i].spin_radps;
        let front = self.params.drivetrain.front_share;
        0.5 * (front * (spin(0) + spin(1)) + (1.0 - front) * (spin(2) + spin(3)))
    }

    /// Cosine and sine of each wheel's turn: the front ones by Ackermann, about one point on the rear axle.
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
        let meeting = Meeting {
            patch,
            // Open differentials: equal torque to both wheels of an axle.
            drive_nm: a.drive_nm * axle(p.drivetrain.front_share),
            brake_nm: a.brake_nm * axle(p.brakes.front_share),
            rolling_nm: p.wheel.rolling_resistance * patch.load_n * p.wheel.radius_m,
            slip_target: p.brakes.abs.slip_target * self.peak_slip * patch.friction,
        };
        self.wheels[i].step(p, &meeting, dt_s)
    }
}

fn velocity_at(motion: &BodyMotion, cg: Point<Map>, point: Point<Map>) -> Vector<Map> {
    let lever = (point - cg).coords;
    let turning = motion.angular_velocity_radps.coords.cross(&lever);
    motion.velocity_mps + Vector::new(turning.x, turning.y, turning.z)
}

impl Wheel {
    /// Moves the wheel on and returns the mean force over the step, along its heading and to its left.
    fn step(&mut self, params: &VehicleParams, meeting: &Meeting, dt_s: f64) -> [f64; 2] {
        #[expect(
            clippy::cast_possible_truncation,
            clippy::cast_sign_loss,
            reason = "a few substeps, above 0"
        )]
        let substeps = (dt_s / SUBSTEP_MAX_S).ceil().clamp(1.0, 1000.0) as u32;
        let h_s = dt_s / f64::from(substeps);
        let (mut fx, mut fy) = (0.0, 0.0);
        for _ in 0..substeps {
            let [fx_now, fy_now] = self.substep(params, meeting, h_s);
            fx += fx_now;
            fy += fy_now;
        }
        let (fx_n, fy_n) = (fx / f64::from(substeps), fy / f64::from(substeps));
        let slip = self.slip(params.wheel.radius_m, meeting.patch.vx_mps);
        self.seen =
            WheelState { load_n: meeting.patch.load_n, fx_n, fy_n, spin_radps: self.spin_radps, slip };
        [fx_n, fy_n]
    }

    fn slip(&self, radius_m: f64, vx_mps: f64) -> f64 {
        let speed = vx_mps.abs();
        if speed < 0.1 { 0.0 } else { (self.spin_radps * radius_m - vx_mps) / speed }
    }

    /// The wheel's spin is linearly implicit in the tyre force: with the tyre's stiffness behind it, the
    /// wheel is far too light for an explicit step near standstill.
    fn substep(&mut self, params: &VehicleParams, meeting: &Meeting, h_s: f64) -> [f64; 2] {
        let radius = params.wheel.radius_m;
        let brake_nm = meeting.brake_nm * self.anti_lock(params, meeting, h_s) + meeting.rolling_nm;
        let tread = self.spin_radps * radius;
        let (force, slope) = self.patch.step(&params.tyre, &meeting.patch, tread, h_s);
        let inertia = params.wheel.spin_inertia_kgm2 + h_s * radius * radius * slope;
        let free = self.spin_radps + h_s * (meeting.drive_nm - radius * force.fx_n) / inertia;
        // Dry friction of the brake: it slows the wheel, stops it, holds it, but never turns it back.
        let most = h_s * brake_nm / inertia;
        self.spin_radps = if free.abs() <= most { 0.0 } else { free - most * free.signum() };
        [force.fx_n, force.fy_n]
    }

    /// Share of the asked brake torque that is let through, moved on by `h_s`.
    fn anti_lock(&mut self, params: &VehicleParams, meeting: &Meeting, h_s: f64) -> f64 {
        let abs = &params.brakes.abs;
        let vx = meeting.patch.vx_mps;
        if !abs.enabled || meeting.brake_nm <= 0.0 || vx < abs.speed_min_mps {
            self.brake_share = 1.0;
        } else {
            let slip = -self.slip(params.wheel.radius_m, vx);
            let error = 1.0 - slip / meeting.slip_target.max(1e-3);
            let rate = (ABS_GAIN_PS * error).clamp(-abs.release_rate_ps, abs.apply_rate_ps);
            self.brake_share = (self.brake_share + rate * h_s).clamp(0.0, 1.0);
        }
        self.brake_share
    }
}
