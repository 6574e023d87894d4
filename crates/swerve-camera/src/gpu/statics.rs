//! Static part of a scene, kept on the device while it is unchanged.

use swerve_scene::Scene;

use super::instance::{self, DrawInstance};
use super::meshes::MeshStore;
use super::records::{Records, Row};

/// Static part of a scene on the device, keyed by content.
#[derive(Default)]
pub(super) struct Statics {
    key: Option<(u64, bool, u64)>,
    pub(super) instances: Vec<DrawInstance>,
    pub(super) surfaces: Records,
    /// True until the surfaces are uploaded.
    pub(super) is_new: bool,
    /// Records of items relative to the centres of cells.
    items: Vec<([f64; 3], Vec<Row>)>,
}

/// Number of cells whose items are kept.
const CELLS_KEPT: usize = 8;

impl Statics {
    /// Updates the static part of a scene if it has changed.
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

    /// Records of all items relative to a centre.
    pub(super) fn around(&mut self, scene: &Scene, centre: [f64; 3]) -> &[Row] {
        let Self { items, instances, .. } = self;
        let found = items.iter().position(|(of, _)| *of == centre);
        let index = found.unwrap_or_else(|| {
            if items.len() == CELLS_KEPT {
                items.remove(0);
            }
            let mut records = Records::default();
            for (placed, instance) in scene.statics().instances().iter().zip(instances) {
                instance::write_item(&mut records, &placed.map_from_body, centre, instance.surfaces);
            }
            items.push((centre, records.rows));
            items.len() - 1
        });
        &items[index].1
    }
}
