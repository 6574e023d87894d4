//! Assignment of radar echoes to objects.

use swerve_geom::{Ego, Map, Point2, Pose2, Vector2, angle_between, math};
use swerve_msg::{ActorKind, EgoState, Extent, RadarScan};

use super::object::Object;
use super::params::Params;
use super::place::{Spread, moved, polar};

/// Radar scan and the ego state at its stamp.
#[derive(Clone, Copy, Debug)]
pub struct Echoes<'a> {
    /// Echoes.
    pub scan: &'a RadarScan,
    /// Ego state at their stamp.
    pub ego: EgoState,
    /// Mounting pose of the radar.
    pub ego_from_radar: Pose2<Ego>,
}

/// Echo relative to the radar's position at its stamp, in the ego frame of the latest boxes.
struct Echo {
    bearing_rad: f64,
    range_m: f64,
    /// Radial speed over ground, m/s, positive for receding objects.
    speed_mps: f64,
    snr_db: f64,
}

/// Standard deviation of half an object's size, as a share of it.
const SIZE_SHARE: f64 = 0.3;

/// Usual length and width of a car, metres.
const CAR_M: [f64; 2] = [4.4, 1.8];

/// Difference of radial speeds up to which echoes may come from one object, m/s.
const ALIKE_MPS: f64 = 1.0;

/// Share of the doubt about an object that an echo of it removes if it moves: clutter stands.
const MOVING_SHARE: f64 = 0.5;

/// Radial speed above which an object moves, m/s: several standard deviations of an echo's.
const MOVES_MPS: f64 = 1.5;

/// Speed that no pedestrian exceeds, m/s: a faster echo is of a vehicle behind.
const SPRINTS_MPS: f64 = 8.0;

/// Distance gate of an echo, in standard deviations of the object's distance.
const DEVIATIONS: f64 = 3.0;

impl Echoes<'_> {
    /// Assigns each object the speed of its strongest echo, and objects with a guessed distance that of their echoes.
    /// An echo belongs to the nearest object whose gate contains it; objects with a measured distance take precedence,
    /// since the gate of a guessed distance also contains the echoes of its neighbours.
    /// With a lidar, a still echo that belongs to none of its objects is clutter up to the range in which the lidar misses
    /// nothing, and does not place a vehicle that only the camera sees.
    pub(super) fn add_to(&self, objects: &mut [Object], ego: Pose2<Map>, params: &Params, has_lidar: bool) {
        if !self.ego.is_plausible() {
            return;
        }
        let (radar, _) = moved((self.ego_from_radar, Spread::along(0.0, 0.0, 0.0)), self.ego.pose, ego);
        let mut own: Vec<Vec<Echo>> = objects.iter().map(|_| Vec::new()).collect();
        for echo in self.echoes(radar) {
            let is_clutter =
                has_lidar && echo.speed_mps.abs() < MOVES_MPS && echo.range_m < params.lidar_sure_m;
            let near = objects
                .iter()
                .enumerate()
                .filter(|(_, object)| !(is_clutter && object.is_guessed && object.is_vehicle()))
                .filter_map(|(k, object)| Some((k, echo.off(object, radar, params)?)));
            let rank = |k: usize| objects[k].is_guessed;
            let best = near.min_by(|a, b| rank(a.0).cmp(&rank(b.0)).then(a.1.total_cmp(&b.1)));
            if let Some((k, _)) = best {
                own[k].push(echo);
            }
        }
        for (object, echoes) in objects.iter_mut().zip(own) {
            let strongest = echoes.iter().max_by(|a, b| a.snr_db.total_cmp(&b.snr_db));
            if let Some(strongest) = strongest {
                strongest.apply_to(object, &echoes, radar, params);
            }
        }
    }

    /// Finite echoes, relative to the radar's position in the latest ego frame.
    fn echoes(&self, radar: Pose2<Ego>) -> impl Iterator<Item = Echo> {
        let Pose2 { x_m, y_m, heading_rad, .. } = self.ego_from_radar;
        // Velocity of the radar due to the ego's yaw rate.
        let turn = self.ego.yaw_rate_radps;
        let own_mps = Vector2::<Ego>::new(self.ego.speed_mps - turn * y_m, turn * x_m);
        self.scan.detections.iter().filter_map(move |echo| {
            let own_mps = own_mps.dot(Vector2::from_heading(heading_rad + echo.azimuth_rad));
            let (bearing_rad, speed_mps) =
                (radar.heading_rad + echo.azimuth_rad, echo.range_rate_mps + own_mps);
            let is_sound = bearing_rad.is_finite()
                && speed_mps.is_finite()
                && echo.range_m > 0.0
                && echo.range_m.is_finite();
            is_sound.then_some(Echo { bearing_rad, range_m: echo.range_m, speed_mps, snr_db: echo.snr_db })
        })
    }
}

