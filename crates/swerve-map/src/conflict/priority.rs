//! Rights of way between lanes with a conflict zone.

use core::f64::consts::PI;

use swerve_geom::angle_between;

use super::{Meeting, Used, Zone};
use crate::{LaneId, Map};

/// Smallest change of heading of a turn, radians.
const TURN_RAD: f64 = 0.5;
/// Most lanes of a way through a junction.
const LANES_MAX: usize = 16;

/// Way through a junction on which a lane is.
struct Passage {
    /// Lanes from the one that leads in to this one.
    lanes: Vec<LaneId>,
    in_rad: f64,
    turn_rad: f64,
    has_sign: bool,
}

/// Sets who yields in each zone.
pub(super) fn assign(lanes: &[Used<'_>], map: &Map, zones: &mut [Vec<Zone>]) {
    let passages: Vec<Passage> = (0..lanes.len()).map(|k| passage(lanes, k)).collect();
    for (own, zones) in passages.iter().zip(zones) {
        for zone in zones.iter_mut().filter(|zone| zone.meeting != Meeting::Fork) {
            let other = lanes.binary_search_by_key(&zone.other, |lane| lane.id);
            zone.yields = other.is_ok_and(|other| yields(map, own, &passages[other]));
        }
    }
}

fn passage(used: &[Used<'_>], k: usize) -> Passage {
    let mut lanes = vec![k];
    while lanes.len() < LANES_MAX {
        let first = lanes[lanes.len() - 1];
        let before = used[first].before.first().filter(|_| used[first].in_junction);
        let Some(&before) = before.filter(|before| !lanes.contains(before)) else { break };
        lanes.push(before);
    }
    let mut last = k;
    for _ in 0..LANES_MAX {
        let next = used[last].next.first().filter(|next| used[**next].in_junction);
        let Some(&next) = next.filter(|_| used[last].in_junction) else { break };
        last = next;
    }
    let entry = &used[lanes[lanes.len() - 1]];
    let in_rad = if lanes.len() > 1 { end_rad(entry) } else { begin_rad(entry) };
    let turn_rad = angle_between(in_rad, end_rad(&used[last]));
    let has_sign = lanes.iter().any(|k| {
        let stops = used[*k].stops.iter();
        let is_entry = used[*k].in_junction;
        // On the lane that leads in, only a sign at its end is for this junction.
        stops.filter(|stop| is_entry || stop.s_m > used[*k].length_m - 30.0).any(|stop| stop.sign.is_some())
    });
    Passage { lanes: lanes.into_iter().map(|k| used[k].id).collect(), in_rad, turn_rad, has_sign }
}

/// Headings of a lane at its begin and at its end, radians.
fn begin_rad(lane: &Used<'_>) -> f64 {
    lane.line.at(0.0).pose.heading_rad
}

fn end_rad(lane: &Used<'_>) -> f64 {
    lane.line.at(lane.length_m).pose.heading_rad
}

fn yields(map: &Map, own: &Passage, other: &Passage) -> bool {
    let [gives, has] = [is_below(map, own, other), is_below(map, other, own)];
    if gives != has {
        return gives;
    }
    if own.has_sign != other.has_sign {
        return own.has_sign;
    }
    let between_rad = angle_between(own.in_rad, other.in_rad);
    let [own_left, other_left] = [own, other].map(|one| one.turn_rad > TURN_RAD);
    if between_rad.abs() > 0.75 * PI && own_left != other_left {
        return own_left;
    }
    if (0.25 * PI..=0.75 * PI).contains(&between_rad.abs()) {
        return between_rad > 0.0;
    }
    let [own_rad, other_rad] = [own, other].map(|one| one.turn_rad.abs());
    if (own_rad - other_rad).abs() > 1e-3 {
        return own_rad > other_rad;
    }
    own.lanes[0] > other.lanes[0]
}

/// True if the map lets a way give way to another.
fn is_below(map: &Map, own: &Passage, other: &Passage) -> bool {
    let junctions = map.junctions_of(own.lanes[0]);
    junctions
        .flat_map(|junction| &junction.rights_of_way)
        .any(|right| own.lanes.contains(&right.lane) && other.lanes.contains(&right.to))
}
