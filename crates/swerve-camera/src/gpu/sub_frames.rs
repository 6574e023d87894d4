//! Sub-frames of a submission: their records, and the triangle clusters that each of them draws.

use swerve_scene::{Instance, Motion, Scene};

use super::cells::cell_of;
use super::instance::{self, DrawInstance};
use super::layout::ImageLayout;
use super::plan::{ClusterRanges, PlacedSubFrame, Round};
use super::prepared::{Cell, FIXED, MOVING, PreparedView, Shown};
use super::records::{Clip, NONE, SUB_FRAME_ROWS, SubFrameRecord, ViewContext, switch};
use super::renderer::GpuRenderer;
use crate::View;
use crate::frame::Outputs;
use crate::frontend::lamp::collect_lamps;
use crate::frontend::light::Environment;
use crate::frontend::pose::{pose_after, rotation_rows};
use crate::frontend::sensor::Sensor;
use crate::frontend::texture::Tiles;
use crate::frontend::viewpoint::Viewpoint;

/// Sub-frames of one cell that are shaded by one dispatch.
pub(super) struct Dispatch {
    pub(super) first_record: u32,
    pub(super) sub_frames: u32,
    pub(super) blocks: u32,
    pub(super) maps: Option<usize>,
}

/// Round prepared for drawing.
pub(super) struct RoundCommands {
    pub(super) sub_frames: Vec<(PlacedSubFrame, ClusterRanges)>,
    pub(super) dispatches: Vec<Dispatch>,
}

