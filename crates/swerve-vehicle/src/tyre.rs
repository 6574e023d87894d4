//! Tyre forces: magic formula, combined slip, load sensitivity, and relaxation down to standstill.

use crate::TyreParams;

impl TyreParams {
    /// Peak friction on a road of the given friction.
    pub fn friction_on(&self, road: f64) -> f64 {
        self.friction.unwrap_or(road)
    }

    fn overload(&self, load_n: f64) -> f64 {
        (load_n / self.nominal_load_n - 1.0).clamp(-1.0, 3.0)
    }

    /// Peak friction at a load relative to that at the nominal load.
    fn friction_scale(&self, load_n: f64) -> f64 {
        (1.0 - self.load_sensitivity * self.overload(load_n)).max(0.3)
    }

    /// Slip stiffness per load at a load relative to that at the nominal load.
    fn stiffness_scale(&self, load_n: f64) -> f64 {
        (1.0 - self.stiffness_load_sensitivity * self.overload(load_n)).max(0.3)
    }

    /// Slope of the lateral force at the origin, per newton of load and radian.
    pub fn cornering_stiffness_per_load(&self, load_n: f64) -> f64 {
        self.lateral.stiffness * self.stiffness_scale(load_n)
    }
}

/// Force in the contact patch, in the wheel's frame.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct SlipForce {
    /// Along the wheel's heading, newtons; positive drives the car forward.
    pub fx_n: f64,
    /// To the wheel's left, newtons.
    pub fy_n: f64,
    /// Secant of `fx_n` over longitudinal slip, newtons per unit of slip: an upper bound of the slope.
    pub fx_secant_n: f64,
}

/// Steady-state force of a tyre under combined slip.
///
/// Slips: `slip_x = (omega R - v_x) / |v_x|`, `slip_y = -v_y / |v_x|` (positive pushes to the left); `load_n` in
/// newtons. Both slips are stretched by their own `B`; the curves are evaluated at the length of the stretched vector
/// and the force has its direction (similarity method, Pacejka section 4.3.2), so that no combination exceeds the
/// friction coefficient.
pub fn combined_slip_force(params: &TyreParams, load_n: f64, friction: f64, slip: [f64; 2]) -> SlipForce {
    if load_n <= 0.0 || friction <= 0.0 {
        return SlipForce::default();
    }
    let mu = friction * params.friction_scale(load_n);
    let stiffness_scale = params.stiffness_scale(load_n);
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

/// Longitudinal slip, at most `most`, that gives the force `asked_n` at the lateral slip `slip_y`.
pub(crate) fn slip_for_force(
    params: &TyreParams,
    load_n: f64,
    friction: f64,
    asked_n: f64,
    slip_y: f64,
    most: f64,
) -> f64 {
    let mu = friction * params.friction_scale(load_n);
    let bx = params.longitudinal.stretch(params.stiffness_scale(load_n), mu);
    let share = asked_n.abs() / (mu * load_n);
    // Exact without lateral slip, or, for a small force, from the slope at the origin; then refined with the secant of
    // the curve.
    let curve = &params.longitudinal;
    let alone = if share < 0.2 { share / curve.shape } else { curve.b_slip_for(share) } / bx;
    let mut slip_x = alone.min(most) * asked_n.signum();
    for _ in 0..2 {
        let force = combined_slip_force(params, load_n, friction, [slip_x, slip_y]);
        slip_x = (asked_n / force.fx_secant_n.max(1.0)).clamp(-most, most);
    }
    slip_x
}

/// Speed below which the contact patch is damped, m/s: without rolling the relaxation equation is an undamped spring,
/// and the car would rock on it for seconds after a stop.
const DAMPED_BELOW_MPS: f64 = 2.5;
/// Damping at standstill: slip per m/s of slip velocity. Gives the car on its braked tyres a damping ratio
/// near 1 (33 rad/s at the default longitudinal stiffness).
const DAMPING_SPM: f64 = 0.3;
/// Largest slip, relative to the slip where the curve bends (`1 / B`), that a deflection may store below
/// [`DAMPED_BELOW_MPS`]: a locked tyre must not remember its sliding distance.
const STORED_SLIP_AT_REST: f64 = 1.0;
/// Largest stored slip at speed: far beyond full slide.
const STORED_SLIP: f64 = 60.0;

/// Deflection of one contact patch: the state behind relaxation, stiction and hold at rest.
///
/// `du/dt = v_slip - |v_x| u / sigma`, and `u / sigma` is the slip at which the curve is evaluated (Pacejka, section
/// 8.6, with his low-speed damping and limit on stored deflection). While the wheel rolls, `sigma` is the relaxation
/// length; at standstill the deflection is a spring that holds the car.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct ContactPatch {
    /// Longitudinal deflection, metres.
    ux_m: f64,
    /// Lateral deflection, metres.
    uy_m: f64,
}

/// Load, ground and motion of the contact patch in one step.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct PatchInput {
    /// Load, newtons.
    pub(crate) load_n: f64,
    /// Friction coefficient of the ground.
    pub(crate) friction: f64,
    /// Velocity of the contact point along the wheel's heading, m/s.
    pub(crate) vx_mps: f64,
    /// Velocity of the contact point to the wheel's left, m/s.
    pub(crate) vy_mps: f64,
}

impl ContactPatch {
    /// Advances the patch by `dt_s` with the tread running at `tread_mps` (`omega R`) and returns the force and, for
    /// the implicit update of the wheel, the slope of `fx_n` over the tread's speed, N s/m.
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

#[cfg(test)]
mod tests {
    use super::*;

