//! Reference lines in the ground plane (ASAM OpenDRIVE 1.8, chapter 9).
//!
//! Lines and arcs are closed forms. Spirals are integrals of the Fresnel integrand, by Gauss-Legendre quadrature over
//! panels in which the line turns by at most a radian: eight nodes leave an error below 1e-12 of the length, and there is
//! no cancellation where the curvature changes little. Parametric curves are evaluated at the parameter that belongs to
//! the true arc length, also where `pRange` is `normalized`.

use swerve_geom::math;

use crate::cubic::{SAME_M, polynomial};

/// Nodes and weights of Gauss-Legendre quadrature on (-1, 1), the positive half (Abramowitz and Stegun, table 25.4).
const GAUSS: [(f64, f64); 4] = [
    (0.183_434_642_495_649_8, 0.362_683_783_378_362),
    (0.525_532_409_916_329, 0.313_706_645_877_887_3),
    (0.796_666_477_413_626_7, 0.222_381_034_453_374_48),
    (0.960_289_856_497_536_3, 0.101_228_536_290_376_26),
];

/// Largest turn of a spiral, radians: bounds the number of panels.
pub(crate) const TURN_MAX_RAD: f64 = 100.0;

/// Panels of a parametric curve.
const PANELS: usize = 32;

/// Speeds of a parametric curve below this have no direction, metres per unit of the parameter.
const STILL: f64 = 1e-9;

/// A place of a reference line.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Pose {
    pub x_m: f64,
    pub y_m: f64,
    /// Direction of increasing s; not wrapped.
    pub heading_rad: f64,
    /// Positive to the left, 1/m.
    pub curvature_1pm: f64,
}

/// A piece of a reference line.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Piece {
    /// Begin along the road, metres.
    pub s_m: f64,
    pub length_m: f64,
    begin: Pose,
    /// Cosine and sine of the heading at the begin.
    direction: (f64, f64),
    shape: Shape,
}

/// Kind of a piece, for summaries.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Debug)]
pub enum PieceKind {
    /// Clause 9.3.
    Line,
    /// Clause 9.5.
    Arc,
    /// Clause 9.4.
    Spiral,
    /// Cubic polynomial, deprecated.
    Poly3,
    /// Clause 9.6.
    ParamPoly3,
}

impl PieceKind {
    /// Name of the element.
    pub fn name(self) -> &'static str {
        match self {
            Self::Line => "line",
            Self::Arc => "arc",
            Self::Spiral => "spiral",
            Self::Poly3 => "poly3",
            Self::ParamPoly3 => "paramPoly3",
        }
    }
}

#[derive(Clone, PartialEq, Debug)]
pub(crate) enum Shape {
    Line,
    Arc { curvature_1pm: f64 },
    Spiral(Spiral),
    Parametric(Box<Parametric>),
}

/// A line whose curvature is linear in arc length.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Spiral {
    begin_1pm: f64,
    /// Change of curvature, 1/m².
    rate: f64,
    panel_m: f64,
    /// Positions at the begin of each panel.
    at: Vec<(f64, f64)>,
}

/// A curve (u(p), v(p)) of cubic polynomials.
#[derive(Clone, PartialEq, Debug)]
pub(crate) struct Parametric {
    u: [f64; 4],
    v: [f64; 4],
    p_max: f64,
    is_poly3: bool,
    /// Arc length at the begin of each panel, and the whole.
    arc_m: [f64; PANELS + 1],
}

impl Spiral {
    /// Creates a spiral from its curvatures at both ends; `None` if it turns by more than [`TURN_MAX_RAD`].
    pub(crate) fn new(begin_1pm: f64, end_1pm: f64, length_m: f64) -> Option<Self> {
        let turn = begin_1pm.abs().max(end_1pm.abs()) * length_m;
        if !(turn <= TURN_MAX_RAD && length_m > 0.0) {
            return None;
        }
        let panels = (turn.ceil() as usize).max(1);
        let panel_m = length_m / panels as f64;
        let mut spiral =
            Self { begin_1pm, rate: (end_1pm - begin_1pm) / length_m, panel_m, at: vec![(0.0, 0.0)] };
        for k in 1..panels {
            let (x, y) = spiral.moved(k - 1, k as f64 * panel_m);
            spiral.at.push((x, y));
        }
        Some(spiral)
    }

