//! Tyre forces: the magic formula, combined slip, load sensitivity, and relaxation down to standstill.

use serde::{Deserialize, Serialize};
use swerve_geom::math;

use crate::TyreParams;

/// One curve of the magic formula (Pacejka, "Tire and Vehicle Dynamics", 3rd ed., eq. 4.6), in a form
/// that separates the tyre from the ground: the slope at the origin belongs to the tyre, the peak to the
/// ground's friction.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MagicFormula {
    /// Slope at the origin: force per load and unit of slip. Raising it makes the response more direct.
    pub stiffness: f64,
    /// Shape factor `C`: above 1 the force falls again beyond its peak.
    pub shape: f64,
    /// Curvature factor `E`: moves the peak; the nearer to 1, the later and the broader it is.
    pub curvature: f64,
}

impl MagicFormula {
    /// Force per peak force at the stretched slip `b_slip`, which is `B` times the slip.
    pub fn shape_at(&self, b_slip: f64) -> f64 {
        let inner = b_slip - self.curvature * (b_slip - math::atan(b_slip));
        math::sin(self.shape * math::atan(inner))
    }

    /// The stretched slip at which the force is largest: where the sine's argument is a quarter turn.
    /// Solved by bisection; the largest slip looked at, 1000, stands for curves without a peak.
    pub fn peak_b_slip(&self) -> f64 {
        let goal = math::tan(core::f64::consts::FRAC_PI_2 / self.shape.max(1.0 + 1e-9));
        let inner = |s: f64| s - self.curvature * (s - math::atan(s));
        let (mut low, mut high) = (0.0, 1000.0);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if inner(middle) < goal { low = middle } else { high = middle }
        }
        0.5 * (low + high)
    }

    /// The slip of largest force on ground of the given friction, at nominal load.
    pub fn peak_slip(&self, friction: f64) -> f64 {
        self.peak_b_slip() / self.stretch(1.0, friction)
    }

    /// The stretch `B` for which the slope at the origin is the stiffness, given the friction coefficient.
    fn stretch(&self, stiffness_scale: f64, friction: f64) -> f64 {
        self.stiffness * stiffness_scale / (self.shape * friction)
    }
}

/// Force in the contact patch, in the wheel's frame.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct SlipForce {
    /// Along the wheel's heading, newtons; positive drives the car forward.
    pub fx_n: f64,
    /// To the wheel's left, newtons.
    pub fy_n: f64,
    /// Secant of `fx_n` over longitudinal slip, newtons per unit of slip: never below its slope.
    pub fx_secant_n: f64,
}

/// Steady-state force of a tyre under combined slip.
///
/// Slips: `slip_x = (omega R - v_x) / |v_x|`, `slip_y = -v_y / |v_x|` (positive pushes to the left);
/// `load_n` in newtons. Both slips are stretched by their own `B`; the curves are read at the length of the
/// stretched vector and the force shares its direction (similarity method, Pacejka section 4.3.2), so that
/// no combination exceeds the friction coefficient.
pub fn combined_slip_force(params: &TyreParams, load_n: f64, friction: f64, slip: [f64; 2]) -> SlipForce {
    if load_n <= 0.0 || friction <= 0.0 {
        return SlipForce::default();
    }
    let overload = (load_n / params.nominal_load_n - 1.0).clamp(-1.0, 3.0);
    let mu = friction * (1.0 - params.load_sensitivity * overload).max(0.3);
    let stiffness_scale = (1.0 - params.stiffness_load_sensitivity * overload).max(0.3);
    let bx = params.longitudinal.stretch(stiffness_scale, mu);
    let by = params.lateral.stretch(stiffness_scale, mu);
    let (sx, sy) = (bx * slip[0], by * slip[1]);
    let s = (sx * sx + sy * sy).sqrt();
    let peak = mu * load_n;
    if s < 1e-9 {
        return SlipForce {
            fx_n: peak * params.longitudinal.shape * sx,
            fy_n: peak * params.lateral.shape * sy,
            fx_secant_n: peak * params.longitudinal.shape * bx,
        };
    }
    let per_x = peak * params.longitudinal.shape_at(s) / s;
    let per_y = peak * params.lateral.shape_at(s) / s;
    SlipForce { fx_n: per_x * sx, fy_n: per_y * sy, fx_secant_n: per_x.max(0.0) * bx }
}

