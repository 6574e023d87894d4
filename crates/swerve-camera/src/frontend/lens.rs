//! Lens: mapping of pixels to points of a pinhole image.
//!
//! The scene is rendered as a pinhole image wide enough for every ray of the lens. Each pixel then uses the triangle
//! seen nearest to its ray and is shaded on its exact ray, so that nothing is blended.

use super::pinhole::Pinhole;
use crate::Camera;

/// Position of each pixel of a distorted image in the pinhole image, row by row, in pixel-centre coordinates.
pub(crate) struct LensMap {
    camera: Camera,
    pub(crate) pinhole: Pinhole,
    pub(crate) points: Vec<[f32; 2]>,
}

/// Largest side of the pinhole image behind a lens, pixels.
const SIDE_MAX: f64 = 16_000.0;

impl LensMap {
    fn new(camera: &Camera) -> Self {
        let (width, height) = (camera.width_px(), camera.height_px());
        let (fx, fy, ..) = camera.focal_px();
        let rays: Vec<[f64; 2]> = (0..width * height)
            .map(|k| camera.ray([(k % width) as f64 + 0.5, (k / width) as f64 + 0.5]))
            .collect();
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for ray in &rays {
            for axis in 0..2 {
                low[axis] = low[axis].min(ray[axis]);
                high[axis] = high[axis].max(ray[axis]);
            }
        }
        // The resolution of the lens at its centre, limited by the image size.
        let fine = |axis: usize, f: f64| f.min((SIDE_MAX - 4.0) / (high[axis] - low[axis]).max(1e-6));
        let (fx, fy) = (fine(0, fx), fine(1, fy));
        let (cx, cy) = (1.0 - low[0] * fx, 1.0 - low[1] * fy);
        let spec = camera.spec();
        let pinhole = Pinhole {
            width: ((high[0] - low[0]) * fx) as usize + 3,
            height: ((high[1] - low[1]) * fy) as usize + 3,
            fx,
            fy,
            cx,
            cy,
            near: spec.near_m as f32,
            far: spec.far_m as f32,
            flat: false,
        };
        let points = rays.iter().map(|ray| [(ray[0] * fx + cx) as f32, (ray[1] * fy + cy) as f32]).collect();
        Self { camera: *camera, pinhole, points }
    }
}

/// Maps of recently used lenses.
#[derive(Default)]
pub(crate) struct LensCache {
    maps: Vec<LensMap>,
}

/// Returns true if two cameras map the same rays to the same pixels.
pub(crate) fn same_lens(one: &Camera, other: &Camera) -> bool {
    let (a, b) = (one.spec(), other.spec());
    let size = (a.width_px, a.height_px) == (b.width_px, b.height_px);
    size && one.focal_px() == other.focal_px()
        && a.distortion == b.distortion
        && (a.near_m, a.far_m) == (b.near_m, b.far_m)
}

/// Number of lenses kept.
const KEPT: usize = 8;

impl LensCache {
    /// Map of a camera with a lens; `None` for an undistorted one.
    pub(crate) fn get(&mut self, camera: &Camera) -> Option<&LensMap> {
        if camera.spec().distortion.is_none() {
            return None;
        }
        let index = self.maps.iter().position(|map| same_lens(&map.camera, camera)).unwrap_or_else(|| {
            if self.maps.len() == KEPT {
                self.maps.remove(0);
            }
            self.maps.push(LensMap::new(camera));
            self.maps.len() - 1
        });
        Some(&self.maps[index])
    }
}
