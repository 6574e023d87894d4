//! Lateral motion: a function of time, or of arc length near standstill.

use super::poly::{Jet, Quintic};

/// Start state of the ego in the Frenet frame.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct FrenetState {
    /// Arc length and its derivatives: m, m/s, m/s².
    pub s: [f64; 3],
    /// Offset and its derivatives: m, m/s, m/s².
    pub d: [f64; 3],
    /// Offset and its derivatives by arc length (m, 1, 1/m) if lateral motion is a function of arc length: at
    /// standstill a function of time has no heading (Werling 2010, section VI, low velocities).
    pub d_by_s: Option<[f64; 3]>,
}

impl FrenetState {
    /// Lateral motion to offset `d_m` at `t_s`, the end time of `longitudinal`.
    pub(super) fn lateral(&self, longitudinal: &Quintic, d_m: f64, t_s: f64) -> Lateral {
        let end = longitudinal.at(t_s);
        let sets_off = end.v >= self.s[1] || self.s[1] < STILL_MPS;
        let Some(from) = self.d_by_s.filter(|_| sets_off) else {
            return Lateral::OverTime(Quintic::new(self.d, [d_m, 0.0, 0.0], t_s));
        };
        // A shorter distance reduces the offset in proportion: the wheels are not turned for an offset that is never
        // reached.
        let way_m = end.x - self.s[0];
        let share = (way_m / ARC_MIN_M).clamp(0.0, 1.0);
        let to = [from[0] + (d_m - from[0]) * share, 0.0, 0.0];
        let end_m = way_m.max(ARC_MIN_M);
        Lateral::OverArc { offset: Quintic::new(from, to, end_m), from_m: self.s[0], end_m }
    }
}

/// Shortest arc length of a lateral motion over arc length, metres: a shorter motion drives its beginning.
const ARC_MIN_M: f64 = 6.0;

/// Below this start speed, m/s, all lateral motion is over arc length; above it, only that of motions that do not slow
/// down: a stop keeps its offset.
const STILL_MPS: f64 = 0.5;

/// The offset from the line during a motion.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) enum Lateral {
    /// As a function of time.
    OverTime(Quintic),
    /// As a function of the arc length from `from_m` on; constant beyond `end_m` further.
    OverArc { offset: Quintic, from_m: f64, end_m: f64 },
}

impl Default for Lateral {
    fn default() -> Self {
        Self::OverTime(Quintic::default())
    }
}

impl Lateral {
    /// Offset and its derivatives by time at `t_s`, with the motion along the line at `s`.
    pub(super) fn at(&self, t_s: f64, s: &Jet) -> Jet {
        match self {
            Self::OverTime(offset) => offset.at(t_s),
            Self::OverArc { .. } => {
                // Chain rule.
                let by_s = self.by_arc(s.x);
                Jet {
                    x: by_s.x,
                    v: by_s.v * s.v,
                    a: by_s.a * s.v * s.v + by_s.v * s.a,
                    j: by_s.j * s.v * s.v * s.v + 3.0 * by_s.a * s.v * s.a + by_s.v * s.j,
                }
            }
        }
    }

    /// Offset and its derivatives by arc length at `s_m`; zero for a motion over time.
    pub(super) fn by_arc(&self, s_m: f64) -> Jet {
        let Self::OverArc { offset, from_m, end_m } = self else { return Jet::default() };
        let along_m = (s_m - from_m).clamp(0.0, *end_m);
        offset.at(along_m)
    }
}
