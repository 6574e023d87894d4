//! The magic formula of tyre forces.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::Ranges;
use swerve_geom::math;

/// One curve of the magic formula (Pacejka, "Tire and Vehicle Dynamics", 3rd ed., eq. 4.6), in a form that separates
/// the tyre from the ground: the slope at the origin is a property of the tyre, the peak is the ground's friction.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct MagicFormula {
    /// Slope at the origin: force per load and unit of slip. A higher value makes the response more direct.
    #[schemars(range(min = 1.0, max = 200.0))]
    pub stiffness: f64,
    /// Shape factor `C`: above 1 the force falls again beyond its peak.
    #[schemars(range(min = 1.0, max = 2.0))]
    pub shape: f64,
    /// Curvature factor `E`: moves the peak; the nearer to 1, the later and broader it is.
    #[schemars(range(min = -10.0, max = 1.0))]
    pub curvature: f64,
}

impl MagicFormula {
    /// Force per peak force at the stretched slip `b_slip`, which is `B` times the slip.
    pub fn shape_at(&self, b_slip: f64) -> f64 {
        let inner = b_slip - self.curvature * (b_slip - math::atan(b_slip));
        math::sin(self.shape * math::atan(inner))
    }

    /// The stretched slip of the largest force: where the sine's argument is a quarter turn. Solved by bisection; 1000,
    /// the largest slip tried, represents curves without a peak.
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

    /// The stretched slip before the peak that gives the fraction `force` (0 to 1) of the peak force.
    pub(crate) fn b_slip_for(&self, force: f64) -> f64 {
        let goal = math::tan(math::asin(force.clamp(0.0, 1.0)) / self.shape);
        let mut s = goal;
        for _ in 0..4 {
            let slope = 1.0 - self.curvature * s * s / (1.0 + s * s);
            s -= (s - self.curvature * (s - math::atan(s)) - goal) / slope.max(0.05);
        }
        s
    }

    /// The slip of largest force on ground of the given friction, at nominal load.
    pub fn peak_slip(&self, friction: f64) -> f64 {
        self.peak_b_slip() / self.stretch(1.0, friction)
    }

    /// The stretch `B` for which the slope at the origin equals the stiffness, given the friction coefficient.
    pub(crate) fn stretch(&self, stiffness_scale: f64, friction: f64) -> f64 {
        self.stiffness * stiffness_scale / (self.shape * friction)
    }
}
