//! Error model of predictions.

use swerve_geom::Vector2;
use swerve_msg::ActorKind;

/// Error model of a prediction: white noise of acceleration.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Wander {
    /// Standard deviation of a sighting along each axis, metres.
    pub(crate) sighting_m: f64,
    /// Standard deviation of the initial velocity, m/s.
    pub(crate) speed_mps: f64,
    /// Spectral density of the acceleration along and across the motion, m²/s³.
    pub(crate) density: [f64; 2],
}

impl Wander {
    /// Variances along and across the motion after `t_s`, m².
    fn variances_m2(&self, t_s: f64) -> [f64; 2] {
        let at_start = self.sighting_m * self.sighting_m + self.speed_mps * self.speed_mps * t_s * t_s;
        self.density.map(|density| at_start + density * t_s * t_s * t_s / 3.0)
    }

    /// Covariance on the map after `t_s` of a motion in `direction` (a unit vector): xx, xy, yy, m².
    pub(crate) fn covariance_m2(&self, direction: Vector2, t_s: f64) -> [f64; 3] {
        let ([along, across], Vector2 { x, y, .. }) = (self.variances_m2(t_s), direction);
        [along * x * x + across * y * y, (along - across) * x * y, along * y * y + across * x * x]
    }
}

/// Error model of a kind of actor: pedestrians fitted to ETH and UCY, all others to NGSIM.
pub(crate) fn wander(kind: ActorKind) -> Wander {
    match kind {
        ActorKind::Pedestrian | ActorKind::Static => {
            Wander { sighting_m: 0.03, speed_mps: 0.08, density: [0.03, 0.012] }
        }
        _ => Wander { sighting_m: 0.15, speed_mps: 0.5, density: [0.9, 0.05] },
    }
}
