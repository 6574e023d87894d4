//! Records read by shaders: rows of four words; the layout is documented in `draw.wgsl` and `pass.wgsl`.

use core::ops::Range;

use swerve_scene::hash;

use super::maps::Corners;
use crate::frontend::lamp::Lamp;
use crate::frontend::light::Environment;
use crate::frontend::pinhole::Pinhole;
use crate::frontend::sensor::Sensor;
use crate::frontend::shadow::{self, Footprint};
use crate::frontend::surface::Surface;
use crate::frontend::texture;

/// Row of four words.
pub(super) type Row = [u32; 4];

/// Rows of one sub-frame.
pub(super) const SUB_FRAME_ROWS: u32 = 16;
/// Missing image or lens.
pub(super) const NONE: u32 = u32::MAX;

/// Bits in a view's record.
pub(super) mod switch {
    /// The sun casts shadows.
    pub(in crate::gpu) const SUN: u32 = 1;
    /// There are maps of moving instances.
    pub(in crate::gpu) const MOVING: u32 = 2;
    /// Rays are parallel.
    pub(in crate::gpu) const FLAT: u32 = 4;
}

/// Consecutive rows.
#[derive(Default)]
pub(super) struct Records {
    pub(super) rows: Vec<Row>,
    /// Index of the first row.
    pub(super) base: u32,
}

fn row(v: [f32; 3], w: f32) -> Row {
    [v[0].to_bits(), v[1].to_bits(), v[2].to_bits(), w.to_bits()]
}

fn narrow(v: [f64; 3]) -> [f32; 3] {
    v.map(|x| x as f32)
}

impl Records {
    /// Index of the next row.
    pub(super) fn next(&self) -> u32 {
        self.base + self.rows.len() as u32
    }

    /// Clears the records and continues at a row.
    pub(super) fn restart(&mut self, base: u32) {
        self.rows.clear();
        self.base = base;
    }

    /// Writes a surface: five rows.
    pub(super) fn surface(&mut self, surface: &Surface) {
        for four in surface.numbers.as_chunks::<4>().0 {
            self.rows.push(four.map(f32::to_bits));
        }
        self.rows.push([surface.texture, surface.flags, u32::from(surface.class), surface.instance]);
    }

    /// Writes an item, four rows: rotation and translation to the map, relative to a centre, and the row of its
    /// surfaces.
    pub(super) fn item(&mut self, rotation: &[[f64; 3]; 3], place: [f64; 3], surfaces: u32) {
        for axis in 0..3 {
            self.rows.push(row(narrow(rotation[axis]), place[axis] as f32));
        }
        self.rows.push([surfaces, 0, 0, 0]);
    }

    /// Writes a footprint: three rows.
    pub(super) fn footprint(&mut self, footprint: &Footprint) -> u32 {
        let at = self.next();
        let Footprint { place, half, rows, strength, fall, reach } = *footprint;
        self.rows.push([place[0], place[1], half[0], half[1]].map(f32::to_bits));
        self.rows.push([rows[0][0], rows[1][0], rows[0][1], rows[1][1]].map(f32::to_bits));
        self.rows.push([reach, strength, fall, 0.0].map(f32::to_bits));
        at
    }

    /// Writes a rectangle: one row.
    pub(super) fn corners(&mut self, corners: &Corners) -> u32 {
        self.rows.push(corners.map(f32::to_bits));
        self.next() - 1
    }

    /// Writes a lamp: four rows.
    pub(super) fn lamp(&mut self, lamp: &Lamp) {
        self.rows.push(row(lamp.position, lamp.range));
        self.rows.push(row(lamp.direction, lamp.cos_outer));
        self.rows.push(row(lamp.intensity, lamp.over_fall));
        let [columns, rows] = [lamp.columns, lamp.rows];
        self.rows.push([columns[0], columns[1], rows[0], rows[1]].map(f32::to_bits));
    }

    /// Writes the light and sensor of one view: sixteen rows.
    pub(super) fn view(&mut self, light: &Environment, sensor: &Sensor<'_>, context: &ViewContext) -> u32 {
        let at = self.next();
        let axes = shadow::axes(light.sun);
        let tile = |number: usize| (number * texture::STRIDE) as u32;
        let rain_keys = [0, 1].map(|layer| hash::mix(sensor.rain_key ^ layer));
        self.rows.extend([
            row(light.sun, light.exposure),
            row(light.sunlight, light.cloudiness),
            row(light.zenith, light.wetness),
            row(light.horizon, light.puddles),
            row(light.glow, light.rain),
            row(light.cloud, light.fog_1pm),
            row(light.ambient, 0.0),
            row(light.bounce, 0.0),
            row(light.fog, 0.0),
            row(axes[0], 0.0),
            row(axes[1], sensor.down[1]),
            row(axes[2], context.centre[2] as f32),
            [context.switches, rain_keys[0], rain_keys[1], tile(texture::STREAKS)],
            row([sensor.vignetting, sensor.across[0], sensor.across[1]], sensor.down[0]),
            [sensor.read.to_bits(), sensor.shot.to_bits(), sensor.key, context.quantiles],
            [0, 0, tile(texture::CLOUDS), tile(texture::PUDDLES)],
        ]);
        at
    }

    /// Reserves rows for sub-frames, to be filled by [`Self::sub_frame`].
    pub(super) fn reserve_sub_frames(&mut self, count: usize) -> u32 {
        let at = self.next();
        self.rows.resize(self.rows.len() + count * SUB_FRAME_ROWS as usize, [0; 4]);
        at
    }

