//! Shadow maps in memory. Maps of the static part are kept; moving instances are drawn on top for each pass, and the
//! texels they covered are restored from the static map before the next.

use swerve_geom::{Map, Point, Transform};
use swerve_scene::hash::Key;
use swerve_scene::vector::{add, dot};
use swerve_scene::{Body, Instance, Mesh, Scene};

use crate::frontend::pinhole::Frustum;
use crate::frontend::pose::{narrow, rotate, rotation_rows};
use crate::frontend::shadow::{
    DEPTH_0, DEPTHS_PER_M, Footprint, PER_M, REACH_M, SIDE, SKY_PER_M, SKY_SIDE, UP, axes, casts_shadow,
    cell, is_shadow_seen, maps_key,
};

/// Shadow maps of one cell.
pub(super) struct ShadowMaps {
    key: Key,
    used: u64,
    /// Direction towards the sun if it casts shadows.
    sun: Option<[f32; 3]>,
    /// Centre of the cell, map frame.
    pub(super) centre: [f64; 3],
    /// Rows: across the light, the perpendicular axis across the light, towards the sun.
    pub(super) axes: [[f32; 3]; 3],
    fixed: Vec<u16>,
    /// Depth towards the sun of the nearest surface; 0 if there is none.
    pub(super) depth: Vec<u16>,
    fixed_sky: Vec<u8>,
    sky: Vec<u8>,
    /// Hidden share of the sky, in 255ths, four neighbours per word.
    pub(super) hidden: Vec<u32>,
    dirty: Vec<[usize; 4]>,
    dirty_sky: Vec<[usize; 4]>,
    scratch: Vec<[f32; 3]>,
}

/// Maps of recently used cells; the least recently used is evicted.
#[derive(Default)]
pub(super) struct ShadowCache {
    maps: Vec<ShadowMaps>,
    clock: u64,
}

/// Number of cells kept.
const KEPT: usize = 2;

impl ShadowCache {
    /// Static maps around a camera, with sun shadows if the sun casts any; moving instances are not drawn yet.
    pub(super) fn around(
        &mut self,
        scene: &Scene,
        camera: [f64; 3],
        sun: Option<[f32; 3]>,
    ) -> &mut ShadowMaps {
        let centre = cell(camera);
        let key = maps_key(scene, centre, sun);
        self.clock += 1;
        let found = self.maps.iter().position(|maps| maps.key == key);
        let index = found.unwrap_or_else(|| {
            let index = if self.maps.len() < KEPT {
                self.maps.push(ShadowMaps::empty());
                self.maps.len() - 1
            } else {
                (0..KEPT).min_by_key(|&k| self.maps[k].used).expect("at least one is kept")
            };
            self.maps[index].draw_fixed(scene, centre, sun);
            self.maps[index].key = key;
            index
        });
        self.maps[index].used = self.clock;
        &mut self.maps[index]
    }
}

impl ShadowMaps {
    fn empty() -> Self {
        Self {
            key: Key::default(),
            used: 0,
            sun: None,
            centre: [0.0; 3],
            axes: [[0.0; 3]; 3],
            fixed: vec![0; SIDE * SIDE],
            depth: vec![0; SIDE * SIDE],
            fixed_sky: vec![0; SKY_SIDE * SKY_SIDE],
            sky: vec![0; SKY_SIDE * SKY_SIDE],
            hidden: vec![0; SKY_SIDE * SKY_SIDE],
            dirty: Vec::new(),
            dirty_sky: Vec::new(),
            scratch: Vec::new(),
        }
    }

    fn draw_fixed(&mut self, scene: &Scene, centre: [f64; 3], sun: Option<[f32; 3]>) {
        (self.centre, self.sun) = (centre, sun);
        self.axes = axes(sun.unwrap_or(UP));
        self.depth.fill(0);
        self.sky.fill(0);
        for instance in scene.statics().instances().iter().filter(|i| casts_shadow(i)) {
            let mesh = scene.meshes.get(instance.mesh);
            if self.sun.is_some() {
                self.draw_mesh(mesh, &instance.map_from_body);
            }
            self.draw_footprint(mesh, instance);
        }
        self.dirty.clear();
        self.dirty_sky.clear();
        self.fixed.copy_from_slice(&self.depth);
        self.fixed_sky.copy_from_slice(&self.sky);
        self.pack([0, SKY_SIDE, 0, SKY_SIDE]);
    }

