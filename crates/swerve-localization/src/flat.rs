//! Local tangent plane of the map about its geodetic origin.

use swerve_geom::math;

/// Semi-major axis of WGS 84, metres, and its flattening.
const EQUATOR_M: f64 = 6_378_137.0;
const FLATTENING: f64 = 1.0 / 298.257_223_563;

/// Geodetic position of the map's origin: latitude and longitude in degrees, height above the ellipsoid in metres.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Origin {
    /// Latitude, degrees north.
    pub latitude_deg: f64,
    /// Longitude, degrees east.
    pub longitude_deg: f64,
    /// Height above the ellipsoid, metres.
    pub altitude_m: f64,
}

impl Origin {
    /// Converts a fix to east, north and up from the origin, metres, on a flat map with the radii of curvature at the
    /// origin: accurate to 0.1 m at one kilometre. `None` for invalid latitudes and for positions more than 100 km
    /// from the origin along an axis.
    pub fn east_north_up_m(
        &self,
        latitude_deg: f64,
        longitude_deg: f64,
        altitude_m: f64,
    ) -> Option<[f64; 3]> {
        let (sin, cos) = math::sin_cos(self.latitude_deg.to_radians());
        let eccentricity_squared = FLATTENING * (2.0 - FLATTENING);
        let root = (1.0 - eccentricity_squared * sin * sin).sqrt();
        let across_m = EQUATOR_M / root + self.altitude_m;
        let along_m = EQUATOR_M * (1.0 - eccentricity_squared) / (root * root * root) + self.altitude_m;
        // The shorter way across the date line.
        let turn = longitude_deg - self.longitude_deg;
        let turn = turn - 360.0 * (turn / 360.0).round();
        let place = [
            turn.to_radians() * across_m * cos,
            (latitude_deg - self.latitude_deg).to_radians() * along_m,
            altitude_m - self.altitude_m,
        ];
        (latitude_deg.abs() <= 90.0 && place.iter().all(|x| x.abs() <= 100_000.0)).then_some(place)
    }
}
