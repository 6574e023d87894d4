//! Localization of a lidar on a map, scan by scan, from a rough initial pose or a global search.
//!
//! A scan is deskewed by the motion from wheels and gyroscopes, and matched from the pose that they predict.
//! Initially, and after several scans without a match, poses are sampled around the guess, and the most likely ones
//! are refined.

use nalgebra::{Isometry3, Vector3};
use swerve_core::Rng;

use crate::downsampled;
use crate::eskf::{exp, unit};
use crate::map_file::MapFile;
use crate::ndt::{self, Limits, Matched};
use crate::sweep::Sweep;
use crate::voxels::{VoxelMap, coarser};

/// Edge of the cubes to which a scan is downsampled, metres, and largest number of points after that.
const THIN_M: f64 = 1.0;
const POINTS_MAX: usize = 20_000;
/// Smallest number of points of a valid scan.
const POINTS_MIN: usize = 50;
/// Number of points by which sampled poses are compared.
const FEW: usize = 400;
/// Largest number of sampled poses that are refined.
const CLIMBED: usize = 12;
/// Minimum distance between these poses, metres or radians.
const APART: [f64; 2] = [0.7, 0.15];
/// Acceptance of a match: smallest share of points on surfaces of the map, and their smallest mean likelihood.
const OVERLAP_MIN: f64 = 0.6;
const LIKELIHOOD_MIN: f64 = 0.3;
/// Largest distance of a match from the prediction, metres and radians; farther ones are at similar-looking places.
const TRUSTED: [f64; 2] = [1.0, 0.1];
/// Consecutive scans without a match after which poses are sampled again.
const PATIENCE: u32 = 5;
/// Standard deviations of that search, metres and radians.
const ASTRAY: [f64; 2] = [1.5, 0.1];

/// A prior pose of a lidar with its uncertainty.
#[derive(Clone, Copy, PartialEq, Debug)]
pub struct Guess {
    /// Transform from the lidar's frame to the map's.
    pub map_from_lidar: Isometry3<f64>,
    /// Standard deviation of the position east and north, metres.
    pub sigma_m: f64,
    /// Standard deviation of the heading, radians; from 2 on, headings are sampled uniformly.
    pub sigma_rad: f64,
    /// Number of sampled poses.
    pub particles: u32,
}

/// Tracks a lidar on a map.
#[derive(Clone, Debug)]
pub struct Matcher {
    /// The map at several resolutions, the coarsest first.
    levels: [VoxelMap; 3],
    seed: u64,
    at: Guess,
    searches: i64,
    /// Consecutive scans without a match; `None` before the first match.
    missed: Option<u32>,
}

impl Matcher {
    /// Creates a matcher that first searches around a guess.
    pub fn new(map: &MapFile, seed: u64, guess: Guess) -> Self {
        let level = |factor: i32| {
            let resolution_m = map.resolution_m * f64::from(factor);
            VoxelMap::new(resolution_m, &coarser(map.voxels(), map.resolution_m, factor))
        };
        Self { levels: [level(4), level(2), level(1)], seed, at: guess, searches: 0, missed: None }
    }

    /// Resets the matcher: with the next scan it searches around the guess, as a new one does.
    pub fn begin_at(&mut self, guess: Guess) {
        (self.at, self.searches, self.missed) = (guess, 0, None);
    }

    /// Sets a pose from another source: with the next scan the matcher searches there, with the standard deviations
    /// of the prior.
    pub fn suppose_at(&mut self, prior: Guess) {
        (self.at, self.missed) = (prior, None);
    }

    /// Latest matched or predicted pose.
    pub fn pose(&self) -> Isometry3<f64> {
        self.at.map_from_lidar
    }

    /// Returns true if one of the last scans matched.
    pub fn is_found(&self) -> bool {
        self.missed.is_some_and(|turns| turns < PATIENCE)
    }

    /// Processes a scan of points in the lidar's frame at the instant of each, with that instant as a share of the
    /// scan from its end, -1 to 0. `over_turn` is the motion over the scan, `since_last` the motion since the end of
    /// the previous scan. Returns `None` without a match; the pose is then the predicted one.
    pub fn take(
        &mut self,
        points: &[(Vector3<f64>, f64)],
        over_turn: &Sweep,
        since_last: &Isometry3<f64>,
    ) -> Option<Matched> {
        let mut scan = downsampled(&over_turn.straightened(points), THIN_M);
        if scan.len() > POINTS_MAX {
            let every = scan.len().div_ceil(POINTS_MAX);
            scan = scan.into_iter().step_by(every).collect();
        }
        self.at.map_from_lidar = sound(self.at.map_from_lidar * since_last)?;
        let found = if scan.len() < POINTS_MIN { None } else { self.matched(&scan) };
        match &found {
            Some(found) => {
                self.at.map_from_lidar = found.map_from_scan;
                self.missed = Some(0);
            }
            None => self.missed = self.missed.map(|turns| turns.saturating_add(1)),
        }
        found
    }

