//! Procedural shapes, created once per kind and variation and shared by all instances.

mod building;
mod cycle;
mod person;
mod plant;
mod road;
mod street;
mod vehicle;

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

pub use road::{LaneLine, LinePattern, RoadLayout, RoadPiece, SideOfRoad, ground_pieces, road_pieces};

use crate::SemanticClass;
use crate::hash::{Draws, Key};
use crate::look::Look;
use crate::mesh::Mesh;

/// A mesh of a [`MeshLibrary`].
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug)]
pub struct MeshId(u32);

impl MeshId {
    /// Position in [`MeshLibrary::meshes`].
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

/// Bounding box of an object, millimetres: integers, so that equal sizes share a mesh.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
pub struct Size {
    /// Along x.
    pub length_mm: u32,
    /// Along y.
    pub width_mm: u32,
    /// Along z.
    pub height_mm: u32,
}

impl Size {
    /// Converts from metres, clamped to the range from a millimetre to a kilometre.
    pub fn from_m(length_m: f64, width_m: f64, height_m: f64) -> Self {
        let mm = |m: f64| (m * 1e3).round().clamp(1.0, 1e6) as u32;
        Self { length_mm: mm(length_m), width_mm: mm(width_m), height_mm: mm(height_m) }
    }

    /// Length, width, height in metres.
    pub fn metres(self) -> [f32; 3] {
        [self.length_mm, self.width_mm, self.height_mm].map(|mm| mm as f32 * 1e-3)
    }
}

/// Kind of shape.
///
/// All have their origin on the ground at the centre of their footprint and face +x.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Debug, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Kind {
    /// Car with a boot.
    Sedan,
    /// Short car with a tailgate.
    Hatchback,
    /// Tall car.
    Suv,
    /// Delivery van.
    Van,
    /// Truck with a box body.
    BoxTruck,
    /// City bus.
    Bus,
    /// Motorcycle with its rider.
    Motorcycle,
    /// Bicycle with its rider, at one of [`PHASES`] phases of pedalling.
    Cyclist {
        /// Below [`PHASES`]; taken modulo it.
        phase: u8,
    },
    /// A person at one of [`PHASES`] phases of walking.
    Pedestrian {
        /// Below [`PHASES`]; taken modulo it.
        phase: u8,
    },
    /// A standing person.
    Standing,
    /// House with windows and doors.
    Building,
    /// Broad-leaved tree.
    Tree,
    /// Bush.
    Bush,
    /// Street lamp; the arm extends along +x.
    StreetLamp,
    /// Bare pole.
    Pole,
    /// Traffic light on a pole, facing +x. Lamps: [`crate::lamps::RED`] and the others.
    TrafficLight,
    /// Stop sign, facing +x.
    StopSign,
    /// Sign to give way, facing +x.
    YieldSign,
    /// Speed limit of 30, 50 or 80 km/h, facing +x.
    SpeedSign {
        /// The limit; other values are rounded to the nearest of 30, 50, 80.
        kmh: u8,
    },
    /// Guard rail along x.
    GuardRail,
    /// Litter bin.
    Bin,
    /// Plain box: for objects of which only the size is known.
    Block,
}

/// Phases of a walk or pedalling cycle.
pub const PHASES: u8 = 16;

/// Phase of a walk after a distance: two steps are one cycle.
pub fn walk_phase(distance_m: f64, height_m: f64) -> u8 {
    let cycle_m = 0.82 * height_m.clamp(0.5, 3.0);
    let turns = distance_m / cycle_m;
    let turns = if turns.is_finite() { turns - turns.floor() } else { 0.0 };
    ((turns * f64::from(PHASES)) as u8) % PHASES
}