    fn turn(&self, u: f64) -> f64 {
        u * (self.begin_1pm + 0.5 * self.rate * u)
    }

    /// Position at `ds`, integrated from the begin of a panel.
    fn moved(&self, panel: usize, ds: f64) -> (f64, f64) {
        let from = panel as f64 * self.panel_m;
        let (middle, half) = (0.5 * (from + ds), 0.5 * (ds - from));
        let (mut x, mut y) = (0.0, 0.0);
        for (node, weight) in GAUSS {
            let (s0, c0) = math::sin_cos(self.turn(middle - half * node));
            let (s1, c1) = math::sin_cos(self.turn(middle + half * node));
            x += weight * (c0 + c1);
            y += weight * (s0 + s1);
        }
        let (x0, y0) = self.at[panel];
        (x0 + half * x, y0 + half * y)
    }

    fn pose(&self, ds: f64) -> Pose {
        let panel = ((ds / self.panel_m).max(0.0) as usize).min(self.at.len() - 1);
        let (x_m, y_m) = self.moved(panel, ds);
        Pose { x_m, y_m, heading_rad: self.turn(ds), curvature_1pm: self.begin_1pm + self.rate * ds }
    }
}

impl Parametric {
    /// Creates a curve; `None` if it has no length.
    pub(crate) fn new(u: [f64; 4], v: [f64; 4], p_max: f64, is_poly3: bool) -> Option<Self> {
        let mut curve = Self { u, v, p_max, is_poly3, arc_m: [0.0; PANELS + 1] };
        for k in 0..PANELS {
            curve.arc_m[k + 1] = curve.arc_m[k] + curve.arc_between(curve.panel(k), curve.panel(k + 1));
        }
        let whole = curve.arc_m[PANELS];
        (whole > 0.0 && whole.is_finite()).then_some(curve)
    }

    /// Arc length of the whole curve, metres.
    pub(crate) fn length_m(&self) -> f64 {
        self.arc_m[PANELS]
    }

    fn panel(&self, k: usize) -> f64 {
        self.p_max * k as f64 / PANELS as f64
    }

    fn speed(&self, p: f64) -> f64 {
        math::hypot(polynomial(&self.u, p)[1], polynomial(&self.v, p)[1])
    }

    fn arc_between(&self, from: f64, to: f64) -> f64 {
        let (middle, half) = (0.5 * (from + to), 0.5 * (to - from));
        let pair =
            |(node, weight)| weight * (self.speed(middle - half * node) + self.speed(middle + half * node));
        half * GAUSS.into_iter().map(pair).sum::<f64>()
    }

    /// Parameter at an arc length: Newton's method, kept within a panel by bisection.
    fn parameter(&self, ds: f64) -> f64 {
        const NEAR_M: f64 = 1e-10;
        let ds = ds.clamp(0.0, self.arc_m[PANELS]);
        let k = self.arc_m.partition_point(|arc_m| *arc_m <= ds).clamp(1, PANELS) - 1;
        let (begin, mut low, mut high) = (self.panel(k), self.panel(k), self.panel(k + 1));
        let share = (ds - self.arc_m[k]) / (self.arc_m[k + 1] - self.arc_m[k]).max(f64::MIN_POSITIVE);
        let mut p = begin + share.clamp(0.0, 1.0) * (high - low);
        for _ in 0..60 {
            let miss = self.arc_m[k] + self.arc_between(begin, p) - ds;
            if miss.abs() <= NEAR_M {
                break;
            }
            *(if miss > 0.0 { &mut high } else { &mut low }) = p;
            let next = p - miss / self.speed(p).max(STILL);
            p = if low < next && next < high { next } else { 0.5 * (low + high) };
        }
        p
    }

