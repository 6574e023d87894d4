//! Parameters of the car, with their sources.
//!
//! Sources: \[A\] Baidu Apollo's `mkz_config` (open source calibration of a Lincoln MKZ with drive-by-wire); \[C\]
//! Althoff and Würsching, "CommonRoad: Vehicle Models", 2020, tables 6 and 7 (tyre: the PAC2002 set of the Adams/Tire
//! handbook); \[P\] Pacejka, "Tire and Vehicle Dynamics", 3rd edition; \[E\] an estimate for the class of car, with its
//! reasoning.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::param::{ParamError, Ranges, require};

use crate::{GRAVITY_MPS2, Limits, MagicFormula, Shape, SteeringParams};

/// Parameters of the whole car. The default is a Lincoln MKZ with drive-by-wire and 1.8 t.
#[derive(Clone, PartialEq, Debug, Default, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct VehicleParams {
    /// Outline and wheelbase of the car.
    #[ranges(nested)]
    pub shape: Shape,
    /// Limits on the demands of planners and controllers; the steering angle and rate also apply to the actuator.
    #[ranges(nested)]
    pub limits: Limits,
    /// Mass and inertia of the car.
    #[ranges(nested)]
    pub body: BodyParams,
    /// Springs, dampers and anti-roll bars.
    #[ranges(nested)]
    pub suspension: SuspensionParams,
    /// Parameters of the wheels.
    #[ranges(nested)]
    pub wheel: WheelParams,
    /// Parameters of the tyres, the same on all corners.
    #[ranges(nested)]
    pub tyre: TyreParams,
    /// Drivetrain from motor to wheels.
    #[ranges(nested)]
    pub drivetrain: DrivetrainParams,
    /// Parameters of the brakes.
    #[ranges(nested)]
    pub brakes: BrakeParams,
    /// Parameters of the steering actuator.
    #[ranges(nested)]
    pub steering: SteeringParams,
    /// Air drag of the car.
    #[ranges(nested)]
    pub aero: AeroParams,
    /// Time from the arrival of a command to the first reaction of the actuators (drive-by-wire), seconds. Delays
    /// steering, throttle and brake alike; at most 10.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub dead_time_s: f64,
}

/// Mass and inertia.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct BodyParams {
    /// Mass of the whole car with its load, kg.
    #[schemars(range(min = 50.0, max = 100_000.0))]
    pub mass_kg: f64,
    /// Height of the centre of gravity above ground, metres.
    #[schemars(range(min = 0.0, max = 5.0))]
    pub cg_height_m: f64,
    /// Share of the weight on the front axle, 0 to 1.
    #[schemars(range(min = 0.2, max = 0.8))]
    pub front_weight_share: f64,
    /// Moment of inertia about the roll axis (x) through the centre of gravity, kg m².
    #[schemars(range(min = 1.0, max = 1e6))]
    pub roll_inertia_kgm2: f64,
    /// Moment of inertia about the pitch axis (y), kg m².
    #[schemars(range(min = 1.0, max = 1e7))]
    pub pitch_inertia_kgm2: f64,
    /// Moment of inertia about the yaw axis (z), kg m².
    #[schemars(range(min = 1.0, max = 1e7))]
    pub yaw_inertia_kgm2: f64,
    /// Distance between the contact points of one axle, metres.
    #[schemars(range(min = 0.2, max = 5.0))]
    pub track_m: f64,
}

impl Default for BodyParams {
    /// \[E\]: front-wheel-drive kerb weights put 58 to 60 % on the front axle, equipment in the boot moves
    /// that to 55 %. Yaw inertia from the dynamic index `I / (m a b) = 0.9` usual for saloon cars; roll and
    /// pitch from radii of gyration of 0.59 m and 1.28 m. Track: the platform's 1.59 m, rounded.
    fn default() -> Self {
        Self {
            mass_kg: 1800.0,
            cg_height_m: 0.55,
            front_weight_share: 0.55,
            roll_inertia_kgm2: 630.0,
            pitch_inertia_kgm2: 2950.0,
            yaw_inertia_kgm2: 3260.0,
            track_m: 1.6,
        }
    }
}

