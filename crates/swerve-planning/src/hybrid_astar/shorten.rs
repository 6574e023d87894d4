//! Shortens a path of arcs and straights by shortcuts.

use swerve_geom::Pose2;

use super::dubins::{Dubins, Piece, advance};
use super::ground::Ground;
use super::search::{join, length_m};

/// Rounds at most.
const ROUNDS: usize = 4;

/// A round that wins less than this share of the length is the last.
const WORTH_IT: f64 = 1e-3;

/// A pose of the path with the best way to it.
#[derive(Clone, Copy, Debug)]
struct Stop {
    pose: Pose2,
    /// Piece of the old path that leads here from the stop before.
    old: Piece,
    travelled_m: f64,
    /// Stop from which the shortcut comes; none for the old piece.
    from: Option<(u32, Dubins)>,
}

/// Memory, kept between calls.
#[derive(Clone, Debug, Default)]
pub(crate) struct Shortener {
    stops: Vec<Stop>,
    way: Vec<Piece>,
}

impl Shortener {
    /// Replaces stretches of the path from `start` by shortest paths wherever these are free and shorter: the best
    /// choice over all pairs of stops some `spacing_m` apart, by dynamic programming, in a few rounds with other
    /// stops each. The ends stay.
    pub(crate) fn shorten(
        &mut self,
        ground: &Ground<'_>,
        radius_m: f64,
        start: Pose2,
        pieces: &mut Vec<Piece>,
        spacing_m: f64,
    ) {
        for round in 0..ROUNDS {
            let before_m = length_m(pieces);
            // Another spacing each round moves the stops to other places.
            let spacing_m = (spacing_m * (1.0 - 0.17 * round as f64)).max(before_m / 96.0);
            self.place_stops(start, pieces, spacing_m);
            for to in 1..self.stops.len() {
                self.reach(ground, radius_m, to);
            }
            self.read_back(pieces);
            if length_m(pieces) > before_m * (1.0 - WORTH_IT) {
                break;
            }
        }
    }

    fn place_stops(&mut self, start: Pose2, pieces: &[Piece], spacing_m: f64) {
        self.stops.clear();
        let nothing = Piece { curvature_1pm: 0.0, length_m: 0.0 };
        self.stops.push(Stop { pose: start, old: nothing, travelled_m: 0.0, from: None });
        let mut pose = start;
        for piece in pieces {
            let n = (piece.length_m / spacing_m).ceil().max(1.0);
            let old = Piece { length_m: piece.length_m / n, ..*piece };
            for _ in 0..n as usize {
                pose = advance(pose, old.curvature_1pm, old.length_m);
                self.stops.push(Stop { pose, old, travelled_m: f64::INFINITY, from: None });
            }
        }
    }

    /// Finds the shortest way to stop `to` over all stops before it.
    fn reach(&mut self, ground: &Ground<'_>, radius_m: f64, to: usize) {
        let Stop { pose, old, .. } = self.stops[to];
        let mut best_m = self.stops[to - 1].travelled_m + old.length_m;
        let mut best = None;
        for (i, stop) in self.stops[..to].iter().enumerate() {
            let straight_m = stop.pose.point().distance(pose.point());
            if stop.travelled_m + straight_m >= best_m - 1e-6 {
                continue;
            }
            let path = Dubins::shortest(stop.pose, pose, radius_m);
            let whole_m = stop.travelled_m + path.length();
            if whole_m < best_m - 1e-6 && ground.path_free(stop.pose, &path, stop.travelled_m) {
                best_m = whole_m;
                best = Some((i as u32, path));
            }
        }
        self.stops[to].travelled_m = best_m;
        self.stops[to].from = best;
    }

    fn read_back(&mut self, pieces: &mut Vec<Piece>) {
        self.way.clear();
        let mut at = self.stops.len() - 1;
        while at > 0 {
            match self.stops[at].from {
                Some((from, path)) => {
                    self.way.extend(path.pieces.iter().rev());
                    at = from as usize;
                }
                None => {
                    self.way.push(self.stops[at].old);
                    at -= 1;
                }
            }
        }
        pieces.clear();
        pieces.extend(self.way.iter().rev());
        join(pieces);
    }
}
