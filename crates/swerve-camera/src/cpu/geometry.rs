//! Geometry: transformation of instances and set-up of triangles on the image.
//!
//! Edges and attributes are planes over the image (Olano and Greer 1997): for a triangle with corners `A B C`
//! in the camera frame, the ray `r = (x, y, 1)` meets it at `z r = αA + βB + γC`, and
//! `γ/z = (A x B)·r / det`. So every attribute over depth is affine in the pixel, and triangles need no clipping:
//! corners behind the camera are valid.
//!
//! An orthographic image (parallel rays) uses `(x, y, 1)` instead of `(x, y, z)`: the attributes themselves are then
//! affine, and depth subtracted from the far depth replaces inverse depth.

use core::ops::Range;

use swerve_scene::Mesh;
use swerve_scene::vector::{cross, dot, sub};
use wide::f32x4;

use super::cull::{Item, Placement};
use crate::frontend::BAND;
use crate::frontend::pinhole::Pinhole;
use crate::frontend::pose::rotate;

/// Affine function over the image: `[a, b, c]` is `a x + b y + c`.
pub(super) type Plane = [f32; 3];

/// Triangle data for the rasteriser.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct TriRaster {
    /// Nearness: inverse depth, or the far depth minus depth.
    pub(super) w: Plane,
    /// Crossing of each edge with row 0, and its shift per row, pixels; padded to four.
    pub(super) start: [f32; 4],
    pub(super) step: [f32; 4],
    /// First and one-past-last column and row.
    pub(super) columns: [u16; 2],
    pub(super) rows: [u16; 2],
    /// Bits 0 to 2: the edge bounds the inside from the left. Bit 3: parts are nearer than the near plane.
    pub(super) flags: u32,
}

/// Additional planes for shading, over depth (plain for orthographic images) and padded to whole quads: nearness, u, v,
/// and the normal in the map frame, one plane each.
pub(super) type TriShade = [f32; 20];

/// Triangles of one unit of work.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    pub(super) raster: Vec<TriRaster>,
    pub(super) shade: Vec<TriShade>,
    /// Entry in the surface table for each triangle.
    pub(super) surfaces: Vec<u32>,
    /// Triangles that touch each band, in order.
    pub(super) bands: Vec<Vec<u32>>,
    corners: Vec<Corner>,
}

/// Vertex in camera coordinates.
#[derive(Clone, Copy, Debug)]
struct Corner {
    /// Position in the camera frame.
    p: [f32; 3],
    /// Pixel position, unless nearer than the near plane.
    x: f32,
    y: f32,
    /// Bits: outside left, right, top, bottom, far; nearer than near.
    out: u32,
}

const NEARER: u32 = 1;

impl Chunk {
    /// Clears the chunk for a new pass over an image of this height.
    pub(super) fn clear(&mut self, height: usize) {
        self.raster.clear();
        self.shade.clear();
        self.surfaces.clear();
        let bands = height.div_ceil(BAND);
        self.bands.resize_with(bands.max(self.bands.len()), Vec::new);
        self.bands.iter_mut().for_each(Vec::clear);
    }

    /// Adds the triangles of an item of a mesh. `shaded` also fills [`Self::shade`].
    pub(super) fn add(&mut self, viewport: &Viewport<'_>, mesh: &Mesh, item: &Item, shaded: bool) {
        let image = viewport.image;
        self.corners.clear();
        let projection = viewport.projection(&item.placement);
        for position in mesh.positions() {
            self.corners.push(projection.corner(*position));
        }
        let (triangles, materials) = (mesh.triangles(), mesh.triangle_materials());
        let range = item.triangles.clone();
        for (triangle, material) in triangles[range.clone()].iter().zip(&materials[range]) {
            let surface = item.surfaces + u32::from(*material);
            let two_sided = mesh.materials()[usize::from(*material)].is_two_sided;
            let [a, b, c] = triangle.map(|k| self.corners[k as usize]);
            if a.out & b.out & c.out != 0 {
                continue;
            }
            let normal = cross(sub(b.p, a.p), sub(c.p, a.p));
            let facing = if image.flat { normal[2] } else { dot(normal, a.p) };
            let flipped = facing > 0.0;
            if facing == 0.0 || (flipped && !two_sided) {
                continue;
            }
            let (b, c) = if flipped { (c, b) } else { (b, c) };
            let Some((columns, rows)) = viewport.bounds([a, b, c]) else { continue };
            let Some((raster, planes)) = set_up(image, [a, b, c], columns, rows) else { continue };
            let id = self.raster.len() as u32;
            self.raster.push(raster);
            self.surfaces.push(surface);
            if shaded {
                let order = if flipped { [triangle[0], triangle[2], triangle[1]] } else { *triangle };
                let order = order.map(|k| k as usize);
                self.shade.push(shade(mesh, item, order, &planes, raster.w, flipped));
            }
            for band in usize::from(rows[0]) / BAND..=(usize::from(rows[1]) - 1) / BAND {
                self.bands[band].push(id);
            }
        }
    }
}