    /// Removes the moving instances of an earlier pass, and draws those whose shadow may be visible according to
    /// `seen`.
    pub(super) fn draw_moving(
        &mut self,
        scene: &Scene,
        camera: &Transform<swerve_geom::Camera, Map>,
        seen: &Frustum,
    ) {
        self.restore();
        for instance in scene.dynamics.iter().filter(|i| casts_shadow(i)) {
            let mesh = scene.meshes.get(instance.mesh);
            let (centre, radius) = mesh.sphere();
            let centre = instance.map_from_body
                * Point::new(f64::from(centre[0]), f64::from(centre[1]), f64::from(centre[2]));
            if !is_shadow_seen(camera, seen, centre, radius, self.sun) {
                continue;
            }
            if self.sun.is_some() {
                self.draw_mesh(mesh, &instance.map_from_body);
            }
            self.draw_footprint(mesh, instance);
        }
        for k in 0..self.dirty_sky.len() {
            self.pack(self.dirty_sky[k]);
        }
    }

    fn restore(&mut self) {
        for [x0, x1, y0, y1] in self.dirty.drain(..) {
            for y in y0..y1 {
                let row = y * SIDE + x0..y * SIDE + x1;
                self.depth[row.clone()].copy_from_slice(&self.fixed[row]);
            }
        }
        for k in 0..self.dirty_sky.len() {
            let [x0, x1, y0, y1] = self.dirty_sky[k];
            for y in y0..y1 {
                let row = y * SKY_SIDE + x0..y * SKY_SIDE + x1;
                self.sky[row.clone()].copy_from_slice(&self.fixed_sky[row]);
            }
            self.pack(self.dirty_sky[k]);
        }
        self.dirty_sky.clear();
    }

    /// Updates the packed words of a rectangle and of its left and lower neighbours.
    fn pack(&mut self, [x0, x1, y0, y1]: [usize; 4]) {
        let sky = &self.sky;
        let byte = |x: usize, y: usize| u32::from(sky[y.min(SKY_SIDE - 1) * SKY_SIDE + x.min(SKY_SIDE - 1)]);
        for y in y0.saturating_sub(1)..y1 {
            for x in x0.saturating_sub(1)..x1 {
                let word = byte(x, y) | byte(x + 1, y) << 8 | byte(x, y + 1) << 16 | byte(x + 1, y + 1) << 24;
                self.hidden[y * SKY_SIDE + x] = word;
            }
        }
    }

    /// Draws the triangles of a mesh that face the sun.
    fn draw_mesh(&mut self, mesh: &Mesh, map_from_body: &Transform<Map, Body>) {
        let rows = narrow(rotation_rows(map_from_body));
        let origin = map_from_body.origin().coords;
        let place = [0, 1, 2].map(|k| (origin[k] - self.centre[k]) as f32);
        let half = 0.5 * SIDE as f32;
        let (middle, radius) = mesh.sphere();
        let middle = add(rotate(&rows, middle), place);
        let far = |axis: usize| dot(self.axes[axis], middle).abs() > REACH_M + radius;
        if far(0) || far(1) {
            return;
        }
        let mut points = std::mem::take(&mut self.scratch);
        points.clear();
        points.extend(mesh.positions().iter().map(|p| {
            let at = add(rotate(&rows, *p), place);
            let [x, y, z] = rotate(&self.axes, at);
            // Texel centres are at integers.
            [x * PER_M + half - 0.5, y * PER_M + half - 0.5, z * DEPTHS_PER_M + DEPTH_0]
        }));
        let (mut low, mut high) = ([SIDE as f32; 2], [0.0_f32; 2]);
        for [x, y, _] in &points {
            low = [low[0].min(*x), low[1].min(*y)];
            high = [high[0].max(*x), high[1].max(*y)];
        }
        let side = SIDE as f32;
        let bound = |x: f32| x.clamp(0.0, side) as usize;
        let rectangle = [bound(low[0]), bound(high[0] + 2.0), bound(low[1]), bound(high[1] + 2.0)];
        for (triangle, material) in mesh.triangles().iter().zip(mesh.triangle_materials()) {
            let [a, b, c] = triangle.map(|k| points[k as usize]);
            let turned = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
            if turned > 0.0 {
                draw_triangle(&mut self.depth, [a, b, c], turned);
            } else if turned < 0.0 && mesh.materials()[usize::from(*material)].is_two_sided {
                draw_triangle(&mut self.depth, [a, c, b], -turned);
            }
        }
        if rectangle[0] < rectangle[1] && rectangle[2] < rectangle[3] {
            self.dirty.push(rectangle);
        }
        self.scratch = points;
    }