impl GpuRenderer {
    /// Writes the records of the views.
    pub(super) fn prepare<'a>(
        &mut self,
        scene: &Scene,
        views: &'a [(View<'a>, Outputs)],
        cells: &[Cell],
        layouts: &[ImageLayout],
    ) -> Vec<PreparedView<'a>> {
        let tiles = Tiles::get().words();
        let mut prepared = Vec::with_capacity(views.len());
        for ((view, outputs), layout) in views.iter().zip(layouts) {
            let centre = cell_of(view);
            let cell =
                cells.iter().position(|c| c.centre == centre).expect("the cell of each view is listed");
            let light = Environment::new(scene, view.camera.spec().exposure);
            let sensor = Sensor::new(view.camera, &light, view.frame, tiles);
            let mut switches = if light.has_shadows() { switch::SUN } else { 0 };
            if cells[cell].moves {
                switches |= switch::MOVING;
            }
            if view.camera.is_orthographic() {
                switches |= switch::FLAT;
            }
            let context = ViewContext { centre, switches, quantiles: self.pipelines.quantiles };
            prepared.push(PreparedView {
                view,
                outputs: *outputs,
                cell,
                lens: self.lenses.get(view.camera),
                record: self.records.view(&light, &sensor, &context),
                layout: *layout,
            });
        }
        prepared
    }

    /// Writes the records of a round and lists the clusters of each of its sub-frames.
    pub(super) fn list(&mut self, shown: &Shown<'_>, round: &Round) -> RoundCommands {
        let first = self.records.reserve_sub_frames(round.sub_frames.len());
        let mut commands =
            RoundCommands { sub_frames: Vec::with_capacity(round.sub_frames.len()), dispatches: Vec::new() };
        let mut last_cell = None;
        for (k, placed) in round.sub_frames.iter().enumerate() {
            let at = first + k as u32 * SUB_FRAME_ROWS;
            let view = &shown.views[placed.view];
            let pinhole = view.lens.map(|lens| lens.pinhole);
            let from = Viewpoint::new(view.view, &placed.sub_frame, pinhole);
            self.write_sub_frame(shown, placed, &from, at);
            commands.sub_frames.push((placed.clone(), self.list_clusters(shown, placed, &from, at)));
            let blocks = (placed.sub_frame.rows.len() * view.view.camera.width_px()).div_ceil(64) as u32;
            if last_cell != Some(view.cell) {
                last_cell = Some(view.cell);
                let maps = shown.cells[view.cell].maps;
                commands.dispatches.push(Dispatch { first_record: at, sub_frames: 0, blocks: 0, maps });
            }
            let dispatch = commands.dispatches.last_mut().expect("one was pushed for the first sub-frame");
            dispatch.sub_frames += 1;
            dispatch.blocks = dispatch.blocks.max(blocks);
        }
        commands
    }

    /// Writes the record of a sub-frame and of the lamps that light it.
    fn write_sub_frame(&mut self, shown: &Shown<'_>, placed: &PlacedSubFrame, from: &Viewpoint, at: u32) {
        let (prepared, sub_frame) = (&shown.views[placed.view], &placed.sub_frame);
        let centre = shown.cells[prepared.cell].centre;
        let Viewpoint { map_from_camera, camera_from_map, image, rows, .. } = from;
        let origin: [f64; 3] = map_from_camera.origin().coords.into();
        let eye = [0, 1, 2].map(|k| origin[k] - centre[k]);
        let first_lamp = self.records.next();
        let mut lamps = Vec::new();
        if prepared.outputs.rgb {
            collect_lamps(shown.scene, camera_from_map, image, centre, &mut lamps);
            lamps.iter().for_each(|lamp| self.records.lamp(lamp));
        }
        let origin = if image.flat {
            image.ray_origins(map_from_camera, centre)
        } else {
            [[0.0; 3], [0.0; 3], eye.map(|x| x as f32)]
        };
        let (camera, layout) = (prepared.view.camera, &prepared.layout);
        let first_point = prepared.lens.map_or(NONE, |lens| lens.first_point);
        let record = SubFrameRecord {
            clip: Clip::new(image, rows, &rotation_rows(camera_from_map), eye),
            ray: image.ray_directions(map_from_camera),
            origin,
            focal: image.fx as f32,
            place: [placed.layer, 0, camera.width_px() as u32, camera.height_px() as u32],
            rows: [
                sub_frame.rows.start as u32,
                sub_frame.rows.end as u32,
                sub_frame.sample,
                sub_frame.samples,
            ],
            images: layout.first,
            lens: [first_point, layout.kept, 0, layout.sums],
            light: [first_lamp, lamps.len() as u32, prepared.record, 0],
        };
        self.records.sub_frame(at, &record);
    }

    /// Lists the clusters of a sub-frame: those of instances that may be visible at its instant.
    fn list_clusters(
        &mut self,
        shown: &Shown<'_>,
        placed: &PlacedSubFrame,
        from: &Viewpoint,
        at: u32,
    ) -> ClusterRanges {
        let (prepared, sub_frame) = (&shown.views[placed.view], &placed.sub_frame);
        let cell = &shown.cells[prepared.cell];
        let hidden = prepared.view.hidden_instance.filter(|id| *id != 0);
        let is_seen = |middle: [f64; 3], radius: f32| {
            let [x, y, z] = middle;
            let at = (from.camera_from_map * swerve_geom::Point::new(x, y, z)).coords;
            from.frustum.touches([at.x as f32, at.y as f32, at.z as f32], radius)
        };
        let Self { listed, records, statics, .. } = self;
        let fixed = shown.scene.statics().instances().iter().zip(&statics.instances);
        let moving = shown.scene.dynamics.iter().zip(shown.moving);
        listed.group(|add| {
            let mut each = |placed: &Instance, instance: &DrawInstance, item: u32| {
                if hidden == Some(placed.instance_id) {
                    return;
                }
                if sub_frame.at_s == 0.0 || placed.motion == Motion::default() {
                    if is_seen(instance.middle, instance.radius()) {
                        add(instance.shape, item, at);
                    }
                    return;
                }
                let pose = pose_after(&placed.map_from_body, &placed.motion, sub_frame.at_s);
                if is_seen(instance.middle_at(&pose), instance.radius()) {
                    let item = records.next();
                    instance::write_item(records, &pose, cell.centre, instance.surfaces);
                    add(instance.shape, item, at);
                }
            };
            for (k, (placed, instance)) in fixed.enumerate() {
                each(placed, instance, cell.items[FIXED] + 4 * k as u32);
            }
            for (k, (placed, instance)) in moving.enumerate() {
                each(placed, instance, cell.items[MOVING] + 4 * k as u32);
            }
        })
    }
}
