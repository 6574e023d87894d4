//! Places of conflict zones.

use swerve_geom::{Obb, Point2};

use super::{Meeting, Used, Zone};
use crate::Map;

/// Boxes of which zones are computed: somewhat more than the largest vehicles, metres.
const CAR_M: [f64; 2] = [5.6, 2.2];
const CYCLE_M: [f64; 2] = [2.5, 1.0];
/// Interval of samples, metres.
const SAMPLE_M: f64 = 0.5;
/// Samples farther apart than this are two zones, metres.
const APART_M: f64 = 3.0;
/// Lanes that continue one within this distance have no zones with it, metres: cars there follow each other.
const FOLLOWS_M: f64 = 8.0;

#[derive(Clone, Copy)]
struct Sample {
    s_m: f64,
    body: Obb,
}

/// Zones of each lane, ordered by begin.
pub(super) fn zones(lanes: &[Used<'_>], map: &Map) -> Vec<Vec<Zone>> {
    let samples: Vec<Vec<Sample>> = (0..lanes.len()).map(|k| sampled(lanes, k)).collect();
    let bounds: Vec<[Point2; 2]> = samples.iter().map(|samples| bounds_of(samples)).collect();
    let follows: Vec<Vec<usize>> = (0..lanes.len()).map(|k| following(lanes, k)).collect();
    let mut zones = vec![Vec::new(); lanes.len()];
    for a in 0..lanes.len() {
        for b in a + 1..lanes.len() {
            let is_apart = !near(&bounds[a], &bounds[b]);
            if is_apart || follows[a].contains(&b) || follows[b].contains(&a) || are_beside(lanes, map, a, b)
            {
                continue;
            }
            for [a_m, b_m] in touching(&samples[a], &samples[b], &bounds[b]) {
                let begins = a_m[0] <= 0.0 && b_m[0] <= 0.0;
                let (shift_m, is_fork) = if begins { parting(lanes, a, b) } else { (None, false) };
                let meeting = if is_fork { Meeting::Fork } else { meeting(lanes, [a, b], [a_m, b_m]) };
                let yields = false;
                zones[a].push(Zone { at_m: a_m, other: lanes[b].id, other_m: b_m, meeting, shift_m, yields });
                let shift_m = shift_m.map(|shift_m: f64| -shift_m);
                zones[b].push(Zone { at_m: b_m, other: lanes[a].id, other_m: a_m, meeting, shift_m, yields });
            }
        }
    }
    for zones in &mut zones {
        zones.sort_by(|a, b| a.at_m[0].total_cmp(&b.at_m[0]).then(a.other.cmp(&b.other)));
    }
    zones
}

fn sampled(lanes: &[Used<'_>], k: usize) -> Vec<Sample> {
    let lane = &lanes[k];
    let [length_m, width_m] = if lane.cycling { CYCLE_M } else { CAR_M };
    let steps = (lane.length_m / SAMPLE_M).ceil().max(1.0);
    let at = |n: usize| lane.length_m * n as f64 / steps;
    let places = (0..=steps as usize).map(at);
    let points = lane.line.at_each(places);
    points.map(|at| Sample { s_m: at.s_m, body: Obb::new(at.pose, length_m, width_m) }).collect()
}

fn bounds_of(samples: &[Sample]) -> [Point2; 2] {
    let mut low = Point2::new(f64::INFINITY, f64::INFINITY);
    let mut high = Point2::new(f64::NEG_INFINITY, f64::NEG_INFINITY);
    for Sample { body, .. } in samples {
        let (center, reach_m) = (body.center.point(), body.radius());
        low = Point2::new(low.x_m.min(center.x_m - reach_m), low.y_m.min(center.y_m - reach_m));
        high = Point2::new(high.x_m.max(center.x_m + reach_m), high.y_m.max(center.y_m + reach_m));
    }
    [low, high]
}

fn near(a: &[Point2; 2], b: &[Point2; 2]) -> bool {
    a[0].x_m <= b[1].x_m && b[0].x_m <= a[1].x_m && a[0].y_m <= b[1].y_m && b[0].y_m <= a[1].y_m
}

/// Lanes that are reached from the end of a lane within [`FOLLOWS_M`].
fn following(lanes: &[Used<'_>], k: usize) -> Vec<usize> {
    let mut found = vec![k];
    let mut open = vec![(k, 0.0)];
    while let Some((lane, after_m)) = open.pop() {
        for &next in &lanes[lane].next {
            if !found.contains(&next) {
                found.push(next);
            }
            let end_m = after_m + lanes[next].length_m;
            if end_m < FOLLOWS_M {
                open.push((next, end_m));
            }
        }
    }
    found
}

/// True for lanes that share a border.
fn are_beside(lanes: &[Used<'_>], map: &Map, a: usize, b: usize) -> bool {
    let other = lanes[b].id;
    let lane = map.lane(lanes[a].id);
    lane.is_some_and(|lane| [lane.left, lane.right].iter().flatten().any(|beside| beside.lane == other))
}

/// Stretches of two lanes on which bodies touch.
fn touching(a: &[Sample], b: &[Sample], bounds: &[Point2; 2]) -> Vec<[[f64; 2]; 2]> {
    let mut found: Vec<[[f64; 2]; 2]> = Vec::new();
    for one in a {
        let center = one.body.center.point();
        if !near(&[center, center], &grown(bounds, one.body.radius())) {
            continue;
        }
        for other in b {
            let between = other.body.center.point() - center;
            let reach_m = one.body.radius() + other.body.radius();
            if between.norm_squared() > reach_m * reach_m || !one.body.overlaps(&other.body) {
                continue;
            }
            let is_near = |stretch: &[[f64; 2]; 2]| {
                let within = |[from, to]: [f64; 2], s: f64| from - APART_M <= s && s <= to + APART_M;
                within(stretch[0], one.s_m) && within(stretch[1], other.s_m)
            };
            match found.iter_mut().find(|stretch| is_near(stretch)) {
                Some(stretch) => {
                    for (part, s_m) in stretch.iter_mut().zip([one.s_m, other.s_m]) {
                        *part = [part[0].min(s_m), part[1].max(s_m)];
                    }
                }
                None => found.push([[one.s_m; 2], [other.s_m; 2]]),
            }
        }
    }
    // Between two samples the bodies may touch a little earlier.
    let wider = |[from, to]: [f64; 2]| [from - SAMPLE_M, to + SAMPLE_M];
    found.into_iter().map(|stretch| stretch.map(wider)).collect()
}

fn grown([low, high]: &[Point2; 2], by_m: f64) -> [Point2; 2] {
    [Point2::new(low.x_m - by_m, low.y_m - by_m), Point2::new(high.x_m + by_m, high.y_m + by_m)]
}

/// Lanes before one within [`FOLLOWS_M`], each with its distance, and whether all traffic of the lane comes from it.
fn preceding(lanes: &[Used<'_>], k: usize) -> Vec<(usize, f64, bool)> {
    let mut found: Vec<(usize, f64, bool)> = Vec::new();
    let mut open = vec![(k, 0.0, true)];
    while let Some((lane, after_m, is_only)) = open.pop() {
        let before = &lanes[lane].before;
        let is_only = is_only && before.len() == 1;
        for &before in before {
            if found.iter().any(|known| known.0 == before) {
                continue;
            }
            found.push((before, after_m, is_only));
            let next_m = after_m + lanes[before].length_m;
            if next_m < FOLLOWS_M {
                open.push((before, next_m, is_only));
            }
        }
    }
    found
}

/// The nearest common lane before two lanes: the difference of the distances from it, and whether it is the origin of all
/// their traffic.
fn parting(lanes: &[Used<'_>], a: usize, b: usize) -> (Option<f64>, bool) {
    let (before_a, before_b) = (preceding(lanes, a), preceding(lanes, b));
    let common = before_a.iter().filter_map(|(lane, a_m, a_only)| {
        let (_, b_m, b_only) = before_b.iter().find(|(other, ..)| other == lane)?;
        Some((a_m + b_m, b_m - a_m, *a_only && *b_only))
    });
    let nearest = common.min_by(|a, b| a.0.total_cmp(&b.0));
    nearest.map_or((None, false), |(_, shift_m, is_only)| (Some(shift_m), is_only))
}

fn meeting(lanes: &[Used<'_>], two: [usize; 2], parts_m: [[f64; 2]; 2]) -> Meeting {
    let [a, b] = two.map(|k| &lanes[k]);
    let ends = parts_m.iter().zip([a, b]).all(|(part, lane)| part[1] >= lane.length_m);
    if ends && a.next.iter().any(|next| b.next.contains(next)) { Meeting::Merge } else { Meeting::Cross }
}
