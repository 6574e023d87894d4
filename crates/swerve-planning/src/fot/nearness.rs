//! Nearness to obstacles: the part of a candidate's cost that couples its lateral and longitudinal motion.

use swerve_core::{Span, Time};
use swerve_geom::simd::widest;

use crate::collision::Obstacles;

/// Number of samples processed together.
const LANES: usize = 4;

/// Corners of all boxes grown by the clearance: box x sample, rounded up to whole lanes, x corner (with the corners of
/// [`LANES`] samples side by side).
#[derive(Clone, Debug, Default)]
pub(super) struct Corners {
    lanes: Vec<Lanes>,
    /// Number of lanes of one box.
    per_box: usize,
}

/// Corners of a box at a few samples: x and y of each.
#[derive(Clone, Copy, Debug, Default)]
struct Lanes {
    x: [[f64; LANES]; 4],
    y: [[f64; LANES]; 4],
}

impl Corners {
    /// Sets the corners of all obstacles at the samples.
    pub(super) fn set(&mut self, obstacles: &Obstacles, at: Time, clearance_m: f64, samples_s: &[f64]) {
        self.per_box = samples_s.len().div_ceil(LANES);
        self.lanes.clear();
        let mut boxes = 0;
        obstacles.for_each_at(at, |_| boxes += 1);
        if boxes == 0 {
            return;
        }
        self.lanes.resize(boxes * self.per_box, Lanes::default());
        for (k, &t) in samples_s.iter().enumerate() {
            let mut first = k / LANES;
            obstacles.for_each_at(at + Span::from_secs(t), |solid| {
                let mut grown = *solid;
                grown.half_length_m += clearance_m;
                grown.half_width_m += clearance_m;
                let lanes = &mut self.lanes[first];
                for (c, corner) in grown.corners().into_iter().enumerate() {
                    lanes.x[c][k % LANES] = corner.x_m;
                    lanes.y[c][k % LANES] = corner.y_m;
                }
                first += self.per_box;
            });
        }
    }

    /// Returns true if there are no obstacles.
    pub(super) fn is_empty(&self) -> bool {
        self.lanes.is_empty()
    }
}

/// Positions at the samples of a motion, in whole lanes; values beyond the last sample are ignored.
#[derive(Clone, Debug, Default)]
pub(super) struct Points {
    lanes: Vec<[[f64; LANES]; 2]>,
}

/// Position of the line at the samples of a motion, and its normal there.
#[derive(Clone, Copy)]
pub(super) struct Beside<'a> {
    pub(super) x: &'a [f64],
    pub(super) y: &'a [f64],
    pub(super) normal_x: &'a [f64],
    pub(super) normal_y: &'a [f64],
    /// Offset of the motion to end offset 0, and its derivative by the end offset.
    pub(super) base_m: &'a [f64],
    pub(super) basis: &'a [f64],
}

impl Points {
    /// Sets the motion beside the line that ends at offset `end_m`.
    #[inline(always)]
    fn set(&mut self, beside: &Beside<'_>, end_m: f64) {
        let Beside { x, y, normal_x, normal_y, base_m, basis } = *beside;
        let n = x.len();
        self.lanes.resize(n.div_ceil(LANES), [[0.0; LANES]; 2]);
        let place = |k: usize| {
            let d = base_m[k] + basis[k] * end_m;
            (x[k] + normal_x[k] * d, y[k] + normal_y[k] * d)
        };
        let mut whole = self.lanes.iter_mut();
        let columns = [x, y, normal_x, normal_y, base_m, basis].map(|column| column.as_chunks::<LANES>().0);
        for (l, [px, py]) in whole.by_ref().take(n / LANES).enumerate() {
            let [x, y, normal_x, normal_y, base_m, basis] = columns.map(|column| column[l]);
            let d: [f64; LANES] = core::array::from_fn(|i| base_m[i] + basis[i] * end_m);
            *px = core::array::from_fn(|i| x[i] + normal_x[i] * d[i]);
            *py = core::array::from_fn(|i| y[i] + normal_y[i] * d[i]);
        }
        for [px, py] in whole {
            for (i, k) in (n / LANES * LANES..n).enumerate() {
                (px[i], py[i]) = place(k);
            }
        }
    }
}

/// Sum over samples and boxes of 1 / distance to the nearest corner, for the motions beside the line that end at the
/// offsets `ends_m`: exact if both are the same, otherwise a lower bound for all motions between them, as each corner
/// counts at the distance of the further end. Stops after a box once `is_enough` returns true for the partial sum.
pub(super) fn sum_nearness(
    corners: &Corners,
    beside: &Beside<'_>,
    ends_m: [f64; 2],
    [from, to]: &mut [Points; 2],
    is_enough: impl Fn(f64) -> bool,
) -> f64 {
    widest(
        #[inline(always)]
        || {
            let n = beside.x.len();
            from.set(beside, ends_m[0]);
            if ends_m[0] == ends_m[1] {
                return sum(
                    (corners, n),
                    #[inline(always)]
                    |x, y, l| squared(x, y, &from.lanes[l]),
                    is_enough,
                );
            }
            to.set(beside, ends_m[1]);
            sum(
                (corners, n),
                #[inline(always)]
                |x, y, l| {
                    let (a, b) = (squared(x, y, &from.lanes[l]), squared(x, y, &to.lanes[l]));
                    core::array::from_fn(|i| if a[i] > b[i] { a[i] } else { b[i] })
                },
                is_enough,
            )
        },
    )
}

