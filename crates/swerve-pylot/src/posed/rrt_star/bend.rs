//! Finds a path that a car can steer along a path of straight lines, if rounding its corners is not enough.

use swerve_geom::{Pose2, Vector2, angle_between};

use super::boxes::Boxes;
use swerve_planning::path::dubins::Dubins;
use swerve_planning::path::piece::{Piece, advance, walk};

/// Distances at which a corner is passed, away from the inside of the turn, metres.
const OFFSETS_M: [f64; 3] = [0.0, 0.5, 1.2];

/// Headings at a corner: fractions of the turn from the previous to the next line.
const SHARES: [f64; 5] = [-0.3, 0.15, 0.5, 0.85, 1.3];

/// Headings at the ends: angles to the line, radians.
const OFF_RAD: [f64; 9] = [0.0, 0.2, -0.2, 0.45, -0.45, 0.8, -0.8, 1.2, -1.2];

/// Length of the chords by which arcs are checked, metres.
pub(super) const CHORD_M: f64 = 0.1;

/// A pose in which a corner may be passed, with the best path to it.
#[derive(Clone, Copy, Debug)]
struct Station {
    pose: Pose2,
    /// Index of the corner.
    corner: u32,
    length_m: f64,
    from: u32,
}

const NONE: u32 = u32::MAX;

/// Storage, reused between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bender {
    stations: Vec<Station>,
    /// Paths to one station: length, and previous station.
    ways: Vec<(f64, u32)>,
}

impl Bender {
    /// Connects shortest paths of the radius from corner to corner, with the best choice of headings and distances at
    /// each, by dynamic programming; a corner may be skipped. The headings at the ends are free. Writes the path to
    /// `pieces` and returns the heading of its start; `None` if there is no such path.
    pub(crate) fn bend(
        &mut self,
        boxes: &Boxes,
        corners: &[Pose2],
        radius_m: f64,
        pieces: &mut Vec<Piece>,
    ) -> Option<f64> {
        self.place(boxes, corners);
        for to in 0..self.stations.len() {
            if self.stations[to].corner > 0 {
                self.reach(boxes, radius_m, to);
            }
        }
        let last = corners.len() as u32 - 1;
        let ends =
            self.stations.iter().enumerate().filter(|(_, s)| s.corner == last && s.length_m.is_finite());
        let (mut at, _) = ends.min_by(|a, b| a.1.length_m.total_cmp(&b.1.length_m))?;
        pieces.clear();
        while self.stations[at].from != NONE {
            let before = self.stations[at].from as usize;
            let path = Dubins::shortest(self.stations[before].pose, self.stations[at].pose, radius_m);
            pieces.extend(path.pieces.iter().rev());
            at = before;
        }
        pieces.reverse();
        Some(self.stations[at].pose.heading_rad)
    }

    fn place(&mut self, boxes: &Boxes, corners: &[Pose2]) {
        self.stations.clear();
        let last = corners.len() - 1;
        let line = |a: usize, b: usize| -> Vector2 { corners[b].point() - corners[a].point() };
        for (i, corner) in corners.iter().enumerate() {
            let point = corner.point();
            let before = if i == 0 { line(0, 1) } else { line(i - 1, i) }.heading();
            let after = if i == last { line(last - 1, last) } else { line(i, i + 1) }.heading();
            let mut push = |at: swerve_geom::Point2, heading_rad: f64| {
                let length_m = if i == 0 { 0.0 } else { f64::INFINITY };
                let pose = Pose2::new(at.x_m, at.y_m, heading_rad);
                self.stations.push(Station { pose, corner: i as u32, length_m, from: NONE });
            };
            if i == 0 || i == last {
                OFF_RAD.iter().for_each(|off| push(point, before + off));
                continue;
            }
            let turn = angle_between(before, after);
            let middle = Vector2::from_heading(before + 0.5 * turn);
            let outward = if turn < 0.0 { middle.left() } else { -middle.left() };
            for offset_m in OFFSETS_M {
                let at = point + outward * offset_m;
                if boxes.point_free(at) {
                    SHARES.iter().for_each(|share| push(at, before + turn * share));
                }
            }
        }
    }

    /// Finds the shortest free path to station `to` from those of the two corners before it.
    fn reach(&mut self, boxes: &Boxes, radius_m: f64, to: usize) {
        let Station { pose, corner, .. } = self.stations[to];
        self.ways.clear();
        for (i, station) in self.stations[..to].iter().enumerate() {
            if station.corner < corner && station.corner + 2 >= corner && station.length_m.is_finite() {
                let length_m = Dubins::shortest(station.pose, pose, radius_m).length();
                // Skip paths that loop.
                if length_m < 1.5 * station.pose.point().distance(pose.point()) + 1.0 {
                    self.ways.push((station.length_m + length_m, i as u32));
                }
            }
        }
        self.ways.sort_unstable_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for &(length_m, from) in &self.ways {
            let start = self.stations[from as usize].pose;
            if pieces_free(boxes, start, &Dubins::shortest(start, pose, radius_m).pieces) {
                (self.stations[to].length_m, self.stations[to].from) = (length_m, from);
                return;
            }
        }
    }
}

/// Returns true if pieces from `start` on stay within bounds and outside the boxes: arcs by chords [`CHORD_M`] long,
/// which are within half a millimetre of them for any radius that a car can steer.
pub(super) fn pieces_free(boxes: &Boxes, start: Pose2, pieces: &[Piece]) -> bool {
    let mut from = start;
    for &piece in pieces {
        let to = advance(from, piece.curvature_1pm, piece.length_m);
        let mut last = from.point();
        let step_m = if piece.curvature_1pm == 0.0 { f64::INFINITY } else { CHORD_M };
        let surely = boxes.all_free(last, to.point(), piece.length_m);
        let free = surely
            || walk(from, piece, step_m, |point, _, _| {
                let free = boxes.segment_free(last, point) && boxes.point_free(point);
                last = point;
                free
            });
        if !free {
            return false;
        }
        from = to;
    }
    true
}
