//! Arcs and straights, the pieces of drivable paths.

use swerve_geom::{Point2, Pose2, math};

/// A stretch of constant curvature: an arc or a straight.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Piece {
    /// Curvature: `1/radius` left, `-1/radius` right, 0 straight, 1/m.
    pub curvature_1pm: f64,
    /// Length, metres.
    pub length_m: f64,
}

/// The pose after `length_m` along a line of constant curvature.
pub fn advance(from: Pose2, curvature_1pm: f64, length_m: f64) -> Pose2 {
    let turned = curvature_1pm * length_m;
    if turned.abs() < 1e-9 {
        return from.ahead(length_m);
    }
    // The chord of the arc lies at half the turn.
    let chord = 2.0 * math::sin(0.5 * turned) / curvature_1pm;
    let (sin, cos) = math::sin_cos(from.heading_rad + 0.5 * turned);
    Pose2::new(from.x_m + chord * cos, from.y_m + chord * sin, from.heading_rad + turned)
}

/// Calls `visit` with point, cosine and sine of the heading, and length so far at even steps of at most `step_m` along
/// the piece, including its end but not its start; stops when `visit` returns false.
///
/// Computes one sine and cosine per piece; the rest are rotations by a fixed angle.
pub fn walk(
    from: Pose2,
    piece: Piece,
    step_m: f64,
    mut visit: impl FnMut(Point2, [f64; 2], f64) -> bool,
) -> bool {
    if piece.length_m <= 0.0 {
        return true;
    }
    let n = (piece.length_m / step_m).ceil().max(1.0);
    let step = piece.length_m / n;
    let (mut sin, mut cos) = math::sin_cos(from.heading_rad);
    let (turn_sin, turn_cos) = math::sin_cos(piece.curvature_1pm * step);
    let (mut x, mut y) = (from.x_m, from.y_m);
    for i in 1..=n as usize {
        if piece.curvature_1pm == 0.0 {
            x += cos * step;
            y += sin * step;
        } else {
            let next = (sin * turn_cos + cos * turn_sin, cos * turn_cos - sin * turn_sin);
            x += (next.0 - sin) / piece.curvature_1pm;
            y -= (next.1 - cos) / piece.curvature_1pm;
            (sin, cos) = next;
        }
        if !visit(Point2::new(x, y), [cos, sin], step * i as f64) {
            return false;
        }
    }
    true
}

/// Drops pieces without length and joins neighbours of equal curvature.
pub fn join(pieces: &mut Vec<Piece>) {
    pieces.retain(|p| p.length_m > 1e-9);
    pieces.dedup_by(|next, kept| {
        let same = next.curvature_1pm == kept.curvature_1pm;
        if same {
            kept.length_m += next.length_m;
        }
        same
    });
}

/// Length of pieces, metres.
pub fn length_m(pieces: &[Piece]) -> f64 {
    pieces.iter().map(|p| p.length_m).sum()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    proptest! {
        #![proptest_config(ProptestConfig { rng_seed: proptest::test_runner::RngSeed::Fixed(1), ..ProptestConfig::default() })]
        #[test]
        fn walk_agrees_with_advance(h in -3.0..3.0, curvature in -0.2..0.2, length in 0.1..20.0) {
            let from = Pose2::new(3.0, 4.0, h);
            let piece = Piece { curvature_1pm: curvature, length_m: length };
            let mut n = 0;
            walk(from, piece, 0.25, |point, [cos, sin], s| {
                let expected = advance(from, curvature, s);
                assert!(point.distance(expected.point()) < 1e-9);
                assert!((cos - math::cos(expected.heading_rad)).abs() < 1e-9);
                assert!((sin - math::sin(expected.heading_rad)).abs() < 1e-9);
                n += 1;
                true
            });
            prop_assert_eq!(n, (length / 0.25).ceil() as usize);
        }
    }
}