/// Part of an image that is rendered.
pub(super) struct Viewport<'a> {
    image: &'a Pinhole,
    f: [f32; 2],
    c: [f32; 2],
    left: f32,
    right: f32,
    top: f32,
    bottom: f32,
    rows: Range<usize>,
}

impl<'a> Viewport<'a> {
    pub(super) fn new(image: &'a Pinhole, rows: Range<usize>) -> Self {
        let (f, c) = ([image.fx as f32, image.fy as f32], [image.cx as f32, image.cy as f32]);
        // Half a pixel of margin on every side beyond the pixel centres.
        let (left, right) = (-1.0 - c[0], image.width as f32 - c[0]);
        let (top, bottom) = (rows.start as f32 - 1.0 - c[1], rows.end as f32 - c[1]);
        Self { image, f, c, left, right, top, bottom, rows }
    }

    /// Number of rows of the whole image.
    pub(super) fn height(&self) -> usize {
        self.image.height
    }

    /// Projection of a placed mesh's vertices.
    fn projection(&self, placement: &Placement) -> Projection {
        let m = placement.camera;
        let column = |k: usize| f32x4::new([m[0][k], m[1][k], m[2][k], 0.0]);
        let [x, y, z] = placement.offset;
        Projection {
            columns: [column(0), column(1), column(2), f32x4::new([x, y, z, 0.0])],
            sides: [
                f32x4::new([self.f[0], -self.f[0], 0.0, 0.0]),
                f32x4::new([0.0, 0.0, self.f[1], -self.f[1]]),
                f32x4::new([-self.left, self.right, -self.top, self.bottom]),
            ],
            f: self.f,
            c: self.c,
            near: self.image.near,
            far: self.image.far,
            flat: self.image.flat,
        }
    }

    /// Columns and rows that a triangle may cover; `None` if it covers no pixel centre.
    fn bounds(&self, corners: [Corner; 3]) -> Option<([u16; 2], [u16; 2])> {
        let (mut low, mut high) = ([f32::INFINITY; 2], [f32::NEG_INFINITY; 2]);
        let mut take = |x: f32, y: f32| {
            low = [low[0].min(x), low[1].min(y)];
            high = [high[0].max(x), high[1].max(y)];
        };
        let near = self.image.near;
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if a.out & NEARER == 0 || self.image.flat {
                take(a.x, a.y);
            }
            if !self.image.flat && (a.out ^ b.out) & NEARER != 0 {
                let t = (near - a.p[2]) / (b.p[2] - a.p[2]);
                let cut = |axis: usize| {
                    (a.p[axis] + t * (b.p[axis] - a.p[axis])) * self.f[axis] / near + self.c[axis]
                };
                take(cut(0), cut(1));
            }
        }
        let clamp = |x: f32, most: usize| x.clamp(0.0, most as f32) as u16;
        let slack = 0.01;
        let up = |x: f32| {
            let whole = x.clamp(-1.0, 70_000.0) as i32;
            whole as f32 + if (whole as f32) < x { 1.0 } else { 0.0 }
        };
        let columns =
            [clamp(up(low[0] - slack), self.image.width), clamp(up(high[0] + slack), self.image.width)];
        let rows = [clamp(up(low[1] - slack), self.rows.end), clamp(up(high[1] + slack), self.rows.end)];
        let rows = [rows[0].max(self.rows.start as u16), rows[1]];
        (columns[0] < columns[1] && rows[0] < rows[1]).then_some((columns, rows))
    }
}

/// Projection of vertices to corners.
struct Projection {
    /// Columns of the rotation matrix from body to camera, and its translation.
    columns: [f32x4; 4],
    /// Factors of x, y and z in the distances from the four sides of the viewport.
    sides: [f32x4; 3],
    f: [f32; 2],
    c: [f32; 2],
    near: f32,
    far: f32,
    flat: bool,
}