    fn pose(&self, ds: f64) -> Pose {
        let p = self.parameter(ds);
        let ([u, du, ddu], [v, dv, ddv]) = (polynomial(&self.u, p), polynomial(&self.v, p));
        let speed = math::hypot(du, dv);
        let curvature_1pm = if speed > STILL { (du * ddv - dv * ddu) / (speed * speed * speed) } else { 0.0 };
        Pose { x_m: u, y_m: v, heading_rad: math::atan2(dv, du), curvature_1pm }
    }
}

impl Piece {
    /// Creates a piece that begins at a position and heading.
    pub(crate) fn new(s_m: f64, length_m: f64, [x_m, y_m, heading_rad]: [f64; 3], shape: Shape) -> Self {
        let (sin, cos) = math::sin_cos(heading_rad);
        let begin = Pose { x_m, y_m, heading_rad, curvature_1pm: 0.0 };
        Self { s_m, length_m, begin, direction: (cos, sin), shape }
    }

    pub(crate) fn kind(&self) -> PieceKind {
        match &self.shape {
            Shape::Line => PieceKind::Line,
            Shape::Arc { .. } => PieceKind::Arc,
            Shape::Spiral(_) => PieceKind::Spiral,
            Shape::Parametric(curve) if curve.is_poly3 => PieceKind::Poly3,
            Shape::Parametric(_) => PieceKind::ParamPoly3,
        }
    }

    /// Pose at `ds` from the begin; beyond the end the curve goes on, a parametric one stays at its end.
    pub(crate) fn at(&self, ds: f64) -> Pose {
        let local = match &self.shape {
            Shape::Line => Pose { x_m: ds, y_m: 0.0, heading_rad: 0.0, curvature_1pm: 0.0 },
            Shape::Arc { curvature_1pm } => arc(*curvature_1pm, ds),
            Shape::Spiral(spiral) => spiral.pose(ds),
            Shape::Parametric(curve) => curve.pose(ds),
        };
        let (cos, sin) = self.direction;
        Pose {
            x_m: self.begin.x_m + local.x_m * cos - local.y_m * sin,
            y_m: self.begin.y_m + local.x_m * sin + local.y_m * cos,
            heading_rad: self.begin.heading_rad + local.heading_rad,
            curvature_1pm: local.curvature_1pm,
        }
    }
}

/// Pose on an arc. `1 - cos` is written by the half angle: it does not cancel for long radii.
fn arc(curvature_1pm: f64, ds: f64) -> Pose {
    let turn = curvature_1pm * ds;
    let (sin, cos) = math::sin_cos(0.5 * turn);
    // Chord over arc length: sin(x) / x.
    let chord = if turn.abs() < 1e-9 { ds } else { 2.0 * sin / curvature_1pm };
    Pose { x_m: chord * cos, y_m: chord * sin, heading_rad: turn, curvature_1pm }
}

/// A reference line: pieces in ascending order.
#[derive(Clone, PartialEq, Debug, Default)]
pub(crate) struct ReferenceLine(pub Vec<Piece>);