/// Springs, dampers and anti-roll bars, as rates at the wheel. Unsprung masses are not modelled.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct SuspensionParams {
    /// Spring rate of one front corner (tyre in series), N/m.
    #[schemars(range(min = 1000.0, max = 1e6))]
    pub front_spring_npm: f64,
    /// Spring rate of one rear corner, N/m.
    #[schemars(range(min = 1000.0, max = 1e6))]
    pub rear_spring_npm: f64,
    /// Damper rate of one corner, N s/m.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub damper_nspm: f64,
    /// Rate of the front anti-roll bar: force on each wheel per metre of difference in compression, N/m.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub front_anti_roll_npm: f64,
    /// Rate of the rear anti-roll bar, N/m.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub rear_anti_roll_npm: f64,
    /// Compression beyond rest at which the bump stop engages, metres.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub bump_stop_m: f64,
    /// Additional rate of the bump stop, N/m.
    #[schemars(range(min = 0.0, max = 1e7))]
    pub bump_stop_npm: f64,
}

impl Default for SuspensionParams {
    /// \[E\]: body bounce near 1.3 Hz with damping ratio 0.34, and about 3 degrees of roll at 0.8 g; most of the
    /// anti-roll stiffness is in front, as in cars designed to understeer at the limit.
    fn default() -> Self {
        Self {
            front_spring_npm: 30_000.0,
            rear_spring_npm: 28_000.0,
            damper_nspm: 2_500.0,
            front_anti_roll_npm: 20_000.0,
            rear_anti_roll_npm: 12_000.0,
            bump_stop_m: 0.08,
            bump_stop_npm: 150_000.0,
        }
    }
}

/// Wheels.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct WheelParams {
    /// Rolling radius, metres.
    #[schemars(range(min = 0.05, max = 2.0))]
    pub radius_m: f64,
    /// Moment of inertia about the axle of one wheel with brake and share of the drivetrain, kg m².
    #[schemars(range(min = 0.01, max = 100.0))]
    pub spin_inertia_kgm2: f64,
    /// Rolling resistance force per wheel load.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub rolling_resistance: f64,
}

impl Default for WheelParams {
    /// Radius \[A\], inertia \[C\]; rolling resistance \[E\] of a summer tyre on asphalt.
    fn default() -> Self {
        Self { radius_m: 0.335, spin_inertia_kgm2: 1.7, rolling_resistance: 0.012 }
    }
}

/// Tyre parameters. The peak friction belongs to the ground; the curve's shape and its initial slope belong to the
/// tyre.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct TyreParams {
    /// Longitudinal force over longitudinal slip.
    #[ranges(nested)]
    pub longitudinal: MagicFormula,
    /// Lateral force over the tangent of the slip angle.
    #[ranges(nested)]
    pub lateral: MagicFormula,
    /// Peak friction on the road, replacing the road's friction, up to 4; when absent, the road's. Patches of a scenario
    /// (`[[slippery]]`) keep theirs.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(range(min = 0.01, max = 4.0))]
    pub friction: Option<f64>,
    /// Load at which the peak friction equals the ground's, newtons.
    #[schemars(range(min = 10.0, max = 1e6))]
    pub nominal_load_n: f64,
    /// Relative loss of peak friction for a load twice the nominal one.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub load_sensitivity: f64,
    /// Relative loss of slip stiffness per load, for a load twice the nominal one.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub stiffness_load_sensitivity: f64,
    /// Longitudinal relaxation length: distance rolled until 63 % of a step of longitudinal slip has become force,
    /// metres.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub relaxation_longitudinal_m: f64,
    /// Lateral relaxation length: distance rolled until 63 % of a step of lateral slip has become force, metres.
    #[schemars(range(min = 0.01, max = 10.0))]
    pub relaxation_lateral_m: f64,
}

impl Default for TyreParams {
    /// Shapes and stiffnesses \[C\] (`p_cx1, p_kx1, p_ex1`; `p_cy1, p_ky1, p_ey1`); load sensitivities and
    /// relaxation lengths in the range of \[P\], sections 4.3 and 8.5.
    fn default() -> Self {
        Self {
            longitudinal: MagicFormula { stiffness: 22.303, shape: 1.6411, curvature: 0.464 },
            lateral: MagicFormula { stiffness: 21.92, shape: 1.3507, curvature: -0.0075 },
            friction: None,
            nominal_load_n: 4414.5,
            load_sensitivity: 0.08,
            stiffness_load_sensitivity: 0.15,
            relaxation_longitudinal_m: 0.2,
            relaxation_lateral_m: 0.4,
        }
    }
}

