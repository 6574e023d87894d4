//! Polynomials of minimum squared jerk (Werling 2010, sections IV and V).

/// `x(t)` of degree five between two full states (position, velocity and acceleration at both ends), or of degree four
/// with a free end position.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Quintic([f64; 6]);

/// Value and first three derivatives.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub(crate) struct Jet {
    pub(crate) x: f64,
    pub(crate) v: f64,
    pub(crate) a: f64,
    pub(crate) j: f64,
}

impl Quintic {
    /// Polynomial from `from` = (x, v, a) at 0 to `to` at `t > 0`: closed form of the 3 x 3 system of the end state.
    pub(crate) fn new(from: [f64; 3], to: [f64; 3], t: f64) -> Self {
        let [x0, v0, a0] = from;
        // Difference from constant acceleration, in units of the duration.
        let dx = to[0] - (x0 + v0 * t + 0.5 * a0 * t * t);
        let dv = (to[1] - (v0 + a0 * t)) * t;
        let da = (to[2] - a0) * t * t;
        let t3 = t * t * t;
        Self([
            x0,
            v0,
            0.5 * a0,
            (10.0 * dx - 4.0 * dv + 0.5 * da) / t3,
            (-15.0 * dx + 7.0 * dv - da) / (t3 * t),
            (6.0 * dx - 3.0 * dv + 0.5 * da) / (t3 * t * t),
        ])
    }

    /// Polynomial from `from` = (x, v, a) at 0 to velocity and acceleration `to` = (v, a) at `t > 0`, with a free end
    /// position.
    pub(crate) fn to_velocity(from: [f64; 3], to: [f64; 2], t: f64) -> Self {
        let [x0, v0, a0] = from;
        let dv = to[0] - (v0 + a0 * t);
        let da = (to[1] - a0) * t;
        Self([x0, v0, 0.5 * a0, (dv - da / 3.0) / (t * t), (0.25 * da - 0.5 * dv) / (t * t * t), 0.0])
    }

    #[inline]
    pub(crate) fn at(&self, t: f64) -> Jet {
        let [c0, c1, c2, c3, c4, c5] = self.0;
        Jet {
            x: c0 + t * (c1 + t * (c2 + t * (c3 + t * (c4 + t * c5)))),
            v: c1 + t * (2.0 * c2 + t * (3.0 * c3 + t * (4.0 * c4 + t * 5.0 * c5))),
            a: 2.0 * c2 + t * (6.0 * c3 + t * (12.0 * c4 + t * 20.0 * c5)),
            j: 6.0 * c3 + t * (24.0 * c4 + t * 60.0 * c5),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn quintic_meets_both_end_states(
            x in -9.0..9.0, v in -9.0..9.0, a in -9.0..9.0,
            to_x in -9.0..9.0, to_v in -9.0..9.0, to_a in -9.0..9.0, t in 0.5..8.0,
        ) {
            let near = |p: f64, q: f64| (p - q).abs() < 1e-9;
            let five = Quintic::new([x, v, a], [to_x, to_v, to_a], t);
            let (start, end) = (five.at(0.0), five.at(t));
            prop_assert!(near(start.x, x) && near(start.v, v) && near(start.a, a));
            prop_assert!(near(end.x, to_x) && near(end.v, to_v) && near(end.a, to_a), "{end:?}");
            let four = Quintic::to_velocity([x, v, a], [to_v, to_a], t);
            let (start, end) = (four.at(0.0), four.at(t));
            prop_assert!(near(start.x, x) && near(start.v, v) && near(start.a, a));
            prop_assert!(near(end.v, to_v) && near(end.a, to_a), "{end:?}");
        }

        #[test]
        fn quintic_derivatives_match_finite_differences(a in -9.0..9.0, to in -9.0..9.0, at in 0.1..1.9) {
            let five = Quintic::new([1.0, -2.0, a], [to, 0.5, 0.0], 2.0);
            let (low, mid, high) = (five.at(at - 1e-5), five.at(at), five.at(at + 1e-5));
            prop_assert!(((high.x - low.x) / 2e-5 - mid.v).abs() < 1e-4);
            prop_assert!(((high.v - low.v) / 2e-5 - mid.a).abs() < 1e-3);
            prop_assert!(((high.a - low.a) / 2e-5 - mid.j).abs() < 1e-2);
        }
    }

    #[test]
    fn a_lane_change_from_rest_is_the_minimum_jerk_curve() {
        // 10 τ³ - 15 τ⁴ + 6 τ⁵ at τ = 1/2 is 1/2, with slope 15/8.
        let half = Quintic::new([0.0; 3], [4.0, 0.0, 0.0], 2.0).at(1.0);
        assert!((half.x - 2.0).abs() < 1e-12 && (half.v - 4.0 * 15.0 / 8.0 / 2.0).abs() < 1e-12);
    }
}
