//! Cells that contain the cameras of a submission, and the contents of their shadow maps.

use core::ops::Range;

use swerve_geom::{Map, Point, Transform};
use swerve_scene::{Motion, Scene};

use super::instance::{self, DrawInstance};
use super::maps::Corners;
use super::plan::ClusterRanges;
use super::prepared::{Cell, FIXED, MOVING};
use super::renderer::GpuRenderer;
use crate::frame::Outputs;
use crate::frontend::light::Environment;
use crate::frontend::pinhole::{Frustum, Pinhole};
use crate::frontend::shadow::{Footprint, UP, cell, is_shadow_seen, maps_key};
use crate::{Exposure, View};

/// Drawing job for the maps of a cell.
pub(super) struct MapJob {
    pub(super) maps: usize,
    /// [`FIXED`] or [`MOVING`].
    pub(super) part: usize,
    /// True if the previous content is discarded.
    pub(super) is_new: bool,
    /// Rectangles to erase in the map of the sun and in that of the sky. On some adapters clearing complete large maps
    /// takes longer than everything else.
    pub(super) erased: [Range<u32>; 2],
    pub(super) sun: ClusterRanges,
    pub(super) footprints: Range<u32>,
}

/// Camera with its frustum.
struct Sight {
    camera_from_map: Transform<swerve_geom::Camera, Map>,
    frustum: Frustum,
}

/// Potential shadow casters of a cell.
struct Casters<'a> {
    scene: &'a Scene,
    moving: &'a [DrawInstance],
    /// Direction towards the sun if it casts shadows.
    sun: Option<[f32; 3]>,
    /// Colour cameras of the cell; `None` if their views are not known before their sub-frames are.
    sights: Option<Vec<Sight>>,
}

impl Casters<'_> {
    /// Returns true if the shadow of a moving instance may be visible.
    fn is_shown(&self, instance: &DrawInstance) -> bool {
        let [x, y, z] = instance.middle;
        let middle = Point::new(x, y, z);
        let is_seen_by = |sight: &Sight| {
            is_shadow_seen(&sight.camera_from_map, &sight.frustum, middle, instance.radius(), self.sun)
        };
        self.sights.as_ref().is_none_or(|sights| sights.iter().any(is_seen_by))
    }
}

/// Centre of the cell of a view.
pub(super) fn cell_of(view: &View<'_>) -> [f64; 3] {
    cell(view.map_from_camera.origin().coords.into())
}

fn sights(views: &[(View<'_>, Outputs)], centre: [f64; 3]) -> Option<Vec<Sight>> {
    let coloured = views.iter().filter(|(view, outputs)| outputs.rgb && cell_of(view) == centre);
    coloured
        .map(|(view, _)| {
            let camera = view.camera;
            let shutter = camera.spec().shutter;
            let is_still = view.motion == Motion::default();
            let is_simple = camera.spec().distortion.is_none() && shutter.blur_samples <= 1;
            (is_simple && (is_still || shutter.readout_s <= 0.0)).then(|| Sight {
                camera_from_map: view.map_from_camera.inverse(),
                frustum: Frustum::new(&Pinhole::new(camera), &(0..camera.height_px())),
            })
        })
        .collect()
}

impl GpuRenderer {
    /// Determines the cells of views, the positions of instances relative to them, and the jobs for their maps.
    pub(super) fn cells(
        &mut self,
        scene: &Scene,
        views: &[(View<'_>, Outputs)],
        moving: &[DrawInstance],
    ) -> (Vec<Cell>, Vec<MapJob>) {
        let sun = Environment::new(scene, Exposure::Factor(1.0)).shadow_sun();
        self.maps.start();
        let (mut cells, mut jobs) = (Vec::<Cell>::new(), Vec::new());
        for (view, outputs) in views {
            let centre = cell_of(view);
            let index = cells.iter().position(|cell| cell.centre == centre).unwrap_or_else(|| {
                cells.push(self.cell(scene, centre, moving));
                cells.len() - 1
            });
            let cell = &mut cells[index];
            if !outputs.rgb || cell.maps.is_some() {
                continue;
            }
            let maps = self.maps.index(&self.gpu, &self.pipelines, maps_key(scene, centre, sun));
            cell.maps = Some(maps);
            let sun_record = self.records.sun(sun.unwrap_or(UP));
            let casters = Casters { scene, moving, sun, sights: sights(views, centre) };
            for part in [FIXED, MOVING] {
                let job = self.map_job(&casters, cell, maps, part, sun_record);
                cell.moves |= job.is_some() && part == MOVING;
                jobs.extend(job);
            }
        }
        (cells, jobs)
    }

    /// Writes the positions of instances relative to a centre.
    fn cell(&mut self, scene: &Scene, centre: [f64; 3], moving: &[DrawInstance]) -> Cell {
        let fixed = self.records.next();
        self.records.rows.extend_from_slice(self.statics.around(scene, centre));
        let first_moving = self.records.next();
        for (placed, instance) in scene.dynamics.iter().zip(moving) {
            instance::write_item(&mut self.records, &placed.map_from_body, centre, instance.surfaces);
        }
        Cell { centre, items: [fixed, first_moving], maps: None, moves: false }
    }

    /// Drawing job for one of the maps of a cell; `None` if there is nothing to draw.
    fn map_job(
        &mut self,
        casters: &Casters<'_>,
        cell: &Cell,
        maps: usize,
        part: usize,
        sun_record: u32,
    ) -> Option<MapJob> {
        let Casters { scene, moving, sun, .. } = *casters;
        let Self { maps: cache, statics, listed, records, .. } = self;
        let kept = &mut cache.maps[maps];
        let instances = [statics.instances.as_slice(), moving][part];
        // Static instances are drawn for all future views, moving ones only for those of this submission.
        let casts = |instance: &DrawInstance| instance.casts && (part == FIXED || casters.is_shown(instance));
        let is_new = kept.is_new[part];
        let is_wanted = if part == FIXED { is_new } else { instances.iter().any(casts) };
        if !is_wanted {
            return None;
        }
        kept.is_new[part] = false;
        let erased = core::mem::take(&mut kept.moved).map(|corners| {
            let from = listed.all.len() as u32;
            let stale = corners.iter().filter(|_| part == MOVING && !is_new);
            listed.all.extend(stale.map(|corners| [records.corners(corners), 0, 0, 0]));
            from..listed.all.len() as u32
        });
        let mut moved: [Vec<Corners>; 2] = Default::default();
        let first = cell.items[part];
        let in_sun = listed.group(|add| {
            let Some(sun) = sun else { return };
            for (k, instance) in instances.iter().enumerate().filter(|(_, instance)| casts(instance)) {
                add(instance.shape, first + 4 * k as u32, sun_record);
                moved[0].push(instance::corners_in_sun(instance, cell.centre, sun));
            }
        });
        let from = listed.all.len() as u32;
        let placed = [scene.statics().instances(), &scene.dynamics][part];
        for (placed, _) in placed.iter().zip(instances).filter(|(_, instance)| casts(instance)) {
            let mesh = scene.meshes.get(placed.mesh);
            if let Some(footprint) = Footprint::new(mesh, placed, cell.centre) {
                listed.all.push([records.footprint(&footprint), 0, 0, 0]);
                moved[1].push(instance::corners_in_sky(&footprint));
            }
        }
        let footprints = from..listed.all.len() as u32;
        if part == MOVING {
            kept.moved = moved;
        }
        Some(MapJob { maps, part, is_new, erased, sun: in_sun, footprints })
    }
}