    /// Writes a sub-frame to sixteen reserved rows: its projection and the location of its pixels.
    pub(super) fn sub_frame(&mut self, at: u32, record: &SubFrameRecord) {
        let [clip_x, clip_y, clip_z, clip_w] =
            record.clip.rows.map(|[x, y, z, w]| row(narrow([x, y, z]), w as f32));
        let rows = [
            row(narrow(record.clip.eye), 0.0),
            clip_x,
            clip_y,
            clip_z,
            clip_w,
            row(record.ray[0], record.focal),
            row(record.ray[1], 0.0),
            row(record.ray[2], 0.0),
            row(record.origin[0], 0.0),
            row(record.origin[1], 0.0),
            row(record.origin[2], 0.0),
            record.place,
            record.rows,
            record.images,
            record.lens,
            record.light,
        ];
        let from = (at - self.base) as usize;
        self.rows[from..from + rows.len()].copy_from_slice(&rows);
    }

    /// Writes the projection of the sun's map around the centre, in as many rows as a sub-frame.
    pub(super) fn sun(&mut self, sun: [f32; 3]) -> u32 {
        let [across, up, towards] = shadow::axes(sun).map(|axis| axis.map(f64::from));
        let over = 1.0 / f64::from(shadow::REACH_M);
        let scaled = |v: [f64; 3], by: f64| v.map(|x| x * by);
        let [x, y, z] = [scaled(across, over), scaled(up, -over), scaled(towards, 1.0 / SUN_DEPTH_M)];
        let rows =
            [[x[0], x[1], x[2], 0.0], [y[0], y[1], y[2], 0.0], [z[0], z[1], z[2], 0.5], [0.0, 0.0, 0.0, 1.0]];
        let clip = Clip { eye: [0.0; 3], rows };
        let at = self.reserve_sub_frames(1);
        self.sub_frame(at, &SubFrameRecord { clip, ..SubFrameRecord::default() });
        at
    }
}

/// Depth range of the sun's map along the light, metres.
const SUN_DEPTH_M: f64 = 8192.0;

/// Parts of a view's record other than light and sensor.
pub(super) struct ViewContext {
    /// Centre of the shadow maps' cell.
    pub(super) centre: [f64; 3],
    /// See [`switch`].
    pub(super) switches: u32,
    /// First word of the quantiles of noise.
    pub(super) quantiles: u32,
}

/// Projection of positions relative to the centre to clip coordinates.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Clip {
    /// Position that is subtracted first.
    pub(super) eye: [f64; 3],
    /// Factors of x, y, z and 1.
    pub(super) rows: [[f64; 4]; 4],
}

impl Clip {
    /// Projection of some rows of a pinhole image. Depth is 1 at the near plane, and 0 at infinity or at the far plane
    /// of an orthographic image.
    pub(super) fn new(
        image: &Pinhole,
        rows: &Range<usize>,
        camera_from_map: &[[f64; 3]; 3],
        eye: [f64; 3],
    ) -> Self {
        let [right, down, ahead] = *camera_from_map;
        let (width, height) = (image.width as f64, rows.len() as f64);
        let cy = image.cy - rows.start as f64;
        if image.flat {
            let row = |main: [f64; 3], a: f64, w: f64| [a * main[0], a * main[1], a * main[2], w];
            let (near, far) = (f64::from(image.near), f64::from(image.far));
            let rows = [
                row(right, 2.0 * image.fx / width, 2.0 * (image.cx + 0.5) / width - 1.0),
                row(down, -2.0 * image.fy / height, 1.0 - 2.0 * (cy + 0.5) / height),
                row(ahead, -1.0 / (far - near), far / (far - near)),
                [0.0, 0.0, 0.0, 1.0],
            ];
            return Self { eye, rows };
        }
        let along = |main: [f64; 3], f: f64, c: f64, size: f64| {
            let (a, b) = (2.0 * f / size, 2.0 * (c + 0.5) / size - 1.0);
            [0, 1, 2].map(|k| a * main[k] + b * ahead[k])
        };
        let x = along(right, image.fx, image.cx, width);
        let y = along(down, image.fy, cy, height);
        let rows = [
            [x[0], x[1], x[2], 0.0],
            [-y[0], -y[1], -y[2], 0.0],
            [0.0, 0.0, 0.0, f64::from(image.near)],
            [ahead[0], ahead[1], ahead[2], 0.0],
        ];
        Self { eye, rows }
    }
}

/// Record of a sub-frame.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct SubFrameRecord {
    pub(super) clip: Clip,
    /// Direction of a pixel's ray: per column, per row, of the first pixel.
    pub(super) ray: [[f32; 3]; 3],
    /// Origin of a pixel's ray: per column, per row, of the first pixel.
    pub(super) origin: [[f32; 3]; 3],
    /// Pixels per unit of direction.
    pub(super) focal: f32,
    /// Layer, 0, width and height of the output image.
    pub(super) place: Row,
    /// First row, one past the last row; index and number of the sub-frame.
    pub(super) rows: Row,
    /// First words of the images: colour, depth, classes, instances.
    pub(super) images: Row,
    /// First point of the lens, first word of unpacked colours and classes, 0, first word of the sums of sub-frames.
    pub(super) lens: Row,
    /// First row of the lamps, their number, row of the view, 0.
    pub(super) light: Row,
}