    fn tyre() -> TyreParams {
        TyreParams::default()
    }

    #[test]
    fn slope_at_the_origin_is_the_tyres_and_peak_is_the_grounds() {
        let params = tyre();
        let load_n = params.nominal_load_n;
        for friction in [0.3, 0.9, 1.2] {
            let small = 1e-5;
            let force = combined_slip_force(&params, load_n, friction, [small, 0.0]);
            assert!((force.fx_n / (small * load_n) / params.longitudinal.stiffness - 1.0).abs() < 1e-3);
            let force = combined_slip_force(&params, load_n, friction, [0.0, small]);
            assert!((force.fy_n / (small * load_n) / params.lateral.stiffness - 1.0).abs() < 1e-3);
            for (curve, axis) in [(params.longitudinal, 0), (params.lateral, 1)] {
                let at = |slip: f64| {
                    let slips = if axis == 0 { [slip, 0.0] } else { [0.0, slip] };
                    let force = combined_slip_force(&params, load_n, friction, slips);
                    [force.fx_n, force.fy_n][axis]
                };
                let peak = curve.peak_slip(friction);
                assert!((at(peak) / (friction * load_n) - 1.0).abs() < 1e-9, "{}", at(peak));
                assert!(at(0.8 * peak) < at(peak) && at(1.3 * peak) < at(peak));
            }
        }
    }

    #[test]
    fn force_never_exceeds_the_friction_and_is_odd_in_slip() {
        let params = tyre();
        for i in 0..40 {
            for j in 0..40 {
                let slip = [f64::from(i - 20) * 0.013, f64::from(j - 20) * 0.017];
                for load_n in [500.0, 4_000.0, 9_000.0] {
                    let mu = 0.9 * params.friction_scale(load_n);
                    let force = combined_slip_force(&params, load_n, 0.9, slip);
                    let size = (force.fx_n * force.fx_n + force.fy_n * force.fy_n).sqrt();
                    assert!(size <= mu * load_n * (1.0 + 1e-12), "{slip:?}: {force:?}");
                    assert!(force.fx_n * slip[0] >= 0.0 && force.fy_n * slip[1] >= 0.0);
                    let mirrored = combined_slip_force(&params, load_n, 0.9, [-slip[0], -slip[1]]);
                    assert!(mirrored.fx_n == -force.fx_n && mirrored.fy_n == -force.fy_n);
                }
            }
        }
    }

    #[test]
    fn slip_for_a_force_gives_that_force() {
        let params = tyre();
        for asked_n in [-3_400.0, -1_000.0, 0.0, 500.0, 3_000.0] {
            let slip = slip_for_force(&params, 4_000.0, 0.9, asked_n, 0.0, 0.2);
            let force = combined_slip_force(&params, 4_000.0, 0.9, [slip, 0.0]).fx_n;
            assert!((force - asked_n).abs() < 5.0, "{asked_n}: {force}");
            let slip = slip_for_force(&params, 4_000.0, 0.9, 0.6 * asked_n, 0.05, 0.2);
            let force = combined_slip_force(&params, 4_000.0, 0.9, [slip, 0.05]).fx_n;
            assert!((force - 0.6 * asked_n).abs() < 10.0 + 0.03 * asked_n.abs(), "{asked_n}: {force}");
        }
        assert_eq!(slip_for_force(&params, 4_000.0, 0.9, -9_000.0, 0.0, 0.1), -0.1);
    }

    #[test]
    fn braking_reduces_the_cornering_force() {
        let params = tyre();
        let free = combined_slip_force(&params, 4_000.0, 0.9, [0.0, 0.08]).fy_n;
        let braked = combined_slip_force(&params, 4_000.0, 0.9, [-0.1, 0.08]).fy_n;
        assert!(braked < 0.75 * free, "{braked} of {free}");
    }

    #[test]
    fn two_wheels_with_unequal_loads_hold_less_than_with_equal_ones() {
        let at = |load_n| combined_slip_force(&tyre(), load_n, 0.9, [0.0, 0.1]).fy_n;
        assert!(at(2_000.0) + at(6_000.0) < 2.0 * at(4_000.0));
    }

    /// After one relaxation length of rolling, 63 % of a small step of slip angle has become force.
    #[test]
    fn force_follows_slip_over_the_relaxation_length() {
        let params = tyre();
        let input = PatchInput { load_n: 4_000.0, friction: 0.9, vx_mps: 20.0, vy_mps: -0.1 };
        let steady = combined_slip_force(&params, 4_000.0, 0.9, [0.0, 0.1 / 20.0]).fy_n;
        let mut patch = ContactPatch::default();
        let steps = 400;
        let dt_s = params.relaxation_lateral_m / 20.0 / f64::from(steps);
        let mut force = SlipForce::default();
        for _ in 0..steps {
            force = patch.step(&params, &input, 20.0, dt_s).0;
        }
        assert!((force.fy_n / steady - 0.632).abs() < 0.01, "{}", force.fy_n / steady);
    }

    #[test]
    fn wheel_off_the_ground_has_no_force_and_no_memory() {
        let mut patch = ContactPatch { ux_m: 0.1, uy_m: -0.1 };
        let input = PatchInput { load_n: 0.0, friction: 0.9, vx_mps: 3.0, vy_mps: 1.0 };
        assert_eq!(patch.step(&tyre(), &input, 9.0, 0.001), (SlipForce::default(), 0.0));
        assert_eq!(patch, ContactPatch::default());
    }
}
