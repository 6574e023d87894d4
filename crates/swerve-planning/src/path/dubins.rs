//! Dubins paths: the shortest path between two poses for a car with a smallest turning radius that never reverses.
//!
//! Source: L. E. Dubins, "On curves of minimal length with a constraint on average curvature", 1957; the
//! closed forms for the six words are those of A. M. Shkel and V. Lumelsky, "Classification of the Dubins
//! set", 2001, section 3.

use core::f64::consts::{PI, TAU};

use swerve_geom::{Pose2, math};

use super::piece::Piece;

/// The shortest path between two poses.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Dubins {
    /// The pieces in driving order; some may have length zero.
    pub pieces: [Piece; 3],
}

/// Turning sides of the three letters of each word (1 left, 0 straight, -1 right).
const WORDS: [[f64; 3]; 6] = [
    [1.0, 0.0, 1.0],
    [-1.0, 0.0, -1.0],
    [1.0, 0.0, -1.0],
    [-1.0, 0.0, 1.0],
    [-1.0, 1.0, -1.0],
    [1.0, -1.0, 1.0],
];

/// Upper bound on the rounding error of a word's length, in units of the radius.
const BOUND_SLACK: f64 = 1e-6;

/// The goal relative to the start in units of the radius (Shkel and Lumelsky, figure 2): distance, and the two headings
/// relative to the line between the positions.
struct Relative {
    d: f64,
    alpha: f64,
    beta: f64,
    sin_alpha: f64,
    cos_alpha: f64,
    sin_beta: f64,
    cos_beta: f64,
    cos_difference: f64,
}

/// An angle in `[0, 2 pi)`; values that are below a full turn only by rounding become zero.
fn turn(angle: f64) -> f64 {
    let wrapped = angle - TAU * (angle / TAU).floor();
    if wrapped > TAU - 1e-9 { 0.0 } else { wrapped }
}

impl Relative {
    fn new(from: Pose2, to: Pose2, radius_m: f64) -> Self {
        let (dx, dy) = (to.x_m - from.x_m, to.y_m - from.y_m);
        let d = math::hypot(dx, dy) / radius_m;
        let along = if d > 0.0 { math::atan2(dy, dx) } else { 0.0 };
        let (alpha, beta) = (from.heading_rad - along, to.heading_rad - along);
        let ((sin_alpha, cos_alpha), (sin_beta, cos_beta)) = (math::sin_cos(alpha), math::sin_cos(beta));
        let cos_difference = cos_alpha * cos_beta + sin_alpha * sin_beta;
        Self { d, alpha, beta, sin_alpha, cos_alpha, sin_beta, cos_beta, cos_difference }
    }

    /// Length, index and segment lengths of the shortest word, of equals the first. Starting with the most promising
    /// word, words that are certainly longer than the best so far are skipped.
    fn shortest(&self) -> (f64, usize, [f64; 3]) {
        let at_least = self.at_least();
        let mut promising = 0;
        for (index, bound) in at_least.iter().enumerate() {
            if *bound < at_least[promising] {
                promising = index;
            }
        }
        let mut best = (f64::INFINITY, 0, [0.0; 3]);
        for index in core::iter::once(promising).chain((0..WORDS.len()).filter(|index| *index != promising)) {
            if at_least[index] >= best.0 {
                continue;
            }
            if let Some(lengths) = self.word(index) {
                let total = lengths[0] + lengths[1] + lengths[2];
                if total < best.0 || (total == best.0 && index < best.1) {
                    best = (total, index, lengths);
                }
            }
        }
        best
    }

