//! Ground segmentation: ground points, and the heights of other points above the ground.

mod rays;
mod zones;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::points::Point;

/// Ground segmentation method.
#[derive(Clone, Copy, PartialEq, Eq, Debug, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Method {
    /// Ray by ray, outwards from point to point.
    #[default]
    Rays,
    /// Fitted plane in each patch of concentric zones.
    Zones,
}

/// Height above the ground up to which a point is ground, metres; includes kerbs of 0.12 m.
const STEP_M: f32 = 0.2;
/// Largest slope of the ground, as a tangent: 8 degrees.
const SLOPE: f32 = 0.14;

/// Segments ground by one of the methods; reuses its buffers between sweeps.
#[derive(Clone, Debug)]
pub struct Ground {
    memory: Memory,
}

#[derive(Clone, Debug)]
enum Memory {
    Rays(rays::Rays),
    Zones(zones::Zones),
}

impl Ground {
    /// Segmentation of points within `reach_m` of the ego along each axis.
    pub fn new(method: Method, reach_m: f32) -> Self {
        let memory = match method {
            Method::Rays => Memory::Rays(rays::Rays::default()),
            Method::Zones => Memory::Zones(zones::Zones::new(reach_m * core::f32::consts::SQRT_2)),
        };
        Self { memory }
    }

    /// Writes the height of each point above the ground below it, metres; 0 for points on or below the ground.
    pub fn heights(&mut self, points: &[Point], over_m: &mut Vec<f32>) {
        over_m.clear();
        over_m.resize(points.len(), 0.0);
        match &mut self.memory {
            Memory::Rays(rays) => rays.heights(points, over_m),
            Memory::Zones(zones) => zones.heights(points, over_m),
        }
    }
}

/// Elements grouped by bin: a counting sort.
#[derive(Clone, Debug, Default)]
pub(super) struct Bins {
    /// Start of each bin, and the end.
    starts: Vec<u32>,
    order: Vec<u32>,
}

impl Bins {
    /// Sorts `count` elements by bin; the sort is stable.
    pub(super) fn fill(&mut self, bins: usize, count: usize, bin_of: impl Fn(usize) -> usize) {
        self.starts.clear();
        self.starts.resize(bins + 2, 0);
        for k in 0..count {
            self.starts[bin_of(k) + 2] += 1;
        }
        for bin in 2..bins + 2 {
            self.starts[bin] += self.starts[bin - 1];
        }
        self.order.clear();
        self.order.resize(count, 0);
        for k in 0..count {
            let next = &mut self.starts[bin_of(k) + 1];
            self.order[*next as usize] = k as u32;
            *next += 1;
        }
    }

    /// Elements of a bin.
    pub(super) fn of(&self, bin: usize) -> &[u32] {
        &self.order[self.starts[bin] as usize..self.starts[bin + 1] as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bins_hold_their_elements_in_order() {
        let mut bins = Bins::default();
        for _ in 0..2 {
            bins.fill(3, 7, |k| [2, 0, 2, 0, 2, 2, 0][k]);
            assert_eq!([bins.of(0), bins.of(1), bins.of(2)], [&[1, 3, 6][..], &[], &[0, 2, 4, 5]]);
        }
    }

    /// Road that rises by 4 %, with a kerb on the left, a wall ahead and a car on the right.
    fn street() -> (Vec<Point>, Vec<bool>) {
        let (mut points, mut is_ground) = (Vec::new(), Vec::new());
        for column in 0..720_i32 {
            let (sin, cos) = libm::sincosf(column as f32 * core::f32::consts::TAU / 720.0);
            for ring in 0..40_i32 {
                let r = 3.0 + 0.02 * (ring * ring) as f32;
                let (x, y) = (r * cos, r * sin);
                let kerb = if y > 4.0 { 0.12 } else { 0.0 };
                points.push([x, y, 0.04 * x + kerb]);
                is_ground.push(true);
            }
            for k in 1..8_i32 {
                let z = 0.2 * k as f32;
                if cos > 0.5 {
                    points.push([30.0, 30.0 * sin / cos, 1.2 + z + 0.25]);
                    is_ground.push(false);
                }
                if sin < -0.7 {
                    points.push([-6.0 * cos / sin, -6.0, -0.24 * cos / sin + z + 0.15]);
                    is_ground.push(false);
                }
            }
        }
        (points, is_ground)
    }

    #[test]
    fn ground_includes_slopes_and_kerbs_but_no_objects() {
        let (points, wanted) = street();
        for method in [Method::Rays, Method::Zones] {
            let mut over_m = Vec::new();
            Ground::new(method, 40.0).heights(&points, &mut over_m);
            let wrong = |ground: bool| {
                let of = wanted.iter().zip(&over_m).filter(|(wanted, _)| **wanted == ground);
                let all = of.clone().count();
                of.filter(|(_, over)| (**over == 0.0) != ground).count() as f64 / all as f64
            };
            let [missed, taken] = [wrong(true), wrong(false)];
            assert!(missed < 0.01 && taken < 0.05, "{method:?}: {missed} {taken}");
        }
    }

    #[test]
    fn ground_accepts_empty_and_single_point_sweeps() {
        for method in [Method::Rays, Method::Zones] {
            let mut ground = Ground::new(method, 40.0);
            let mut over_m = vec![1.0; 9];
            ground.heights(&[], &mut over_m);
            assert!(over_m.is_empty());
            for (z, over) in [(0.1, 0.0), (1.0, 1.0), (-2.0, 0.0)] {
                ground.heights(&[[5.0, 1.0, z]], &mut over_m);
                assert_eq!(over_m, [over], "{method:?}");
            }
            ground.heights(&vec![[0.0, 0.0, 1.0]; 1000], &mut over_m);
            assert_eq!(over_m, vec![1.0; 1000], "{method:?}");
        }
    }
}