impl Kind {
    /// Default size for a seed.
    fn usual_size(self, seed: u64) -> Size {
        let mut draws = Draws::new(seed, 0x512e);
        let mut near =
            |m: f64, spread: f64| m * f64::from(draws.between(1.0 - spread as f32, 1.0 + spread as f32));
        match self {
            Self::Sedan => Size::from_m(near(4.7, 0.04), near(1.83, 0.02), near(1.45, 0.02)),
            Self::Hatchback => Size::from_m(near(4.1, 0.06), near(1.76, 0.02), near(1.48, 0.03)),
            Self::Suv => Size::from_m(near(4.6, 0.04), near(1.88, 0.02), near(1.68, 0.03)),
            Self::Van => Size::from_m(near(5.6, 0.06), near(2.0, 0.02), near(2.45, 0.06)),
            Self::BoxTruck => Size::from_m(near(7.6, 0.1), near(2.45, 0.02), near(3.3, 0.05)),
            Self::Bus => Size::from_m(near(11.9, 0.02), near(2.55, 0.0), near(3.05, 0.02)),
            Self::Motorcycle => Size::from_m(near(2.1, 0.03), near(0.8, 0.03), near(1.65, 0.04)),
            Self::Cyclist { .. } => Size::from_m(1.8, near(0.62, 0.04), near(1.78, 0.05)),
            Self::Pedestrian { .. } | Self::Standing => {
                let height = near(1.72, 0.08);
                Size::from_m(0.62 * height, 0.36 * height, height)
            }
            Self::Building => Size::from_m(near(16.0, 0.3), near(12.0, 0.2), near(12.0, 0.4)),
            Self::Tree => {
                let height = near(7.5, 0.3);
                Size::from_m(0.6 * height, 0.6 * height, height)
            }
            Self::Bush => Size::from_m(near(1.6, 0.3), near(1.4, 0.3), near(1.1, 0.3)),
            Self::StreetLamp => Size::from_m(2.2, 0.3, 7.5),
            Self::Pole => Size::from_m(0.14, 0.14, near(4.0, 0.2)),
            Self::TrafficLight => Size::from_m(0.45, 0.4, 3.4),
            Self::StopSign | Self::YieldSign | Self::SpeedSign { .. } => {
                Size::from_m(0.1, 0.7, near(2.6, 0.08))
            }
            Self::GuardRail => Size::from_m(8.0, 0.3, 0.75),
            Self::Bin => Size::from_m(0.5, 0.5, near(1.0, 0.1)),
            Self::Block => Size::from_m(1.0, 1.0, 1.0),
        }
    }

    /// Class of its instances.
    pub fn class(self) -> SemanticClass {
        match self {
            Self::Sedan | Self::Hatchback | Self::Suv | Self::Van => SemanticClass::Car,
            Self::BoxTruck => SemanticClass::Truck,
            Self::Bus => SemanticClass::Bus,
            Self::Motorcycle => SemanticClass::Motorcycle,
            Self::Cyclist { .. } => SemanticClass::Rider,
            Self::Pedestrian { .. } | Self::Standing => SemanticClass::Person,
            Self::Building => SemanticClass::Building,
            Self::Tree | Self::Bush => SemanticClass::Vegetation,
            Self::StreetLamp | Self::Pole => SemanticClass::Pole,
            Self::TrafficLight => SemanticClass::TrafficLight,
            Self::StopSign | Self::YieldSign | Self::SpeedSign { .. } => SemanticClass::TrafficSign,
            Self::GuardRail => SemanticClass::GuardRail,
            Self::Bin | Self::Block => SemanticClass::Static,
        }
    }

    /// Number of shapes of one kind and size that differ by seed.
    fn variations(self) -> u64 {
        match self {
            Self::Building => 64,
            Self::Tree | Self::Bush | Self::Pedestrian { .. } | Self::Standing => 8,
            Self::Sedan | Self::Hatchback | Self::Suv | Self::Van | Self::BoxTruck | Self::Bus => 4,
            Self::Motorcycle | Self::Cyclist { .. } => 2,
            _ => 1,
        }
    }
}

/// A shape of the library with its appearance.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Model {
    /// Mesh.
    pub mesh: MeshId,
    /// Class of its instances.
    pub class: SemanticClass,
    /// Colours drawn from the seed, lamps off.
    pub look: Look,
    /// Size.
    pub size: Size,
}

