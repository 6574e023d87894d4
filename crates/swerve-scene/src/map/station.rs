//! Cross-sections of lanes.

use swerve_geom::{FrenetPoint, Point2, Pose2};
use swerve_map::{Lane, Side};

/// Largest distance of two cross-sections, metres.
const STEP_M: f64 = 12.0;
/// Largest distance of a border from the straight line between two cross-sections, metres.
const CHORD_M: f64 = 0.02;

/// A cross-section of a lane.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    /// Arc length along the lane, metres.
    pub(super) s_m: f64,
    pose: Pose2,
    /// Distances of the borders, metres.
    left_m: f64,
    right_m: f64,
}

impl Station {
    pub(super) fn new(lane: &Lane, s_m: f64) -> Self {
        let pose = lane.line.at(s_m).pose;
        Self { s_m, pose, left_m: lane.borders.left_m(s_m), right_m: lane.borders.right_m(s_m) }
    }

    /// Point `d_m` metres to the left of the centre line.
    pub(super) fn at(&self, d_m: f64) -> Point2 {
        self.pose.point() + self.pose.direction().left() * d_m
    }

    /// Offset of a border to the left of the centre line, metres.
    pub(super) fn border_m(&self, side: Side) -> f64 {
        match side {
            Side::Left => self.left_m,
            Side::Right => -self.right_m,
        }
    }

    pub(super) fn width_m(&self) -> f64 {
        self.left_m + self.right_m
    }

    /// The same cross-section moved along its direction, metres.
    pub(super) fn moved(self, by_m: f64) -> Self {
        Self { pose: self.pose.ahead(by_m), ..self }
    }
}

/// A lane with cross-sections that follow its borders.
pub(super) struct Strip<'m> {
    pub(super) lane: &'m Lane,
    /// From the begin of the lane to its end.
    pub(super) stations: Vec<Station>,
}

impl<'m> Strip<'m> {
    pub(super) fn new(lane: &'m Lane) -> Self {
        let vertices = lane.line.points().windows(2).scan(0.0, |s_m, two| {
            *s_m += two[0].distance(two[1]);
            Some(*s_m)
        });
        let borders = [lane.borders.left(), lane.borders.right()];
        let of_borders = borders.into_iter().flat_map(|border| border.stations()).map(|one| one.s_m);
        let length_m = lane.line.length();
        let inner = |s_m: &f64| 0.0 < *s_m && *s_m < length_m;
        let mut places: Vec<f64> = vertices.chain(of_borders).filter(inner).chain([0.0, length_m]).collect();
        places.sort_by(f64::total_cmp);
        places.dedup();
        let all: Vec<Station> = places.into_iter().map(|s_m| Station::new(lane, s_m)).collect();
        Self { lane, stations: divided(lane, &thinned(&all), STEP_M) }
    }

    /// Cross-sections from one arc length to another, metres.
    pub(super) fn between(&self, [from_m, to_m]: [f64; 2]) -> Vec<Station> {
        let first = self.stations.partition_point(|station| station.s_m <= from_m + 1e-3);
        let inner = self.stations[first..].iter().take_while(|station| station.s_m < to_m - 1e-3);
        let mut found = vec![Station::new(self.lane, from_m)];
        found.extend(inner);
        found.push(Station::new(self.lane, to_m));
        found
    }

    /// Cross-sections at most `step_m` apart.
    pub(super) fn dense(&self, step_m: f64) -> Vec<Station> {
        divided(self.lane, &self.stations, step_m)
    }

    pub(super) fn point(&self, s_m: f64, d_m: f64) -> Point2 {
        self.lane.line.to_map(FrenetPoint { s_m, d_m })
    }
}

/// Stations, and others between them so that they are at most `step_m` apart.
fn divided(lane: &Lane, stations: &[Station], step_m: f64) -> Vec<Station> {
    let mut found = vec![stations[0]];
    for two in stations.windows(2) {
        let (from_m, length_m) = (two[0].s_m, two[1].s_m - two[0].s_m);
        let steps = (length_m / step_m).ceil().max(1.0) as usize;
        let inner = (1..steps).map(|k| from_m + length_m * (k as f64 / steps as f64));
        found.extend(inner.map(|s_m| Station::new(lane, s_m)));
        found.push(two[1]);
    }
    found
}

/// The first and last station, and as many between them as the borders need.
fn thinned(all: &[Station]) -> Vec<Station> {
    let mut kept = vec![all[0]];
    let mut from = 0;
    while from + 1 < all.len() {
        let is_straight =
            |to: &usize| all[*to].s_m - all[from].s_m <= STEP_M && is_straight(&all[from..=*to]);
        let to = (from + 2..all.len()).take_while(is_straight).last().unwrap_or(from + 1);
        kept.push(all[to]);
        from = to;
    }
    kept
}

/// True if both borders are straight from the first to the last station.
fn is_straight(stations: &[Station]) -> bool {
    let (first, last) = (&stations[0], &stations[stations.len() - 1]);
    [Side::Left, Side::Right].into_iter().all(|side| {
        let point = |station: &Station| station.at(station.border_m(side));
        let (from, chord) = (point(first), point(last) - point(first));
        let off_m = |station: &Station| chord.cross(point(station) - from).abs();
        stations.iter().all(|station| off_m(station) <= CHORD_M * chord.norm().max(CHORD_M))
    })
}