    /// Reduces the visible sky on the ground under and around an instance.
    fn draw_footprint(&mut self, mesh: &Mesh, instance: &Instance) {
        let Some(footprint) = Footprint::new(mesh, instance, self.centre) else { return };
        let Footprint { place, half, rows, strength, fall, reach } = footprint;
        let texel = |m: f32| (m * SKY_PER_M + 0.5 * SKY_SIDE as f32).clamp(0.0, SKY_SIDE as f32) as usize;
        let rectangle = [
            texel(place[0] - reach),
            texel(place[0] + reach),
            texel(place[1] - reach),
            texel(place[1] + reach),
        ];
        let [x0, x1, y0, y1] = rectangle;
        if x0 >= x1 || y0 >= y1 {
            return;
        }
        for y in y0..y1 {
            for x in x0..x1 {
                let metre = |k: usize| (k as f32 + 0.5 - 0.5 * SKY_SIDE as f32) / SKY_PER_M;
                let (dx, dy) = (metre(x) - place[0], metre(y) - place[1]);
                // Position in the body's frame.
                let (u, v) = (rows[0][0] * dx + rows[1][0] * dy, rows[0][1] * dx + rows[1][1] * dy);
                let (ox, oy) = (u.abs() - half[0], v.abs() - half[1]);
                let outside = (ox.max(0.0) * ox.max(0.0) + oy.max(0.0) * oy.max(0.0)).sqrt();
                let distance = outside + ox.max(oy).min(0.0);
                let t = ((fall - distance) / (fall + 0.35)).clamp(0.0, 1.0);
                let value = (strength * t * t) as u8;
                let cell = &mut self.sky[y * SKY_SIDE + x];
                *cell = (*cell).max(value);
            }
        }
        self.dirty_sky.push(rectangle);
    }
}

/// Draws a counter-clockwise triangle into the depth map, keeping the largest values. `area` is twice its area.
fn draw_triangle(depth: &mut [u16], [a, b, c]: [[f32; 3]; 3], area: f32) {
    let top = SIDE as f32 - 1.0;
    let y0 = a[1].min(b[1]).min(c[1]).max(0.0);
    let y1 = a[1].max(b[1]).max(c[1]).min(top);
    let x0 = a[0].min(b[0]).min(c[0]).max(0.0);
    let x1 = a[0].max(b[0]).max(c[0]).min(top);
    let up = |x: f32| {
        let whole = x as i32;
        whole + i32::from((whole as f32) < x)
    };
    if y0 > y1 || x0 > x1 {
        return;
    }
    let slope_x = ((b[2] - a[2]) * (c[1] - a[1]) - (c[2] - a[2]) * (b[1] - a[1])) / area;
    let slope_y = ((c[2] - a[2]) * (b[0] - a[0]) - (b[2] - a[2]) * (c[0] - a[0])) / area;
    let edges = [(a, b), (b, c), (c, a)].map(|(p, q)| {
        let (dx, dy) = (q[0] - p[0], q[1] - p[1]);
        // Upward edges bound from the right, downward ones from the left.
        let step = if dy == 0.0 { 0.0 } else { dx / dy };
        (p, step, dy)
    });
    for y in up(y0)..=y1 as i32 {
        let at = y as f32;
        let (mut from, mut to) = (x0, x1);
        for (p, step, dy) in edges {
            let crossing = p[0] + step * (at - p[1]);
            if dy > 0.0 {
                to = to.min(crossing);
            } else if dy < 0.0 {
                from = from.max(crossing);
            }
        }
        let (first, last) = (up(from), to as i32);
        if first > last || to < 0.0 {
            continue;
        }
        let row = &mut depth[y as usize * SIDE + first as usize..=y as usize * SIDE + last as usize];
        let start = a[2] + slope_y * (at - a[1]) - slope_x * a[0];
        for (k, cell) in row.iter_mut().enumerate() {
            let value = (start + slope_x * (first + k as i32) as f32).clamp(1.0, 65535.0) as u16;
            *cell = (*cell).max(value);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn draw_triangle_covers_its_area_with_its_depth() {
        let mut depth = vec![0; SIDE * SIDE];
        let corners = [[10.2, 20.3, 1000.0], [110.7, 20.3, 1000.0], [10.2, 120.9, 3000.0]];
        let area = 100.5 * 100.6;
        draw_triangle(&mut depth, corners, area);
        let covered = depth.iter().filter(|d| **d > 0).count() as f32;
        assert!((covered - 0.5 * area).abs() < 0.02 * area, "{covered}");
        assert!((f32::from(depth[70 * SIDE + 20]) - 1988.0).abs() < 20.0);
        assert_eq!(depth[119 * SIDE + 90], 0);
        draw_triangle(
            &mut depth,
            [[-5000.0, -80.0, 9.0], [9000.0, -70.0, 9.0], [300.0, 9000.0, 9.0]],
            1.4e4 * 9.0e3,
        );
        assert_eq!(depth[1000 * SIDE + 300], 9);
    }
}
