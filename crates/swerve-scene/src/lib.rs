//! The scene rendered for sensors: procedural shapes, roads, materials, weather, instances.
//!
//! A [`Scene`] can be filled from any world (poses, kinds, seeds); the crate is independent of simulator and sensors:
//!
//! ```text
//! MeshLibrary::model ─> Instance ─┐
//! RoadLayout ─> road_pieces ──────┼─> Scene
//! swerve_map::Map ─> add_map ─────┘
//! ```
//!
//! [`Mesh`] contains the triangles, [`Material`] the colours for cameras and the reflectance for lidars.
//!
//! **Frames.** Map and body: x forward, y left, z up. Colours are linear reflectances.
//!
//! **Guarantees.** A scene is a function of the calls that filled it: shapes and colours depend only on their seeds and
//! are bit-identical on every x86-64 machine. Versions and keys are content hashes, for caches.

mod class;
pub mod hash;
mod library;
mod look;
mod map;
mod material;
mod mesh;
mod paving;
mod scene;
pub mod town;
pub mod vector;
mod weather;

pub use class::SemanticClass;
pub use library::{
    Kind, LaneLine, LinePattern, MeshId, MeshLibrary, Model, PHASES, RoadLayout, RoadPiece, SideOfRoad, Size,
    ground_pieces, road_pieces, walk_phase,
};
pub use look::{Look, lamps};
pub use map::{MapGround, SignalMast, add_map, map_pieces, signal_masts};
pub use material::{Material, Texture};
pub use mesh::{Body, Mesh, MeshBuilder, MeshError, MeshParts};
pub use scene::{Instance, Light, Motion, Scene, StaticPart};
pub use weather::{Sun, UnknownWeather, Weather, WeatherPreset};
