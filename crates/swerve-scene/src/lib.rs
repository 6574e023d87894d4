//! The scene that sensors see: procedural shapes, roads, materials, weather, things with a place.
//!
//! Fill a [`Scene`] from any world (poses, kinds, seeds; nothing here knows the simulator, nor any sensor):
//!
//! ```text
//! MeshLibrary::model ─> Instance ─┐
//! RoadLayout ─> road_pieces ──────┴─> Scene
//! ```
//!
//! [`Mesh`] has the triangles, [`Material`] colours for cameras and the reflectance for lidars.
//!
//! **Frames.** Map and body: x forward, y left, z up. Colours are linear reflectances.
//!
//! **Promises.** A scene is a function of the calls that filled it: shapes and colours follow their seeds and are
//! the same bits on every x86-64 machine. Versions and keys are hashes of content, for caches.

mod class;
pub mod hash;
mod library;
mod material;
mod mesh;
mod scene;
pub mod town;
pub mod vector;
mod weather;

pub use class::SemanticClass;
pub use library::{
    Kind, LaneLine, LinePattern, MeshId, MeshLibrary, Model, PHASES, RoadLayout, RoadPiece, SideOfRoad, Size,
    ground_pieces, road_pieces, walk_phase,
};
pub use material::{Material, Texture};
pub use mesh::{Body, Mesh, MeshBuilder, MeshError, MeshParts};
pub use scene::{Instance, Light, Look, Motion, Scene, StaticPart, lamps};
pub use weather::{Sun, UnknownWeather, Weather, WeatherPreset};
