//! Zone-based ground segmentation: a plane in each patch of concentric zones (after Lim, Oh and Myung 2021, Patchwork).
//!
//! Patches grow with the distance, like the gaps between points. In each patch a plane is fitted to the lowest points,
//! then to those near that plane, three times. Unlike in Patchwork the plane is a least-squares fit of height over
//! position, regularised towards the plane of the next inner patch, and instead of likelihoods a patch must continue
//! that plane: a patch that starts higher is an object on the ground.

use super::super::points::{Point, sector};
use super::{Bins, SLOPE, STEP_M};

/// Number of rings, and sectors per ring, of each zone.
const ZONES: [(usize, usize); 4] = [(2, 16), (4, 32), (4, 54), (4, 32)];
/// Outer radius of each zone, as a share of the range.
const ENDS: [f32; 4] = [0.13, 0.32, 0.56, 1.0];
/// Number of lowest points whose mean height defines the seeds, and height of the seeds above that mean, metres.
const SEEDS: (usize, f32) = (20, 0.125);
/// Distance from a plane within which points contribute to the next fit, metres.
const NEAR_M: f32 = 0.15;
/// Fewest points of a fit.
const POINTS_MIN: usize = 10;
const ROUNDS: usize = 3;
/// Weight of the inner patch's plane, in points.
const PRIOR: f32 = 3.0;

/// Ground plane of a patch: height at its centre, and slopes along x and y.
#[derive(Clone, Copy, Debug, Default)]
struct Plane {
    middle: [f32; 2],
    z: f32,
    slope: [f32; 2],
}

/// Zone-based ground segmentation.
#[derive(Clone, Debug)]
pub(super) struct Zones {
    reach_m: f32,
    /// Number of sectors, first patch and outer radius in metres of each ring.
    rings: Vec<(usize, usize, f32)>,
    patches: usize,
    bins: Bins,
    planes: Vec<Plane>,
    lowest: Vec<f32>,
}

impl Zones {
    pub(super) fn new(reach_m: f32) -> Self {
        let (mut rings, mut patches, mut begin) = (Vec::new(), 0, 0.0);
        for ((count, sectors), end) in ZONES.into_iter().zip(ENDS) {
            for k in 1..=count {
                let share = begin + (end - begin) * k as f32 / count as f32;
                rings.push((sectors, patches, share * reach_m));
                patches += sectors;
            }
            begin = end;
        }
        Self { reach_m, rings, patches, bins: Bins::default(), planes: Vec::new(), lowest: Vec::new() }
    }

    pub(super) fn heights(&mut self, points: &[Point], over_m: &mut [f32]) {
        let Self { rings, patches, bins, planes, lowest, reach_m } = self;
        let patch = |x: f32, y: f32| {
            let r = (x * x + y * y).sqrt().min(*reach_m);
            let ring = rings.iter().position(|(_, _, end)| r <= *end).unwrap_or(rings.len() - 1);
            rings[ring].1 + sector(x, y, rings[ring].0)
        };
        bins.fill(*patches, points.len(), |k| patch(points[k][0], points[k][1]));
        planes.clear();
        planes.resize(*patches, Plane::default());
        for (ring, &(sectors, first, _)) in rings.iter().enumerate() {
            for own in 0..sectors {
                let inner = match ring.checked_sub(1).map(|inner| rings[inner]) {
                    None => Plane::default(),
                    Some((others, begin, _)) => planes[begin + (2 * own + 1) * others / (2 * sectors)],
                };
                let of = bins.of(first + own);
                let plane = plane(of, points, inner, lowest);
                planes[first + own] = plane;
                for &k in of {
                    let over = points[k as usize][2] - plane.at(points[k as usize]);
                    over_m[k as usize] = if over > STEP_M { over } else { 0.0 };
                }
            }
        }
    }
}

impl Plane {
    fn at(&self, [x, y, _]: Point) -> f32 {
        self.z + self.slope[0] * (x - self.middle[0]) + self.slope[1] * (y - self.middle[1])
    }
}

/// Ground plane of a patch; the extrapolated inner plane if the patch has no valid plane.
fn plane(of: &[u32], points: &[Point], inner: Plane, lowest: &mut Vec<f32>) -> Plane {
    if of.is_empty() {
        return inner;
    }
    let count = of.len() as f32;
    let sum = of.iter().fold([0.0; 2], |[x, y], &k| [x + points[k as usize][0], y + points[k as usize][1]]);
    let middle = sum.map(|sum| sum / count);
    let moved = Plane { middle, z: inner.at([middle[0], middle[1], 0.0]), slope: inner.slope };
    if of.len() < POINTS_MIN {
        return moved;
    }
    lowest.clear();
    // Points far below the ground are mirror reflections.
    lowest.extend(of.iter().map(|&k| points[k as usize][2]).filter(|z| *z > moved.z - 1.0));
    if lowest.len() < POINTS_MIN {
        return moved;
    }
    let seeds = SEEDS.0.min(lowest.len());
    lowest.select_nth_unstable_by(seeds - 1, f32::total_cmp);
    let mean = lowest[..seeds].iter().sum::<f32>() / seeds as f32;
    let mut fitted = Plane { middle, z: mean, slope: [0.0; 2] };
    let mut within = [-1.0, SEEDS.1];
    for _ in 0..ROUNDS {
        let is_near = |place: &Point| {
            let over = place[2] - fitted.at(*place);
            within[0] < over && over < within[1]
        };
        fitted = least_squares(of.iter().map(|&k| points[k as usize]).filter(is_near), moved);
        within = [-NEAR_M, NEAR_M];
    }
    let steepest = fitted.slope[0].abs().max(fitted.slope[1].abs());
    let steps = (fitted.z - moved.z).abs();
    if steepest <= SLOPE && steps <= STEP_M + 0.1 { fitted } else { moved }
}

/// Least-squares plane in height, regularised towards an expected one.
fn least_squares(places: impl Iterator<Item = Point>, expected: Plane) -> Plane {
    let [mx, my] = expected.middle;
    // Sums over x, y and height relative to the expected plane.
    let (mut n, mut s) = (PRIOR, [0.0_f32; 8]);
    for place in places {
        let (x, y, z) = (place[0] - mx, place[1] - my, place[2] - expected.at(place));
        n += 1.0;
        for (sum, term) in s.iter_mut().zip([x, y, z, x * x, x * y, y * y, x * z, y * z]) {
            *sum += term;
        }
    }
    let [x, y, z] = [s[0] / n, s[1] / n, s[2] / n];
    // Regularises the slopes by points one metre out on the expected plane.
    let (xx, xy, yy) = (s[3] + PRIOR - n * x * x, s[4] - n * x * y, s[5] + PRIOR - n * y * y);
    let (xz, yz) = (s[6] - n * x * z, s[7] - n * y * z);
    let whole = xx * yy - xy * xy;
    let [a, b] =
        if whole > 0.0 { [(xz * yy - yz * xy) / whole, (yz * xx - xz * xy) / whole] } else { [0.0; 2] };
    let slope = [expected.slope[0] + a, expected.slope[1] + b];
    Plane { middle: expected.middle, z: expected.z + z - a * x - b * y, slope }
}
