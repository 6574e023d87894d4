//! Grade and bank along a lane, by the heights of the points of its lines.

use swerve_geom::Point2;

use super::{STEP_M, WIDTH_MIN_M};

/// Shortest distance of a grade, metres; shorter lanes count as if they had this length. Over less, an error of some
/// centimetres would be a hill.
const LEAST_M: f64 = 2.5;

/// Points of a line, each with its height, metres.
pub(crate) type Raised = Vec<(Point2, f64)>;

/// The points of a line with their heights; `None` if one has none.
pub(crate) fn raised(points: &[Point2], heights_m: &[Option<f64>]) -> Option<Raised> {
    points.iter().zip(heights_m).map(|(point, z_m)| Some((*point, (*z_m)?))).collect()
}

/// The same for the left and right border of a lane, each with points and heights.
pub(crate) fn raised_borders(borders: [(&[Point2], &[Option<f64>]); 2]) -> Option<[Raised; 2]> {
    let [left, right] = borders.map(|(points, heights_m)| raised(points, heights_m));
    Some([left?, right?])
}

/// Slopes of one piece of a lane.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Piece {
    /// Height over distance in the ground plane along the lane: positive uphill in its direction.
    pub grade: f64,
    /// The same across the lane: positive with the left border over the right one. `None` if the file has heights of the
    /// centre line only, or the lane is too narrow.
    pub bank: Option<f64>,
}

/// Slopes along a lane: pieces of equal length, at least 5 m each if the lane is that long.
#[derive(Clone, PartialEq, Debug)]
pub struct Profile {
    pieces: Vec<Piece>,
}

impl Profile {
    /// Slopes between a left and a right border in the direction of travel; `None` for a level lane.
    pub(crate) fn between(left: &[(Point2, f64)], right: &[(Point2, f64)]) -> Option<Self> {
        Self::of(&[left, right])
    }

    /// Slopes along a centre line; `None` if it is level.
    pub(crate) fn along(line: &[(Point2, f64)]) -> Option<Self> {
        Self::of(&[line])
    }

    /// Points at the same share of the lengths of both lines are beside each other.
    fn of(lines: &[&[(Point2, f64)]]) -> Option<Self> {
        let level_m = lines.first()?.first()?.1;
        if lines.iter().copied().flatten().all(|(_, z_m)| *z_m == level_m) {
            return None;
        }
        let count = lines.len() as f64;
        let length_m = lines.iter().map(|line| length_m(line)).sum::<f64>() / count;
        let pieces = (length_m / STEP_M).floor().max(1.0);
        let apart_m = (length_m / pieces).max(LEAST_M);
        let samples: Vec<Raised> = lines.iter().map(|line| sampled(line, pieces as usize)).collect();
        let height_m = |k: usize| samples.iter().map(|line| line[k].1).sum::<f64>() / count;
        let bank = |k: usize| {
            let ([left, right], [next_left, next_right]) = (at(&samples, k)?, at(&samples, k + 1)?);
            let over_m = 0.5 * ((left.1 - right.1) + (next_left.1 - next_right.1));
            let width_m = 0.5 * (left.0.distance(right.0) + next_left.0.distance(next_right.0));
            (width_m > WIDTH_MIN_M).then(|| over_m / width_m)
        };
        let piece = |k: usize| {
            let grade = (height_m(k + 1) - height_m(k)) / apart_m;
            Piece { grade, bank: bank(k) }
        };
        Some(Self { pieces: (0..pieces as usize).map(piece).collect() })
    }

    /// Pieces that a part of the lane touches, each with the place of its middle within the part; both as shares of the
    /// lane's length.
    pub(crate) fn over(&self, [from, to]: [f64; 2]) -> impl Iterator<Item = (f64, Piece)> {
        let count = self.pieces.len() as f64;
        self.pieces.iter().enumerate().filter_map(move |(k, piece)| {
            let [begin, end] = [k as f64 / count, (k as f64 + 1.0) / count];
            (begin < to && end > from).then(|| (0.5 * (begin.max(from) + end.min(to)), *piece))
        })
    }
}

/// Points of both borders at a sample; `None` for a centre line alone.
fn at(samples: &[Raised], k: usize) -> Option<[(Point2, f64); 2]> {
    match samples {
        [left, right] => Some([left[k], right[k]]),
        _ => None,
    }
}

fn length_m(line: &[(Point2, f64)]) -> f64 {
    line.windows(2).map(|two| two[0].0.distance(two[1].0)).sum()
}

/// The ends of `pieces` pieces of equal length: one more than these.
fn sampled(line: &[(Point2, f64)], pieces: usize) -> Raised {
    let piece_m = length_m(line) / pieces as f64;
    let mut samples = Vec::with_capacity(pieces + 1);
    let (mut k, mut begin_m) = (0, 0.0);
    for sample in 0..pieces {
        let s_m = sample as f64 * piece_m;
        let mut step_m = line[k].0.distance(line[(k + 1).min(line.len() - 1)].0);
        while k + 2 < line.len() && begin_m + step_m < s_m {
            begin_m += step_m;
            k += 1;
            step_m = line[k].0.distance(line[k + 1].0);
        }
        let ((a, a_z_m), (b, b_z_m)) = (line[k], line[(k + 1).min(line.len() - 1)]);
        let share = if step_m > 0.0 { ((s_m - begin_m) / step_m).clamp(0.0, 1.0) } else { 0.0 };
        samples.push((a + (b - a) * share, a_z_m + (b_z_m - a_z_m) * share));
    }
    samples.push(line[line.len() - 1]);
    samples
}
