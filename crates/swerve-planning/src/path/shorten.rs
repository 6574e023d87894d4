//! Shortens a path of arcs and straights with shortcuts.

use swerve_geom::Pose2;

use super::dubins::Dubins;
use super::ground::Ground;
use super::piece::{Piece, advance, join};

/// Radii tried in each round, in units of the smallest: the first rounds straighten, the last widens.
const ROUNDS: [&[f64]; 3] = [&[1.0], &[1.0], &[1.0, 2.0, 4.0]];

/// Largest number of stations, excluding ends of pieces.
const STATIONS_MAX: f64 = 64.0;

/// Relative extra cost of a metre at the smallest radius, decreasing with the square of the radius: of two paths of
/// about the same length the one that is easier to steer wins.
const TURN_COST: f64 = 0.06;

/// A pose of the path with the best path to it.
#[derive(Clone, Copy, Debug)]
struct Station {
    pose: Pose2,
    /// Piece of the old path that leads here from the previous station.
    old: Piece,
    /// Length of the best path to here, metres.
    travelled_m: f64,
    /// Cost of the best path to here, with the extra cost of turns.
    cost_m: f64,
    /// Station at which the shortcut starts; `None` for the old piece.
    from: Option<(u32, Dubins)>,
}

/// Storage, reused between calls.
#[derive(Clone, Debug, Default)]
pub struct Shortener {
    stations: Vec<Station>,
    way: Vec<Piece>,
}

impl Shortener {
    /// Replaces parts of the path from `start` by shortest paths where these are free and shorter: the best choice over
    /// all pairs of stations about `spacing_m` apart, by dynamic programming, in a few rounds with different stations.
    /// The ends are unchanged.
    pub fn shorten(
        &mut self,
        ground: &Ground<'_>,
        radius_m: f64,
        start: Pose2,
        pieces: &mut Vec<Piece>,
        spacing_m: f64,
    ) {
        for (round, radii) in ROUNDS.into_iter().enumerate() {
            // Each round uses another spacing, which moves the stations.
            let whole_m: f64 = pieces.iter().map(|p| p.length_m).sum();
            let spacing_m = (spacing_m * (1.0 - 0.17 * round as f64)).max(whole_m / STATIONS_MAX);
            self.place_stations(start, pieces, spacing_m);
            for to in 1..self.stations.len() {
                self.reach(ground, radius_m, radii, to);
            }
            self.read_back(pieces);
        }
    }

    fn place_stations(&mut self, start: Pose2, pieces: &[Piece], spacing_m: f64) {
        self.stations.clear();
        let nothing = Piece { curvature_1pm: 0.0, length_m: 0.0 };
        self.stations.push(Station { pose: start, old: nothing, travelled_m: 0.0, cost_m: 0.0, from: None });
        let mut pose = start;
        for piece in pieces {
            let n = (piece.length_m / spacing_m).ceil().max(1.0);
            let old = Piece { length_m: piece.length_m / n, ..*piece };
            for _ in 0..n as usize {
                pose = advance(pose, old.curvature_1pm, old.length_m);
                self.stations.push(Station { pose, old, travelled_m: 0.0, cost_m: 0.0, from: None });
            }
        }
    }

    /// Finds the shortest path to station `to` over all stations before it.
    fn reach(&mut self, ground: &Ground<'_>, radius_m: f64, radii: &[f64], to: usize) {
        let before = self.stations[to - 1];
        let mut best = self.stations[to];
        best.travelled_m = before.travelled_m + best.old.length_m;
        best.cost_m = before.cost_m + cost_m(&best.old, radius_m);
        for (i, station) in self.stations[..to].iter().enumerate() {
            let straight_m = station.pose.point().distance(best.pose.point());
            if station.cost_m + straight_m >= best.cost_m - 1e-6 {
                continue;
            }
            for &scale in radii {
                let path = Dubins::shortest(station.pose, best.pose, radius_m * scale);
                let whole_m = station.cost_m + path.pieces.iter().map(|p| cost_m(p, radius_m)).sum::<f64>();
                if whole_m < best.cost_m - 1e-6 && ground.path_free(station.pose, &path, station.travelled_m)
                {
                    best.cost_m = whole_m;
                    best.travelled_m = station.travelled_m + path.length();
                    best.from = Some((i as u32, path));
                }
            }
        }
        self.stations[to] = best;
    }

    fn read_back(&mut self, pieces: &mut Vec<Piece>) {
        self.way.clear();
        let mut at = self.stations.len() - 1;
        while at > 0 {
            match self.stations[at].from {
                Some((from, path)) => {
                    self.way.extend(path.pieces.iter().rev());
                    at = from as usize;
                }
                None => {
                    self.way.push(self.stations[at].old);
                    at -= 1;
                }
            }
        }
        pieces.clear();
        pieces.extend(self.way.iter().rev());
        join(pieces);
    }
}

/// Cost: length with the extra cost of turns, metres.
fn cost_m(piece: &Piece, radius_m: f64) -> f64 {
    let share = piece.curvature_1pm * radius_m;
    piece.length_m * (1.0 + TURN_COST * share * share)
}
