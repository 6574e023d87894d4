//! Registration of a recording on a map, by the driven paths.
//!
//! Each of CommonRoad's scenarios has its own origin. Every position of a moving track votes for all translations
//! that bring it onto a lane of its direction (Hough transform); the best are then fitted to the centre lines of the
//! lanes.

use std::sync::Arc;

use swerve_geom::{Point2, Vector2, angle_between};
use swerve_map::Map;

use super::Recording;

/// Largest translation along each axis in either direction, and size of the cells, metres.
const REACH_M: f64 = 200.0;
const CELL_M: f64 = 2.0;
/// Number of cells along one axis.
const CELLS: usize = 201;
/// Largest number of positions for voting, and for the fit.
const VOTES: usize = 400;
const FITS: usize = 120;
/// Largest angle to the direction of a lane, radians.
const ALONG_RAD: f64 = 0.25;
/// Number of translations that are fitted, and iterations of each fit.
const TRIED: usize = 4;
const ROUNDS: usize = 8;

/// A position of a track, and its direction of motion.
type Going = (Point2, f64);

impl Recording {
    /// Moves the recording onto `lanes`. Also returns the share of moving positions that are then near the centre of
    /// a lane of their direction, 0 to 1. `None` if nothing moves, or no lane is within reach.
    pub fn placed(&self, lanes: &Arc<Map>) -> Option<(Self, f64)> {
        let going = self.going();
        let (votes, fits) = (thinned(&going, VOTES), thinned(&going, FITS));
        let fitted = best_cells(&votes, lanes).into_iter().map(|shift| fitted(shift, &fits, lanes));
        let (shift, share) = fitted.fold(None, |best: Option<(Vector2, f64)>, one| match best {
            Some(best) if best.1 >= one.1 => Some(best),
            _ => Some(one),
        })?;
        let mut moved = self.clone();
        let samples = moved.tracks.iter_mut().flat_map(|track| &mut track.samples);
        samples.for_each(|(_, point)| *point = *point + shift);
        moved.lanes = Some(lanes.clone());
        Some((moved, share))
    }

    fn going(&self) -> Vec<Going> {
        let mut going = Vec::new();
        for track in &self.tracks {
            let later = track.samples.iter().skip(5).step_by(5);
            for ((_, from), (_, to)) in track.samples.iter().step_by(5).zip(later) {
                if from.distance(*to) > 1.0 {
                    going.push((*from + (*to - *from) * 0.5, (*to - *from).heading()));
                }
            }
        }
        going
    }
}

/// Selects about `most` of the positions, evenly.
fn thinned(going: &[Going], most: usize) -> Vec<Going> {
    going.iter().step_by(going.len().div_ceil(most).max(1)).copied().collect()
}

/// Translations with the most votes, without neighbours of better ones.
fn best_cells(going: &[Going], lanes: &Map) -> Vec<Vector2> {
    let mut votes = vec![0_u32; CELLS * CELLS];
    let cell = |shift_m: f64| ((shift_m + REACH_M) / CELL_M).round();
    for lane in lanes.lanes() {
        for k in 0..(lane.line.length() / CELL_M).min(1e4) as usize {
            let pose = lane.line.at((k as f64 + 0.5) * CELL_M).pose;
            for (point, heading_rad) in going {
                let (x, y) = (cell(pose.x_m - point.x_m), cell(pose.y_m - point.y_m));
                let is_near = [x, y].iter().all(|at| (0.0..CELLS as f64).contains(at));
                if is_near && angle_between(pose.heading_rad, *heading_rad).abs() < ALONG_RAD {
                    votes[x as usize * CELLS + y as usize] += 1;
                }
            }
        }
    }
    let mut best = Vec::new();
    while best.len() < TRIED {
        let Some((most, count)) = votes.iter().enumerate().max_by_key(|(k, count)| (**count, usize::MAX - k))
        else {
            break;
        };
        if *count == 0 {
            break;
        }
        let (x, y) = (most / CELLS, most % CELLS);
        best.push(Vector2::new(x as f64 * CELL_M - REACH_M, y as f64 * CELL_M - REACH_M));
        for near_x in x.saturating_sub(2)..(x + 3).min(CELLS) {
            for near_y in y.saturating_sub(2)..(y + 3).min(CELLS) {
                votes[near_x * CELLS + near_y] = 0;
            }
        }
    }
    best
}

/// Fits a translation to the centre lines of the lanes by least squares; also returns the share of positions near a
/// centre line.
fn fitted(mut shift: Vector2, going: &[Going], lanes: &Map) -> (Vector2, f64) {
    let mut share = 0.0;
    for round in 0..=ROUNDS {
        // Damped, so that a component along a straight road, which is unobservable, stays as it is.
        let damp = 0.05 * going.len() as f64;
        let ([mut xx, mut xy, mut yy], [mut x, mut y]) = ([damp, 0.0, damp], [0.0; 2]);
        share = 0.0;
        for (point, heading_rad) in going {
            let Some((off_m, left)) = off_middle(*point + shift, *heading_rad, lanes) else { continue };
            let weight = 1.0 / (1.0 + off_m * off_m * off_m * off_m);
            share += weight;
            xx += weight * left.x * left.x;
            xy += weight * left.x * left.y;
            yy += weight * left.y * left.y;
            x -= weight * off_m * left.x;
            y -= weight * off_m * left.y;
        }
        if round < ROUNDS {
            let determinant = xx * yy - xy * xy;
            shift = shift + Vector2::new((yy * x - xy * y) / determinant, (xx * y - xy * x) / determinant);
        }
    }
    (shift, share / going.len().max(1) as f64)
}

/// Offset of a point to the left of the nearest lane of its direction, and the direction of that offset.
fn off_middle(point: Point2, heading_rad: f64, lanes: &Map) -> Option<(f64, Vector2)> {
    let places = lanes.path_places(point).filter_map(|found| {
        let length_m = lanes.lane(found.lane)?.line.length();
        let on = lanes.path_pose(found)?;
        let is_along = angle_between(on.heading_rad, heading_rad).abs() < ALONG_RAD;
        let is_between_ends = (0.0..=length_m).contains(&found.place.s_m);
        (is_along && is_between_ends).then_some((found.place.d_m, on.direction().left()))
    });
    places.min_by(|a, b| a.0.abs().total_cmp(&b.0.abs()))
}

#[cfg(test)]
mod tests;