impl ReferenceLine {
    /// Pose at `s_m`; `None` for a line without pieces.
    pub(crate) fn at(&self, s_m: f64) -> Option<Pose> {
        let next = self.0.partition_point(|piece| piece.s_m <= s_m + SAME_M);
        let piece = self.0.get(next.max(1) - 1)?;
        Some(piece.at(s_m - piece.s_m))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn close(pose: Pose, [x, y, heading, curvature]: [f64; 4], within: f64) {
        let apart = [pose.x_m - x, pose.y_m - y, pose.heading_rad - heading, pose.curvature_1pm - curvature];
        assert!(apart.iter().all(|d| d.abs() <= within), "{pose:?}: {apart:?}");
    }

    #[test]
    fn spirals_match_the_fresnel_integrals() {
        // Abramowitz and Stegun, table 7.7: C(x) and S(x) of the integrands cos and sin of pi t²/2.
        let pi = core::f64::consts::PI;
        for (x, c, s) in [
            (0.5, 0.492_344_225_871_446_3, 0.064_732_432_859_999_28),
            (1.0, 0.779_893_400_376_822_8, 0.438_259_147_390_354_8),
            (2.0, 0.488_253_406_075_340_7, 0.343_415_678_363_698_24),
            (5.0, 0.563_631_188_704_012_3, 0.499_191_381_917_116_9),
        ] {
            let spiral = Spiral::new(0.0, pi * x, x).unwrap();
            close(spiral.pose(x), [c, s, 0.5 * pi * x * x, pi * x], 2e-13);
        }
        // Nearly an arc, and nearly a line: no cancellation.
        let spiral = Spiral::new(0.01, 0.01 + 1e-13, 100.0).unwrap();
        let on_arc = arc(0.01, 100.0);
        close(spiral.pose(100.0), [on_arc.x_m, on_arc.y_m, 1.0, 0.01], 1e-9);
        assert!(Spiral::new(0.0, 11.0, 10.0).is_none(), "it turns by 110 rad");
    }

    #[test]
    fn arcs_of_any_radius_are_exact() {
        let quarter = core::f64::consts::FRAC_PI_2;
        close(arc(0.1, 10.0 * quarter), [10.0, 10.0, quarter, 0.1], 1e-12);
        close(arc(-0.1, 10.0 * quarter), [10.0, -10.0, -quarter, -0.1], 1e-12);
        // y = ds²/2 k, to the last digits.
        close(arc(1e-8, 100.0), [100.0, 5e-5, 1e-6, 1e-8], 1e-10);
        close(arc(0.0, 3.0), [3.0, 0.0, 0.0, 0.0], 0.0);
    }

    #[test]
    fn parametric_curves_are_evaluated_at_the_true_arc_length() {
        // A straight line that is run through unevenly: u = p² over [0, 1], 4 m long with u = 4 p².
        let curve = Parametric::new([0.0, 0.0, 4.0, 0.0], [0.0; 4], 1.0, false).unwrap();
        assert!((curve.length_m() - 4.0).abs() < 1e-12);
        for s in [0.5, 1.0, 3.0, 4.0] {
            close(curve.pose(s), [s, 0.0, 0.0, 0.0], 1e-9);
        }
        // y = x²/2 from 0 to 1: arc length (sqrt(2) + asinh(1)) / 2.
        let parabola = Parametric::new([0.0, 1.0, 0.0, 0.0], [0.0, 0.0, 0.5, 0.0], 1.0, true).unwrap();
        let arc_m = 0.5 * (2_f64.sqrt() + 0.881_373_587_019_543);
        assert!((parabola.length_m() - arc_m).abs() < 1e-12);
        close(parabola.pose(arc_m), [1.0, 0.5, core::f64::consts::FRAC_PI_4, 0.5 * 0.5_f64.sqrt()], 1e-8);
        assert!(Parametric::new([1.0, 0.0, 0.0, 0.0], [0.0; 4], 1.0, false).is_none());
    }

    #[test]
    fn pieces_are_turned_to_their_heading_and_followed_in_order() {
        let quarter = core::f64::consts::FRAC_PI_2;
        let line = ReferenceLine(vec![
            Piece::new(0.0, 10.0, [1.0, 2.0, quarter], Shape::Line),
            Piece::new(10.0, 5.0, [1.0, 12.0, quarter], Shape::Arc { curvature_1pm: 0.2 }),
        ]);
        close(line.at(4.0).unwrap(), [1.0, 6.0, quarter, 0.0], 1e-12);
        close(line.at(10.0 + 5.0 * quarter).unwrap(), [-4.0, 17.0, 2.0 * quarter, 0.2], 1e-12);
        assert_eq!(ReferenceLine::default().at(0.0), None);
    }
}