    /// Lower bound on the length of each word, infinite if it does not exist: the straight plus the net turn of its two
    /// arcs, to one side or against each other; half a turn for three arcs.
    fn at_least(&self) -> [f64; 6] {
        let d = self.d;
        let (rise, sum) = (self.sin_alpha - self.sin_beta, self.sin_alpha + self.sin_beta);
        let turned = self.beta - self.alpha;
        let left = if turned < 0.0 { turned + TAU } else { turned };
        let inside = (0.0..=TAU).contains(&left);
        let (left, right) = if inside { (left, TAU - left) } else { (0.0, 0.0) };
        // A full turn may be none at all.
        let either = |turn: f64| if turn > TAU - BOUND_SLACK { 0.0 } else { turn };
        let same_side = |side: f64, turn: f64| {
            let square = 2.0 + d * d - 2.0 * self.cos_difference + 2.0 * d * side * rise;
            square.max(0.0).sqrt() + either(turn) - BOUND_SLACK
        };
        let crossing = |side: f64| {
            let square = d * d - 2.0 + 2.0 * self.cos_difference + 2.0 * d * side * sum;
            if square < 0.0 { f64::INFINITY } else { square.sqrt() + left.min(right) - BOUND_SLACK }
        };
        let three_arcs = if d >= 4.0 { f64::INFINITY } else { PI - BOUND_SLACK };
        [same_side(1.0, left), same_side(-1.0, right), crossing(1.0), crossing(-1.0), three_arcs, three_arcs]
    }

    /// The three lengths of word `index` in units of the radius; `None` if the word does not exist.
    fn word(&self, index: usize) -> Option<[f64; 3]> {
        match index {
            0 => self.same_side(1.0),
            1 => self.same_side(-1.0),
            2 => self.crossing(1.0),
            3 => self.crossing(-1.0),
            4 => self.three_arcs(-1.0),
            _ => self.three_arcs(1.0),
        }
    }

    /// LSL (`side` 1) and RSR (`side` -1).
    fn same_side(&self, side: f64) -> Option<[f64; 3]> {
        let (d, rise) = (self.d, self.sin_alpha - self.sin_beta);
        let square = 2.0 + d * d - 2.0 * self.cos_difference + 2.0 * d * side * rise;
        if square < -1e-9 {
            return None;
        }
        // On one circle the straight vanishes and with it its direction: all the turn goes to the last arc.
        let middle = if square < 1e-12 {
            self.alpha
        } else {
            math::atan2(side * (self.cos_beta - self.cos_alpha), d + side * rise)
        };
        Some([turn(side * (middle - self.alpha)), square.max(0.0).sqrt(), turn(side * (self.beta - middle))])
    }

    /// LSR (`side` 1) and RSL (`side` -1).
    fn crossing(&self, side: f64) -> Option<[f64; 3]> {
        let (d, sum) = (self.d, self.sin_alpha + self.sin_beta);
        let square = d * d - 2.0 + 2.0 * self.cos_difference + 2.0 * d * side * sum;
        if square < 0.0 {
            return None;
        }
        let p = square.sqrt();
        let middle = math::atan2(-side * (self.cos_alpha + self.cos_beta), d + side * sum)
            - math::atan2(-2.0 * side, p);
        Some([turn(side * (middle - self.alpha)), p, turn(side * (middle - self.beta))])
    }

    /// LRL (`side` 1) and RLR (`side` -1).
    fn three_arcs(&self, side: f64) -> Option<[f64; 3]> {
        if self.d >= 4.0 {
            return None;
        }
        let (d, rise) = (self.d, self.sin_alpha - self.sin_beta);
        let cos = (6.0 - d * d + 2.0 * self.cos_difference - 2.0 * d * side * rise) / 8.0;
        if cos.abs() > 1.0 {
            return None;
        }
        let p = TAU - math::acos(cos);
        let middle = math::atan2(self.cos_alpha - self.cos_beta, d + side * rise);
        let t = turn(-side * self.alpha - middle + 0.5 * p);
        Some([t, p, turn(side * (self.beta - self.alpha) - t + p)])
    }
}

impl Dubins {
    /// The shortest path from pose to pose with turns of `radius_m` (positive).
    pub fn shortest(from: Pose2, to: Pose2, radius_m: f64) -> Self {
        let (_, index, lengths) = Relative::new(from, to, radius_m).shortest();
        let piece =
            |i: usize| Piece { curvature_1pm: WORDS[index][i] / radius_m, length_m: lengths[i] * radius_m };
        Self { pieces: [piece(0), piece(1), piece(2)] }
    }