/// Drivetrain from pedal to torque; open differentials (equal torque left and right), no traction control, engine
/// braking, reverse gear or creep.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct DrivetrainParams {
    /// Largest total torque at the driven wheels, N m.
    #[schemars(range(min = 1.0, max = 1e6))]
    pub torque_max_nm: f64,
    /// Largest power at the wheels, watts.
    #[schemars(range(min = 0.0, max = 1e7))]
    pub power_max_w: f64,
    /// Time constant of the torque's first-order lag, seconds.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub lag_s: f64,
    /// Fraction of the torque at the front axle: 1 is front-wheel drive.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub front_share: f64,
}

impl Default for DrivetrainParams {
    /// Front-wheel drive; 140 kW is the hybrid's system power by the maker (188 hp); torque \[E\] for
    /// 4 m/s² from rest; lag \[E\] within the usual 0.1 s to 0.3 s.
    fn default() -> Self {
        Self { torque_max_nm: 2_400.0, power_max_w: 140_000.0, lag_s: 0.2, front_share: 1.0 }
    }
}

/// Brake parameters.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct BrakeParams {
    /// Total torque of all four brakes at full pedal, N m.
    #[schemars(range(min = 1.0, max = 1e6))]
    pub torque_max_nm: f64,
    /// Fraction of the brake torque at the front axle.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub front_share: f64,
    /// Time in which the torque builds up from zero to full pedal, seconds.
    #[schemars(range(min = 0.0, max = 10.0))]
    pub build_up_s: f64,
    /// Parameters of the anti-lock control.
    #[ranges(nested)]
    pub abs: AbsParams,
}

impl Default for BrakeParams {
    /// \[E\]: enough to lock all wheels on dry asphalt (1.2 g), and the build-up time of hydraulic units, 0.15 s.
    fn default() -> Self {
        Self { torque_max_nm: 7_100.0, front_share: 0.7, build_up_s: 0.15, abs: AbsParams::default() }
    }
}

/// Anti-lock control of each wheel: the brake torque is scaled so that slip stays near the target. A target that
/// follows the ground's friction replaces the peak search of real units.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct AbsParams {
    /// Enables anti-lock control.
    pub enabled: bool,
    /// Target slip, as a fraction of the slip of largest force on the current ground.
    #[schemars(range(min = 0.0, max = 1.0))]
    pub slip_target: f64,
    /// Largest rate at which the torque is increased, as a fraction of full brake per second.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub apply_rate_ps: f64,
    /// Largest rate at which the torque is reduced, as a fraction of full brake per second.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub release_rate_ps: f64,
    /// Speed below which anti-lock control is inactive and wheels may lock, m/s.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub speed_min_mps: f64,
}

impl Default for AbsParams {
    /// \[E\]: the curve is flat before the peak and falls beyond it: the target is before it.
    fn default() -> Self {
        Self {
            enabled: true,
            slip_target: 0.8,
            apply_rate_ps: 5.0,
            release_rate_ps: 15.0,
            speed_min_mps: 1.5,
        }
    }
}

/// Air drag, acting at the centre of gravity.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct AeroParams {
    /// Drag coefficient times frontal area, m².
    #[schemars(range(min = 0.0, max = 100.0))]
    pub drag_area_m2: f64,
    /// Density of the air, kg/m³.
    #[schemars(range(min = 0.0, max = 100.0))]
    pub air_density_kgpm3: f64,
}

impl Default for AeroParams {
    /// \[E\]: drag coefficient 0.28, frontal area 2.3 m², usual for the class.
    fn default() -> Self {
        Self { drag_area_m2: 0.64, air_density_kgpm3: 1.2 }
    }
}

impl VehicleParams {
    /// Checks that all parameters are in range; returns the first that is not.
    pub fn validate(&self) -> Result<(), ParamError> {
        self.check_ranges()?;
        let sound = self.steering.curve_is_sound();
        let curve = format!("{:?}", self.steering.curve);
        let wanted = "increasing speeds from 0 to 200 with shares from 0 to 1";
        require("steering.curve", curve, sound, wanted)
    }

    /// Distance from the rear axle forward to the centre of gravity, metres.
    pub fn cg_to_rear_m(&self) -> f64 {
        self.body.front_weight_share * self.shape.wheelbase_m
    }

    /// Distance from the centre of gravity forward to the front axle, metres.
    pub fn cg_to_front_m(&self) -> f64 {
        self.shape.wheelbase_m - self.cg_to_rear_m()
    }

