//! Ends at which a nearer object hides the rest of a cluster.

use core::f32::consts::TAU;

use super::points::Point;

/// Sectors of the horizon, 0.35 degrees each: about the width between two columns of a sweep.
const SECTORS: usize = 1024;
/// Sectors beyond the end of a cluster that are searched for a nearer object.
const BESIDE: i32 = 2;
/// Height above the ground from which a point hides others, metres.
const HIDES_FROM_M: f32 = 0.4;
/// Distance by which an object is nearer than the end that it hides, metres.
const NEARER_M: f32 = 0.5;

/// Distance to the nearest object in each direction of a sweep.
#[derive(Clone, Debug)]
pub(super) struct Skyline {
    sensor: [f32; 2],
    nearest_m: Vec<f32>,
}

impl Default for Skyline {
    fn default() -> Self {
        Self { sensor: [0.0; 2], nearest_m: vec![f32::INFINITY; SECTORS] }
    }
}

impl Skyline {
    /// Takes the points of a sweep with their heights above the ground.
    pub(super) fn take(&mut self, sensor: [f32; 2], places: &[Point], over_m: &[f32]) {
        self.sensor = sensor;
        self.nearest_m.fill(f32::INFINITY);
        for (&[x, y, _], _) in places.iter().zip(over_m).filter(|(_, over)| **over > HIDES_FROM_M) {
            let (sector, range_m) = self.toward([x, y]);
            let nearest_m = &mut self.nearest_m[sector.rem_euclid(SECTORS as i32) as usize];
            *nearest_m = nearest_m.min(range_m);
        }
    }

    /// Place of the sensor of the sweep.
    pub(super) fn sensor(&self) -> [f32; 2] {
        self.sensor
    }

    /// True where the left and the right end of a cluster, as seen from the sensor, are at a nearer object.
    pub(super) fn hides(&self, points: &[[f32; 4]]) -> [bool; 2] {
        let Some(&[x, y, ..]) = points.first() else { return [false; 2] };
        let (first, first_m) = self.toward([x, y]);
        let half = SECTORS as i32 / 2;
        // Ends: sector relative to that of the first point, and distance.
        let (mut left, mut right) = ((0, first_m), (0, first_m));
        for &[x, y, ..] in points {
            let (sector, range_m) = self.toward([x, y]);
            let off = (sector - first + half).rem_euclid(SECTORS as i32) - half;
            if off > left.0 {
                left = (off, range_m);
            }
            if off < right.0 {
                right = (off, range_m);
            }
        }
        let is_nearer = |off: i32, range_m: f32| {
            self.nearest_m[(first + off).rem_euclid(SECTORS as i32) as usize] < range_m - NEARER_M
        };
        [
            (1..=BESIDE).any(|k| is_nearer(left.0 + k, left.1)),
            (1..=BESIDE).any(|k| is_nearer(right.0 - k, right.1)),
        ]
    }

    /// Sector and distance of a place.
    fn toward(&self, [x, y]: [f32; 2]) -> (i32, f32) {
        let [dx, dy] = [x - self.sensor[0], y - self.sensor[1]];
        ((libm::atan2f(dy, dx) * (SECTORS as f32 / TAU)).floor() as i32, libm::hypotf(dx, dy))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Points of a wall across the road, 0.1 m apart.
    fn wall(x: f32, [from, to]: [f32; 2]) -> Vec<Point> {
        (0..=((to - from) * 10.0) as i32).map(|k| [x, from + 0.1 * k as f32, 1.0]).collect()
    }

    #[test]
    fn ends_beside_a_nearer_object_are_hidden() {
        let (truck, person) = (wall(10.0, [-4.0, -1.85]), wall(15.0, [-2.9, -2.6]));
        let places = [truck.clone(), person.clone()].concat();
        let mut skyline = Skyline::default();
        skyline.take([1.0, 0.0], &places, &vec![1.0; places.len()]);
        let points = |of: &[Point]| of.iter().map(|[x, y, z]| [*x, *y, *z, 1.0]).collect::<Vec<_>>();
        assert_eq!(skyline.hides(&points(&person)), [false, true], "beside the truck");
        assert_eq!(skyline.hides(&points(&truck)), [false, false], "the truck is nearer");
        skyline.take([1.0, 0.0], &places, &vec![0.1; places.len()]);
        assert_eq!(skyline.hides(&points(&person)), [false, false], "too low to hide anything");
        // Across the direction in which sectors begin.
        let (near, far) = (wall(-8.0, [0.05, 1.0]), wall(-12.0, [-0.4, 0.0]));
        let behind = [near, far.clone()].concat();
        skyline.take([0.0, 0.0], &behind, &vec![1.0; behind.len()]);
        assert_eq!(skyline.hides(&points(&far)), [false, true], "left and right as seen backwards");
    }
}
