//! Lamps of a scene that may light objects in an image.

use swerve_geom::{Map, Transform};
use swerve_scene::Scene;
use swerve_scene::vector::dot;

use super::pinhole::Pinhole;

/// Lamp parameters for shading.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Lamp {
    /// Position relative to the centre of the shadow maps' cell.
    pub(crate) position: [f32; 3],
    pub(crate) direction: [f32; 3],
    pub(crate) intensity: [f32; 3],
    pub(crate) range: f32,
    pub(crate) cos_outer: f32,
    pub(crate) over_fall: f32,
    /// First and last column and row that it may light.
    pub(crate) columns: [f32; 2],
    pub(crate) rows: [f32; 2],
}

impl Lamp {
    /// Returns true if the lamp contributes to the image.
    fn shines(&self) -> bool {
        self.range > 0.0 && dot(self.intensity, self.intensity) > 0.0 && self.columns[0] <= self.columns[1]
    }
}

/// Collects the lamps that may light objects in the image; `centre` is that of the shadow maps' cell.
pub(crate) fn collect_lamps(
    scene: &Scene,
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
    image: &Pinhole,
    centre: [f64; 3],
    lamps: &mut Vec<Lamp>,
) {
    lamps.clear();
    if !scene.weather.lamps_on {
        return;
    }
    for light in &scene.lights {
        let [x, y, z] = light.position_m;
        let at = (*camera_from_map * swerve_geom::Point::new(x, y, z)).coords;
        let range = f64::from(light.range_m);
        if at.z + range < 0.0 {
            continue;
        }
        let everywhere = [-1.0, 1e6];
        let (mut columns, mut rows) = (everywhere, everywhere);
        if image.flat {
            columns = [at.x - range, at.x + range].map(|x| image.fx * x + image.cx);
            rows = [at.y - range, at.y + range].map(|y| image.fy * y + image.cy);
        } else if at.z > range {
            // Conservative bounds of the sphere's image.
            let (near, far) = (at.z - range, at.z + range);
            let extent = |p: f64, f: f64, c: f64| {
                let ends = [(p - range) / near, (p - range) / far, (p + range) / near, (p + range) / far];
                let low = ends.iter().copied().fold(f64::INFINITY, f64::min);
                let high = ends.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                [f * low + c, f * high + c]
            };
            columns = extent(at.x, image.fx, image.cx);
            rows = extent(at.y, image.fy, image.cy);
        }
        let lamp = Lamp {
            position: [x - centre[0], y - centre[1], z - centre[2]].map(|v| v as f32),
            direction: light.direction.map(|v| v as f32),
            intensity: light.intensity,
            range: light.range_m,
            cos_outer: light.cos_outer,
            over_fall: 1.0 / (light.cos_inner - light.cos_outer).max(1e-3),
            columns: columns.map(|v| v as f32),
            rows: rows.map(|v| v as f32),
        };
        if lamp.shines() {
            lamps.push(lamp);
        }
    }
}
