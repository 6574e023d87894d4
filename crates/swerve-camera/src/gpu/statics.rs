//! The static part of a scene: kept on the device for as long as it is the same.

use swerve_scene::Scene;

use super::meshes::MeshStore;
use super::plan::{self, DrawInstance};
use super::records::{Records, Row};

/// The static part of a scene on the device, by content.
#[derive(Default)]
pub(super) struct Statics {
    key: Option<(u64, bool, u64)>,
    pub(super) instances: Vec<DrawInstance>,
    pub(super) surfaces: Records,
    /// Surfaces are yet to be uploaded.
    pub(super) is_new: bool,
    /// Records of items around the centres of cells.
    items: Vec<([f64; 3], Vec<Row>)>,
}

/// Cells of which the items are kept.
const CELLS_KEPT: usize = 8;

impl Statics {
    /// Takes over the static part of a scene if it is another one.
    pub(super) fn follow(&mut self, scene: &Scene, meshes: &mut MeshStore) {
        let key = (scene.statics().version(), scene.weather.lamps_on, meshes.generation);
        if self.key == Some(key) {
            return;
        }
        let Self { instances, surfaces, .. } = self;
        surfaces.restart(0);
        instances.clear();
        let placed = scene.statics().instances().iter();
        instances.extend(placed.map(|instance| DrawInstance::new(scene, instance, meshes, surfaces)));
        self.items.clear();
        (self.key, self.is_new) = (Some(key), true);
    }

    /// Records of all items around a centre.
    pub(super) fn around(&mut self, scene: &Scene, centre: [f64; 3]) -> &[Row] {
        let Self { items, instances, .. } = self;
        let found = items.iter().position(|(of, _)| *of == centre);
        let index = found.unwrap_or_else(|| {
            if items.len() == CELLS_KEPT {
                items.remove(0);
            }
            let mut records = Records::default();
            for (placed, instance) in scene.statics().instances().iter().zip(instances) {
                plan::write_item(&mut records, &placed.map_from_body, centre, instance.surfaces);
            }
            items.push((centre, records.rows));
            items.len() - 1
        });
        &items[index].1
    }
}
