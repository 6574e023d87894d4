//! GNSS receiver: position of its antenna with noise, a drifting bias, multipath and outages.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use swerve_core::{Ranges, Rng, Time};
use swerve_geom::{Point, Point2, math};
use swerve_msg::Gnss;
use swerve_msg::truth::WorldState;

use super::key;

/// Region of the map within a distance of a line segment, such as a tunnel; a circle if start and end coincide.
#[derive(Clone, Copy, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields)]
pub struct Zone {
    /// Start of the segment, x and y, metres.
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub from_m: [f64; 2],
    /// End of the segment; the start when absent.
    #[serde(default)]
    #[schemars(inner(range(min = -1e6, max = 1e6)))]
    pub to_m: Option<[f64; 2]>,
    /// Extent of the zone around the segment, metres.
    #[schemars(range(min = 0.0, max = 1e5))]
    pub radius_m: f64,
}

impl Zone {
    /// True if a position is inside.
    pub fn has(&self, at: Point2) -> bool {
        let [from, to] = [self.from_m, self.to_m.unwrap_or(self.from_m)].map(|[x, y]| Point2::new(x, y));
        let (along, off) = (to - from, at - from);
        let share = (off.dot(along) / along.norm_squared().max(1e-12)).clamp(0.0, 1.0);
        (off - along * share).norm_squared() <= self.radius_m * self.radius_m
    }
}

/// GNSS receiver, and the geographic origin of the map.
#[derive(Clone, PartialEq, Debug, Serialize, Deserialize, JsonSchema, Ranges)]
#[serde(deny_unknown_fields, default)]
pub struct GnssParams {
    /// Latitude of the map's origin, degrees north. Default 37.4 (with the longitude: the south of San Francisco Bay).
    #[schemars(range(min = -89.9, max = 89.9))]
    pub origin_latitude_deg: f64,
    /// Longitude of the map's origin, degrees east. Default -122.0.
    #[schemars(range(min = -180.0, max = 180.0))]
    pub origin_longitude_deg: f64,
    /// Height of the map's plane above the ellipsoid, metres. Default 0.
    #[schemars(range(min = -1000.0, max = 10_000.0))]
    pub origin_altitude_m: f64,
    /// Standard deviation of the noise of east and of north, metres. Default 0.5. Twice as much for the height.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub noise_m: f64,
    /// Standard deviation of the bias of east and of north, metres. Default 0.5. Twice as much for the height.
    #[schemars(range(min = 0.0, max = 1000.0))]
    pub bias_m: f64,
    /// Correlation time of the bias, seconds: a first-order Gauss-Markov process with standard deviation `bias_m`.
    /// Default 0: the bias is constant for the run.
    #[schemars(range(min = 0.0, max = 1e6))]
    pub bias_time_s: f64,
    /// Position of the antenna in the ego frame, metres; fixes are those of the antenna. Default: the ego origin.
    #[schemars(inner(range(min = -20.0, max = 20.0)))]
    pub antenna_at_m: [f64; 3],
    /// Time of the first fix, seconds from the start of the run. Default 0.
    #[schemars(range(min = 0.0, max = 3600.0))]
    pub first_fix_s: f64,
    /// Zones of the map in which the antenna has no fix: `{ from_m = [x, y], to_m = [x, y], radius_m = r }`, all within
    /// r of the segment; a circle without `to_m`. Default none.
    #[ranges(nested)]
    pub outages: Vec<Zone>,
    /// Mean rate of multipath errors, which offset all fixes by one step, per minute without one. Default 0.
    #[schemars(range(min = 0.0, max = 600.0))]
    pub multipath_per_min: f64,
    /// Length of the step of a multipath error, metres; its direction is random. Default 20.
    #[schemars(range(min = 0.0, max = 10_000.0))]
    pub multipath_m: f64,
    /// Duration of a multipath error, seconds. Default 5.
    #[schemars(range(min = 0.001, max = 3600.0))]
    pub multipath_s: f64,
}

impl Default for GnssParams {
    fn default() -> Self {
        Self {
            origin_latitude_deg: 37.4,
            origin_longitude_deg: -122.0,
            origin_altitude_m: 0.0,
            noise_m: 0.5,
            bias_m: 0.5,
            bias_time_s: 0.0,
            antenna_at_m: [0.0; 3],
            first_fix_s: 0.0,
            outages: Vec::new(),
            multipath_per_min: 0.0,
            multipath_m: 20.0,
            multipath_s: 5.0,
        }
    }
}

/// The receiver of one car in one run.
#[derive(Clone, Debug)]
pub struct GnssReceiver {
    params: GnssParams,
    sensor: String,
    seed: u64,
    /// Bias of fixes east, north and up, over its standard deviation.
    offset: [f64; 3],
    /// Stamp of the last reading, with or without a fix.
    last: Option<Time>,
    multipath: Multipath,
}

/// The current or next multipath error.
#[derive(Clone, Copy, Debug)]
struct Multipath {
    count: i64,
    /// Start and end, seconds.
    lasts_s: [f64; 2],
    direction_rad: f64,
}

