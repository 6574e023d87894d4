//! Points of a sweep in the ego frame at one instant.

use swerve_geom::math;

use super::scan::Scan;

/// Point in the ego frame at the sweep's stamp, metres: forward, left, up.
pub type Point = [f32; 3];

/// Largest time offset of a point from the stamp, seconds; others are ignored.
const OFFSET_MAX_S: f32 = 1.0;
/// Height range of points relative to the ground under the ego, metres; others are ignored.
const Z_M: [f32; 2] = [-3.0, 8.0];

/// Collects the points within `reach_m` of the ego's origin along each axis and not on the ego, compensated for the
/// ego's motion during the sweep.
///
/// The motion is an arc at the measured speed and yaw rate. If the arrays have different lengths, only the points in
/// all of them are used; non-finite points are ignored.
pub fn in_ego_frame(scan: &Scan<'_>, reach_m: f32, points: &mut Vec<Point>) {
    points.clear();
    let cloud = scan.cloud;
    let [rear, front, side] = scan.own_m.map(|m| m as f32);
    let (mut offset_s, mut still) = (f32::NAN, Still::default());
    let places = cloud.x_m.iter().zip(cloud.y_m.iter()).zip(cloud.z_m.iter());
    for (((x, y), z), at_s) in places.zip(cloud.time_offset_s.iter()) {
        if *at_s != offset_s {
            (offset_s, still) = (*at_s, Still::new(scan, f64::from(*at_s)));
        }
        let [x, y, z] = still.place([*x, *y, *z]);
        let is_near = x.abs() < reach_m && y.abs() < reach_m && Z_M[0] < z && z < Z_M[1];
        let is_own = rear < x && x < front && y.abs() < side;
        if is_near && !is_own && at_s.abs() <= OFFSET_MAX_S {
            points.push([x, y, z]);
        }
    }
}

/// Transform from the sensor at one instant to the ego at the stamp: rows of a rotation, and a translation.
#[derive(Default)]
struct Still([[f32; 4]; 3]);

impl Still {
    fn new(scan: &Scan<'_>, since_s: f64) -> Self {
        let turn_rad = scan.ego.yaw_rate_radps * since_s;
        let way_m = scan.ego.speed_mps * since_s;
        let (sin, cos) = math::sin_cos(turn_rad);
        let (half_sin, half_cos) = math::sin_cos(0.5 * turn_rad);
        let mount = scan.ego_from_lidar.rotation().to_rotation_matrix();
        let (m, at) = (mount.matrix(), scan.ego_from_lidar.origin().coords);
        let column = |x: f64, y: f64, z: f64| [cos * x - sin * y, sin * x + cos * y, z];
        let turned = [0, 1, 2].map(|k| column(m[(0, k)], m[(1, k)], m[(2, k)]));
        let moved = column(at.x, at.y, at.z);
        let way = [way_m * half_cos, way_m * half_sin, 0.0];
        Self([0, 1, 2].map(|row| {
            [turned[0][row], turned[1][row], turned[2][row], moved[row] + way[row]].map(|x| x as f32)
        }))
    }

    fn place(&self, [x, y, z]: [f32; 3]) -> Point {
        self.0.map(|[a, b, c, d]| a * x + b * y + c * z + d)
    }
}

/// Sector index of a direction from the ego's origin, of nearly equal widths, without an arc tangent.
pub(super) fn sector(x: f32, y: f32, sectors: usize) -> usize {
    let sum = x.abs() + y.abs();
    let part = if sum > 0.0 { y / sum } else { 0.0 };
    let turn = if x >= 0.0 { 1.0 + part } else { 3.0 - part };
    ((turn * 0.25 * sectors as f32) as usize).min(sectors - 1)
}
