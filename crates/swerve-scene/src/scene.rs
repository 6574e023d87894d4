//! The scene: instances, lights and weather, as plain data.

use std::sync::Arc;

use swerve_geom::{Map, Point, Transform};

use crate::SemanticClass;
use crate::hash::Key;
use crate::library::{MeshId, MeshLibrary, Model, RoadPiece};
use crate::look::Look;
use crate::mesh::Body;
use crate::weather::{Sun, Weather, WeatherPreset};

/// Motion of an instance, for motion blur and rolling shutters; map frame.
#[derive(Clone, Copy, PartialEq, Debug, Default)]
pub struct Motion {
    /// Velocity of its origin, m/s.
    pub linear_mps: [f64; 3],
    /// Angular velocity about its origin, rad/s.
    pub angular_radps: [f64; 3],
}

/// One object in the scene.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Instance {
    /// Mesh, an id of the scene's own library.
    pub mesh: MeshId,
    /// Pose.
    pub map_from_body: Transform<Map, Body>,
    /// Id in the instance image; 0 for objects without one.
    pub instance_id: u32,
    /// Class of its triangles, except those whose material has its own class.
    pub class: SemanticClass,
    /// Colours and lamps.
    pub look: Look,
    /// Motion, for blur.
    pub motion: Motion,
}

impl Instance {
    /// A model on the ground plane, at rest, without an instance id.
    pub fn new(model: &Model, x_m: f64, y_m: f64, yaw_rad: f64) -> Self {
        Self::placed(model, Transform::from_roll_pitch_yaw(Point::new(x_m, y_m, 0.0), 0.0, 0.0, yaw_rad))
    }

    /// A model at any pose, at rest, without an instance id.
    pub fn placed(model: &Model, map_from_body: Transform<Map, Body>) -> Self {
        Self {
            mesh: model.mesh,
            map_from_body,
            instance_id: 0,
            class: model.class,
            look: model.look,
            motion: Motion::default(),
        }
    }

    /// This instance with an instance id.
    #[must_use]
    pub fn with_id(self, instance_id: u32) -> Self {
        Self { instance_id, ..self }
    }

    fn add_to(&self, key: &mut Key) {
        let origin = self.map_from_body.origin().coords;
        let rotation = self.map_from_body.rotation();
        for value in origin.iter().chain(rotation.coords.iter()) {
            key.long(value.to_bits());
        }
        key.word(self.instance_id);
        key.word(u32::from(self.class as u8) | u32::from(self.look.lamps) << 8);
        self.look.tints.iter().flatten().for_each(|tint| key.number(*tint));
    }
}

/// The static part of a scene. Back ends cache results by its version; copies share it.
#[derive(Clone, Debug, Default)]
pub struct StaticPart {
    instances: Arc<Vec<Instance>>,
    version: Key,
}

impl StaticPart {
    /// Static instances.
    pub fn instances(&self) -> &[Instance] {
        &self.instances
    }

    /// Content hash: static parts with equal versions are equal.
    pub fn version(&self) -> u64 {
        self.version.0
    }
}

/// A lamp that illuminates its surroundings.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Light {
    /// Position, map frame.
    pub position_m: [f64; 3],
    /// Axis of its cone, unit length, map frame.
    pub direction: [f64; 3],
    /// Radiance of white paper on the axis times the distance squared, for distances well above 3 m.
    pub intensity: [f32; 3],
    /// Range beyond which it illuminates nothing, metres.
    pub range_m: f32,
    /// Cosine of the angle from the axis up to which it has full intensity.
    pub cos_inner: f32,
    /// Cosine of the angle beyond which it is dark; -1 for an omnidirectional lamp.
    pub cos_outer: f32,
}

impl Light {
    /// The two head lamps of a vehicle on low beam; `front_m` is the distance from the body's origin to the lamps.
    ///
    /// A beam that illuminates a person at 60 m (UN Regulation 112 requires 12 lx at 25 m, as much as street lamps
    /// give), and a weak wide one for the surroundings close by and beside the lane.
    pub fn head_lamps(map_from_body: &Transform<Map, Body>, front_m: f64, height_m: f64) -> [Self; 2] {
        let position = *map_from_body * Point::new(front_m + 0.1, 0.0, height_m);
        let aimed = |down: f64| -> [f64; 3] {
            let direction = *map_from_body * Point::new(front_m + 1.1, 0.0, height_m - down) - position;
            (direction * (1.0 / direction.norm())).coords.into()
        };
        let position_m = position.coords.into();
        let far = Self {
            position_m,
            direction: aimed(0.02),
            intensity: [150.0, 141.0, 124.0],
            range_m: 90.0,
            cos_inner: 0.9976,
            cos_outer: 0.94,
        };
        let wide = Self {
            position_m,
            direction: aimed(0.1),
            intensity: [14.0, 13.2, 11.6],
            range_m: 25.0,
            cos_inner: 0.9,
            cos_outer: 0.35,
        };
        [far, wide]
    }

    /// A street lamp that shines downwards.
    pub fn street_lamp(position_m: [f64; 3]) -> Self {
        Self {
            position_m,
            direction: [0.0, 0.0, -1.0],
            intensity: [13.0, 10.0, 6.2],
            range_m: 18.0,
            cos_inner: 0.75,
            cos_outer: 0.15,
        }
    }
}

/// All visible objects with lights and weather.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Meshes of all instances.
    pub meshes: MeshLibrary,
    statics: StaticPart,
    /// Moving instances; replaced or changed before each pass.
    pub dynamics: Vec<Instance>,
    /// Lamps that illuminate other objects; used while the weather has lamps on.
    pub lights: Vec<Light>,
    /// Air and ground.
    pub weather: Weather,
    /// Position of the sun.
    pub sun: Sun,
}

impl Default for Sun {
    fn default() -> Self {
        WeatherPreset::default().sun()
    }
}

impl Scene {
    /// Creates an empty scene with a weather.
    pub fn new(preset: WeatherPreset) -> Self {
        Self { weather: preset.weather(), sun: preset.sun(), ..Self::default() }
    }

    /// Sets weather and sun to a preset.
    pub fn set_weather(&mut self, preset: WeatherPreset) {
        (self.weather, self.sun) = (preset.weather(), preset.sun());
    }

    /// Static part.
    pub fn statics(&self) -> &StaticPart {
        &self.statics
    }

    /// Adds a static instance.
    pub fn add_static(&mut self, instance: Instance) {
        instance.add_to(&mut self.statics.version);
        self.statics.version.long(self.meshes.get(instance.mesh).key().0);
        Arc::make_mut(&mut self.statics.instances).push(instance);
    }

    /// Adds a piece of road or ground.
    pub fn add_piece(&mut self, piece: RoadPiece) {
        let RoadPiece { mesh, class, map_from_body } = piece;
        let mesh = self.meshes.add(mesh);
        let (look, motion) = (Look::default(), Motion::default());
        self.add_static(Instance { mesh, map_from_body, instance_id: 0, class, look, motion });
    }

    /// Removes all static instances.
    pub fn clear_statics(&mut self) {
        self.statics = StaticPart::default();
    }
}