/// Speed below which the contact patch also damps: with no rolling the relaxation equation is a bare
/// spring, and the car would rock on it for seconds after a stop, m/s.
const DAMPED_BELOW_MPS: f64 = 2.5;
/// Damping at standstill: slip per m/s of slip velocity. Gives the car on its braked tyres a damping ratio
/// near 1 (33 rad/s at the default longitudinal stiffness).
const DAMPING_SPM: f64 = 0.3;
/// Largest slip, in units of the slip where the curve bends (`1 / B`), that a deflection may store below
/// [`DAMPED_BELOW_MPS`]: a locked tyre must not remember how far it slid.
const STORED_SLIP_AT_REST: f64 = 1.0;
/// The same at speed: far beyond full slide.
const STORED_SLIP: f64 = 60.0;

/// The deflection of one contact patch: the memory behind relaxation, stiction and hold at rest.
///
/// `du/dt = v_slip - |v_x| u / sigma`, and `u / sigma` is the slip that the curve is read at (Pacejka,
/// section 8.6, with his low-speed damping and the limit on stored deflection). While the wheel rolls, this
/// is the relaxation length; at standstill it is a spring that holds the car.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct ContactPatch {
    /// Longitudinal deflection, metres.
    ux_m: f64,
    /// Lateral deflection, metres.
    uy_m: f64,
}

/// What the contact patch rides on in one step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct PatchInput {
    /// Load, newtons.
    pub(crate) load_n: f64,
    /// Friction of the ground.
    pub(crate) friction: f64,
    /// Velocity of the contact point along the wheel's heading, m/s.
    pub(crate) vx_mps: f64,
    /// Velocity of the contact point to the wheel's left, m/s.
    pub(crate) vy_mps: f64,
}

impl ContactPatch {
    /// Moves the patch on by `dt_s` with the tread running at `tread_mps` (`omega R`) and returns the force
    /// and, for the implicit update of the wheel, the slope of `fx_n` over the tread's speed, N s/m.
    pub(crate) fn step(
        &mut self,
        params: &TyreParams,
        input: &PatchInput,
        tread_mps: f64,
        dt_s: f64,
    ) -> (SlipForce, f64) {
        if input.load_n <= 0.0 || input.friction <= 0.0 {
            *self = Self::default();
            return (SlipForce::default(), 0.0);
        }
        let rolling = input.vx_mps.abs();
        let (sigma_x, sigma_y) = (params.relaxation_longitudinal_m, params.relaxation_lateral_m);
        let (slip_vx, slip_vy) = (tread_mps - input.vx_mps, -input.vy_mps);
        let (keep_x, keep_y) =
            (1.0 / (1.0 + dt_s * rolling / sigma_x), 1.0 / (1.0 + dt_s * rolling / sigma_y));
        self.ux_m = (self.ux_m + dt_s * slip_vx) * keep_x;
        self.uy_m = (self.uy_m + dt_s * slip_vy) * keep_y;
        let still = (1.0 - rolling / DAMPED_BELOW_MPS).max(0.0);
        self.limit(params, input.friction, still);
        let damping = DAMPING_SPM * still * still;
        let slip = [self.ux_m / sigma_x + damping * slip_vx, self.uy_m / sigma_y + damping * slip_vy];
        let force = combined_slip_force(params, input.load_n, input.friction, slip);
        let slope = force.fx_secant_n * (dt_s / sigma_x * keep_x + damping);
        (force, slope)
    }

    fn limit(&mut self, params: &TyreParams, friction: f64, still: f64) {
        let bx = params.longitudinal.stretch(1.0, friction) / params.relaxation_longitudinal_m;
        let by = params.lateral.stretch(1.0, friction) / params.relaxation_lateral_m;
        let (sx, sy) = (bx * self.ux_m, by * self.uy_m);
        let stored = (sx * sx + sy * sy).sqrt();
        let most = if still > 0.0 { STORED_SLIP_AT_REST + 10.0 * (1.0 - still) } else { STORED_SLIP };
        if stored > most {
            self.ux_m *= most / stored;
            self.uy_m *= most / stored;
        }
    }
}
