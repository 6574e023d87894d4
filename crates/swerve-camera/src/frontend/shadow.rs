//! Size and position of shadow maps, and their contents.
//!
//! A depth map seen from the sun, and a map of the hidden share of the sky above the ground. Both are centred on the
//! cell of a coarse grid that contains the camera, so that they are a function of scene and cell, and those of the
//! static part can be kept.

use swerve_geom::{Map, Point, Transform};
use swerve_scene::hash::Key;
use swerve_scene::vector::{cross, dot, normalized};
use swerve_scene::{Instance, Mesh, Scene, SemanticClass};

use super::pinhole::Frustum;
use super::pose::{narrow, rotate, rotation_rows};

/// Side of the sun's map, texels.
pub(crate) const SIDE: usize = 2048;
/// Half of the side of the sun's map, metres.
pub(crate) const REACH_M: f32 = 120.0;
/// Texels per metre.
pub(crate) const PER_M: f32 = SIDE as f32 / (2.0 * REACH_M);
/// Steps of stored depth per metre.
pub(crate) const DEPTHS_PER_M: f32 = 128.0;
/// Stored depth of the cell's centre.
pub(crate) const DEPTH_0: f32 = 32768.0;
/// Side of the sky's map, texels.
pub(crate) const SKY_SIDE: usize = 1024;
/// Texels per metre of the sky's map.
pub(crate) const SKY_PER_M: f32 = 8.0;
/// Side of a cell, metres.
const CELL_M: f64 = 48.0;

/// Centre of the cell that contains a position.
pub(crate) fn cell(position: [f64; 3]) -> [f64; 3] {
    position.map(|x| (x / CELL_M).round() * CELL_M)
}

/// Viewing direction of the sun's map if the sun casts no shadows.
pub(crate) const UP: [f32; 3] = [0.0, 0.0, 1.0];

/// Hash of all inputs of a cell's static maps.
pub(crate) fn maps_key(scene: &Scene, centre: [f64; 3], sun: Option<[f32; 3]>) -> Key {
    let mut key = Key::default();
    key.long(scene.statics().version());
    centre.iter().for_each(|x| key.long(x.to_bits()));
    sun.unwrap_or(UP).iter().for_each(|x| key.number(*x));
    key.word(u32::from(sun.is_some()));
    key
}

/// Returns true if an instance casts a relevant shadow; instances flat on the ground do not.
pub(crate) fn casts_shadow(instance: &Instance) -> bool {
    use SemanticClass as C;
    !matches!(instance.class, C::Road | C::Ground | C::Terrain | C::Sidewalk | C::Parking | C::RailTrack)
}

/// Returns true if a camera may see a sphere, the ground around it, or its shadow. `sun` is the direction towards the
/// sun, if it casts shadows.
pub(crate) fn is_shadow_seen(
    camera_from_map: &Transform<swerve_geom::Camera, Map>,
    frustum: &Frustum,
    middle: Point<Map>,
    radius: f32,
    sun: Option<[f32; 3]>,
) -> bool {
    let at = (*camera_from_map * middle).coords;
    let at = [at.x as f32, at.y as f32, at.z as f32];
    let along = sun.map_or([0.0; 3], |sun| {
        let reach = ((2.0 * radius) / sun[2].max(0.08)).min(80.0);
        let rows = narrow(rotation_rows(camera_from_map));
        rotate(&rows, sun).map(|x| -x * reach)
    });
    frustum.touches_swept(at, radius + 1.0, along)
}

/// Footprint of an instance that hides the sky from the ground.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Footprint {
    /// Centre of the footprint, relative to the centre of the map.
    pub(crate) place: [f32; 2],
    /// Half of its length and width.
    pub(crate) half: [f32; 2],
    /// Rotation from the body to the map.
    pub(crate) rows: [[f32; 3]; 3],
    /// Hidden share of the sky, in 255ths.
    pub(crate) strength: f32,
    /// Distance over which the effect fades.
    pub(crate) fall: f32,
    /// Distance from the centre beyond which there is no effect.
    pub(crate) reach: f32,
}

impl Footprint {
    /// Footprint of an instance, relative to the centre of a cell; `None` for flat instances.
    pub(crate) fn new(mesh: &Mesh, instance: &Instance, centre: [f64; 3]) -> Option<Self> {
        let (min, max) = mesh.bounds();
        let height = max[2] - min[2];
        if height < 0.3 {
            return None;
        }
        let origin = instance.map_from_body.origin().coords;
        let [min, max] = mesh.base();
        let rows = narrow(rotation_rows(&instance.map_from_body));
        let middle = [0.5 * (min[0] + max[0]), 0.5 * (min[1] + max[1]), 0.0];
        let place = [0, 1].map(|k| (origin[k] - centre[k]) as f32 + dot(rows[k], middle));
        let half = [0.5 * (max[0] - min[0]), 0.5 * (max[1] - min[1])];
        let is_person = matches!(instance.class, SemanticClass::Person | SemanticClass::Rider);
        let strength = if is_person { 130.0 } else { 235.0 };
        let fall = (0.5 * height).clamp(0.15, 1.0);
        let reach = half[0].max(half[1]) * core::f32::consts::SQRT_2 + fall;
        Some(Self { place, half, rows, strength, fall, reach })
    }
}

/// Axes of the sun's map, by rows: across the light, the perpendicular axis across the light, towards the sun.
pub(crate) fn axes(sun: [f32; 3]) -> [[f32; 3]; 3] {
    let helper = if sun[2].abs() < 0.99 { [0.0, 0.0, 1.0] } else { [1.0, 0.0, 0.0] };
    let across = normalized(cross(helper, sun));
    [across, cross(sun, across), sun]
}