impl Projection {
    #[inline]
    fn corner(&self, [x, y, z]: [f32; 3]) -> Corner {
        let [i, j, k, offset] = self.columns;
        let moved = i * f32x4::splat(x) + j * f32x4::splat(y) + (k * f32x4::splat(z) + offset);
        let [x, y, z, _] = moved.to_array();
        let [by_x, by_y, by_z] = self.sides;
        let scale = if self.flat { 1.0 } else { z };
        let distances = by_x * f32x4::splat(x) + by_y * f32x4::splat(y) + by_z * f32x4::splat(scale);
        // Signs of the four distances.
        let out = distances.to_bitmask() << 1 | u32::from(z < self.near) | u32::from(z > self.far) << 5;
        let inverse = 1.0 / scale.max(1e-6);
        let pixel = [self.f[0] * x * inverse + self.c[0], self.f[1] * y * inverse + self.c[1]];
        Corner { p: [x, y, z], x: pixel[0], y: pixel[1], out }
    }
}

/// Planes of the barycentric coordinates over depth, for the attributes.
struct Barycentric([[f64; 3]; 3]);

impl Barycentric {
    /// Plane of an attribute over depth from its values at the corners.
    fn plane(&self, values: [f32; 3]) -> Plane {
        let [a, b, c] = values.map(f64::from);
        [0, 1, 2].map(|k| (a * self.0[0][k] + b * self.0[1][k] + c * self.0[2][k]) as f32)
    }
}

fn cross64(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

/// Set-up of a triangle; `None` if it faces away from the camera.
fn set_up(
    image: &Pinhole,
    corners: [Corner; 3],
    columns: [u16; 2],
    rows: [u16; 2],
) -> Option<(TriRaster, Barycentric)> {
    let [a, b, c] = corners.map(|corner| {
        let [x, y, z] = corner.p.map(f64::from);
        [x, y, if image.flat { 1.0 } else { z }]
    });
    // Opposite edges in the order of the corners; a shared edge gives exactly opposite numbers in the neighbouring
    // triangle.
    let opposite = [cross64(b, c), cross64(c, a), cross64(a, b)];
    let det = a[0] * opposite[0][0] + a[1] * opposite[0][1] + a[2] * opposite[0][2];
    if det >= 0.0 {
        return None;
    }
    let (over_fx, over_fy) = (1.0 / image.fx, 1.0 / image.fy);
    let mut raster = TriRaster { columns, rows, ..TriRaster::default() };
    let over_det = 1.0 / det;
    let mut planes = [[0.0; 3]; 3];
    for k in 0..3 {
        let [x, y, z] = opposite[k];
        let (ax, ay) = (x * over_fx, y * over_fy);
        let at = z - ax * image.cx - ay * image.cy;
        planes[k] = [ax * over_det, ay * over_det, at * over_det];
        // The inside is where the unscaled plane is negative: left of the crossing if it rises with x.
        if ax == 0.0 {
            // A horizontal edge bounds rows, not columns: a row is entirely inside or outside.
            let level = -at / ay;
            let row = level.clamp(-1.0, 70_000.0).ceil() as u16;
            if ay > 0.0 {
                raster.rows[1] = raster.rows[1].min(row);
            } else {
                raster.rows[0] = raster.rows[0].max(row);
            }
            raster.start[k] = 1e6;
        } else {
            (raster.start[k], raster.step[k]) = ((-at / ax) as f32, (-ay / ax) as f32);
            raster.flags |= u32::from(ax < 0.0) << k;
        }
    }
    if corners.iter().any(|corner| corner.out & NEARER != 0) {
        raster.flags |= 8;
    }
    let planes = Barycentric(planes);
    raster.w = planes.plane(corners.map(|corner| if image.flat { image.far - corner.p[2] } else { 1.0 }));
    (raster.rows[0] < raster.rows[1]).then_some((raster, planes))
}

fn shade(
    mesh: &Mesh,
    item: &Item,
    corners: [usize; 3],
    planes: &Barycentric,
    w: Plane,
    flipped: bool,
) -> TriShade {
    let uv = corners.map(|k| mesh.uvs()[k]);
    let sign = if flipped { -1.0 } else { 1.0 };
    let normals = corners.map(|k| rotate(&item.placement.map, mesh.normals()[k]));
    let mut all = [0.0; 20];
    let normal = |axis: usize| planes.plane(normals.map(|n| sign * n[axis]));
    let rows =
        [w, planes.plane(uv.map(|t| t[0])), planes.plane(uv.map(|t| t[1])), normal(0), normal(1), normal(2)];
    for (three, plane) in all.chunks_exact_mut(3).zip(rows) {
        three.copy_from_slice(&plane);
    }
    all
}
