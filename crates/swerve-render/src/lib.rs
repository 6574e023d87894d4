//! What a camera sees of a scene: procedural shapes, weather, camera model, a rasteriser for the CPU, and the
//! same for graphics adapters.
//!
//! Fill a [`Scene`] from any world (poses, kinds, seeds; nothing here knows the simulator), make a
//! [`Camera`], and let a [`Renderer`] write colour, depth, semantic and instance images into memory of yours:
//!
//! ```text
//! MeshLibrary::model ─> Instance ─┐
//! RoadLayout ─> road_pieces ──────┴─> Scene ──┐
//! CameraSpec ─> Camera ─> View ───────────────┴─> Renderer::render ─> Frame (rgb, depth, class, instance)
//! ```
//!
//! **Frames.** Map and body: x forward, y left, z up. Camera: x right, y down, z forward; [`camera::mount`]
//! makes one from a position and angles on the vehicle. Colours are linear inside, sRGB in the image.
//!
//! **Promises.** The images are a function of scene, view and options: not of earlier passes, of the number
//! of threads, or of the x86-64 machine. Ids are never blended. What can be kept between passes (static
//! shadow maps, lens maps) is keyed by content. A pass into used buffers allocates nothing that grows with
//! the image.
//!
//! These are the promises of [`Backend::Cpu`]. The other back ends, on adapters that [`gpu`] finds, keep the
//! first one on one adapter and driver alone: against the CPU's, colours may be off by a level or two and
//! outlines by a pixel. When their adapter fails, the [`Renderer`] goes on with the CPU, in the same frame.
//!
//! Other sensors read the same scene: [`Mesh`] has the triangles, [`Material`] the reflectance for lidars. [`lidar`]
//! has those, and rays for whoever asks what is in the way.

pub mod camera;
mod class;
mod cpu;
mod frame;
pub mod gpu;
mod hash;
mod library;
pub mod lidar;
mod light;
mod material;
mod mesh;
mod renderer;
mod scene;
mod surface;
mod texture;
pub mod town;
mod vector;
mod weather;

pub use camera::{Camera, CameraSpec, Distortion, Exposure, Intrinsics, SensorNoise, Shutter, mount};
pub use class::SemanticClass;
pub use frame::{Frame, FrameMut, FrameSizeError, Outputs};
pub use library::{
    Kind, LaneLine, LinePattern, MeshId, MeshLibrary, Model, PHASES, RoadLayout, RoadPiece, SideOfRoad, Size,
    ground_pieces, road_pieces, walk_phase,
};
pub use material::{Material, Texture};
pub use mesh::{Body, MESH_TRIANGLES_MAX, Mesh, MeshError, MeshParts};
pub use renderer::{Backend, RenderError, RenderOptions, Renderer, Submission, View};
pub use scene::{Instance, Light, Look, Motion, Scene, StaticPart, lamps};
pub use weather::{Sun, UnknownWeather, Weather, WeatherPreset};