/// Squared distances of a corner from positions.
#[inline(always)]
fn squared(x: &[f64; LANES], y: &[f64; LANES], [px, py]: &[[f64; LANES]; 2]) -> [f64; LANES] {
    core::array::from_fn(|i| {
        let (dx, dy) = (x[i] - px[i], y[i] - py[i]);
        dx * dx + dy * dy
    })
}

/// Sum for squared distances, given a corner's coordinates and the lane number.
#[inline(always)]
fn sum(
    (corners, n): (&Corners, usize),
    squared: impl Fn(&[f64; LANES], &[f64; LANES], usize) -> [f64; LANES],
    is_enough: impl Fn(f64) -> bool,
) -> f64 {
    let mut total = 0.0;
    for of_box in corners.lanes.chunks_exact(corners.per_box) {
        for (l, lanes) in of_box[..n.div_ceil(LANES)].iter().enumerate() {
            let mut near = [f64::INFINITY; LANES];
            for (x, y) in lanes.x.iter().zip(&lanes.y) {
                let squared = squared(x, y, l);
                near = core::array::from_fn(|i| if squared[i] < near[i] { squared[i] } else { near[i] });
            }
            // Several at a time; the order of summation is unchanged.
            let nearness: [f64; LANES] = core::array::from_fn(|i| 1.0 / near[i].sqrt());
            for one in &nearness[..LANES.min(n - l * LANES)] {
                total += one;
            }
        }
        if is_enough(total) {
            break;
        }
    }
    total
}

#[cfg(test)]
mod tests {
    use swerve_geom::simd::both;

    use super::*;
    use crate::collision::{CollisionMode, Solid};
    use crate::testing::World;

    /// For ranges and for single motions.
    #[test]
    fn nearness_matches_the_direct_sum_to_the_bit() {
        let world =
            World::straight(10.0).with_person((20.0, 4.0), (0.0, -2.0)).with_person((9.0, -3.0), (0.7, 0.3));
        let obstacles = Obstacles::new(&world.predictions, CollisionMode::TimeIndexed);
        let at = world.start.stamp;
        for n in [1, 3, 4, 7, 16, 17] {
            let samples_s: Vec<f64> = (0..17).map(|k| 0.3 * f64::from(k)).collect();
            let mut corners = Corners::default();
            corners.set(&obstacles, at, 0.3, &samples_s);
            let column =
                |scale: f64, from: f64| -> Vec<f64> { (0..n).map(|k| from + scale * k as f64).collect() };
            let (x, y, base, basis) =
                (column(3.1, 0.0), column(0.01, 0.0), column(0.0, 0.2), column(0.06, 0.0));
            let (normal_x, normal_y) = (column(0.0, 0.0), column(0.0, 1.0));
            let beside = Beside {
                x: &x,
                y: &y,
                normal_x: &normal_x,
                normal_y: &normal_y,
                base_m: &base,
                basis: &basis,
            };
            for ends_m in [[1.0, 1.0], [-1.0, 2.5]] {
                let mut plain = 0.0;
                let mut boxes = [vec![], vec![]];
                for &t_s in &samples_s {
                    let mut each = boxes.iter_mut();
                    let mut push = |solid: &Solid| each.next().unwrap().push(*solid);
                    obstacles.for_each_at(at + Span::from_secs(t_s), &mut push);
                }
                for of_box in boxes {
                    for (k, mut solid) in of_box.into_iter().enumerate().take(n) {
                        solid.half_length_m += 0.3;
                        solid.half_width_m += 0.3;
                        let squared = solid.corners().map(|corner| {
                            ends_m.map(|end_m| {
                                let d = base[k] + basis[k] * end_m;
                                let (dx, dy) = (corner.x_m - (x[k] + 0.0 * d), corner.y_m - (y[k] + 1.0 * d));
                                dx * dx + dy * dy
                            })
                        });
                        let near = squared.into_iter().map(|[a, b]| a.max(b)).fold(f64::INFINITY, f64::min);
                        plain += 1.0 / near.sqrt();
                    }
                }
                let mut points = Default::default();
                let all = both(|| sum_nearness(&corners, &beside, ends_m, &mut points, |_| false));
                assert_eq!(all, [plain; 2], "{n} {ends_m:?}");
                let some = sum_nearness(&corners, &beside, ends_m, &mut points, |_| true);
                assert!(some > 0.0 && some < plain, "one box of two");
            }
        }
    }
}