    /// Length, metres.
    pub fn length(&self) -> f64 {
        self.pieces[0].length_m + self.pieces[1].length_m + self.pieces[2].length_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use swerve_geom::angle_between;

    use crate::path::piece::advance;

    fn end(from: Pose2, path: &Dubins) -> Pose2 {
        path.pieces.iter().fold(from, |pose, piece| advance(pose, piece.curvature_1pm, piece.length_m))
    }

    fn length(to: [f64; 3], radius_m: f64) -> f64 {
        Dubins::shortest(Pose2::default(), Pose2::new(to[0], to[1], to[2]), radius_m).length()
    }

    /// The first of the shortest words by exhaustive search.
    fn of_all(relative: &Relative) -> (f64, usize, [f64; 3]) {
        let mut best = (f64::INFINITY, 0, [0.0; 3]);
        for index in 0..WORDS.len() {
            let Some(lengths) = relative.word(index) else { continue };
            let total = lengths[0] + lengths[1] + lengths[2];
            if total < best.0 {
                best = (total, index, lengths);
            }
        }
        best
    }

    #[test]
    fn skipped_words_are_longer_than_the_shortest() {
        let mut rng = swerve_core::Rng::keyed(3, "dubins", &[]);
        let round = [-PI, -0.5 * PI, 0.0, 0.5 * PI, PI];
        for k in 0..20_000 {
            let far = [0.5, 3.0, 20.0][k % 3];
            let mut angle = || match k % 2 {
                0 => rng.uniform(-PI, PI),
                _ => round[rng.below(round.len())],
            };
            let (from_rad, to_rad) = (angle(), angle());
            let (x, y) = (rng.uniform(-far, far), if k % 5 == 0 { 0.0 } else { rng.uniform(-far, far) });
            let relative = Relative::new(Pose2::new(0.0, 0.0, from_rad), Pose2::new(x, y, to_rad), 1.0);
            assert_eq!(relative.shortest(), of_all(&relative), "{from_rad} {to_rad} {x} {y}");
            for (index, bound) in relative.at_least().into_iter().enumerate() {
                let Some(lengths) = relative.word(index) else { continue };
                assert!(lengths.iter().sum::<f64>() >= bound, "{index}: {lengths:?} {bound}");
            }
        }
    }

    #[test]
    fn shortest_paths_match_the_closed_forms() {
        let cases = [
            ([10.0, 0.0, 0.0], 10.0),
            ([0.0, 0.0, 0.0], 0.0),
            // A quarter and a half turn left; a half turn to the other side of the circle.
            ([5.0, 5.0, 0.5 * PI], 2.5 * PI),
            ([0.0, 10.0, PI], 5.0 * PI),
            ([0.0, -10.0, PI], 5.0 * PI),
            // Quarter left, 7 m straight, quarter right.
            ([10.0, 17.0, 0.0], 5.0 * PI + 7.0),
            // On the spot, the other way: three arcs of 60, 300 and 60 degrees.
            ([0.0, 0.0, PI], 5.0 * 7.0 * PI / 3.0),
            // Straight back: half a turn, the straight, half a turn.
            ([-20.0, 0.0, 0.0], 10.0 * PI + 20.0),
        ];
        for (to, expected) in cases {
            assert!((length(to, 5.0) - expected).abs() < 1e-9, "{to:?}: {} {expected}", length(to, 5.0));
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn shortest_path_ends_at_the_goal_and_is_never_beaten(
            x in -30.0..30.0, y in -30.0..30.0, h in -3.1..3.1, h0 in -3.1..3.1, radius in 3.0..12.0,
        ) {
            let (from, to) = (Pose2::new(1.0, -2.0, h0), Pose2::new(x, y, h));
            let path = Dubins::shortest(from, to, radius);
            let reached = end(from, &path);
            prop_assert!(reached.point().distance(to.point()) < 1e-6, "{path:?} {reached:?}");
            prop_assert!(angle_between(reached.heading_rad, h).abs() < 1e-6);
            prop_assert!(path.length() + 1e-9 >= from.point().distance(to.point()));
            prop_assert!(path.length() <= brute_force(from, to, radius) + 1e-6);
        }
    }

    /// Length of the shortest of many paths that begin with a turn or straight of a given length and continue with the
    /// shortest path from there: none may beat the overall shortest path.
    fn brute_force(from: Pose2, to: Pose2, radius: f64) -> f64 {
        let mut best = f64::INFINITY;
        for side in [-1.0, 0.0, 1.0] {
            for k in 1..20 {
                let first = 0.5 * f64::from(k);
                let at = advance(from, side / radius, first);
                best = best.min(first + Dubins::shortest(at, to, radius).length());
            }
        }
        best
    }
}
