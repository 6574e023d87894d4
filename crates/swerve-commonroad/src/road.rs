//! The ground of all lanelets, and outlines that leave it.
//!
//! The official checker triangulates the space beside the lanelets; here the lanelets are subtracted from the outline.
//! Both agree but in gaps between lanelets that are thinner than [`SLIVER_M`], and more than a metre beyond the hull of
//! the lanelets, where the official checker has no triangles.

use std::collections::BTreeMap;

use swerve_geom::{Obb, Point2};

use crate::Lanelet;
use crate::shape::box_of;

/// Parts of an outline outside that are thinner than this do not count, metres: lanelets that follow each other have
/// ends that differ by their digits.
const SLIVER_M: f64 = 1e-3;

/// Width of the cells in which lanelets are looked up, metres.
const CELL_M: f64 = 16.0;

/// Most cells of a triangle: longer ones are in the list of those that are everywhere.
const CELLS_MAX: i64 = 4096;

/// The ground of the lanelets of a scenario.
#[derive(Clone, Debug, Default)]
pub struct Road {
    triangles: Vec<[Point2; 3]>,
    cells: BTreeMap<(i64, i64), Vec<usize>>,
    everywhere: Vec<usize>,
}

impl Road {
    /// The ground of lanelets, and of the gaps between lanelets side by side: only the outermost bounds of those limit
    /// the road.
    pub fn new(lanelets: &BTreeMap<u32, Lanelet>) -> Self {
        let mut road = Self::default();
        for lanelet in lanelets.values() {
            road.strip(&lanelet.left, &lanelet.right);
            for (side, beside) in lanelet.beside.iter().enumerate() {
                let Some(beside) = beside else { continue };
                let Some(other) = lanelets.get(&beside.lanelet) else { continue };
                let own = if side == 0 { &lanelet.left } else { &lanelet.right };
                // A lanelet to the left has its right bound here, or its left one backwards if it runs the other way.
                if beside.opposite {
                    let facing = if side == 0 { &other.left } else { &other.right };
                    let facing: Vec<Point2> = facing.iter().rev().copied().collect();
                    road.strip(own, &facing);
                } else {
                    road.strip(own, if side == 0 { &other.right } else { &other.left });
                }
            }
        }
        road
    }

    /// Adds the ground between two lines that run the same way.
    fn strip(&mut self, one: &[Point2], other: &[Point2]) {
        let (mut i, mut k) = (0, 0);
        while i + 1 < one.len() || k + 1 < other.len() {
            let share = |next: usize, of: &[Point2]| next as f64 / (of.len().max(2) - 1) as f64;
            let (at, across) = (one.get(i), other.get(k));
            let (Some(&at), Some(&across)) = (at, across) else { return };
            if k + 1 >= other.len() || (i + 1 < one.len() && share(i + 1, one) <= share(k + 1, other)) {
                i += 1;
                self.push([at, across, one[i]]);
            } else {
                k += 1;
                self.push([at, across, other[k]]);
            }
        }
    }

    fn push(&mut self, corners: [Point2; 3]) {
        let [a, b, c] = corners;
        let area = (b - a).cross(c - a);
        if area == 0.0 || !area.is_finite() {
            return;
        }
        let index = self.triangles.len();
        self.triangles.push(if area > 0.0 { corners } else { [a, c, b] });
        let cells = cells(&corners);
        let count = cells.iter().map(|[from, to]| to.saturating_sub(*from).saturating_add(1));
        if count.fold(1, i64::saturating_mul) > CELLS_MAX {
            self.everywhere.push(index);
            return;
        }
        let [[x0, x1], [y0, y1]] = cells;
        for key in (x0..=x1).flat_map(|x| (y0..=y1).map(move |y| (x, y))) {
            self.cells.entry(key).or_default().push(index);
        }
    }

    /// Area of an outline that is on no lanelet, m²; 0 for a road without lanelets.
    pub fn outside_m2(&self, outline: &Obb) -> f64 {
        if self.triangles.is_empty() {
            return 0.0;
        }
        let corners = outline.corners();
        let [[x0, x1], [y0, y1]] = cells(&corners);
        let keys = (x0..=x1).flat_map(|x| (y0..=y1).map(move |y| (x, y)));
        let mut near: Vec<usize> = keys.filter_map(|key| self.cells.get(&key)).flatten().copied().collect();
        near.extend(&self.everywhere);
        near.sort_unstable();
        near.dedup();
        let mut pieces = vec![corners.to_vec()];
        for index in near {
            pieces = pieces.into_iter().flat_map(|piece| without(piece, &self.triangles[index])).collect();
            if pieces.is_empty() {
                return 0.0;
            }
        }
        pieces.iter().filter(|piece| thickness_m(piece) > SLIVER_M).map(|piece| area_m2(piece)).sum()
    }
}