    fn matched(&mut self, scan: &[Vector3<f64>]) -> Option<Matched> {
        let guess = self.at.map_from_lidar;
        if self.is_found() {
            let near = |found: &Matched| {
                let off = guess.inverse() * found.map_from_scan;
                off.translation.vector.norm() < TRUSTED[0] && off.rotation.vector().norm() < 0.5 * TRUSTED[1]
            };
            let [_, middle, fine] = &self.levels;
            // Most scans match at the predicted pose: the fine map alone suffices.
            let at_once = ndt::align(&[fine], scan, &guess, &Limits::default());
            let found = at_once.filter(is_match).filter(near);
            return found.or_else(|| {
                let again = ndt::align(&[middle, fine], scan, &guess, &Limits::default());
                again.filter(is_match).filter(near)
            });
        }
        let again = self.missed.map(|turns| f64::from(turns - PATIENCE + 1).sqrt());
        let around = again.map_or(self.at, |grown| Guess {
            sigma_m: ASTRAY[0] * grown,
            sigma_rad: ASTRAY[1] * grown.min(10.0),
            ..self.at
        });
        self.searches += 1;
        let mut rng = Rng::keyed(self.seed, "poses of a lidar", &[self.searches]);
        search(&self.levels, scan, &around, &mut rng).filter(is_match)
    }
}

fn is_match(found: &Matched) -> bool {
    found.overlap >= OVERLAP_MIN && found.likelihood >= LIKELIHOOD_MIN
}

/// Pose with a normalised rotation; `None` if it is not finite.
fn sound(pose: Isometry3<f64>) -> Option<Isometry3<f64>> {
    let rotation = unit(pose.rotation);
    let numbers = pose.translation.vector.iter().chain(rotation.coords.iter());
    numbers.copied().all(f64::is_finite).then(|| Isometry3::from_parts(pose.translation, rotation))
}

fn are_near(a: &Isometry3<f64>, b: &Isometry3<f64>) -> bool {
    let off = a.inverse() * b;
    off.translation.vector.norm() < APART[0] && off.rotation.vector().norm() < 0.5 * APART[1]
}

/// Best match of a scan from poses sampled around a guess, the guess included.
fn search(levels: &[VoxelMap; 3], scan: &[Vector3<f64>], around: &Guess, rng: &mut Rng) -> Option<Matched> {
    let [coarse, middle, fine] = levels;
    let few: Vec<_> = scan.iter().step_by(scan.len().div_ceil(FEW).max(1)).copied().collect();
    let mut drawn = vec![around.map_from_lidar];
    for _ in 0..around.particles {
        let (east, north) = (around.sigma_m * rng.normal(), around.sigma_m * rng.normal());
        let any = core::f64::consts::PI;
        let turn =
            if around.sigma_rad < 2.0 { around.sigma_rad * rng.normal() } else { rng.uniform(-any, any) };
        let mut pose = around.map_from_lidar;
        pose.translation.vector += Vector3::new(east, north, 0.0);
        pose.rotation = exp(&Vector3::new(0.0, 0.0, turn)) * pose.rotation;
        drawn.push(pose);
    }
    let score = |pose: &Isometry3<f64>| ndt::likelihood(middle, &few, pose);
    let mut scored: Vec<_> = drawn.iter().map(|pose| (score(pose), pose)).collect();
    scored.sort_by(|a, b| b.0.total_cmp(&a.0));
    let mut chosen: Vec<&Isometry3<f64>> = Vec::new();
    for (_, pose) in &scored {
        // Neighbouring poses converge to the same place.
        if chosen.len() < CLIMBED && chosen.iter().all(|other| !are_near(other, pose)) {
            chosen.push(pose);
        }
    }
    let climbed = chosen.into_iter().filter_map(|pose| {
        // A subset of the points finds the place, and all points refine it.
        let near = ndt::align(&[coarse, middle, fine], &few, pose, &Limits::default())?;
        ndt::align(&[fine], scan, &near.map_from_scan, &Limits::default())
    });
    climbed.max_by(|a, b| (a.likelihood * a.overlap).total_cmp(&(b.likelihood * b.overlap)))
}

#[cfg(test)]
mod tests;