    /// Load of each wheel at rest on level ground, newtons: front left, front right, rear left, rear right.
    pub fn static_loads_n(&self) -> [f64; 4] {
        let weight = self.body.mass_kg * GRAVITY_MPS2;
        let front = 0.5 * weight * self.body.front_weight_share;
        let rear = 0.5 * weight - front;
        [front, front, rear, rear]
    }

    /// Cornering stiffness of the front and the rear axle at their static loads, N/rad: the slope at the origin, for
    /// linear models (controllers, estimators).
    pub fn axle_cornering_stiffness_nprad(&self) -> [f64; 2] {
        let loads_n = self.static_loads_n();
        [loads_n[0], loads_n[2]].map(|load_n| 2.0 * load_n * self.tyre.cornering_stiffness_per_load(load_n))
    }

    /// Understeer gradient `K` of small lateral accelerations, rad s²/m: `delta = L kappa + K a_y`
    /// (Pacejka, section 1.3.3, with both axles at static load).
    pub fn understeer_gradient_rads2pm(&self) -> f64 {
        let [front, rear] = self.axle_cornering_stiffness_nprad();
        let share = self.body.front_weight_share;
        self.body.mass_kg * (share / front - (1.0 - share) / rear)
    }

    /// Mass that resists acceleration: the car's plus that of its spinning wheels, kg.
    pub fn effective_mass_kg(&self) -> f64 {
        let r = self.wheel.radius_m;
        self.body.mass_kg + 4.0 * self.wheel.spin_inertia_kgm2 / (r * r)
    }

    /// Air drag and rolling resistance at `speed_mps`, newtons.
    pub fn resistance_n(&self, speed_mps: f64) -> f64 {
        let air = 0.5 * self.aero.air_density_kgpm3 * self.aero.drag_area_m2 * speed_mps * speed_mps.abs();
        let rolling = self.wheel.rolling_resistance * self.body.mass_kg * GRAVITY_MPS2;
        let rolling = if speed_mps.abs() < 1e-3 { 0.0 } else { rolling * speed_mps.signum() };
        air + rolling
    }

    /// Largest total torque at the driven wheels at a spin of `wheel_speed_radps`, N m.
    pub fn drive_torque_max_nm(&self, wheel_speed_radps: f64) -> f64 {
        let drive = &self.drivetrain;
        drive.torque_max_nm.min(drive.power_max_w / wheel_speed_radps.abs().max(1e-3))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_default_car_is_valid_and_carries_its_weight() {
        let params = VehicleParams::default();
        assert_eq!(params.validate(), Ok(()));
        let weight: f64 = params.static_loads_n().iter().sum();
        assert!((weight - 1800.0 * GRAVITY_MPS2).abs() < 1e-9);
        assert!((params.cg_to_rear_m() + params.cg_to_front_m() - 2.85).abs() < 1e-12);
        assert!(params.understeer_gradient_rads2pm() > 0.0);
    }

    #[test]
    fn parameters_out_of_range_are_named() {
        let wrong = |change: fn(&mut VehicleParams)| {
            let mut params = VehicleParams::default();
            change(&mut params);
            params.validate().unwrap_err().to_string()
        };
        assert_eq!(wrong(|p| p.body.mass_kg = -1.0), "`body.mass_kg` is -1, expected 50 to 100000");
        assert_eq!(wrong(|p| p.tyre.friction = Some(9.0)), "`tyre.friction` is 9, expected 0.01 to 4");
        assert_eq!(
            wrong(|p| p.steering.curve[1][1] = 1.5),
            "`steering.curve` is [[0.0, 1.0], [10.0, 1.5], [20.0, 1.0], [30.0, 1.0]], expected increasing speeds \
             from 0 to 200 with shares from 0 to 1"
        );
        assert_eq!(wrong(|p| p.dead_time_s = f64::NAN), "`dead_time_s` is NaN, expected 0 to 10");
        assert_eq!(wrong(|p| p.brakes.front_share = 1.5), "`brakes.front_share` is 1.5, expected 0 to 1");
        assert_eq!(
            wrong(|p| p.limits.steering_max_rad = 3.0),
            "`limits.steering_max_rad` is 3, expected 0.01 to 1.25"
        );
        assert_eq!(wrong(|p| p.tyre.lateral.shape = 0.5), "`tyre.lateral.shape` is 0.5, expected 1 to 2");
    }
}
