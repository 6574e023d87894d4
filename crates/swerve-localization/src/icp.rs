//! Point-to-point ICP with a map of points in cubes.

use nalgebra::{Isometry3, Translation3, Vector3};

use crate::eigen;
use crate::eskf::{exp, unit};
use crate::grid::Grid;
use crate::ndt::Matrix6;

/// Map of points: a limited number per cube, with a minimum distance between the points of a cube.
#[derive(Clone, Debug)]
pub struct PointMap {
    grid: Grid<Vec<Vector3<f64>>>,
    per_cube: usize,
    apart_m: f64,
}

impl PointMap {
    /// Creates an empty map of cubes of edge `size_m` with at most `per_cube` points each.
    pub fn new(size_m: f64, per_cube: usize) -> Self {
        let apart_m = size_m / (per_cube.max(1) as f64).sqrt();
        Self { grid: Grid::new(size_m), per_cube, apart_m }
    }

    /// Adds points, in map coordinates, as far as there is room in their cubes.
    pub fn add<'a>(&mut self, points: impl IntoIterator<Item = &'a Vector3<f64>>) {
        let near_m2 = self.apart_m * self.apart_m;
        for point in points {
            let Some(index) = self.grid.index(point.data.0[0]) else { continue };
            let cube = self.grid.entry(index, Vec::new);
            if cube.len() < self.per_cube && cube.iter().all(|other| (other - point).norm_squared() > near_m2)
            {
                cube.push(*point);
            }
        }
    }

    /// Removes cubes farther than `distance_m` from a position.
    pub fn forget_beyond(&mut self, from: &Vector3<f64>, distance_m: f64) {
        self.grid.retain(|_, cube| {
            cube.first().is_some_and(|point| (point - from).norm_squared() < distance_m * distance_m)
        });
    }

    /// Returns true if it has no points.
    pub fn is_empty(&self) -> bool {
        self.grid.cells().is_empty()
    }

    /// Nearest point within `within_m`, which must be at most the edge of a cube, and its squared distance.
    fn nearest(&self, at: &Vector3<f64>, within_m: f64) -> Option<(Vector3<f64>, f64)> {
        let index = self.grid.index(at.data.0[0])?;
        let mut nearest = None;
        let mut least = within_m * within_m;
        for x in -1..=1 {
            for y in -1..=1 {
                for z in -1..=1 {
                    let cube = self.grid.get([index[0] + x, index[1] + y, index[2] + z]);
                    for point in cube.into_iter().flatten() {
                        let distance = (point - at).norm_squared();
                        if distance < least {
                            (nearest, least) = (Some((*point, distance)), distance);
                        }
                    }
                }
            }
        }
        nearest
    }
}

/// Result of a registration.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Fitted {
    /// Transform from the scan's frame to the map's.
    pub map_from_scan: Isometry3<f64>,
    /// Number of iterations.
    pub iterations: u32,
    /// True if the last step was below 1e-4.
    pub converged: bool,
    /// Share of the scan's points with a correspondence.
    pub overlap: f64,
}

/// Registers a scan from an initial pose with map points within `within_m`; the Geman-McClure kernel gives pairs that
/// are `kernel_m` apart a quarter of the weight. `None` with fewer than six correspondences or a singular system.
pub fn align(
    map: &PointMap,
    scan: &[Vector3<f64>],
    guess: &Isometry3<f64>,
    [within_m, kernel_m]: [f64; 2],
    iterations: u32,
) -> Option<Fitted> {
    let mut pose = *guess;
    let mut hits = 0;
    for iteration in 1..=iterations {
        let rotation = pose.rotation.to_rotation_matrix().into_inner();
        let (mut hessian, mut gradient) = (Matrix6::zeros(), nalgebra::SVector::<f64, 6>::zeros());
        hits = 0;
        for point in scan {
            let lever = rotation * point;
            let at = lever + pose.translation.vector;
            let Some((near, distance)) = map.nearest(&at, within_m) else { continue };
            let kernel = kernel_m * kernel_m;
            let weight = kernel * kernel / ((kernel + distance) * (kernel + distance));
            let r = (near - at) * weight;
            let t = lever.cross(&r);
            for i in 0..3 {
                gradient[i] += r[i];
                gradient[3 + i] += t[i];
                hessian[(i, i)] += weight;
            }
            let u = lever * weight;
            // -[lever]× and its square.
            let mixed = [(0, 4, u.z), (0, 5, -u.y), (1, 3, -u.z), (1, 5, u.x), (2, 3, u.y), (2, 4, -u.x)];
            for (i, j, x) in mixed {
                hessian[(i, j)] += x;
                hessian[(j, i)] += x;
            }
            let length = u.dot(&lever);
            for i in 0..3 {
                for j in 0..3 {
                    hessian[(3 + i, 3 + j)] += if i == j { length } else { 0.0 } - u[i] * lever[j];
                }
            }
            hits += 1;
        }
        let step = (hits >= 6).then(|| eigen::solved(&hessian, &gradient)).flatten()?;
        let place = pose.translation.vector + Vector3::new(step[0], step[1], step[2]);
        let turn = Vector3::new(step[3], step[4], step[5]);
        let rotation = exp(&turn) * pose.rotation;
        pose = Isometry3::from_parts(Translation3::from(place), unit(rotation));
        let length = step.iter().map(|x| x * x).sum::<f64>().sqrt();
        if length < 1e-4 {
            return Some(Fitted {
                map_from_scan: pose,
                iterations: iteration,
                converged: true,
                overlap: overlap(hits, scan),
            });
        }
    }
    Some(Fitted { map_from_scan: pose, iterations, converged: false, overlap: overlap(hits, scan) })
}

fn overlap(hits: usize, scan: &[Vector3<f64>]) -> f64 {
    hits as f64 / scan.len().max(1) as f64
}
