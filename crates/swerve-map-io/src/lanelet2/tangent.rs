//! Projection of latitude and longitude to the plane that touches the Earth at an origin.
//!
//! WGS 84; positions are taken at height 0 of the ellipsoid, converted to geocentric coordinates and rotated to east,
//! north and up at the origin. Within 5 km of the origin, horizontal distances differ from those on the ellipsoid by at
//! most 0.6 mm (the third power of the distance over six times the squared radius), and directions from the origin are
//! exact. Computed by difference formulas without cancellation: errors of the arithmetic are below a micrometre.

use swerve_geom::math;

/// Semi-major axis, metres.
const AXIS_M: f64 = 6_378_137.0;

/// Flattening.
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Plane that touches the ellipsoid at an origin.
#[derive(Clone, Copy, PartialEq, Debug)]
pub(super) struct Tangent {
    latitude_deg: f64,
    longitude_deg: f64,
    sin: f64,
    cos: f64,
    normal_m: f64,
}

impl Tangent {
    /// Plane at a latitude and longitude, degrees.
    pub(super) fn new([latitude_deg, longitude_deg]: [f64; 2]) -> Self {
        let (sin, cos) = math::sin_cos(latitude_deg.to_radians());
        Self { latitude_deg, longitude_deg, sin, cos, normal_m: normal_m(sin) }
    }

    /// East and north of the origin, metres, of a latitude and longitude in degrees.
    pub(super) fn project(&self, [latitude_deg, longitude_deg]: [f64; 2]) -> [f64; 2] {
        let (sin, cos) = math::sin_cos(latitude_deg.to_radians());
        let east_rad = (longitude_deg - self.longitude_deg).to_radians();
        let (sin_east, _) = math::sin_cos(east_rad);
        let (sin_half, _) = math::sin_cos(0.5 * east_rad);
        let normal_m = normal_m(sin);
        // Distance from the axis and height above the equator, less those of the origin.
        let [sin_less, cos_less] = differences(self.latitude_deg, latitude_deg);
        let wider_m = normal_m - self.normal_m;
        let axis_m = normal_m * cos_less + wider_m * self.cos;
        let height_m = (1.0 - eccentricity2()) * (normal_m * sin_less + wider_m * self.sin);
        // Towards the axis by the curvature of the parallel.
        let sagged_m = 2.0 * normal_m * cos * sin_half * sin_half;
        [normal_m * cos * sin_east, self.cos * height_m - self.sin * (axis_m - sagged_m)]
    }
}

/// Square of the first eccentricity.
fn eccentricity2() -> f64 {
    FLATTENING * (2.0 - FLATTENING)
}

/// Radius of curvature across the meridian, metres.
fn normal_m(sin: f64) -> f64 {
    AXIS_M / (1.0 - eccentricity2() * sin * sin).sqrt()
}

/// Differences of the sines and of the cosines of two angles in degrees.
fn differences(from_deg: f64, to_deg: f64) -> [f64; 2] {
    let (sin_half, _) = math::sin_cos(0.5 * (to_deg - from_deg).to_radians());
    let (sin_mean, cos_mean) = math::sin_cos(0.5 * (to_deg + from_deg).to_radians());
    [2.0 * cos_mean * sin_half, -2.0 * sin_mean * sin_half]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// East and north by geocentric coordinates, as in textbooks.
    fn geocentric(origin: [f64; 2], place: [f64; 2]) -> [f64; 2] {
        let at = |[latitude, longitude]: [f64; 2]| {
            let (sin, cos) = math::sin_cos(latitude.to_radians());
            let (sin_east, cos_east) = math::sin_cos(longitude.to_radians());
            let normal_m = normal_m(sin);
            [normal_m * cos * cos_east, normal_m * cos * sin_east, normal_m * (1.0 - eccentricity2()) * sin]
        };
        let (a, b) = (at(origin), at(place));
        let [dx, dy, dz] = [b[0] - a[0], b[1] - a[1], b[2] - a[2]];
        let (sin, cos) = math::sin_cos(origin[0].to_radians());
        let (sin_east, cos_east) = math::sin_cos(origin[1].to_radians());
        [-sin_east * dx + cos_east * dy, -sin * cos_east * dx - sin * sin_east * dy + cos * dz]
    }

    #[test]
    fn places_agree_with_geocentric_coordinates() {
        for origin in [[49.0, 8.4], [-33.86, 151.2], [0.0, 179.99], [89.0, 10.0], [35.2, 139.1]] {
            for (north, east) in [(0.0, 0.0), (0.01, 0.0), (0.0, 0.01), (-0.03, 0.04), (1e-6, -1e-6)] {
                let place = [origin[0] + north, origin[1] + east];
                let (found, expected) = (Tangent::new(origin).project(place), geocentric(origin, place));
                for (found, expected) in found.into_iter().zip(expected) {
                    assert!((found - expected).abs() < 1e-7, "{origin:?} {place:?}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn distances_are_those_on_the_ellipsoid() {
        // A minute of longitude on the equator, and one of latitude beside it, WGS 84.
        let equator = Tangent::new([0.0, 0.0]);
        let [east_m, _] = equator.project([0.0, 1.0 / 60.0]);
        let [_, north_m] = equator.project([1.0 / 60.0, 0.0]);
        assert!((east_m - AXIS_M * (1.0_f64 / 60.0).to_radians()).abs() < 1e-3, "{east_m}");
        let meridian_m = AXIS_M * (1.0 - eccentricity2()) * (1.0_f64 / 60.0).to_radians();
        assert!((north_m - meridian_m).abs() < 1e-3, "{north_m} {meridian_m}");
    }

    #[test]
    fn date_line_is_no_border() {
        let [east_m, _] = Tangent::new([10.0, 179.999]).project([10.0, -179.999]);
        assert!((east_m - 219.279).abs() < 1e-3, "{east_m}");
    }
}