impl Echo {
    /// Normalised distance from an object, in units of the gates of distance and bearing; `None` outside the gates.
    fn off(&self, object: &Object, radar: Pose2<Ego>, params: &Params) -> Option<f64> {
        if object.found.kind == ActorKind::Pedestrian && self.speed_mps.abs() > SPRINTS_MPS {
            return None;
        }
        let (bearing_rad, range_m) = polar(object.found.pose.point() - radar.point());
        let half_m = 0.5 * object.found.extent.length_m.max(object.found.extent.width_m);
        let range_gate_m =
            params.radar_range_m + half_m + DEVIATIONS * object.spread.deviation_m(bearing_rad);
        let bearing_gate_rad = params.radar_bearing_rad + math::atan2(half_m, range_m);
        let by_range = (self.range_m - range_m).abs() / range_gate_m;
        let by_bearing = angle_between(self.bearing_rad, bearing_rad).abs() / bearing_gate_rad;
        (by_range <= 1.0 && by_bearing <= 1.0).then(|| math::hypot(by_range, by_bearing))
    }

    /// Gives the object its speed and, if its distance is a guess, the distance of the nearest of the echoes within its
    /// length that move alike: the strongest may come from its far end.
    fn apply_to(&self, object: &mut Object, own: &[Self], radar: Pose2<Ego>, params: &Params) {
        object.found.radial_speed_mps = Some(self.speed_mps);
        let (bearing_rad, _) = polar(object.found.pose.point() - radar.point());
        let Pose2 { heading_rad, .. } = object.found.pose;
        if self.speed_mps.abs() > MOVES_MPS {
            object.found.score += MOVING_SHARE * (1.0 - object.found.score);
            if object.found.kind == ActorKind::Static {
                complete(object, bearing_rad);
            }
        }
        if !object.is_guessed || object.spread.deviation_m(bearing_rad) <= params.radar_noise_m {
            return;
        }
        // The bearing stays the camera's. The echo comes from the side that faces the radar; the extent of the body
        // behind it is as uncertain as the size.
        let half_m = half_along_m(object.found.extent, heading_rad - bearing_rad);
        let is_own = |echo: &&Self| {
            (echo.speed_mps - self.speed_mps).abs() < ALIKE_MPS
                && self.range_m - echo.range_m < 2.0 * half_m + params.radar_noise_m
        };
        let nearest_m = own.iter().filter(is_own).map(|echo| echo.range_m).fold(self.range_m, f64::min);
        let across_m = object.spread.deviation_m(bearing_rad + core::f64::consts::FRAC_PI_2);
        let way = Vector2::from_heading(bearing_rad) * (nearest_m + half_m);
        let at: Point2<Ego> = radar.point() + way;
        object.found.pose = Pose2::new(at.x_m, at.y_m, heading_rad);
        object.spread = Spread::along(bearing_rad, params.radar_noise_m + SIZE_SHARE * half_m, across_m);
    }
}

/// Makes a moving object of no class a vehicle, of which it is the visible part.
fn complete(object: &mut Object, bearing_rad: f64) {
    let Pose2 { heading_rad, .. } = object.found.pose;
    let seen_m = half_along_m(object.found.extent, heading_rad - bearing_rad);
    object.found.kind = ActorKind::Car;
    object.found.extent.length_m = object.found.extent.length_m.max(CAR_M[0]);
    object.found.extent.width_m = object.found.extent.width_m.max(CAR_M[1]);
    let hidden_m = half_along_m(object.found.extent, heading_rad - bearing_rad) - seen_m;
    let at: Point2<Ego> = object.found.pose.point() + Vector2::from_heading(bearing_rad) * hidden_m;
    object.found.pose = Pose2::new(at.x_m, at.y_m, heading_rad);
    object.spread = object.spread.grown(SIZE_SHARE * hidden_m);
}

/// Half of the larger projection of an outline's sides on a line of sight at this angle from its heading, metres.
fn half_along_m(extent: Extent, off_rad: f64) -> f64 {
    let (sin, cos) = math::sin_cos(off_rad);
    0.5 * (extent.length_m * cos.abs()).max(extent.width_m * sin.abs())
}
