//! Ray-based ground segmentation, outwards from point to point (Himmelsbach et al. 2010, section III; Autoware's ray
//! ground filter is similar).

use super::super::points::{Point, sector};
use super::{Bins, SLOPE, STEP_M};

/// Number of rays around the ego.
const RAYS: usize = 720;
/// Possible rise of the ground beyond its last observed point, as a tangent, and its limit, metres.
const UNSEEN: (f32, f32) = (0.05, 0.3);

/// Ray-based ground segmentation.
#[derive(Clone, Debug, Default)]
pub(super) struct Rays {
    bins: Bins,
    /// Squared distances of a ray's points, as bits that sort like the values, and the point indices.
    ray: Vec<(u32, u32)>,
}

impl Rays {
    pub(super) fn heights(&mut self, points: &[Point], over_m: &mut [f32]) {
        self.bins.fill(RAYS, points.len(), |k| sector(points[k][0], points[k][1], RAYS));
        for ray in 0..RAYS {
            self.ray.clear();
            self.ray.extend(self.bins.of(ray).iter().map(|&k| {
                let [x, y, _] = points[k as usize];
                ((x * x + y * y).to_bits(), k)
            }));
            self.ray.sort_unstable();
            walk(&self.ray, points, over_m);
        }
    }
}

/// Walks along one ray. The ground height changes by at most the largest slope times the distance between two ground
/// points, regardless of how many points are stacked: vertical surfaces are not climbed.
fn walk(ray: &[(u32, u32)], points: &[Point], over_m: &mut [f32]) {
    let (mut ground_r, mut ground_z) = (0.0_f32, 0.0_f32);
    for &(squared, k) in ray {
        let (r, z) = (f32::from_bits(squared).sqrt(), points[k as usize][2]);
        let way = r - ground_r;
        let over = z - ground_z;
        let allowed = STEP_M + (UNSEEN.0 * way).min(UNSEEN.1);
        if over > allowed {
            over_m[k as usize] = over;
        } else if over >= -allowed {
            ground_z += over.clamp(-SLOPE * way, SLOPE * way);
            ground_r = r;
        }
    }
}
