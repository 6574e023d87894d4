//! Places at which lines across the road meet lanes.

use swerve_geom::Point2;
use swerve_map::{Lane, LaneId, Map};

/// A line may end this far beside the centre line that it stops, metres.
const BESIDE_M: f64 = 0.5;

/// Most pieces of a line across the road; of longer ones, only the ends count.
const PIECES_MAX: usize = 32;

/// Lanes among `lanes` whose centre line a line crosses, and the arc length there. If there are none, all of them: at the
/// place beside the middle of the line.
pub(super) fn met(map: &Map, lanes: &[LaneId], line: &[Point2]) -> Vec<(LaneId, f64)> {
    let ([first, ..], [.., last]) = (line, line) else { return Vec::new() };
    let ends = [*first, *last];
    let line = if line.len() > PIECES_MAX { &ends } else { line };
    let found = || lanes.iter().filter_map(|lane| map.lane(*lane));
    let crossed: Vec<_> = found().filter_map(|lane| Some((lane.id, crossing_m(lane, line)?))).collect();
    if !crossed.is_empty() {
        return crossed;
    }
    let middle = *first + (*last - *first) * 0.5;
    found().map(|lane| (lane.id, lane.line.project(middle).s_m.clamp(0.0, lane.line.length()))).collect()
}

/// Arc length at which a line crosses the centre line of a lane, or ends beside it; the first one, metres.
fn crossing_m(lane: &Lane, line: &[Point2]) -> Option<f64> {
    let mut begin_m = 0.0;
    for two in lane.line.points().windows(2) {
        let along = two[1] - two[0];
        let length_m = along.norm();
        for other in line.windows(2) {
            let across = other[1] - other[0];
            let spread = along.cross(across);
            let reach = BESIDE_M / across.norm().max(1e-9);
            if spread.abs() < 1e-9 {
                continue;
            }
            let off = other[0] - two[0];
            let (t, u) = (off.cross(across) / spread, off.cross(along) / spread);
            if (0.0..=1.0).contains(&t) && (-reach..=1.0 + reach).contains(&u) {
                return Some((begin_m + t * length_m).min(lane.line.length()));
            }
        }
        begin_m += length_m;
    }
    None
}