impl GnssReceiver {
    /// Creates a receiver whose initial bias is drawn under (seed, sensor).
    pub fn new(params: GnssParams, sensor: &str, seed: u64) -> Self {
        let mut bias = Rng::keyed(seed, "sensor bias", &[key(sensor)]);
        let offset = core::array::from_fn(|_| bias.normal());
        let multipath = Multipath { count: 0, lasts_s: [f64::NEG_INFINITY, 0.0], direction_rad: 0.0 };
        Self { params, sensor: sensor.to_owned(), seed, offset, last: None, multipath }
    }

    /// Fix of the antenna, if available.
    ///
    /// The map is treated as flat, with the WGS 84 radii of curvature at its origin; the resulting error grows with the
    /// square of the distance from the origin and is about 0.1 m at one kilometre.
    pub fn sense(&mut self, world: &WorldState) -> Option<Gnss> {
        let stamp = world.stamp;
        self.wander(stamp);
        let [x, y, z] = self.params.antenna_at_m;
        let at = world.ego.map_from_ego * Point::new(x, y, z);
        let place = Point2::new(at.coords.x, at.coords.y);
        let is_late = (stamp - Time::ZERO).as_secs() < self.params.first_fix_s;
        if is_late || self.params.outages.iter().any(|zone| zone.has(place)) {
            return None;
        }
        let mut noise = Rng::keyed(self.seed, "sensor noise", &[key(&self.sensor), stamp.ns()]);
        let GnssParams { noise_m, bias_m, .. } = self.params;
        let mut error =
            |axis: usize, times: f64| times * bias_m * self.offset[axis] + times * noise_m * noise.normal();
        let at_m = [at.coords.x + error(0, 1.0), at.coords.y + error(1, 1.0), at.coords.z + error(2, 2.0)];
        let at_m = self.reflected(stamp, at_m);
        Some(self.fix(stamp, at_m))
    }

    /// Advances the bias with a draw of this stamp.
    fn wander(&mut self, stamp: Time) {
        let before = self.last.replace(stamp);
        let dt_s = before.map_or(0.0, |before| (stamp - before).as_secs());
        if self.params.bias_time_s <= 0.0 || dt_s <= 0.0 {
            return;
        }
        let kept = math::exp(-dt_s / self.params.bias_time_s);
        let drawn = (1.0 - kept * kept).sqrt();
        let mut rng = Rng::keyed(self.seed, "sensor walk", &[key(&self.sensor), stamp.ns()]);
        for offset in &mut self.offset {
            *offset = kept * *offset + drawn * rng.normal();
        }
    }

    /// Position with the current multipath error. The times between errors are exponentially distributed.
    fn reflected(&mut self, stamp: Time, [east, north, up]: [f64; 3]) -> [f64; 3] {
        let GnssParams { multipath_per_min, multipath_m, multipath_s, .. } = self.params;
        if multipath_per_min <= 0.0 {
            return [east, north, up];
        }
        let now_s = (stamp - Time::ZERO).as_secs();
        let next = &mut self.multipath;
        while next.lasts_s[1] <= now_s {
            let mut rng = Rng::keyed(self.seed, "multipath", &[key(&self.sensor), next.count]);
            let wait_s = -math::ln(1.0 - rng.unit()) * 60.0 / multipath_per_min;
            let from_s = next.lasts_s[1] + wait_s;
            let direction_rad = rng.uniform(0.0, core::f64::consts::TAU);
            *next =
                Multipath { count: next.count + 1, lasts_s: [from_s, from_s + multipath_s], direction_rad };
        }
        if now_s < next.lasts_s[0] {
            return [east, north, up];
        }
        let (sin, cos) = math::sin_cos(next.direction_rad);
        [east + multipath_m * cos, north + multipath_m * sin, up]
    }

    /// Converts a map position to a fix.
    fn fix(&self, stamp: Time, [east, north, up]: [f64; 3]) -> Gnss {
        const EQUATOR_M: f64 = 6_378_137.0;
        const FLATTENING: f64 = 1.0 / 298.257_223_563;
        let params = &self.params;
        let (sin, cos) = math::sin_cos(params.origin_latitude_deg.to_radians());
        let eccentricity_squared = FLATTENING * (2.0 - FLATTENING);
        let root = (1.0 - eccentricity_squared * sin * sin).sqrt();
        let across_m = EQUATOR_M / root + params.origin_altitude_m;
        let along_m =
            EQUATOR_M * (1.0 - eccentricity_squared) / (root * root * root) + params.origin_altitude_m;
        Gnss {
            stamp,
            latitude_deg: params.origin_latitude_deg + (north / along_m).to_degrees(),
            longitude_deg: params.origin_longitude_deg + (east / (across_m * cos)).to_degrees(),
            altitude_m: params.origin_altitude_m + up,
            deviation_m: math::hypot(params.noise_m, params.bias_m),
        }
    }
}
