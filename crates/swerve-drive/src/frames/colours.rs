//! Colour mapping of depth, class and instance images.

use swerve_msg::Pixels;
use swerve_scene::SemanticClass;

/// Depth at which a pixel is half as bright as right in front of the camera, metres.
const HALF_M: f32 = 12.0;

/// Red, green and blue of each pixel.
pub(super) fn of(pixels: &Pixels) -> Vec<u8> {
    match pixels {
        Pixels::Rgb8(bytes) => bytes.to_vec(),
        Pixels::DepthF32M(depths) => depths.iter().flat_map(|depth_m| [near(*depth_m); 3]).collect(),
        Pixels::ClassU8(classes) => classes.iter().flat_map(|id| class(*id)).collect(),
        Pixels::InstanceU32(ids) => ids.iter().flat_map(|id| instance(*id)).collect(),
    }
}

fn near(depth_m: f32) -> u8 {
    (255.0 * HALF_M / (HALF_M + depth_m.max(0.0))) as u8
}

/// Colour of a class in the palette of the Cityscapes data set.
pub(super) fn class(id: u8) -> [u8; 3] {
    use SemanticClass as C;
    match SemanticClass::from_id(id) {
        Some(C::Road) => [128, 64, 128],
        Some(C::Sidewalk) => [244, 35, 232],
        Some(C::Building) => [70, 70, 70],
        Some(C::GuardRail) => [180, 165, 180],
        Some(C::Pole) => [153, 153, 153],
        Some(C::TrafficLight) => [250, 170, 30],
        Some(C::TrafficSign) => [220, 220, 0],
        Some(C::Vegetation) => [107, 142, 35],
        Some(C::Terrain) => [152, 251, 152],
        Some(C::Sky) => [70, 130, 180],
        Some(C::Person) => [220, 20, 60],
        Some(C::Rider) => [255, 0, 0],
        Some(C::Car) => [0, 0, 142],
        Some(C::Truck) => [0, 0, 70],
        Some(C::Bus) => [0, 60, 100],
        Some(C::Motorcycle) => [0, 0, 230],
        Some(C::Bicycle) => [119, 11, 32],
        _ => [0, 0, 0],
    }
}

/// Maps an instance id to a colour far from those of similar ids; black for no instance.
fn instance(id: u32) -> [u8; 3] {
    if id == 0 {
        return [0; 3];
    }
    let mixed = id.wrapping_mul(0x9e37_79b1) ^ id.wrapping_mul(0x85eb_ca6b).rotate_left(13);
    [mixed, mixed >> 8, mixed >> 16].map(|bits| (bits as u8) | 64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_pixel_has_a_colour_and_near_is_bright() {
        assert_eq!(of(&Pixels::ClassU8(vec![7, 24, 255].into())), [128, 64, 128, 220, 20, 60, 0, 0, 0]);
        let depth = of(&Pixels::DepthF32M(vec![0.0, 12.0, f32::INFINITY].into()));
        assert_eq!([depth[0], depth[3], depth[6]], [255, 127, 0]);
        let ids = of(&Pixels::InstanceU32(vec![0, 1, 2].into()));
        assert!(ids[..3] == [0; 3] && ids[3..6] != ids[6..9]);
    }
}
