//! Pinhole images: pixel rays and view frusta.

use core::ops::Range;

use swerve_geom::{Map, Transform};
use swerve_scene::vector::dot;

use super::pose::rotation_rows;
use crate::Camera;

/// Pinhole image, the reference of the planes. The centre of pixel `(i, j)` is at `x = i`, `y = j`.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(crate) struct Pinhole {
    pub(crate) width: usize,
    pub(crate) height: usize,
    pub(crate) fx: f64,
    pub(crate) fy: f64,
    /// Principal point in pixel-centre coordinates, which are half a pixel less than usual.
    pub(crate) cx: f64,
    pub(crate) cy: f64,
    pub(crate) near: f32,
    pub(crate) far: f32,
    /// True for parallel rays; `fx` and `fy` are then pixels per metre.
    pub(crate) flat: bool,
}

impl Pinhole {
    /// Image of a camera without its lens.
    pub(crate) fn new(camera: &Camera) -> Self {
        let (fx, fy, cx, cy) = camera.focal_px();
        let spec = camera.spec();
        Self {
            width: camera.width_px(),
            height: camera.height_px(),
            fx,
            fy,
            cx: cx - 0.5,
            cy: cy - 0.5,
            near: spec.near_m as f32,
            far: spec.far_m as f32,
            flat: camera.is_orthographic(),
        }
    }

    /// Origin of a pixel's ray in an orthographic image, relative to a centre in the map frame: factors of x and y, and
    /// the constant.
    pub(crate) fn ray_origins(
        &self,
        map_from_camera: &Transform<Map, swerve_geom::Camera>,
        centre: [f64; 3],
    ) -> [[f32; 3]; 3] {
        let rows = rotation_rows(map_from_camera);
        let at = map_from_camera.origin().coords;
        let at: [f64; 3] = [0, 1, 2]
            .map(|k| at[k] - centre[k] - rows[k][0] * self.cx / self.fx - rows[k][1] * self.cy / self.fy);
        [
            [0, 1, 2].map(|k| (rows[k][0] / self.fx) as f32),
            [0, 1, 2].map(|k| (rows[k][1] / self.fy) as f32),
            at.map(|x| x as f32),
        ]
    }

    /// Direction of a pixel's ray with depth 1, map frame: factors of x and y, and the constant.
    pub(crate) fn ray_directions(
        &self,
        map_from_camera: &Transform<Map, swerve_geom::Camera>,
    ) -> [[f32; 3]; 3] {
        let rows = rotation_rows(map_from_camera);
        let narrow = |f: &dyn Fn([f64; 3]) -> f64| [f(rows[0]) as f32, f(rows[1]) as f32, f(rows[2]) as f32];
        if self.flat {
            return [[0.0; 3], [0.0; 3], narrow(&|row| row[2])];
        }
        [
            narrow(&|row| row[0] / self.fx),
            narrow(&|row| row[1] / self.fy),
            narrow(&|row| row[2] - row[0] * self.cx / self.fx - row[1] * self.cy / self.fy),
        ]
    }

    /// Image sampled at an offset from the centre of each pixel.
    pub(crate) fn shifted(self, [right, down]: [f64; 2]) -> Self {
        Self { cx: self.cx - right, cy: self.cy - down, ..self }
    }

    /// Nearness at the near plane; the nearness of sky is 0.
    pub(crate) fn nearest(&self) -> f32 {
        if self.flat { self.far - self.near } else { 1.0 / self.near }
    }

    /// Converts nearness to depth.
    pub(crate) fn depths(&self, out: &mut [f32], nearness: &[f32]) {
        for (depth, w) in out.iter_mut().zip(nearness) {
            *depth = if !self.flat {
                1.0 / *w
            } else if *w > 0.0 {
                self.far - *w
            } else {
                f32::INFINITY
            };
        }
    }
}

/// View frustum for visibility tests of spheres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Frustum {
    /// Inward normals of the four sides, camera frame.
    sides: [[f32; 3]; 4],
    /// Distances of the sides from the camera.
    offsets: [f32; 4],
    near: f32,
    far: f32,
}

impl Frustum {
    /// Frustum of some rows of an image.
    pub(crate) fn new(image: &Pinhole, rows: &Range<usize>) -> Self {
        let left = (-0.5 - image.cx) / image.fx;
        let right = (image.width as f64 - 0.5 - image.cx) / image.fx;
        let top = (rows.start as f64 - 0.5 - image.cy) / image.fy;
        let bottom = (rows.end as f64 - 0.5 - image.cy) / image.fy;
        if image.flat {
            let sides = [[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]];
            let offsets = [-left, right, -top, bottom].map(|v| v as f32);
            return Self { sides, offsets, near: image.near, far: image.far };
        }
        let side = |x: f64, y: f64, z: f64| {
            let length = (x * x + y * y + z * z).sqrt();
            [x / length, y / length, z / length].map(|v| v as f32)
        };
        let sides =
            [side(1.0, 0.0, -left), side(-1.0, 0.0, right), side(0.0, 1.0, -top), side(0.0, -1.0, bottom)];
        Self { sides, offsets: [0.0; 4], near: image.near, far: image.far }
    }

    /// Returns true if a sphere may be visible.
    pub(crate) fn touches(&self, centre: [f32; 3], radius: f32) -> bool {
        centre[2] + radius >= self.near
            && centre[2] - radius <= self.far
            && self
                .sides
                .iter()
                .zip(self.offsets)
                .all(|(side, offset)| dot(*side, centre) + offset >= -radius)
    }

    /// Returns true if a sphere swept along a vector may be visible.
    pub(crate) fn touches_swept(&self, centre: [f32; 3], radius: f32, along: [f32; 3]) -> bool {
        let end = [centre[0] + along[0], centre[1] + along[1], centre[2] + along[2]];
        centre[2].max(end[2]) + radius >= self.near
            && (self.sides.iter().zip(self.offsets))
                .all(|(side, offset)| dot(*side, centre).max(dot(*side, end)) + offset >= -radius)
    }
}
