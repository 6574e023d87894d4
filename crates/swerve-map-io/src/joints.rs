//! Ends of lanes that the file joins and that are apart: closed where the gap is small, and listed.

use std::collections::BTreeMap;

use swerve_geom::{Point2, Vector2};
use swerve_map::LaneId;

use crate::draft::{Drafts, Joint, joints};
use crate::import::{Gap, JOINED_M};
use crate::strip::Vertex;

/// Largest gap that is closed, metres.
pub(crate) const CLOSED_M: f64 = 0.5;

/// Largest gap that a map accepts, metres: its centre lines keep their ends.
const ACCEPTED_M: f64 = 0.1;

/// Length over which a lane is moved towards its new end, metres; half of a shorter lane.
const BLEND_M: f64 = 10.0;

/// An end of a lane; true for its start.
type End = (LaneId, bool);

/// Moves ends of centre lines together where they are apart, and drops successors that are too far away.
///
/// Ends that joints connect are a group. If a gap in the group is wider than a map accepts, all its ends move to their
/// mean, unless one of them would have to move by more than [`CLOSED_M`].
pub(crate) fn close(drafts: &mut Drafts<'_>, centers: &mut BTreeMap<LaneId, Vec<Vertex>>) -> Vec<Gap> {
    let joints = joints(drafts);
    let place = |centers: &BTreeMap<LaneId, Vec<Vertex>>, (lane, is_start): End| {
        let line = &centers[&lane];
        if is_start { line[0].at } else { line[line.len() - 1].at }
    };
    let gap_m = |centers: &_, joint: &Joint| {
        place(centers, (joint.from, false)).distance(place(centers, (joint.to, true)))
    };
    let near: Vec<(Joint, f64)> = joints.iter().map(|joint| (*joint, gap_m(centers, joint))).collect();
    for group in groups(near.iter().filter(|(_, gap_m)| *gap_m <= CLOSED_M)) {
        if group.widest_m <= ACCEPTED_M {
            continue;
        }
        let places: Vec<Point2> = group.ends.iter().map(|end| place(centers, *end)).collect();
        let off = places.iter().fold(Vector2::new(0.0, 0.0), |sum, at| sum + (*at - places[0]));
        let mean = places[0] + off * (1.0 / places.len() as f64);
        if places.iter().all(|at| at.distance(mean) <= CLOSED_M) {
            for (end, at) in group.ends.iter().zip(&places) {
                centers.entry(end.0).and_modify(|line| shift(line, end.1, mean - *at));
            }
        }
    }
    let mut gaps = Vec::new();
    for (Joint { from, to }, was_m) in near {
        let joined = gap_m(centers, &Joint { from, to }) <= ACCEPTED_M;
        if !joined && let Some(draft) = drafts.get_mut(&from) {
            draft.successors.remove(&to);
        }
        if was_m > JOINED_M {
            let ends =
                format!("lane {} at its end and lane {} at its start", drafts[&from].name, drafts[&to].name);
            gaps.push(Gap { ends, gap_m: was_m, joined });
        }
    }
    gaps
}

/// Ends that are connected by joints, and the widest gap of those.
struct Group {
    ends: Vec<End>,
    widest_m: f64,
}

fn groups<'j>(joints: impl Iterator<Item = &'j (Joint, f64)> + Clone) -> Vec<Group> {
    let mut beside: BTreeMap<End, Vec<(End, f64)>> = BTreeMap::new();
    for (Joint { from, to }, gap_m) in joints {
        let (from, to) = ((*from, false), (*to, true));
        beside.entry(from).or_default().push((to, *gap_m));
        beside.entry(to).or_default().push((from, *gap_m));
    }
    let mut groups = Vec::new();
    while let Some(first) = beside.keys().next().copied() {
        let (mut group, mut open) = (Group { ends: Vec::new(), widest_m: 0.0 }, vec![first]);
        while let Some(end) = open.pop() {
            let Some(others) = beside.remove(&end) else { continue };
            group.ends.push(end);
            for (other, gap_m) in others {
                group.widest_m = f64::max(group.widest_m, gap_m);
                open.push(other);
            }
        }
        group.ends.sort_unstable();
        groups.push(group);
    }
    groups
}

/// Moves an end of a line; vertices up to [`BLEND_M`] away move in proportion.
fn shift(line: &mut [Vertex], is_start: bool, by: Vector2) {
    let length_m: f64 = line.windows(2).map(|two| two[0].at.distance(two[1].at)).sum();
    let reach_m = BLEND_M.min(0.5 * length_m);
    let count = line.len();
    let index = |k: usize| if is_start { k } else { count - 1 - k };
    let mut s_m = 0.0;
    for k in 0..count {
        let last = line[index(k)].at;
        let next = (k + 1 < count).then(|| line[index(k + 1)].at);
        line[index(k)].at = last + by * (1.0 - s_m / reach_m).max(0.0);
        s_m += next.map_or(0.0, |next| next.distance(last));
        if s_m >= reach_m {
            break;
        }
    }
}

#[cfg(test)]
mod tests;