/// First and last cell along x and y that points are in.
fn cells(points: &[Point2]) -> [[i64; 2]; 2] {
    let [low, high] = box_of(points);
    let cell = |value: f64| (value / CELL_M).floor() as i64;
    [[cell(low.x_m), cell(high.x_m)], [cell(low.y_m), cell(high.y_m)]]
}

/// Convex parts of a convex polygon outside a triangle; both are counter-clockwise.
fn without(piece: Vec<Point2>, triangle: &[Point2; 3]) -> Vec<Vec<Point2>> {
    let ([low, high], [from, to]) = (box_of(&piece), box_of(triangle));
    if from.x_m >= high.x_m || to.x_m <= low.x_m || from.y_m >= high.y_m || to.y_m <= low.y_m {
        return vec![piece];
    }
    let (mut outside, mut rest) = (Vec::new(), piece.clone());
    for k in 0..3 {
        let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
        let [inner, outer] = cut(&rest, a, b);
        outside.extend(outer);
        let Some(inner) = inner else { return vec![piece] };
        rest = inner;
    }
    outside
}

/// Parts of a convex polygon to the left and to the right of the line from `a` to `b`; `None` where one is empty.
fn cut(piece: &[Point2], a: Point2, b: Point2) -> [Option<Vec<Point2>>; 2] {
    let side = |point: Point2| (b - a).cross(point - a);
    let mut parts = [Vec::new(), Vec::new()];
    for (k, &p) in piece.iter().enumerate() {
        let q = piece[(k + 1) % piece.len()];
        let (at_p, at_q) = (side(p), side(q));
        if at_p >= 0.0 {
            parts[0].push(p);
        }
        if at_p <= 0.0 {
            parts[1].push(p);
        }
        if (at_p > 0.0 && at_q < 0.0) || (at_p < 0.0 && at_q > 0.0) {
            let between = p + (q - p) * (at_p / (at_p - at_q));
            parts.iter_mut().for_each(|part| part.push(between));
        }
    }
    parts.map(|part| Some(part).filter(|part| part.len() > 2 && area_m2(part) > 1e-12))
}

fn area_m2(corners: &[Point2]) -> f64 {
    let Some(&first) = corners.first() else { return 0.0 };
    0.5 * corners.windows(2).map(|two| (two[0] - first).cross(two[1] - first)).sum::<f64>()
}

/// Area by the largest distance between corners: half the height of a triangle over its longest side, metres.
fn thickness_m(corners: &[Point2]) -> f64 {
    let pairs = corners.iter().flat_map(|a| corners.iter().map(move |b| a.distance(*b)));
    area_m2(corners) / pairs.fold(1e-9, f64::max)
}

#[cfg(test)]
mod tests {
    use swerve_geom::Pose2;

    use super::*;
    use crate::Beside;

    fn lane(low: f64, high: f64, left: Option<u32>) -> Lanelet {
        let line = |y: f64| [0.0, 40.0, 100.0].map(|x| Point2::new(x, y)).to_vec();
        let left_of = left.map(|lanelet| Beside { lanelet, opposite: false });
        Lanelet { left: line(high), right: line(low), beside: [left_of, None] }
    }

    fn outside_m2(lanes: &[Lanelet], outline: Obb) -> f64 {
        let lanes = lanes.iter().enumerate().map(|(k, lane)| (k as u32, lane.clone())).collect();
        Road::new(&lanes).outside_m2(&outline)
    }

    #[test]
    fn outline_across_two_lanelets_is_on_the_road() {
        let lanes = [lane(0.0, 3.0, None), lane(3.0, 6.0, None)];
        let at = |x: f64, y: f64| outside_m2(&lanes, Obb::new(Pose2::new(x, y, 0.3), 4.0, 2.0));
        assert!(at(40.0, 3.0) < 1e-9, "{}", at(40.0, 3.0));
        assert!((at(50.0, -9.0) - 8.0).abs() < 1e-9 && (at(200.0, 3.0) - 8.0).abs() < 1e-9);
    }

    #[test]
    fn gap_is_road_between_lanelets_side_by_side_only() {
        let across = Obb::new(Pose2::new(40.0, 3.1, 0.0), 4.0, 2.0);
        let gap_m2 = |left| outside_m2(&[lane(0.0, 3.0, left), lane(3.2, 6.0, None)], across);
        assert!((gap_m2(None) - 0.8).abs() < 1e-9 && gap_m2(Some(1)) < 1e-9);
    }

    #[test]
    fn area_outside_is_the_part_beyond_the_border() {
        let outline = Obb::new(Pose2::new(39.0, 2.5, 0.0), 4.0, 2.0);
        let outside_m2 = outside_m2(&[lane(0.0, 3.0, None)], outline);
        assert!((outside_m2 - 4.0 * 0.5).abs() < 1e-9, "{outside_m2}");
    }
}