/// All meshes of a scene with the kinds they were made for. Copies share the meshes.
#[derive(Clone, Debug, Default)]
pub struct MeshLibrary {
    meshes: Vec<Arc<Mesh>>,
    made: BTreeMap<(Kind, Size, u64), MeshId>,
    version: Key,
}

impl MeshLibrary {
    /// Adds a custom mesh.
    pub fn add(&mut self, mesh: Mesh) -> MeshId {
        self.version.long(mesh.key().0);
        self.meshes.push(Arc::new(mesh));
        MeshId(self.meshes.len() as u32 - 1)
    }

    /// Mesh of this library.
    ///
    /// # Panics
    /// If the id is from another library.
    pub fn get(&self, id: MeshId) -> &Mesh {
        &self.meshes[id.index()]
    }

    /// All meshes, by id. The list is append-only.
    pub fn meshes(&self) -> &[Arc<Mesh>] {
        &self.meshes
    }

    /// Content hash: libraries with equal versions are equal.
    pub fn version(&self) -> u64 {
        self.version.0
    }

    /// Model of a kind in its default size; shape and colours by seed.
    pub fn model(&mut self, kind: Kind, seed: u64) -> Model {
        self.model_sized(kind, kind.usual_size(seed), seed)
    }

    /// Model of a kind in a given size; shape and colours by seed.
    pub fn model_sized(&mut self, kind: Kind, size: Size, seed: u64) -> Model {
        let variation = u64::from(crate::hash::keyed(seed, 0x5a9e)) % kind.variations();
        let key = (kind, size, variation);
        let mesh = match self.made.get(&key) {
            Some(&mesh) => mesh,
            None => {
                let mesh = self.add(build(kind, size, variation));
                self.made.insert(key, mesh);
                mesh
            }
        };
        Model { mesh, class: kind.class(), look: look(kind, seed), size }
    }
}

/// Builds a shape.
fn build(kind: Kind, size: Size, variation: u64) -> Mesh {
    let outline = size.metres();
    let mut draws = Draws::new(variation, 0xb11d);
    match kind {
        Kind::Sedan | Kind::Hatchback | Kind::Suv | Kind::Van => vehicle::car(kind, outline, &mut draws),
        Kind::BoxTruck => vehicle::box_truck(outline, &mut draws),
        Kind::Bus => vehicle::bus(outline, &mut draws),
        Kind::Motorcycle => cycle::motorcycle(outline, &mut draws),
        Kind::Cyclist { phase } => cycle::cyclist(outline, phase % PHASES),
        Kind::Pedestrian { phase } => person::pedestrian(outline, Some(phase % PHASES), &mut draws),
        Kind::Standing => person::pedestrian(outline, None, &mut draws),
        Kind::Building => building::building(outline, &mut draws),
        Kind::Tree => plant::tree(outline, &mut draws),
        Kind::Bush => plant::bush(outline, &mut draws),
        Kind::StreetLamp => street::street_lamp(outline),
        Kind::Pole => street::pole(outline),
        Kind::TrafficLight => street::traffic_light(outline),
        Kind::StopSign => street::stop_sign(outline),
        Kind::YieldSign => street::yield_sign(outline),
        Kind::SpeedSign { kmh } => street::speed_sign(outline, kmh),
        Kind::GuardRail => street::guard_rail(outline),
        Kind::Bin => street::bin(outline),
        Kind::Block => street::block(outline),
    }
}

/// Colours of a seed.
fn look(kind: Kind, seed: u64) -> Look {
    let mut draws = Draws::new(seed, 0x100c);
    let tints = match kind {
        Kind::Sedan | Kind::Hatchback | Kind::Suv | Kind::Motorcycle => vehicle::paint(&mut draws),
        Kind::Van | Kind::BoxTruck | Kind::Bus => vehicle::fleet_paint(&mut draws),
        Kind::Pedestrian { .. } | Kind::Standing | Kind::Cyclist { .. } => person::clothes(&mut draws),
        Kind::Building => building::colours(&mut draws),
        Kind::Tree | Kind::Bush => plant::leaves(&mut draws),
        _ => [[1.0; 3]; 4],
    };
    Look { tints, lamps: 0 }
}

#[cfg(test)]
mod tests;
