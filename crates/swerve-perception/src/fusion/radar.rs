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

/// Radial speed above which an object moves, m/s: several standard deviations of an echo's.
const MOVES_MPS: f64 = 1.5;

/// Distance gate of an echo, in standard deviations of the object's distance.
const DEVIATIONS: f64 = 3.0;

impl Echoes<'_> {
    /// Assigns each object the speed of its strongest echo, and objects with a guessed distance that echo's distance.
    /// An echo belongs to the nearest object whose gate contains it; objects with a measured distance take precedence,
    /// since the gate of a guessed distance also contains the echoes of its neighbours.
    pub(super) fn add_to(&self, objects: &mut [Object], ego: Pose2<Map>, params: &Params) {
        if !self.ego.is_plausible() {
            return;
        }
        let (radar, _) = moved((self.ego_from_radar, Spread::along(0.0, 0.0, 0.0)), self.ego.pose, ego);
        let mut strongest: Vec<Option<Echo>> = objects.iter().map(|_| None).collect();
        for echo in self.echoes(radar) {
            let near = objects
                .iter()
                .enumerate()
                .filter_map(|(k, object)| Some((k, echo.off(object, radar, params)?)));
            let rank = |k: usize| objects[k].is_guessed;
            let best = near.min_by(|a, b| rank(a.0).cmp(&rank(b.0)).then(a.1.total_cmp(&b.1)));
            let Some((k, _)) = best else { continue };
            if strongest[k].as_ref().is_none_or(|known| echo.snr_db > known.snr_db) {
                strongest[k] = Some(echo);
            }
        }
        for (object, echo) in objects.iter_mut().zip(strongest) {
            if let Some(echo) = echo {
                echo.tell(object, radar, params);
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
        let (bearing_rad, range_m) = polar(object.found.pose.point() - radar.point());
        let half_m = 0.5 * object.found.extent.length_m.max(object.found.extent.width_m);
        let range_gate_m =
            params.radar_range_m + half_m + DEVIATIONS * object.spread.deviation_m(bearing_rad);
        let bearing_gate_rad = params.radar_bearing_rad + math::atan2(half_m, range_m);
        let by_range = (self.range_m - range_m).abs() / range_gate_m;
        let by_bearing = angle_between(self.bearing_rad, bearing_rad).abs() / bearing_gate_rad;
        (by_range <= 1.0 && by_bearing <= 1.0).then(|| math::hypot(by_range, by_bearing))
    }

    fn tell(&self, object: &mut Object, radar: Pose2<Ego>, params: &Params) {
        object.found.radial_speed_mps = Some(self.speed_mps);
        // An object of no class that moves is no static one.
        if object.found.kind == ActorKind::Static && self.speed_mps.abs() > MOVES_MPS {
            object.found.kind = ActorKind::Car;
        }
        let (bearing_rad, _) = polar(object.found.pose.point() - radar.point());
        if !object.is_guessed || object.spread.deviation_m(bearing_rad) <= params.radar_noise_m {
            return;
        }
        // The bearing stays the camera's. The echo comes from the side that faces the radar; the extent of the body
        // behind it is as uncertain as the size.
        let Pose2 { heading_rad, .. } = object.found.pose;
        let (sin, cos) = math::sin_cos(heading_rad - bearing_rad);
        let Extent { length_m, width_m, .. } = object.found.extent;
        let half_m = 0.5 * (length_m * cos.abs()).max(width_m * sin.abs());
        let range_m = self.range_m + half_m;
        let across_m = object.spread.deviation_m(bearing_rad + core::f64::consts::FRAC_PI_2);
        let way = Vector2::from_heading(bearing_rad) * range_m;
        let at: Point2<Ego> = radar.point() + way;
        object.found.pose = Pose2::new(at.x_m, at.y_m, heading_rad);
        object.spread = Spread::along(bearing_rad, params.radar_noise_m + SIZE_SHARE * half_m, across_m);
    }
}
