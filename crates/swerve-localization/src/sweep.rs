//! Deskewing of lidar scans: transforms points to the lidar's frame at the end of the scan.

use nalgebra::{Isometry3, Vector3};
use swerve_geom::math;

/// Range of the points used, metres: nearer ones may be on the vehicle, farther ones are sparse.
pub(crate) const RANGE_M: [f64; 2] = [2.0, 100.0];

/// Motion of a lidar over a scan, in pieces of equal duration with constant velocity and angular rate.
#[derive(Clone, PartialEq, Debug)]
pub struct Sweep {
    /// Pieces in the order of time.
    pieces: Vec<Piece>,
}

/// One piece: the lidar's pose at its end, in the frame at the end of the scan, and its motion.
#[derive(Clone, PartialEq, Debug)]
struct Piece {
    end_from_here: Isometry3<f64>,
    twist: Twist,
}

impl Sweep {
    /// Constant velocity and angular rate over the scan.
    pub fn steady(motion: &Isometry3<f64>) -> Self {
        Self { pieces: vec![Piece { end_from_here: Isometry3::identity(), twist: Twist::new(motion) }] }
    }

    /// Interpolates poses at equal intervals from start to end of the scan, in any common frame; fewer than two give
    /// no motion.
    pub fn through(poses: &[Isometry3<f64>]) -> Self {
        let Some(end) = poses.last().filter(|_| poses.len() > 1) else {
            return Self::steady(&Isometry3::identity());
        };
        let piece = |pair: &[Isometry3<f64>]| Piece {
            end_from_here: end.inverse() * pair[1],
            twist: Twist::new(&(pair[0].inverse() * pair[1])),
        };
        Self { pieces: poses.windows(2).map(piece).collect() }
    }

    /// Transforms the points of a scan to the lidar's frame at its end. Each is given in the frame at its own
    /// instant, with that instant as a share of the scan from its end, -1 to 0. Points that are too near, too far or
    /// not finite are dropped.
    pub fn straightened(&self, points: &[(Vector3<f64>, f64)]) -> Vec<Vector3<f64>> {
        points
            .iter()
            .filter(|(point, _)| (RANGE_M[0]..RANGE_M[1]).contains(&point.norm()))
            .map(|(point, share)| self.at_end(point, share.clamp(-1.0, 0.0)))
            .collect()
    }

    fn at_end(&self, point: &Vector3<f64>, share: f64) -> Vector3<f64> {
        let many = self.pieces.len() as f64;
        let last = self.pieces.len() - 1;
        let place = (((1.0 + share) * many) as usize).min(last);
        let piece = &self.pieces[place];
        let moved = piece.twist.moved(point, (share * many + (last - place) as f64).clamp(-1.0, 0.0));
        if place == last {
            return moved;
        }
        piece.end_from_here.rotation * moved + piece.end_from_here.translation.vector
    }
}

/// A motion that is applied to points in part, at constant velocity and angular rate.
#[derive(Clone, PartialEq, Debug)]
struct Twist {
    way: Vector3<f64>,
    turn: Vector3<f64>,
    /// Squared length of `turn`.
    square: f64,
}

impl Twist {
    fn new(motion: &Isometry3<f64>) -> Self {
        let q = motion.rotation.coords;
        let half = q.xyz() * if q.w < 0.0 { -1.0 } else { 1.0 };
        let sin = half.norm();
        let turn = if sin > 1e-12 { half * (2.0 * math::atan2(sin, q.w.abs()) / sin) } else { half * 2.0 };
        Self { way: motion.translation.vector, turn, square: turn.dot(&turn) }
    }

    /// Applies a share of the motion, by Rodrigues' formula with series for sine and cosine: for turns below one
    /// radian, the relative error is 1e-6.
    fn moved(&self, point: &Vector3<f64>, share: f64) -> Vector3<f64> {
        let (turn, square) = (self.turn * share, self.square * share * share);
        let sine = 1.0 - square / 6.0 * (1.0 - square / 20.0 * (1.0 - square / 42.0));
        let cosine = 0.5 - square / 24.0 * (1.0 - square / 30.0 * (1.0 - square / 56.0));
        let across = turn.cross(point);
        point + across * sine + turn.cross(&across) * cosine + self.way * share
    }
}

#[cfg(test)]
mod tests {
    use nalgebra::Translation3;

    use super::*;
    use crate::eskf::exp;

    fn pose(x_m: f64, turn_rad: f64) -> Isometry3<f64> {
        Isometry3::from_parts(Translation3::new(x_m, 0.0, 0.0), exp(&Vector3::new(0.0, 0.0, turn_rad)))
    }

    #[test]
    fn motion_in_pieces_equals_a_steady_one() {
        let poses: Vec<_> = (0..=8).map(|k| pose(0.25 * f64::from(k), 0.0)).collect();
        let [many, once] = [Sweep::through(&poses), Sweep::steady(&pose(2.0, 0.0))];
        for k in 0..=100 {
            let point = (Vector3::new(10.0, -4.0, 1.0), -0.01 * f64::from(k));
            let [a, b] = [&many, &once].map(|sweep| sweep.straightened(&[point])[0]);
            assert!((a - b).norm() < 1e-12, "{k}: {a} {b}");
        }
    }

    #[test]
    fn growing_turn_rate_is_followed_piecewise() {
        // From rest to 0.6 rad/s in a scan of 0.1 s: 0.03 rad in total.
        let angle = |t: f64| 0.5 * 6.0 * t * t;
        let poses: Vec<_> = (0..=8).map(|k| pose(0.0, angle(0.0125 * f64::from(k)))).collect();
        let seen = |share: f64| {
            let then = pose(0.0, angle(0.1 * (1.0 + share)));
            (then.rotation.inverse() * Vector3::new(30.0, 0.0, 0.0), share)
        };
        let exact = pose(0.0, angle(0.1)).rotation.inverse() * Vector3::new(30.0, 0.0, 0.0);
        let worst = |sweep: &Sweep| {
            let shares = (0..=100).map(|k| -0.01 * f64::from(k));
            shares.map(|share| (sweep.straightened(&[seen(share)])[0] - exact).norm()).fold(0.0, f64::max)
        };
        let steady = worst(&Sweep::steady(&pose(0.0, angle(0.1))));
        assert!(steady > 0.2, "{steady}");
        let pieces = worst(&Sweep::through(&poses));
        assert!(pieces < 0.005, "{pieces}");
    }

    #[test]
    fn invalid_near_and_far_points_are_dropped() {
        let still = Sweep::through(&[]);
        let points = [[f64::NAN, 0.0, 0.0], [0.5, 0.0, 0.0], [500.0, 0.0, 0.0], [5.0, 0.0, 0.0]];
        let kept = still.straightened(&points.map(|point| (Vector3::from(point), f64::NAN)));
        assert_eq!(kept.len(), 1);
    }
}
